"""What devices with a thread for each row do otherwise, here on the processor."""

import numpy as np
import pytest
import scipy.sparse.linalg

from arrangements import block, table
from spume import kernels, lanes
from spume.particles import FLUID, WALL
from spume.pressure.bicgstab import StabilisedBiconjugateGradient
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.matrix import FLUX, KNOWN, SYSTEM_FIELDS, UNKNOWN, LinearSystem
from spume.pressure.multigrid import Multigrid, coarse_levels
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.laplacian.original import Original
from spume.schemes.source.base import SOURCE


@pytest.fixture
def wide(device, monkeypatch):
    monkeypatch.setenv("SPUME_WIDE", "1")
    return kernels.initialize(device, 1, "double")


@pytest.mark.parametrize("n", [0, 1, 5, 1000, 70_001, 200_000])
def test_partial_sums_are_folded(wide, n):
    fold, total, real = lanes.fold().fold, lanes.fold().total, kernels.runtime().real
    Reals = kernels.array_type(real)
    given = np.random.default_rng(1).normal(size=(n, 3))
    partial, found = kernels.array(real, 3 * lanes.room_for_sums(n, 8)), kernels.array(real, 3)
    values = kernels.host(partial)
    values[: 3 * n] = given.ravel()
    kernels.publish(partial, values)

    @kernels.kernel
    def sums(partial: Reals, found: Reals, n: kernels.i32):
        fold(partial, n)
        for _ in range(1):
            for which in kernels.static(range(3)):
                found[which] = total(partial, 8, which)

    sums(partial, found, n)
    np.testing.assert_allclose(kernels.host(found), given.sum(axis=0), rtol=0, atol=1e-9)


@pytest.mark.parametrize("n", [0, 1, 5, 32, 20_000, 1_000_003])
def test_exclusive_sums(wide, n):
    Rows, scan = kernels.array_type(kernels.i32), lanes.exclusive_sums()
    given = np.random.default_rng(2).integers(0, 7, n + 1)
    counts, start, sums = (kernels.array(kernels.i32, m) for m in (n + 1, n + 2, lanes.room_for_scan(n)))
    values = kernels.host(counts)
    values[:] = given
    kernels.publish(counts, values)

    @kernels.kernel
    def scanned(counts: Rows, start: Rows, sums: Rows, n: kernels.i32):
        scan(counts, start, sums, n)

    scanned(counts, start, sums, n)
    expected = np.concatenate([[0], np.cumsum(given[:n])])
    np.testing.assert_array_equal(kernels.host(start)[: n + 1], expected)
    np.testing.assert_array_equal(kernels.host(counts)[:n], expected[:n])


def test_slots_lie_interleaved(wide):
    start, length = np.array([0, 1, 2, 640]), np.array([2, 0, 3, 1])
    assert lanes.slots(start, length).tolist() == [0, 32, 2, 34, 66, 640]


@pytest.mark.parametrize(("solver", "d"), [(Multigrid, 3), (ConjugateGradient, 2), (StabilisedBiconjugateGradient, 2)])
def test_against_a_direct_solver(wide, solver, d):
    m = 30 if d == 2 else 8
    rng = np.random.default_rng(d)
    state = rng.choice([UNKNOWN] * 30 + [KNOWN, FLUX], m**d)
    fields = (*SYSTEM_FIELDS, SURFACE_SHARE, SOURCE, *solver.needs, *ConjugateGradient.needs)
    lattice, particles, pairs = table(
        block(d, m, disturbance=0.1), fields=tuple(dict.fromkeys(fields)), kind=np.where(state == FLUX, WALL, FLUID)
    )
    particles.set("row_state", state[particles.numpy("id")])
    particles.set("source", rng.normal(size=m**d))
    system = LinearSystem()
    system.assemble(Original(), lattice, particles, pairs)
    solution = solver(tolerance=1e-10)(system, particles)
    unknown = np.flatnonzero(particles.numpy("row_state") == UNKNOWN)
    matrix, right = system.sparse(particles)[unknown][:, unknown], particles.numpy("rhs")[unknown]
    expected = scipy.sparse.linalg.spsolve(matrix.tocsc(), right)
    np.testing.assert_allclose(particles.numpy("pressure")[unknown], expected, atol=1e-7 * np.abs(expected).max())
    if solver is Multigrid:
        assert solution.iterations <= 20
        assert coarse_levels(d)[-1][0] <= 12, "the last level is solved by one thread"
