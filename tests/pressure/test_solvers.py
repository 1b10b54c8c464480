"""Linear solvers against a direct one, and systems without a known pressure."""

import numpy as np
import pytest
import scipy.sparse.linalg

from arrangements import block, table
from spume import named
from spume.particles import FLUID, WALL
from spume.pressure.base import NotConverged
from spume.pressure.bicgstab import StabilisedBiconjugateGradient
from spume.pressure.components import COMPONENT_FIELDS, Components
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.matrix import ABSENT, FLUX, KNOWN, SYSTEM_FIELDS, UNKNOWN, LinearSystem
from spume.schemes import discover
from spume.schemes.correction import CORRECTION
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.laplacian.base import Laplacian, Terms
from spume.schemes.laplacian.corrected_vector import CORRECTED_VECTOR, CorrectedVector
from spume.schemes.laplacian.original import Original
from spume.schemes.source.base import SOURCE

discover()
LAPLACIANS = {scheme.key: scheme() for scheme in named.schemes("laplacian")}
LAPLACIANS["corrected-vector"] = CorrectedVector(base="distance", correction="lagged")
LAPLACIANS = {key: model for key, model in LAPLACIANS.items() if model.symmetric}
SOLVERS = {"cg": ConjugateGradient, "bicgstab": StabilisedBiconjugateGradient}
FIELDS = (
    *SYSTEM_FIELDS, SURFACE_SHARE, SOURCE, CORRECTION, CORRECTED_VECTOR, *COMPONENT_FIELDS,
    *ConjugateGradient.needs, *StabilisedBiconjugateGradient.needs
)  # fmt: skip
solvers = pytest.mark.parametrize("solver", SOLVERS)


def random_system(d=2, seed=0, laplacian=LAPLACIANS["original"], periodic=False, **rows):
    """Return (particles, system) of a disturbed block; by default with rows of every state."""
    cells = 14 if d == 2 else 7
    n = cells**d
    rng = np.random.default_rng(seed)
    half = cells * 0.05
    state = rng.choice([ABSENT, UNKNOWN, UNKNOWN, UNKNOWN, KNOWN, FLUX], n)
    given = {
        "row_state": state, "source": rng.normal(size=n), "pressure": rng.normal(size=n),
        "wall_acceleration": rng.normal(size=(n, d)), "density": np.full(n, 1000.0),
    } | rows  # fmt: skip
    given["kind"] = np.where(given["row_state"] == FLUX, WALL, FLUID)
    lattice, particles, pairs = table(
        block(d, cells, disturbance=0.3, seed=seed), fields=FIELDS, skin=0.1,
        region=([-half] * d, [half] * d) if periodic else None, periodic=[periodic] * d, **given,
    )  # fmt: skip
    system = LinearSystem()
    system.assemble(laplacian, lattice, particles, pairs)
    return particles, system


def sparse(particles, system):
    """Return matrix and right side of the unknown rows, and their row numbers."""
    unknown = np.flatnonzero(particles.numpy("row_state") == UNKNOWN)
    matrix = system.sparse(particles)
    return matrix[unknown][:, unknown], particles.numpy("rhs")[unknown], unknown


@pytest.mark.parametrize("laplacian", LAPLACIANS.values(), ids=LAPLACIANS)
@pytest.mark.parametrize("d", [2, 3])
def test_the_matrix_is_symmetric(runtime, laplacian, d):
    rng = np.random.default_rng(3)
    n = 14**2 if d == 2 else 7**3
    particles, system = random_system(d, 3, laplacian, density=rng.choice([1.0, 1000.0], n))
    matrix, _, _ = sparse(particles, system)
    assert laplacian.symmetric
    assert matrix.nnz > 3 * matrix.shape[0]
    assert abs(matrix - matrix.T).max() <= 1e-13 * abs(matrix).max()


@solvers
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", [0, 1])
def test_against_a_direct_solver(every_runtime, solver, d, seed):
    double = every_runtime.precision == "double"
    # Every component is tied to something, so that the matrix is regular.
    n = 14**2 if d == 2 else 7**3
    particles, system = random_system(d, seed, surface_diagonal=np.full(n, 0.01))
    matrix, rhs, unknown = sparse(particles, system)
    before = particles.numpy("pressure")
    direct = scipy.sparse.linalg.spsolve(matrix.tocsc(), rhs)
    tolerance = 1e-12 if double else 1e-5
    solution = SOLVERS[solver](tolerance=tolerance)(system, particles)
    after = particles.numpy("pressure")
    assert after[unknown] == pytest.approx(direct, abs=(1e-9 if double else 2e-3) * np.abs(direct).max())
    others = np.setdiff1d(np.arange(n), unknown)
    assert np.array_equal(after[others], before[others]), "only unknown rows change"
    assert 0 < solution.iterations < 50, "steepest descent would take hundreds"
    assert solution.residual <= 2 * tolerance
    residual = np.linalg.norm(rhs - matrix @ after[unknown]) / np.linalg.norm(rhs)
    assert residual < 10 * tolerance
    # A warm start from the solution has nothing left to do.
    assert SOLVERS[solver](tolerance=20 * tolerance)(system, particles).iterations == 0


