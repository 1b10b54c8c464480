"""Number density and detection of the free surface."""

import numpy as np
import pytest

from arrangements import block, inside, offsets, table, weights
from spume.named import find
from spume.pressure.matrix import SYSTEM_FIELDS
from spume.schemes.free_surface.asymmetry import Asymmetry, flat_sum
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.free_surface.blended import Blended
from spume.schemes.free_surface.detection_free import DetectionFree
from spume.schemes.free_surface.divergence_of_position import DivergenceOfPosition
from spume.schemes.free_surface.hybrid import Hybrid
from spume.schemes.free_surface.number_density import LowNumberDensity
from spume.schemes.free_surface.umbrella import Umbrella, scan
from spume.schemes.free_surface.vector import VectorFunction
from spume.schemes.gradient.completed import Completed
from spume.schemes.gradient.dummy_neighbour import DummyNeighbour
from spume.schemes.gradient.minimum import Minimum
from spume.schemes.laplacian.original import Original as OriginalLaplacian
from spume.schemes.number_density.base import Original as NumberDensity
from spume.schemes.source.divergence import VelocityDivergence
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace
from spume.wall_models.neumann import Neumann
from spume.wall_models.resting import Resting
from surfaces import SHAPES, by_id, errors, mark, surface
from tanks import advanced, column
from tanks import by_id as column_rows

pytestmark = pytest.mark.usefixtures("runtime")


def detected(surface, position, re=2.1):
    lattice, particles, pairs = table(position, fields=(SURFACE_SHARE,), reach=max(re, 2.1))
    number_density = NumberDensity(re=re)
    number_density(lattice, particles, pairs)
    surface(lattice, particles, pairs, number_density)
    return lattice, particles, number_density


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("re", [2.1, 3.1])
def test_number_density(d, re):
    """n by a direct sum; n0 inside the regular arrangement."""
    cells = 9
    for disturbance in (0.0, 0.3):
        position = block(d, cells if d == 2 else 8, disturbance=disturbance)
        lattice, particles, number_density = detected(LowNumberDensity(), position, re)
        w = weights(offsets(particles.numpy("position")), number_density.weight, re * 0.1)
        assert particles.numpy("number_density") == pytest.approx(w.sum(axis=1), rel=1e-10)
        if disturbance == 0.0:
            core = inside(particles.numpy("position"), cells if d == 2 else 8, reach=re)
            expected = number_density.n0(lattice)
            assert particles.numpy("number_density")[core] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("surface", [LowNumberDensity(), Blended()], ids=lambda s: s.key)
def test_the_surface_of_a_block_is_its_outer_layer(surface, d):
    cells = 9 if d == 2 else 7
    _, particles, _ = detected(surface, block(d, cells))
    outer = np.any(np.abs(particles.numpy("position")) > (cells / 2 - 1) * 0.1, axis=1)
    assert np.array_equal(particles.numpy("free_surface") == 1, outer)


def test_below_beta():
    lattice, particles, number_density = detected(LowNumberDensity(beta=0.8), block(2, 9, disturbance=0.3))
    low = particles.numpy("number_density") < 0.8 * number_density.n0(lattice)
    assert np.array_equal(particles.numpy("free_surface") == 1, low)
    assert np.array_equal(particles.numpy("surface_share"), low.astype(float))


def test_share_falls_from_one_to_nothing():
    surface = Blended(upper=0.95, lower=0.7)
    lattice, particles, number_density = detected(surface, block(2, 12, disturbance=0.35))
    ratio = particles.numpy("number_density") / number_density.n0(lattice)
    expected = np.clip((0.95 - ratio) / 0.25, 0, 1)
    assert ((expected > 0) & (expected < 1)).any()
    assert particles.numpy("surface_share") == pytest.approx(expected, abs=1e-12)
    assert np.array_equal(particles.numpy("free_surface") == 1, expected > 0.5)


