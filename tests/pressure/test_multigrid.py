"""The multigrid method: right on any arrangement, as many iterations for many rows as for few, the same bits again."""

import numpy as np
import pytest
import scipy.sparse.linalg

from arrangements import block, table
from conftest import initialized
from spume import kernels, team
from spume.pressure import aggregation, cycle, multigrid, team_iteration
from spume.pressure.base import NotConverged
from spume.pressure.components import COMPONENT_FIELDS, Components
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.matrix import ABSENT, KNOWN, SYSTEM_FIELDS, UNKNOWN, LinearSystem
from spume.pressure.multigrid import Multigrid
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.laplacian.corrected_vector import CorrectedVector
from spume.schemes.laplacian.dummy_neighbour import DummyNeighbour
from spume.schemes.laplacian.original import Original
from spume.schemes.laplacian.second_order import SecondOrder
from spume.schemes.source.base import SOURCE

FIELDS = (*SYSTEM_FIELDS, SURFACE_SHARE, SOURCE, *COMPONENT_FIELDS, *ConjugateGradient.needs, *Multigrid.needs)


def assembled(position, tied=None, seed=0, periodic=False, single=True, region=None, **rows):
    """Return (particles, system) of rows that are all unknown but for ``rows``; ``tied`` ones are a free surface."""
    n, d = position.shape
    rng = np.random.default_rng(seed)
    given = {
        "row_state": np.full(n, UNKNOWN), "source": rng.normal(size=n),
        "surface_diagonal": 0.05 * (np.zeros(n) if tied is None else tied), "density": np.full(n, 1.0),
    } | rows  # fmt: skip
    half = 0.05 * round(n ** (1 / d))
    lattice, particles, pairs = table(
        position, fields=FIELDS, skin=0.1, region=([-half] * d, [half] * d) if periodic else region,
        periodic=[periodic] * d, **given,
    )  # fmt: skip
    # The list sorts the rows, but takes along only what a step keeps.
    order = particles.numpy("id")
    for name, values in given.items():
        particles.set(name, np.asarray(values)[order])
    system = LinearSystem(single=single)
    system.assemble(Original(), lattice, particles, pairs)
    return particles, system


def sparse(particles, system):
    """Return matrix and right side of the unknown rows, and their row numbers."""
    unknown = np.flatnonzero(particles.numpy("row_state") == UNKNOWN)
    matrix = system.sparse(particles)
    return matrix[unknown][:, unknown], particles.numpy("rhs")[unknown], unknown


def solved(particles, system, tolerance=1e-11, **parameters):
    """Solve from zero; return the solution's figures, the pressure of unknown rows and that of a direct solver."""
    pressure = particles.numpy("pressure")
    matrix, rhs, unknown = sparse(particles, system)
    pressure[unknown] = 0.0
    particles.set("pressure", pressure)
    solution = Multigrid(tolerance=tolerance, **parameters)(system, particles)
    after = particles.numpy("pressure")
    others = np.setdiff1d(np.arange(particles.count), unknown)
    assert np.array_equal(after[others], pressure[others]), "only unknown rows change"
    assert np.linalg.norm(rhs - matrix @ after[unknown]) <= 3 * tolerance * np.linalg.norm(rhs)
    return solution, after[unknown], lambda: scipy.sparse.linalg.spsolve(matrix.tocsc(), rhs)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("inner_levels", [20, 0])
def test_against_a_direct_solver(every_runtime, d, seed, inner_levels):
    double = every_runtime.precision == "double"
    n = 14**2 if d == 2 else 7**3
    position = block(d, 14 if d == 2 else 7, disturbance=0.3, seed=seed)
    rng = np.random.default_rng(seed)
    state = rng.choice([ABSENT, UNKNOWN, UNKNOWN, UNKNOWN, KNOWN], n)
    particles, system = assembled(position, np.full(n, 0.2), row_state=state, pressure=rng.normal(size=n))
    tolerance = 1e-11 if double else 1e-5
    solution, pressure, direct = solved(particles, system, tolerance, inner_levels=inner_levels)
    assert pressure == pytest.approx(direct(), abs=(1e-8 if double else 2e-3) * float(np.abs(pressure).max()))
    assert 0 < solution.iterations < 40
    # A warm start from the solution has nothing left to do.
    assert Multigrid(tolerance=20 * tolerance)(system, particles).iterations == 0


