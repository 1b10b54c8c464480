"""Particle shifting: from crowded to empty places, never out of the surface, with the fields it carries."""

import numpy as np
import pytest

from arrangements import block, inside, offsets, table, weights
from spume.particles import FLUID, WALL
from spume.schemes.crowding import flat_surface_gradient
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.free_surface.number_density import LowNumberDensity
from spume.schemes.number_density.base import Original as NumberDensity
from spume.schemes.shifting.classes import INNER, SPLASH, SURFACE, VICINITY
from spume.schemes.shifting.fickian import Fickian
from spume.schemes.shifting.fickian_surface import FickianSurface
from spume.schemes.shifting.none import Unshifted
from spume.schemes.shifting.optimised import Optimised
from spume.schemes.shifting.tangential import Tangential

pytestmark = pytest.mark.usefixtures("runtime")

L0 = 0.1
SCHEMES = [Fickian(), FickianSurface(), Optimised(), Tangential()]
AT_SURFACE = [FickianSurface(), FickianSurface(normal_share=0.1), Optimised(), Tangential()]
FIELDS = dict.fromkeys([SURFACE_SHARE, *(field for scheme in SCHEMES for field in scheme.needs)])


def key(scheme):
    return scheme.key


def shifted(position, shifting, periodic=False, dt=0.01, beta=0.0, reach=2.1, **rows):
    """Return (lattice, particles, shift) after one shift, the shift in the order of ``position``.

    Rows with n < beta n0 are the free surface.
    """
    d = position.shape[1]
    half = np.abs(block(d, round(len(position) ** (1 / d)))).max() + 0.05
    lattice, particles, pairs = table(
        position, fields=FIELDS, region=([-half] * d, [half] * d) if periodic else None,
        periodic=[periodic] * d, skin=0.1, reach=reach, **rows,
    )  # fmt: skip
    if beta:
        NumberDensity()(lattice, particles, pairs)
        low = particles.numpy("number_density") < beta * NumberDensity().n0(lattice)
        particles.set("free_surface", low)
        particles.set("surface_share", low)
    before = particles.numpy("position")
    shifting(lattice, particles, pairs, NumberDensity(), dt)
    return lattice, particles, (particles.numpy("position") - before)[np.argsort(particles.numpy("id"))]


def by_id(particles, name):
    return particles.numpy(name)[np.argsort(particles.numpy("id"))]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("shifting", SCHEMES, ids=key)
def test_a_perfect_lattice_is_left_alone(shifting, d):
    assert np.abs(shifted(block(d, 7), shifting, periodic=True)[2]).max() < 1e-15


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("tensile", [0.0, 0.2])
def test_the_shift_by_a_direct_sum(d, tensile):
    """D grad C with the coefficient that each scheme states, inside the fluid."""
    position = block(d, 6, disturbance=0.3)
    lattice, _, plain = shifted(position, Fickian(largest=0.5))
    scheme = FickianSurface(tensile=tensile, largest=0.5)
    treated = shifted(position, scheme)[2]
    optimised = shifted(position, Optimised(largest=0.5))[2]
    r = offsets(position)
    w = weights(r, scheme.weight, 2.1 * L0)
    rr = (r**2).sum(axis=2) + np.eye(len(r))
    scale = d / scheme.n0(lattice)
    raw = scale * np.einsum("ij,ijk->ik", w / rr, r)
    strong = scale * np.einsum("ij,ijk->ik", (1 + tensile * (w / 1.1) ** 4) * w / rr, r)

    def limited(shift):
        return shift * np.minimum(1.0, 0.5 * L0 / np.linalg.norm(shift, axis=1))[:, None]

    assert plain == pytest.approx(limited(-0.1 * L0**2 * raw), abs=1e-12)
    assert treated == pytest.approx(limited(-0.1 * L0**2 * strong), abs=1e-12)
    assert optimised == pytest.approx(limited(-0.5 * (0.7 * L0) ** 2 * raw), abs=1e-12)


