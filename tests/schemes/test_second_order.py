"""The second-order corrective matrix: against NumPy, exact for quadratics, and sound where neighbours are few."""

import numpy as np
import pytest

from arrangements import block, offsets, table, weights
from spume.pairs import pair_sum, pair_term
from spume.schemes.operator import Operator
from spume.schemes.second_order import (
    FIT_DEGREE,
    GRADIENT_VECTORS,
    LAPLACIAN_VECTOR,
    basis,
    second_order_vectors,
)

pytestmark = pytest.mark.usefixtures("runtime")
FIELDS = (LAPLACIAN_VECTOR, GRADIENT_VECTORS, FIT_DEGREE)
OPERATOR = Operator(re=3.1)
dimensions = pytest.mark.parametrize("d", [2, 3])
fits = pytest.mark.parametrize("inverse_square", [True, False], ids=["scm", "lsmps"])


@pair_term(reads=("value", "laplacian_vector"))
def share_scm(a, b, r, w, scale, l0):
    return scale * w / r.dot(r) * l0 * l0 * (b.value - a.value) * basis(r, l0).dot(a.laplacian_vector)


@pair_term(reads=("value", "laplacian_vector"))
def share_lsmps(a, b, r, w, scale, l0):
    return scale * w * (b.value - a.value) * basis(r, l0).dot(a.laplacian_vector)


def monomials(r, l0=0.1):
    d = r.shape[-1]
    x = [r[..., k] / l0 for k in range(d)]
    mixed = [x[0] * x[1]] if d == 2 else [x[0] * x[1], x[1] * x[2], x[2] * x[0]]
    return np.stack([*x, *[y**2 for y in x], *mixed], axis=-1)


def computed(position, inverse_square, **rows):
    lattice, particles, pairs = table(position, fields=FIELDS, reach=3.1, **rows)
    second_order_vectors(
        OPERATOR, lattice, particles, pairs, inverse_square=inverse_square, laplacian=True, gradient=True
    )
    return lattice, particles, pairs


@fits
@dimensions
def test_vectors_against_numpy(every_runtime, d, inverse_square):
    lattice, particles, _ = computed(block(d, 10 if d == 2 else 6, disturbance=0.3), inverse_square)
    r = offsets(particles.numpy("position"))
    v = weights(r, OPERATOR.weight, 0.31) / lattice.n0(OPERATOR.weight, 3.1)
    if inverse_square:
        v *= 0.01 / np.maximum((r**2).sum(axis=-1), 1e-30)
    q = monomials(r)
    inverse = np.linalg.inv(np.einsum("ij,ijk,ijl->ikl", v, q, q))
    rel = 1e-10 if every_runtime.precision == "double" else 2e-2
    assert np.all(particles.numpy("fit_degree") == 2), "even a corner of the block has neighbours enough"
    expected = inverse[:, :, d : 2 * d].sum(axis=2)
    assert particles.numpy("laplacian_vector") == pytest.approx(expected, abs=rel * float(np.abs(expected).max()))
    assert particles.numpy("gradient_vectors") == pytest.approx(inverse[:, :d], abs=rel * float(np.abs(inverse).max()))


@fits
@dimensions
def test_exact_for_quadratics_anywhere(d, inverse_square):
    """Also in the corners of the block, where no other model is exact."""
    lattice, particles, pairs = computed(block(d, 9 if d == 2 else 6, disturbance=0.3), inverse_square)
    x = particles.numpy("position")
    phi = 3 + 2 * x[:, 0] - x[:, 1] + 4 * x[:, 0] ** 2 - x[:, 1] ** 2 + 5 * x[:, 0] * x[:, 1] + 7 * x[:, -1] ** 2
    particles.set("scalar", phi)
    pair_sum(
        share_scm if inverse_square else share_lsmps, particles, pairs, out="answer", weight=OPERATOR.weight, re=0.31,
        arguments=(2.0 / (lattice.n0(OPERATOR.weight, 3.1) * 0.01), 0.1), fields={"value": "scalar"},
    )  # fmt: skip
    assert particles.numpy("answer") == pytest.approx(8.0 - 2.0 + 14.0, rel=1e-9)


@fits
@dimensions
def test_rows_with_few_neighbours(d, inverse_square):
    """A lone row, a pair, a line, a plane and a full block: what the neighbours do not determine is left out."""
    lone, pair = np.zeros((1, d)), np.zeros((2, d))
    pair[1, 0] = 0.1
    line = np.zeros((8, d))
    line[:, 0] = np.arange(8) * 0.1
    sheet = np.zeros((49, d))
    sheet[:, :2] = block(2, 7, disturbance=0.1)
    parts = [lone, pair + 3.0, line + 6.0, sheet + 9.0, block(d, 7, disturbance=0.1) + 12.0]
    part = np.repeat(np.arange(5), [len(p) for p in parts])
    lattice, particles, _ = computed(np.vstack(parts), inverse_square, body=part)
    part, degree = particles.numpy("body"), particles.numpy("fit_degree")
    expected = [0, 0, 0, 2 if d == 2 else 0, 2]
    for k, number in enumerate(expected):
        assert np.all(degree[part == k] == number)
    laplacian, gradient = particles.numpy("laplacian_vector"), particles.numpy("gradient_vectors")
    poor = degree < 2
    # The original models, each normalised by the regular arrangement.
    second = lattice.lambda_(OPERATOR.weight, 3.1) / 0.01
    full = second if inverse_square else lattice.fourth(OPERATOR.weight, 3.1) / 1e-4
    assert laplacian[poor, d : 2 * d] == pytest.approx(d / full)
    assert not laplacian[poor, :d].any()
    first = 1 / d if inverse_square else second / d
    assert gradient[poor] == pytest.approx(
        np.broadcast_to(np.eye(d, 2 * d + d * (d - 1) // 2) / first, gradient[poor].shape)
    )


@dimensions
def test_a_row_that_determines_a_gradient_only(d):
    """Two neighbours off a line (three in 3D): the gradient of first order, exact for linear fields."""
    position = np.vstack([np.zeros((1, d)), 0.1 * np.eye(d) + 0.02])
    lattice, particles, _ = computed(position, True)
    row = int(np.argmin(np.linalg.norm(particles.numpy("position"), axis=1)))
    assert particles.numpy("fit_degree")[row] == 1
    r = offsets(particles.numpy("position"))[row]
    v = weights(offsets(particles.numpy("position")), OPERATOR.weight, 0.31)[row]
    v *= 0.01 / np.maximum((r**2).sum(axis=-1), 1e-30) / lattice.n0(OPERATOR.weight, 3.1)
    slope = np.array([3.0, -2.0, 0.5][:d])
    share = np.einsum("j,j,jk,ck->c", v, r @ slope, monomials(r), particles.numpy("gradient_vectors")[row]) / 0.1
    assert share == pytest.approx(slope)