ALL = {kind.key: kind() for kind in (LowNumberDensity, Blended, DivergenceOfPosition, Asymmetry, VectorFunction,
                                     Umbrella, Hybrid, DetectionFree)}  # fmt: skip


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", ALL)
def test_surfaces_of_the_lattice(name, d):
    """On the regular arrangement every row of every surface is found, and none inside.

    Blended and vector leave out some rows in the concave corners of a small bubble and of tank and surface in 3D.
    """
    for shape in SHAPES:
        case = surface(shape, d)
        assert (case.on.sum() > 0) == (shape != "bulk")
        missed, wrong = errors(ALL[name], case)
        assert wrong == 0, shape
        concave = d == 3 and name in ("blended", "vector") and shape in ("bubble", "tank")
        assert missed <= (case.on.sum() // 2 if concave else 0), shape


LARGEST = {  # missed on the surface, marked inside, as parts of all such rows; disturbed by 0.2 l0
    "number-density": (0.05, 0.25),
    "blended": (0.25, 0.02),
    "divergence-of-position": (0.10, 0.05),
    "asymmetry": (0.05, 0.16),
    "vector": (0.15, 0.01),
    "umbrella": (0.05, 0.0),
    "hybrid": (0.04, 0.0),
    "detection-free": (0.20, 0.05),
}


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", ALL)
def test_surfaces_of_a_disordered_fluid(name, d):
    found, on, off = np.zeros(2), 0, 0
    for shape in SHAPES:
        case = surface(shape, d, disturbance=0.2)
        found += errors(ALL[name], case)
        on, off = on + case.on.sum(), off + case.off.sum()
    missed, wrong = found / [on, off]
    assert missed <= LARGEST[name][0]
    assert wrong <= LARGEST[name][1]


@pytest.mark.parametrize("d", [2, 3])
def test_sums_of_the_detections_by_a_direct_sum(d):
    """Divergence of position, asymmetry, vector function and umbrella on a disturbed ball of rows."""
    case = surface("drop", d, disturbance=0.3)
    r = offsets(case.position)
    distance = np.linalg.norm(r, axis=2) + 9.0 * np.eye(len(r))
    lattice, particles, _ = mark(DivergenceOfPosition(), case)
    q = np.minimum(distance / 0.21, 1.0)
    inner = surface("bulk", d)
    period = offsets(inner.position, inner.period)
    full = np.linalg.norm(period, axis=2) + 9.0 * np.eye(len(period))
    q0 = np.minimum(full[0] / 0.21, 1.0)
    expected = d * (q**2 * (1 - q) ** 3).sum(axis=1) / (q0**2 * (1 - q0) ** 3).sum()
    assert by_id(particles, "position_divergence") == pytest.approx(expected, rel=1e-9)
    _, particles, _ = mark(Asymmetry(), case)
    near = (distance < 0.185)[:, :, None]
    assert by_id(particles, "neighbour_offset") == pytest.approx((near * r).sum(axis=1), abs=1e-12)
    assert flat_sum(1.85, d) == 3.0 ** (d - 1)
    _, particles, _ = mark(VectorFunction(), case)
    w = weights(r, NumberDensity().weight, 0.21)
    expected = d / NumberDensity().n0(lattice) * (w[:, :, None] * r / distance[:, :, None]).sum(axis=1)
    assert by_id(particles, "direction_sum") == pytest.approx(expected, abs=1e-12)
    _, particles, _ = mark(Umbrella(), case)
    n, h = by_id(particles, "surface_normal"), 0.105
    rt = np.linalg.norm(r - h * n[:, None, :], axis=2)
    far = (distance >= np.sqrt(2) * h) & (rt < h)
    close = (distance < np.sqrt(2) * h) & (np.einsum("ijk,ik->ij", r, n) > np.cos(np.pi / 4) * distance)
    under = (far | close) & (distance < 0.21)
    assert np.array_equal(by_id(particles, "umbrella") == 1, under.any(axis=1))
    moment = d / NumberDensity().n0(lattice) * np.einsum("ij,ijk,ijl->ikl", w / distance**2, r, r)
    assert by_id(particles, "least_eigenvalue") == pytest.approx(np.linalg.eigvalsh(moment)[:, 0], abs=1e-9)
    outside = case.position - case.position.mean(axis=0)
    outward = np.einsum("ik,ik->i", n, outside / np.linalg.norm(outside, axis=1)[:, None])
    assert outward[case.on].min() > 0.6, "normals point out of the ball"


@pytest.mark.parametrize("d", [2, 3])
def test_hybrid_scans_candidates_alone(d):
    """The rows deep inside are spared, and the result is that of a scan of all rows."""
    case, hybrid = surface("drop", d, disturbance=0.3), Hybrid()
    lattice, particles, pairs = table(case.position, fields=dict.fromkeys(Hybrid.needs), reach=2.1)
    model = NumberDensity()
    model(lattice, particles, pairs)
    particles.set("umbrella", np.full(particles.count, 7, dtype=np.int32))
    hybrid(lattice, particles, pairs, model)
    found, scanned = particles.numpy("free_surface"), particles.numpy("umbrella") != 7
    candidates = particles.numpy("position_divergence") < 0.9 * d
    assert 0 < candidates.sum() < 0.9 * particles.count
    assert np.array_equal(scanned, candidates)
    scan(hybrid, lattice, particles, pairs)
    assert np.array_equal(found == 1, candidates & (particles.numpy("umbrella") == 0))
    assert found.any()


def test_the_printed_cone_is_a_cone():
    """In 2D |n . x_jT| + |t . x_jT| < h and |x_ji| < sqrt(2) h is the cone of 45 degrees (review Eq. 31)."""
    x = np.random.default_rng(5).uniform(-2, 2, (20000, 2))
    x = x[np.linalg.norm(x, axis=1) < np.sqrt(2)]
    printed = np.abs(x[:, 1] - 1) + np.abs(x[:, 0]) < 1
    cone = x[:, 1] > np.cos(np.pi / 4) * np.linalg.norm(x, axis=1)
    assert np.array_equal(printed, cone)


def test_conceptual_particles_fill_the_diagonal():
    """The diagonal becomes that of max(n, n0) neighbours, with the value zero; no row is left out of the matrix."""
    case = surface("drop", 2, disturbance=0.2)
    scheme, laplacian = DetectionFree(), OriginalLaplacian()
    lattice, particles, number_density = mark(scheme, case, fields=SYSTEM_FIELDS)
    particles.set("surface_value", np.full(len(case.position), 7.0))
    scheme.draw(lattice, particles, laplacian, number_density)
    n, n0 = by_id(particles, "number_density"), number_density.n0(lattice)
    scale = 4.0 / (laplacian.lambda_(lattice) * n0) / 1000.0
    assert by_id(particles, "surface_diagonal") == pytest.approx(scale * np.maximum(n0 - n, 0.0), abs=1e-12)
    assert not by_id(particles, "surface_value").any()
    assert not scheme.known
    with pytest.raises(ValueError, match=r"detection-free.*density.*stretched"):
        PredictMoveProject(free_surface=scheme)


@pytest.mark.parametrize(
    ("step", "name"),
    [
        *[(ProjectInPlace, name) for name in ALL],
        *[(PredictMoveProject, name) for name in ALL if ALL[name].known],
    ],
    ids=lambda value: getattr(value, "key", value),
)
def test_a_column_stays_at_rest(runtime, device, name, step):
    """Hydrostatic pressure and next to no motion with every detection, in both steps, walls beside the water."""
    case = column(step=step(free_surface=ALL[name]), cells=(8, 16), initial="hydrostatic")
    simulation = advanced(case.build(device=device, threads=1, precision="double"), steps=15)
    x, u, p = column_rows(simulation, "position", "velocity", "pressure")
    # With the surface pressure at the centres the level is l0/2 = 0.03 H off, in the original method and with E7.
    bound = 0.09 if step is PredictMoveProject else 0.01
    if name == "detection-free":
        bound = 0.05
    assert np.abs(p - 9810.0 * (0.4 - x[:, 1])).max() < bound * 9810.0 * 0.4
    assert np.abs(u).max() < 0.02 * np.sqrt(9.81 * 0.4)


@pytest.mark.parametrize(
    ("gradient", "walls", "bound"),
    [
        (Completed(), Resting(), 0.03),
        (DummyNeighbour(), Neumann(), 0.05),
        (Minimum(), Neumann(), None),
    ],
    ids=lambda value: getattr(value, "key", ""),
)
def test_moved_positions_without_detection_want_a_gradient_that_counts_what_is_missing(device, gradient, walls, bound):
    """Conceptual particles stand in the matrix: a gradient without them is told of, and does not hold water at rest."""
    step = PredictMoveProject(
        free_surface=DetectionFree(), source=VelocityDivergence(), gradient=gradient, wall_model=walls
    )
    assert ("leaves out the neighbours missing" in step.caution()) == (bound is None)
    case = column(step=step, cells=(8, 16), initial="hydrostatic")
    simulation = advanced(case.build(device=device, threads=1, precision="double"), steps=15)
    x, p = column_rows(simulation, "position", "pressure")
    error = np.abs(p - 9810.0 * (0.4 - x[:, 1])).max() / (9810.0 * 0.4)
    assert error > 0.15 if bound is None else error < bound


@pytest.mark.parametrize("key", ["blended", "imaged", "umbrella", "vector"])
def test_limits_in_the_wrong_order_are_refused(key):
    scheme = find("free_surface", key)
    with pytest.raises(ValueError, match=r"lower = 0\.9 must be less than upper = 0\.8"):
        scheme(lower=0.9, upper=0.8)
    with pytest.raises(ValueError, match="must be less than upper"):
        scheme(lower=0.9, upper=0.9)