def test_the_coefficient_of_the_speed():
    """D = A h |u|max dt, at most h^2/2; the constant D needs no speed."""
    position = block(2, 6, disturbance=0.3)
    velocity = np.zeros_like(position)
    velocity[3] = [0.3, -0.4]
    constant = shifted(position, Fickian(largest=0.5))[2]
    for dt, expected in ((0.01, 2.0 * 0.07 * 0.5 * 0.01), (10.0, 0.5 * 0.07**2)):
        moved = shifted(position, Fickian(largest=0.5, advective=2.0), velocity=velocity, dt=dt)[2]
        inner = np.linalg.norm(moved, axis=1) < 0.049
        assert moved[inner] == pytest.approx(constant[inner] * expected / (0.1 * L0**2), rel=1e-9)


@pytest.mark.parametrize("shifting", SCHEMES, ids=key)
def test_a_crowded_row_moves_away(shifting):
    """A row displaced from its place in the lattice is moved back, the one ahead of it away from it."""
    position = block(2, 7)
    centre = np.argmin(np.linalg.norm(position, axis=1))
    ahead = np.argmin(np.linalg.norm(position - L0 * np.eye(2)[0], axis=1))
    position[centre, 0] += 0.03
    moved = shifted(position, shifting, periodic=True)[2]
    assert moved[centre, 0] < -1e-3
    assert np.abs(moved[centre, 1:]).max() < 1e-15
    assert moved[ahead, 0] > 0


@pytest.mark.parametrize("shifting", SCHEMES, ids=key)
def test_disorder_shrinks(shifting):
    """The spread of n on a disturbed periodic lattice, and the nearest pairs draw apart."""

    lattice, particles, pairs = table(
        block(2, 12, disturbance=0.3), fields=FIELDS, region=([-0.6] * 2, [0.6] * 2), periodic=[True] * 2, skin=0.1
    )  # fmt: skip

    def spread():
        pairs.update(particles)
        NumberDensity()(lattice, particles, pairs)
        near = weights(offsets(particles.numpy("position"), [1.2, 1.2]), NumberDensity().weight, 0.21)
        return particles.numpy("number_density").std(), near.max()

    before, near_before = spread()
    for _ in range(20):
        pairs.update(particles)
        shifting(lattice, particles, pairs, NumberDensity(), 0.01)
    after, near_after = spread()
    assert after < 0.4 * before
    assert near_after < 0.6 * near_before


@pytest.mark.parametrize("shifting", [s.model_copy(update={"largest": 0.07}) for s in SCHEMES], ids=key)
def test_the_largest_shift(shifting):
    position = np.array([[0.0, 0.0], [1e-3, 0.0]])
    assert np.linalg.norm(shifted(position, shifting)[2], axis=1) == pytest.approx(0.007)


def test_fickian_leaves_the_surface_alone():
    """Inside the block rows at the edge would be pushed out; as surface rows they stay."""
    position = block(2, 9)
    edge = ~inside(position, 9, reach=0.6)
    assert np.linalg.norm(shifted(position, Fickian())[2][edge], axis=1).min() > 1e-3
    assert np.abs(shifted(position, Fickian(), surface_share=np.ones(81))[2]).max() < 1e-15


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("shifting", AT_SURFACE, ids=key)
def test_a_flat_surface_stays_and_disorder_moves_along_it(shifting, d):
    """On the faces of a regular block nothing moves; a row displaced within a face is moved back within it."""
    cells = 9 if d == 2 else 7
    position = block(d, cells)
    half = (cells - 1) / 2 * L0
    on_face = np.isclose(position[:, -1], half) & np.all(np.abs(position[:, :-1]) < half - 1.9 * L0, axis=1)
    under = np.isclose(position[:, -1], half - L0) & np.all(np.abs(position[:, :-1]) < half - 1.9 * L0, axis=1)
    still = shifted(position, shifting, beta=0.8)[2]
    assert np.abs(still[on_face | under]).max() < 1e-14
    row = int(np.argmin(np.linalg.norm(position - half * np.eye(d)[-1], axis=1)))
    position[row, 0] += 0.02
    moved = shifted(position, shifting, beta=0.8)[2][row]
    assert moved[0] < -1e-4
    if shifting.key != "fickian-surface" or shifting.normal_share == 0.0:
        # The normal leans a little towards the displaced row.
        assert np.abs(moved[1:]).max() < 0.3 * abs(moved[0])