@pytest.mark.parametrize("rows_alone", [False, True])
def test_one_large_level_in_one_launch(device, monkeypatch, rows_alone):
    """What two threads do where only the particles' level is large, on a small system; also without any other level."""
    initialized(device, 2, "double")
    monkeypatch.setattr(aggregation, "alone", lambda rows: False)
    position = block(3, 7, disturbance=0.3) * (5.0 if rows_alone else 1.0)
    particles, system = assembled(position, np.full(len(position), 0.2))
    solution, pressure, direct = solved(particles, system, 1e-11)
    assert pressure == pytest.approx(direct(), abs=1e-8 * float(np.abs(pressure).max()))
    assert 0 < solution.iterations < (3 if rows_alone else 40)
    assert Multigrid(tolerance=2e-10)(system, particles).iterations == 0
    if not rows_alone:
        particles.set("pressure", np.zeros(particles.count))
        with pytest.raises(NotConverged, match=r"after 2 iterations"):
            Multigrid(tolerance=1e-11, largest_iterations=2, patience=2)(system, particles)


@pytest.mark.parametrize("d", [2, 3])
def test_iterations_do_not_grow_with_the_number_of_rows(runtime, d):
    counts = []
    for cells in (30, 120) if d == 2 else (10, 25):
        position = block(d, cells, disturbance=0.2)
        particles, system = assembled(position, position[:, -1] > position[:, -1].max() - 0.1)
        particles.set("pressure", np.zeros(particles.count))
        counts.append(Multigrid(tolerance=1e-6)(system, particles).iterations)
    assert max(counts) <= 14, counts
    assert counts[1] <= 1.25 * counts[0] + 1, counts
    # What it is measured against: the diagonal alone.
    particles.set("pressure", np.zeros(particles.count))
    assert ConjugateGradient(tolerance=1e-6)(system, particles).iterations > 4 * counts[1]


def test_entries_in_double_precision(runtime):
    """Rounding the coefficients to single precision changes the pressure by no more than moving a particle does."""
    position = block(2, 30, disturbance=0.2)
    found = []
    for single in (True, False):
        particles, system = assembled(position, position[:, -1] > position[:, -1].max() - 0.1, single=single)
        solution, pressure, direct = solved(particles, system, 1e-10)
        assert pressure == pytest.approx(direct(), abs=1e-7 * np.abs(pressure).max())
        assert solution.iterations <= 25
        found.append(pressure)
    assert not np.array_equal(*found)
    assert found[0] == pytest.approx(found[1], abs=1e-5 * np.abs(found[1]).max())


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("arrangement", ["flat", "disordered", "bubbles"])
def test_a_jump_of_density(runtime, d, arrangement):
    """A thousand times: aggregates keep to one fluid, or it takes 46 iterations around bubbles."""
    position = block(d, 60 if d == 2 else 14, disturbance=0.1)
    mixed = np.random.default_rng(2).uniform(-0.3, 0.3, len(position)) if arrangement == "disordered" else 0.0
    light = position[:, -1] > mixed
    if arrangement == "bubbles":
        light = (((position + 0.6) % 1.2 - 0.6) ** 2).sum(axis=1) < 0.4**2
    density = np.where(light, 1.0, 1000.0)
    tied = (position[:, -1] > position[:, -1].max() - 0.15) / density
    particles, system = assembled(position, tied, density=density)
    solution, pressure, direct = solved(particles, system, 1e-6)
    assert pressure == pytest.approx(direct(), abs=1e-3 * np.abs(pressure).max())
    assert solution.iterations <= 25


def test_drops_and_thin_walls(runtime):
    """Two deep pools a wall apart, of which one is tied to the air far away, and drops of one to four rows."""
    pool = block(2, 40, disturbance=0.1) + np.array([0.0, 2.0])
    other = pool + np.array([4.4, 0.0])
    rng = np.random.default_rng(3)
    corners = np.stack(np.meshgrid(np.arange(30) * 0.65 - 6.0, np.arange(8) * 0.65 + 5.0), axis=-1).reshape(-1, 2)
    drops = [c + rng.uniform(-0.09, 0.09, (rng.integers(1, 5), 2)) for c in corners]
    position = np.vstack([pool, other, *drops])
    tied = np.full(len(position), 0.02)
    for k in (0, 1):
        rows = slice(k * len(pool), (k + 1) * len(pool))
        tied[rows] = position[rows, 1] > position[rows, 1].max() - (0.1 if k else 0.3)
    particles, system = assembled(position, tied)
    solution, pressure, direct = solved(particles, system, 1e-10)
    assert pressure == pytest.approx(direct(), abs=1e-6 * np.abs(pressure).max())
    assert solution.iterations <= 25


