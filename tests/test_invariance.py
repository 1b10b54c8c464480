"""Symmetries of the method: what must not change a result, over 20 steps to 1e-10 in double precision.

Later the flows diverge, as chaos must. The pressure is solved to 1e-15, for the solver's tolerance is
a difference that rounding may decide (one iteration more or less).
"""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from spume.build import _simulation, initial_rows
from spume.particles import ANY, FLUID
from spume.pressure.conjugate_gradient import ConjugateGradient
from tanks import STEPS, advanced, by_id, dam_break

N = 20
TOLERANCE = 1e-10

every_step = pytest.mark.parametrize("step", STEPS)
_runs = {}


def simulation_of(device, step, threads=1, **options):
    case = dam_break(step=STEPS[step](solver=ConjugateGradient(tolerance=1e-15)), **options)
    return case.build(device=device, threads=threads, precision="double")


def reference(device, step):
    """Return initial and final state of the plain dam break; computed once."""
    if step not in _runs:
        simulation = simulation_of(device, step)
        start = by_id(simulation, "position", kinds=ANY)
        advanced(simulation, N)
        assert np.abs(by_id(simulation, "velocity")).max() > 0.1, "something happened"
        _runs[step] = start, final(simulation)
    return _runs[step]


def final(simulation):
    return by_id(simulation, "position", "velocity", "pressure", kinds=ANY)


def difference(one, other, l0=0.02):
    """Return the largest differences of position, velocity and pressure, relative to l0 and to their maxima."""
    scales = [l0, np.abs(other[1]).max(), np.abs(other[2]).max()]
    return [float(np.abs(a - b).max() / s) for a, b, s in zip(one, other, scales, strict=True)]


def partners(here, there):
    """Return for each point of ``here`` the index of the same point in ``there``."""
    distance, index = cKDTree(there).query(here)
    assert distance.max() < 1e-12
    assert len(set(index)) == len(index)
    return index


@every_step
def test_translation(device, step):
    shift = np.array([0.37, -1.213])
    start, expected = reference(device, step)
    simulation = simulation_of(device, step, shift=tuple(shift))
    twin = partners(start, by_id(simulation, "position", kinds=ANY) - shift)
    x, u, p = (field[twin] for field in final(advanced(simulation, N)))
    assert max(difference((x - shift, u, p), expected)) < TOLERANCE


@every_step
def test_rotation(device, step):
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    start, expected = reference(device, step)
    simulation = simulation_of(device, step, turned=True)
    twin = partners(start, by_id(simulation, "position", kinds=ANY) @ turn)
    x, u, p = (field[twin] for field in final(advanced(simulation, N)))
    assert max(difference((x @ turn, u @ turn, p), expected)) < TOLERANCE


@every_step
def test_renumbering(device, step):
    start, expected = reference(device, step)
    case = dam_break(step=STEPS[step](solver=ConjugateGradient(tolerance=1e-15)))
    case.build(device=device, threads=1, precision="double")
    rows = initial_rows(case)
    order = np.random.default_rng(3).permutation(len(rows["id"]))
    number = np.argsort(order)
    rows = {name: values[order] for name, values in rows.items()}
    rows["id"] = np.arange(len(order), dtype=np.int32)
    rows["master"] = number[rows["master"]].astype(np.int32)
    simulation = _simulation(case, rows)
    twin = partners(start, by_id(simulation, "position", kinds=ANY))
    assert not np.array_equal(twin, np.arange(len(twin)))
    found = [field[twin] for field in final(advanced(simulation, N))]
    assert max(difference(found, expected)) < TOLERANCE


@every_step
def test_mirror_symmetry(device, step):
    """A column in the middle of the tank collapses to both sides alike."""
    simulation = simulation_of(device, step, start=10)
    mirror = np.array([-1.0, 1.0])
    middle = np.array([2 * 0.3, 0.0])
    start = by_id(simulation, "position", kinds=ANY)
    twin = partners(start, start * mirror + middle)
    x, u, p = final(advanced(simulation, N))
    assert np.abs(u[by_id(simulation, "kind", kinds=ANY) == FLUID, 0]).max() > 0.1
    reflected = (x[twin] * mirror + middle, u[twin] * mirror, p[twin])
    assert max(difference(reflected, (x, u, p))) < TOLERANCE


@every_step
def test_threads(device, step):
    _, expected = reference(device, step)
    found = final(advanced(simulation_of(device, step, threads=2), N))
    assert max(difference(found, expected)) < TOLERANCE