@solvers
def test_a_matrix_that_is_not_symmetric(runtime, solver):
    """BiCGSTAB solves it; that conjugate gradients may not is their claim."""
    from spume import kernels

    def skewed(a, b, r, w):
        return w * (1.0 + 5.0 * r[0])

    terms = Terms(kernels.func(skewed))

    class Skewed(Original):
        symmetric = False

        def terms(self):
            return terms

    assert issubclass(Skewed, Laplacian)
    particles, system = random_system(2, 0, Skewed(), surface_diagonal=np.full(196, 0.01))
    matrix, rhs, unknown = sparse(particles, system)
    assert abs(matrix - matrix.T).max() > 0.1 * abs(matrix).max()
    assert SOLVERS[solver].symmetric_only == (solver == "cg")
    if solver == "bicgstab":
        SOLVERS[solver](tolerance=1e-12)(system, particles)
        direct = scipy.sparse.linalg.spsolve(matrix.tocsc(), rhs)
        found = particles.numpy("pressure")[unknown]
        assert found == pytest.approx(direct, abs=1e-9 * np.abs(direct).max())


def rows_of(roots, particles):
    """Return the unknown rows of each component that is named by its smallest row number."""
    label, unknown = particles.numpy("component"), particles.numpy("row_state") == UNKNOWN
    return [np.flatnonzero((label == root) & unknown) for root in roots]


@solvers
@pytest.mark.parametrize("periodic", [True, False], ids=["periodic", "closed"])
def test_a_system_without_a_known_pressure(runtime, solver, periodic):
    """The right side is projected, the pressure has the mean zero, and solves what is left."""
    n = 14**2
    particles, system = random_system(2, 5, periodic=periodic, row_state=np.full(n, UNKNOWN))
    matrix, rhs, _ = sparse(particles, system)
    assert np.abs(matrix @ np.ones(n)).max() < 1e-12 * abs(matrix).max()
    assert abs(rhs.mean()) > 1e-3
    components = Components()
    found = components.project(system, particles)
    assert [len(rows) for rows in rows_of(found, particles)] == [n]
    projected = particles.numpy("rhs")
    assert projected == pytest.approx(rhs - rhs.mean(), abs=1e-12)
    SOLVERS[solver](tolerance=1e-11)(system, particles)
    components.centre(found, particles)
    pressure = particles.numpy("pressure")
    assert abs(pressure.mean()) < 1e-10 * np.abs(pressure).max()
    direct = np.linalg.lstsq(matrix.toarray(), projected, rcond=None)[0]
    assert pressure == pytest.approx(direct - direct.mean(), abs=1e-7 * np.abs(direct).max())


def test_more_pockets_than_there_is_room_for_at_first(runtime):
    """Eighty pairs of rows, each a component of its own."""
    corner = np.stack(np.meshgrid(np.arange(10) * 2.0, np.arange(8) * 2.0), axis=-1).reshape(-1, 2)
    position = np.concatenate([corner, np.add(corner, [0.1, 0.0])])
    lattice, particles, pairs = table(position, fields=FIELDS, row_state=np.full(160, UNKNOWN))
    particles.set("source", np.random.default_rng(8).normal(size=160))
    system = LinearSystem()
    system.assemble(LAPLACIANS["original"], lattice, particles, pairs)
    found = Components().project(system, particles)
    parts, right = rows_of(found, particles), particles.numpy("rhs")
    assert [len(rows) for rows in parts] == [2] * 80
    assert max(abs(right[rows].sum()) for rows in parts) < 1e-12


@solvers
def test_pockets_are_projected_one_by_one(runtime, solver):
    """Two pockets that only walls enclose, a lake under a free surface, a lone row, and a chain across many rows."""
    lake, pocket, second = block(2, 6, disturbance=0.2), block(2, 5, disturbance=0.2), block(2, 4)
    chain = np.stack([np.arange(60) * 0.2, np.full(60, 9.0)], axis=1)
    position = np.vstack([lake, np.add(pocket, [3.0, 0.0]), np.add(second, [0.0, 3.0]), chain, [[6.0, 6.0]]])
    part = np.repeat([0, 1, 2, 3, 4], [36, 25, 16, 60, 1])
    rng = np.random.default_rng(2)
    shuffled = rng.permutation(len(position))
    position, part = position[shuffled], part[shuffled]
    state = np.full(len(part), UNKNOWN)
    state[np.flatnonzero(part == 0)[:4]] = KNOWN
    lattice, particles, pairs = table(
        position, fields=FIELDS, row_state=state, source=rng.normal(size=len(part)), body=part, id=shuffled
    )
    system = LinearSystem()
    system.assemble(LAPLACIANS["original"], lattice, particles, pairs)
    part = particles.numpy("body")
    components = Components()
    before = particles.numpy("rhs")
    found = components.project(system, particles)
    parts = rows_of(found, particles)
    assert sorted(tuple(np.unique(part[rows])) for rows in parts) == [(1,), (2,), (3,), (4,)]
    assert sorted(len(rows) for rows in parts) == [1, 16, 25, 60]
    after = particles.numpy("rhs")
    for rows in parts:
        assert abs(after[rows].sum()) < 1e-10
    assert np.array_equal(after[part == 0], before[part == 0]), "what a known pressure ties is left alone"
    # The lone row has no equation at all (zero diagonal): it may not spoil the others.
    particles.set("row_state", np.where(part == 4, ABSENT, particles.numpy("row_state")))
    system.assemble(LAPLACIANS["original"], lattice, particles, pairs)
    found = components.project(system, particles)
    SOLVERS[solver](tolerance=1e-10)(system, particles)
    components.centre(found, particles)
    pressure = particles.numpy("pressure")
    for number in (1, 2, 3):
        assert abs(pressure[part == number].mean()) < 1e-9 * np.abs(pressure).max()
    matrix, rhs, unknown = sparse(particles, system)
    assert np.linalg.norm(matrix @ pressure[unknown] - rhs) < 1e-9 * np.linalg.norm(rhs)