def test_more_cells_than_there_is_room_for(runtime):
    """Then far apart rows share a cell, but no aggregate: a pool with spray high above it."""
    pool = block(2, 60, disturbance=0.1)
    rng = np.random.default_rng(4)
    spray = np.array([0.0, 30.0]) + np.stack(np.meshgrid(np.arange(6) * 1.0 - 3.0, np.arange(700) * 1.2), -1).reshape(
        -1, 2
    )
    drops = (spray[:, None, :] + 0.1 * np.array([[0, 0], [1, 0], [0, 1], [1, 1]])).reshape(-1, 2)
    position = np.vstack([pool, drops + rng.uniform(-0.01, 0.01, drops.shape)])
    tied = np.concatenate([pool[:, 1] > pool[:, 1].max() - 0.1, np.ones(len(drops))])
    particles, system = assembled(position, tied)
    solution, pressure, direct = solved(particles, system, 1e-6)
    assert kernels.host(multigrid._workspace(2)._table)[aggregation.WRAPPED] == 1
    assert pressure == pytest.approx(direct(), abs=1e-3 * np.abs(pressure).max())
    assert solution.iterations <= 15


def test_more_cells_along_an_axis_than_are_counted(runtime):
    """Two pools whose cells would have the same numbers: they share them, but no aggregate."""
    pool = block(2, 40, disturbance=0.2)
    apart = (aggregation.MOST_CELLS + 2) * aggregation.CELL * 0.1
    position = np.vstack([pool, pool + np.array([apart, 0.0])])
    tied = position[:, 1] > 1.85
    particles, system = assembled(position, tied, region=([-10.0, -10.0], [apart + 10.0, 10.0]))
    solution, pressure, direct = solved(particles, system, 1e-6)
    assert kernels.host(multigrid._workspace(2)._table)[aggregation.WRAPPED] == 1
    assert pressure == pytest.approx(direct(), abs=1e-3 * np.abs(pressure).max())
    particles, system = assembled(pool, tied[: len(pool)])
    assert solution.iterations <= solved(particles, system, 1e-6)[0].iterations + 1


@pytest.mark.parametrize("periodic", [True, False], ids=["periodic", "closed"])
@pytest.mark.parametrize("d", [2, 3])
def test_a_system_without_a_known_pressure(runtime, d, periodic):
    position = block(d, 14 if d == 2 else 7, disturbance=0.3, seed=5)
    particles, system = assembled(position, periodic=periodic)
    components = Components()
    found = components.project(system, particles)
    solution = Multigrid(tolerance=1e-10)(system, particles)
    components.centre(found, particles)
    pressure = particles.numpy("pressure")
    matrix, rhs, _ = sparse(particles, system)
    direct = np.linalg.lstsq(matrix.toarray(), rhs, rcond=None)[0]
    assert pressure == pytest.approx(direct - direct.mean(), abs=1e-7 * np.abs(direct).max())
    assert solution.iterations < 25


def test_nothing_to_solve_and_lone_rows(runtime):
    particles, system = assembled(block(2, 5), row_state=np.full(25, KNOWN))
    assert Multigrid()(system, particles).iterations == 0
    # Far apart: rows without an entry, no coarse level at all.
    particles, system = assembled(block(2, 5) * 9.0, np.ones(25))
    solution, pressure, direct = solved(particles, system)
    assert solution.iterations <= 2
    assert pressure == pytest.approx(direct())


@pytest.mark.parametrize("threads", [1, 2])
def test_room_is_made_as_needed(device, threads, monkeypatch):
    initialized(device, threads, "double")
    monkeypatch.setattr(multigrid, "ROOM", (0.001, 0.01))
    multigrid._workspace.cache_clear()
    position = block(2, 110, disturbance=0.2)
    assert aggregation.alone(len(position)) == (threads == 1 and not kernels.runtime().wide)
    particles, system = assembled(position, position[:, 1] > 5.3)
    solution, _, _ = solved(particles, system, 1e-8)
    assert solution.iterations <= 18
    multigrid._workspace.cache_clear()


def test_not_converged(runtime):
    particles, system = assembled(block(2, 20, disturbance=0.2), np.full(400, 0.001))
    with pytest.raises(NotConverged, match=r"relative residual .* after 2 iterations"):
        Multigrid(tolerance=1e-9, largest_iterations=2)(system, particles)
    rhs = particles.numpy("rhs")
    rhs[7] = np.nan
    particles.set("rhs", rhs)
    with pytest.raises(NotConverged):
        Multigrid()(system, particles)