def test_the_normal_part_draws_a_row_to_its_distance():
    """A surface row that was lifted comes back down, one that was pressed in goes up; a flat one stays."""
    for lift, sign in ((0.02, -1), (-0.02, 1)):
        position = block(2, 9)
        row = int(np.argmin(np.linalg.norm(position - [0.0, 0.4], axis=1)))
        position[row, 1] += lift
        moved = shifted(position, FickianSurface(normal_share=0.5, tensile=0.0), beta=0.9)[2][row]
        assert sign * moved[1] > 1e-4
        assert abs(moved[0]) < 1e-14


@pytest.mark.parametrize("d", [2, 3])
def test_the_reference_of_a_flat_surface(d):
    """n . grad C of the outermost layer by a direct sum."""
    position = block(d, 7)
    r = offsets(position)
    row = int(np.argmin(np.linalg.norm(position - 0.3 * np.eye(d)[-1], axis=1)))
    weight = FickianSurface().weight
    w = weights(r, weight, 0.21)[row]
    rr = (r[row] ** 2).sum(axis=1) + (w == 0)
    lattice = shifted(position, Unshifted())[0]
    expected = L0 * d / lattice.n0(weight, 2.1) * (w * (1 + 0.2 * (w / 1.1) ** 4) * r[row, :, -1] / rr).sum()
    assert flat_surface_gradient(weight, 2.1, d, 0.2) == pytest.approx(expected)
    assert expected < -0.3


def test_the_classes():
    """A drop with spray and a thread: splash, surface, vicinity and inner rows by their neighbours."""
    cells = block(2, 9)
    spray = np.array([[2.0, 2.0], [2.1, 2.0], [3.0, -3.0]])
    position = np.concatenate([cells, spray])
    particles = shifted(position, Optimised(), beta=0.8)[1]
    found = by_id(particles, "surface_class")
    depth = np.round((0.4 - np.abs(cells).max(axis=1)) / L0).astype(int)
    assert np.all(found[:81][depth == 0] == SURFACE)
    assert np.all(found[:81][(depth == 1) | (depth == 2)] == VICINITY)
    assert np.all(found[:81][depth > 2] == INNER)
    assert np.all(found[81:] == SPLASH)
    moved = shifted(position, Optimised(), beta=0.8)[2]
    assert not moved[81:].any(), "splash is not shifted"


@pytest.mark.parametrize("shifting", AT_SURFACE, ids=key)
def test_a_drop_keeps_its_size(shifting):
    """100 shifts of a disturbed drop, its surface found anew each time: neither radius of gyration nor outline grow.

    The same scheme blind to the surface spreads the drop by five times as much at least.
    """
    radius = 0.8
    position = block(2, 17, disturbance=0.1)
    position = position[np.linalg.norm(position, axis=1) < radius]

    def after(seen):
        lattice, particles, pairs = table(position, fields=FIELDS, skin=0.1)
        number_density = NumberDensity()
        for _ in range(100):
            pairs.update(particles)
            number_density(lattice, particles, pairs)
            LowNumberDensity(beta=0.85)(lattice, particles, pairs, number_density)
            if not seen:
                particles.set("free_surface", np.zeros(len(position)))
            shifting(lattice, particles, pairs, number_density, 0.01)
        x = particles.numpy("position")
        distance = np.linalg.norm(x - x.mean(axis=0), axis=1)
        return np.sqrt((distance**2).mean()), np.quantile(distance, 0.95)

    start = np.linalg.norm(position, axis=1)
    gyration, outline = after(True)
    assert gyration == pytest.approx(np.sqrt((start**2).mean()), rel=0.02)
    assert outline == pytest.approx(np.quantile(start, 0.95), rel=0.03)
    assert after(False)[0] > 1.1 * np.sqrt((start**2).mean())


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kind", [Fickian, FickianSurface, Optimised, Tangential], ids=key)
def test_corrected_fields_reproduce_a_linear_field(kind, d):
    """On any arrangement, at its edges too, velocity and pressure after the shift are those of the new place."""
    rng = np.random.default_rng(3)
    slope, gradient = rng.normal(size=d), rng.normal(size=(d, d))
    position = block(d, 6, disturbance=0.3)
    fields = {"velocity": position @ gradient.T + 1.0, "pressure": 0.0 * position @ slope + 5.0}
    if kind is not Tangential:  # which answers a pressure with a change of velocity
        fields["pressure"] = position @ slope + 5.0
    else:
        fields["pressure"] = np.zeros(len(position))
    _, particles, moved = shifted(position, kind(correct_fields=True), beta=0.8, **fields)
    x = by_id(particles, "position")
    assert np.linalg.norm(moved, axis=1).max() > 0.02 * L0
    assert by_id(particles, "velocity") == pytest.approx(x @ gradient.T + 1.0, abs=1e-10)
    if kind is not Tangential:
        assert by_id(particles, "pressure") == pytest.approx(x @ slope + 5.0, abs=1e-10)
    _, particles, _ = shifted(position, kind(), beta=0.8, **fields)
    assert np.array_equal(by_id(particles, "velocity"), fields["velocity"]), "without correction nothing changes"