@solvers
def test_not_converged(runtime, solver):
    particles, system = random_system(2, 0, surface_diagonal=np.full(196, 0.01))
    with pytest.raises(NotConverged, match=f"{solver}: relative residual .* after 2 iterations, tolerance 1e-09"):
        SOLVERS[solver](tolerance=1e-9, largest_iterations=2)(system, particles)


@solvers
def test_not_a_number_is_not_converged(runtime, solver):
    particles, system = random_system(2, 0, surface_diagonal=np.full(196, 0.01))
    rhs = particles.numpy("rhs")
    rhs[np.flatnonzero(particles.numpy("row_state") == UNKNOWN)[3]] = np.nan
    particles.set("rhs", rhs)
    with pytest.raises(NotConverged):
        SOLVERS[solver]()(system, particles)


@solvers
def test_nothing_to_solve(runtime, solver):
    """A right side of zero gives a pressure of zero without an iteration, from a start at rest."""
    n = 196
    particles, system = random_system(2, 0, row_state=np.full(n, UNKNOWN), source=np.zeros(n), pressure=np.zeros(n))
    assert SOLVERS[solver]()(system, particles).iterations == 0
    assert not particles.numpy("pressure").any()


@solvers
def test_a_zero_right_side_from_a_start_that_is_not_zero(runtime, solver):
    n = 196
    particles, system = random_system(
        2, 0, row_state=np.full(n, UNKNOWN), source=np.zeros(n), surface_diagonal=np.full(n, 0.01)
    )
    SOLVERS[solver]()(system, particles)
    assert np.abs(particles.numpy("pressure")).max() < 1e-3


@solvers
def test_the_same_bits_with_any_number_of_threads(device, solver):
    from conftest import initialized

    found = []
    for threads in (1, 2):
        initialized(device, threads, "double")
        particles, system = random_system(3, 7, surface_diagonal=np.full(343, 0.01))
        SOLVERS[solver](tolerance=1e-8)(system, particles)
        found.append(particles.numpy("pressure"))
    assert np.array_equal(*found)


def test_what_ties_a_pocket_hardly_is_taken_off(runtime):
    """Two blocks in which one row is drawn to a known pressure, of one by little: that one floats, as if by nothing."""
    first, second = block(2, 6, disturbance=0.2), block(2, 5, disturbance=0.2)
    position = np.vstack([first, np.add(second, [3.0, 0.0])])
    part = np.repeat([0, 1], [36, 25])
    lattice, particles, pairs = table(position, fields=FIELDS, row_state=np.full(61, UNKNOWN), body=part)
    part = particles.numpy("body")
    particles.set("source", np.random.default_rng(3).normal(size=61))
    drawn = np.array([np.flatnonzero(part == number)[7] for number in (0, 1)])

    def assembled(first, second):
        draw = np.zeros(61)
        draw[drawn] = first, second
        particles.set("surface_diagonal", draw)
        particles.set("surface_value", np.full(61, 50.0))
        system = LinearSystem()
        system.assemble(LAPLACIANS["original"], lattice, particles, pairs)
        return system

    free = assembled(0.0, 0.0)
    whole = particles.numpy("diagonal")[drawn]
    Components().project(free, particles)
    alone = particles.numpy("rhs")[part == 1]
    for share, floating in ((0.1, [1]), (0.3, [])):
        system = assembled(whole[0], share * whole[1])
        assert particles.numpy("grounded")[drawn] == pytest.approx([50, 100 * share / (1 + share)], abs=1)
        particles.set("ties", np.full(61, 1000))  # of another step
        found = Components().project(system, particles, 20)
        assert [np.unique(part[rows]).tolist() for rows in rows_of(found, particles)] == [[n] for n in floating]
        taken = particles.numpy("diagonal")[drawn] / whole
        assert taken == pytest.approx([2.0, 1.0 + (0.0 if floating else share)])
        assert (particles.numpy("rhs")[part == 1] == pytest.approx(alone, abs=1e-9)) == bool(floating)
    system = assembled(whole[0], 0.1 * whole[1])
    assert Components().project(system, particles) == [], "where nothing is said any tie is one"