@pytest.mark.parametrize("threads", [1, 2])
def test_many_rows_that_cannot_be_solved_end_too(device, threads):
    initialized(device, threads, "double")
    position = block(2, 110, disturbance=0.2)
    assert aggregation.alone(len(position)) == (threads == 1 and not kernels.runtime().wide)
    particles, system = assembled(position, position[:, 1] > 5.3)
    with pytest.raises(NotConverged, match=r"relative residual .* after 2 iterations"):
        Multigrid(tolerance=1e-9, largest_iterations=2)(system, particles)
    rhs = particles.numpy("rhs")
    rhs[7] = np.nan
    particles.set("rhs", rhs)
    with pytest.raises(NotConverged):
        Multigrid()(system, particles)
    with pytest.raises(NotConverged, match=r"^multigrid: relative residual nan after [01] iterations"):
        multigrid._workspace(2).solve(Multigrid(), system, particles)
    rhs[7] = 0.0
    particles.set("rhs", rhs)
    particles.set("pressure", np.zeros(particles.count))
    with pytest.raises(NotConverged, match=r"^multigrid: .* after 2 iterations"):
        multigrid._workspace(2).solve(Multigrid(tolerance=1e-9, largest_iterations=2), system, particles)


def test_a_team_builds_the_levels_that_one_thread_builds(device):
    position = block(2, 110, disturbance=0.2)
    found = []
    for threads in (1, 2):
        initialized(device, threads, "double")
        assert aggregation.alone(len(position)) == (threads == 1 and not kernels.runtime().wide)
        particles, system = assembled(position, position[:, 1] > 5.3)
        solved(particles, system, 1e-6)
        found.append(multigrid.coarse_levels(2))
    assert len(found[0]) >= 3
    assert found[0] == found[1]


@pytest.mark.parametrize("threads", [1, 2])
def test_the_same_bits_again(device, threads):
    """Enough rows that two threads share those of the first coarse level, too."""
    initialized(device, threads, "double")
    position = block(2, 120, disturbance=0.2)
    assert aggregation.alone(len(position)) == (threads == 1 and not kernels.runtime().wide)
    assert len(position) > 2 * 4 * team.ROWS_OF_PART
    particles, system = assembled(position, position[:, 1] > 5.8)
    found = []
    for _ in range(3):
        particles.set("pressure", np.zeros(particles.count))
        solution = Multigrid(tolerance=1e-6)(system, particles)
        found.append(particles.numpy("pressure"))
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])
    assert solution.iterations <= 14
    matrix, rhs, _ = sparse(particles, system)
    assert np.linalg.norm(rhs - matrix @ found[0]) < 1.1e-6 * np.linalg.norm(rhs)


@pytest.mark.parametrize("threads", [1, 2])
def test_no_second_inner_iteration_where_the_first_is_enough(device, threads):
    """Rows that are all held need one, as a cycle without inner iterations has; rows far below a surface need two."""
    if initialized(device, threads, "double").wide:
        pytest.skip("a graph of loops visits every level as often as planned")
    position = block(2, 110, disturbance=0.2)
    assert aggregation.alone(len(position)) == (threads == 1 and not kernels.runtime().wide)
    counts = {}
    for name, tied in (("held", np.full(len(position), 1000.0)), ("free", position[:, 1] > 5.3)):
        particles, system = assembled(position, tied)
        for inner in (0, 20):
            solution, pressure, direct = solved(particles, system, 1e-11, inner_levels=inner)
            assert pressure == pytest.approx(direct(), abs=1e-8 * float(np.abs(pressure).max()))
            counts[name, inner] = solution.iterations
        # The step along the second correction on the first coarse level, of the last iteration.
        second = kernels.host(multigrid._workspace(2)._scalars)[cycle.SCALARS + 4 + 2]
        assert (second == 0) == (name == "held"), second
    assert counts["held", 20] <= counts["held", 0] + 1
    assert counts["free", 20] <= 0.7 * counts["free", 0], counts


def test_the_program_of_a_cycle():
    """Two inner iterations on the two finest coarse levels: 1, 2, 4, 4, 4 visits."""
    assert cycle.program(1, ()) == []
    operations = cycle.program(6, {1, 2})
    visits = [operations.count((cycle.POLISH, level)) for level in range(1, 5)]
    assert visits == [2, 4, 4, 4]
    assert operations.count((cycle.SOLVE, 5)) == 4
    assert operations.count((cycle.SECOND, 2)) == 2
    assert operations.count((cycle.RESTRICT, 5)) == 0


def test_levels_that_hardly_shrink_are_not_visited_twice():
    """Or the visits to the last of twenty levels of drops and films would be a million."""
    assert cycle.inner_levels([1000, 200, 190, 90, 80], 20) == {1, 3}
    assert cycle.inner_levels([1000, 200, 190, 90, 80], 2) == {1}
    assert cycle.inner_levels([1000], 20) == cycle.inner_levels([], 20) == frozenset()