def test_across_the_surface_the_gradient_is_conservative():
    """By a direct sum; at rest on the flat surface of the lattice next to nothing, and only the normal part."""
    rho_g, dt = 1e4, 1e-3
    position = block(2, 9)
    position[:, 0] += 0.02 * np.sin(5 * position[:, 1])
    top = position[:, 1].max()
    pressure = rho_g * (top + 0.5 * L0 - position[:, 1])
    gradient = np.broadcast_to([0.0, -rho_g], position.shape)
    scheme = Tangential(largest=0.5)
    rows = {"pressure": pressure, "pressure_gradient": gradient}
    lattice, particles, _ = shifted(position, scheme, beta=0.8, dt=dt, **rows)
    change = by_id(particles, "velocity")
    surface = by_id(particles, "surface_class") == SURFACE
    assert not change[~surface].any()
    r = offsets(position)
    w = weights(r, scheme.weight, 2.1 * L0)
    rr = (r**2).sum(axis=2) + np.eye(len(r))
    sums = np.einsum("ij,ijk->ik", w / rr * (pressure[:, None] + pressure[None, :]), r)
    conservative = 2 / scheme.n0(lattice) * sums
    n = by_id(particles, "surface_normal")
    expected = -dt / 1000.0 * np.einsum("ik,ik->i", conservative - gradient, n)[:, None] * n
    assert change[surface] == pytest.approx(expected[surface], rel=1e-9, abs=1e-15)
    flat = surface & (np.abs(position[:, 0]) < 0.2) & (position[:, 1] > 0.35)
    assert flat.sum() >= 3
    assert np.abs(change[flat]).max() < 0.02 * dt * rho_g / 1000.0


def test_a_row_pressed_into_the_surface_is_pushed_out():
    rho_g = 1e4
    for lift, sign in ((-0.02, 1), (0.02, -1)):
        position = block(2, 9)
        pressure = rho_g * (0.45 - position[:, 1])
        row = int(np.argmin(np.linalg.norm(position - [0.0, 0.4], axis=1)))
        position[row, 1] += lift
        gradient = np.broadcast_to([0.0, -rho_g], position.shape)
        particles = shifted(position, Tangential(), beta=0.9, pressure=pressure, pressure_gradient=gradient)[1]
        assert sign * by_id(particles, "velocity")[row, 1] > 1e-3


def test_without_shifting_nothing_moves():
    assert not shifted(block(2, 6, disturbance=0.3), Unshifted())[2].any()


@pytest.mark.parametrize(("height", "moves"), [(-0.05, False), (0.05, True)])
@pytest.mark.parametrize("shifting", SCHEMES, ids=key)
def test_a_row_behind_a_walls_surface_is_not_shifted_further_into_it(shifting, height, moves):
    """A wall whose rows lie a spacing below its surface, as on a gentle slope: that is no empty place."""
    cells = np.arange(-4, 5) * L0
    wall = np.stack(np.meshgrid(cells, [-1.0 * L0, -2.0 * L0]), axis=-1).reshape(-1, 2)
    fluid = np.stack(np.meshgrid(cells, (height + 0.8 * np.arange(5)) * L0), axis=-1).reshape(-1, 2)
    position = np.concatenate([wall, fluid])
    kind = np.repeat([WALL, FLUID], [len(wall), len(fluid)])
    to_surface = np.where((kind == WALL)[:, None], np.stack([0 * position[:, 0], -position[:, 1]], axis=1), 0.0)
    shape = {"kind": kind, "to_surface": to_surface, "density": np.full(len(position), 1000.0)}
    _, _, shift = shifted(position, shifting, **shape)
    row = np.flatnonzero((np.abs(position[:, 0]) < 1e-9) & np.isclose(position[:, 1], height * L0))[0]
    assert (shift[row, 1] < -1e-4 * L0) == moves
    assert moves or not shift[row].any()