@pytest.mark.parametrize("laplacian", [CorrectedVector(), DummyNeighbour(), SecondOrder(re=2.1)], ids=lambda m: m.key)
@pytest.mark.parametrize("d", [2, 3])
def test_a_matrix_that_is_not_symmetric(runtime, laplacian, d):
    """Conjugate residuals take the place of conjugate gradients, outside and inside; as few iterations, no fallback."""
    counts = []
    for cells in (20, 50) if d == 2 else (10, 16):
        position = block(d, cells, disturbance=0.2)
        n = len(position)
        rng = np.random.default_rng(1)
        fields = tuple(dict.fromkeys((*FIELDS, *laplacian.needs)))
        lattice, particles, pairs = table(position, fields=fields, skin=0.1, density=np.full(n, 1.0))
        x = particles.numpy("position")
        edge = (np.abs(x) > np.abs(x).max() - 0.25).any(axis=1)
        particles.set("row_state", np.where(edge, KNOWN, UNKNOWN))
        particles.set("source", rng.normal(size=n))
        particles.set("pressure", np.where(edge, rng.normal(size=n), 0.0))
        system = LinearSystem()
        system.assemble(laplacian, lattice, particles, pairs)
        assert not system.symmetric
        solution, pressure, direct = solved(particles, system, 1e-8)
        assert solution.fallbacks == 0
        assert pressure == pytest.approx(direct(), abs=1e-6 * np.abs(pressure).max())
        counts.append(solution.iterations)
    assert max(counts) <= 18, counts
    assert counts[1] <= counts[0] + 4, counts


@pytest.mark.parametrize("solver", [Multigrid, ConjugateGradient], ids=lambda s: s.key)
def test_a_residual_that_may_remain(runtime, solver):
    """The iteration stops at it though the tolerance is far, and not before."""
    position = block(2, 20, disturbance=0.2)
    particles, system = assembled(position, position[:, -1] > position[:, -1].max() - 0.1)
    system.negligible = 1e-3
    matrix, rhs, unknown = sparse(particles, system)
    assert rhs.std() > 100 * system.negligible
    solution = solver(tolerance=1e-12)(system, particles)
    rest = np.sqrt(np.mean((rhs - matrix @ particles.numpy("pressure")[unknown]) ** 2))
    assert 0.01 * system.negligible < rest <= 1.01 * system.negligible
    assert 0 < solution.residual <= 1e-12


@pytest.mark.parametrize("solver", [Multigrid, ConjugateGradient], ids=lambda s: s.key)
def test_however_little_it_matters_a_row_is_solved_to_a_thousandth(runtime, solver):
    """What may remain is bounded by each row's own right side, so a slow flow is solved as well."""
    position = block(2, 20, disturbance=0.2)
    particles, system = assembled(position, position[:, -1] > position[:, -1].max() - 0.1)
    matrix, rhs, unknown = sparse(particles, system)
    system.negligible = 1e6 * rhs.std()
    solution = solver(tolerance=1e-9)(system, particles)
    rest = np.linalg.norm(rhs - matrix @ particles.numpy("pressure")[unknown]) / np.linalg.norm(rhs)
    assert 1e-6 < rest <= 1.01e-3
    assert 0 < solution.residual <= 1e-9


def test_stages_of_an_iteration_follow_the_cycle():
    cycle_of_two = [(cycle.SOLVE, 1)]
    assert team_iteration.stages_of([]) == [
        (cycle.POLISH, 0), (team_iteration.PRODUCTS, 0), (team_iteration.ADVANCE, 0)
    ]  # fmt: skip
    assert team_iteration.stages_of(cycle_of_two) == [
        (team_iteration.LEAVE, 0), (cycle.RESTRICT, 0), (cycle.SOLVE, 1), (cycle.CORRECT, 0), (cycle.POLISH, 0),
        (team_iteration.PRODUCTS, 0), (team_iteration.ADVANCE, 0),
    ]  # fmt: skip
    deep = team_iteration.stages_of(cycle.program(4, frozenset({1})))
    steps = [step for step in deep if step[0] in (team_iteration.FIRST_STEP, team_iteration.SECOND_STEP)]
    assert steps == [(team_iteration.FIRST_STEP, 1), (team_iteration.SECOND_STEP, 1)]
    assert deep[deep.index(steps[0]) - 1] == (cycle.FIRST, 1)
    # Who restricts first notes what is left over; the two are always beside each other.
    assert all(
        deep[k - 1] == (team_iteration.LEAVE, level) for k, (op, level) in enumerate(deep) if op == cycle.RESTRICT
    )