def test_a_row_behind_a_walls_surface_may_be_shifted_out_of_it():
    wall = np.stack(np.meshgrid(np.arange(-4, 5) * L0, [-0.5 * L0, -1.5 * L0]), axis=-1).reshape(-1, 2)
    position = np.concatenate([wall, [[0.0, -0.1 * L0]]])
    kind = np.repeat([WALL, FLUID], [len(wall), 1])
    to_surface = np.where((kind == WALL)[:, None], np.stack([0 * position[:, 0], -position[:, 1]], axis=1), 0.0)
    _, particles, shift = shifted(position, Fickian(), kind=kind, to_surface=to_surface)
    row = np.flatnonzero(particles.numpy("kind") == FLUID)[0]
    assert shift[-1, 1] > 0.0
    assert particles.numpy("position")[row, 1] == pytest.approx(-0.1 * L0 + shift[-1, 1])


@pytest.mark.parametrize("shifting", SCHEMES, ids=key)
def test_what_is_held_by_a_wall_keeps_its_velocity_too(shifting):
    """The fields of a place that a row is not moved to are not its own."""
    cells = np.arange(-4, 5) * L0
    wall = np.stack(np.meshgrid(cells, [-1.0 * L0, -2.0 * L0]), axis=-1).reshape(-1, 2)
    fluid = np.stack(np.meshgrid(cells, (-0.05 + 0.8 * np.arange(5)) * L0), axis=-1).reshape(-1, 2)
    position = np.concatenate([wall, fluid])
    kind = np.repeat([WALL, FLUID], [len(wall), len(fluid)])
    to_surface = np.where((kind == WALL)[:, None], np.stack([0 * position[:, 0], -position[:, 1]], axis=1), 0.0)
    velocity = np.random.default_rng(3).normal(size=position.shape)
    shape = {"kind": kind, "to_surface": to_surface, "density": np.full(len(position), 1000.0), "velocity": velocity}
    _, particles, _ = shifted(position, shifting.model_copy(update={"correct_fields": True}), **shape)
    held = (particles.numpy("held_by_wall") > 0) & (particles.numpy("kind") == FLUID)
    assert held.any()
    assert not particles.numpy("shift")[held].any()
    assert np.array_equal(particles.numpy("velocity")[held], velocity[particles.numpy("id")[held]])


def test_the_end_of_a_film_that_is_held_by_a_wall_is_not_repelled_either():
    """What `tangential` adds to the velocity of surface rows goes with a move that a wall has stopped."""
    cells = np.arange(-4, 5) * L0
    wall = np.stack(np.meshgrid(cells, [-1.0 * L0, -2.0 * L0]), axis=-1).reshape(-1, 2)
    fluid = np.stack(np.meshgrid(cells, [-0.05 * L0, 0.85 * L0]), axis=-1).reshape(-1, 2)
    position = np.concatenate([wall, fluid])
    kind = np.repeat([WALL, FLUID], [len(wall), len(fluid)])
    to_surface = np.where((kind == WALL)[:, None], np.stack([0 * position[:, 0], -position[:, 1]], axis=1), 0.0)
    shape = {
        "kind": kind, "to_surface": to_surface, "density": np.full(len(position), 1000.0),
        "pressure": np.full(len(position), -2e3),
    }  # fmt: skip
    _, particles, _ = shifted(position, Tangential(), beta=0.97, **shape)
    held = (particles.numpy("held_by_wall") > 0) & (particles.numpy("kind") == FLUID)
    repelled = np.linalg.norm(particles.numpy("repulsion"), axis=1) > 1e-6
    assert (held & repelled).any()
    assert not particles.numpy("velocity")[held].any()
