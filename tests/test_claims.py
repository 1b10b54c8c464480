"""Every scheme against what it claims, found unasked: ``tests/claims.toml`` is written from the equations.

A scheme without an entry fails, as does one below its entry or better than it by a full order, and two schemes of a
family that give the same numbers. The reference values come from the double loops in ``tests/reference``, which import
nothing of Spume; both they and the schemes are held to the number in the file.
"""

import importlib
import json
import re
import sys
from copy import copy
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import asked
from conftest import initialized
from measured import CLAIMS, FAMILIES, SCHEMES, cells_of, claim, cloud_of, exact_degree, full, made, values, wave_error
from reference.cloud import DT, Cloud, checksum, compared, loop, reference_value, scattered
from reference.shapes import SHAPES, Water
from spume.citation import bibliography
from spume.cli import app
from spume.named import find
from spume.problems import CaseError

DOCS = Path(__file__).parents[1] / "docs"
sys.path.append(str(DOCS))

dimensions = pytest.mark.parametrize("d", [2, 3], ids=["2D", "3D"])


def of(*families, with_claim=None):
    """Parametrise a test over the schemes of some families, whose entry has a key."""
    chosen = [
        name for name in SCHEMES if name.split(".")[0] in families and (with_claim is None or with_claim in claim(name))
    ]
    return pytest.mark.parametrize("name", chosen)


@pytest.fixture(scope="module", autouse=True)
def one_runtime(device):
    """One thread, double precision, for the whole file: kernels are compiled once."""
    return initialized(device, 1, "double")


# ------------------------------------------------------------------------------------- entries and references


def test_every_scheme_has_an_entry_and_every_entry_a_scheme():
    entries = {f"{family}.{key}" for family, keys in CLAIMS.items() for key in keys}
    assert sorted(set(SCHEMES) - entries) == [], "schemes without an entry in tests/claims.toml"
    assert sorted(entries - set(SCHEMES)) == [], "entries without a scheme"


@of(*FAMILIES)
def test_attributes_are_the_claims(name):
    """What a scheme says of itself is what its entry says, neither less nor more."""
    scheme = SCHEMES[name]
    assert scheme.order == claim(name).get("order"), "order"
    assert scheme.conserves == set(claim(name).get("conserves", [])), "conserves"
    assert sorted(scheme.ids) == sorted(claim(name).get("ids", [])), "ids"


@pytest.mark.parametrize("name", [n for n, scheme in SCHEMES.items() if "largest_condition" in scheme.model_fields])
def test_no_matrix_is_better_conditioned_than_the_unit_matrix(name):
    """A largest condition number of 1 or less would turn every correction off."""
    for wrong in (1.0, 0.0, -1e3):
        with pytest.raises(CaseError, match=r"largest_condition = .*: must be greater than 1"):
            SCHEMES[name](largest_condition=wrong)


# --------------------------------------------------------------------------------------------------- values


def reference(name, entry, d):
    """Return the checksum that the double loop gives."""
    family, key = name.split(".")
    key, text = entry.get("function", key), claim(name).get("loop")
    return reference_value(family, key, cloud_of(name, d), entry.get("arguments"), text)


def given(name, entry, d):
    """Return the checksum that the scheme gives."""
    family = name.split(".")[0]
    scheme = made(name, entry)
    if family == "weight":
        return checksum(scheme.values(0.11 + 0.09 * scattered(9, 2), 0.21))
    cloud = cloud_of(name, d)
    more = {"dt": DT, "acceleration": cloud.force} if family == "gradient" else {}
    ask = getattr(asked, entry["ask"]) if "ask" in entry else asked.ASK[family]
    return checksum(ask(scheme, cloud, share=cloud.share, **more), compared(family, cloud))


def each_value():
    return [
        pytest.param(name, entry, d, id=f"{name}-{index}-{d}D" if index else f"{name}-{d}D")
        for name in SCHEMES
        for index, entry in enumerate(values(name))
        for d in (2, 3)
        if f"{d}D" in entry
    ]


@pytest.mark.parametrize(("name", "entry", "d"), each_value())
def test_the_double_loop_gives_the_reference_value(name, entry, d):
    assert reference(name, entry, d) == pytest.approx(entry[f"{d}D"], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("name", "entry", "d"), each_value())
def test_the_scheme_gives_the_reference_value(name, entry, d):
    assert given(name, entry, d) == pytest.approx(entry[f"{d}D"], rel=1e-8, abs=1e-11)


@of(*FAMILIES)
def test_every_scheme_has_a_reference_value(name):
    assert all({"2D", "3D"} <= set(entry) for entry in values(name))
    assert values(name), "no reference value in tests/claims.toml"


@of("weight")
def test_slope_of_a_weight(name):
    """The derivative that sources follow the number density with."""
    weight, r, step = SCHEMES[name], 0.11 + 0.09 * scattered(9, 2), 1e-6
    difference = (made(name).values(r + step, 0.21) - made(name).values(r - step, 0.21)) / (2 * step)
    assert [weight.slope(float(s), 0.21) for s in r] == pytest.approx(difference, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("family", sorted({name.split(".")[0] for name in SCHEMES}))
def test_no_two_schemes_are_one(family):
    """Two names for one set of numbers on the disturbed clouds are one scheme."""
    found = [
        (name, np.array([entry["2D"], entry["3D"]]))
        for name in SCHEMES
        if name.startswith(f"{family}.")
        for entry in values(name)
    ]
    for (one, here), (other, there) in combinations(found, 2):
        assert one == other or np.any(np.abs(here - there) > 1e-6 * np.abs(here) + 1e-12), f"{one} is {other}"


# ------------------------------------------------------------------------------------ polynomials and rates


@of("gradient", "divergence", "laplacian")
@dimensions
def test_order_on_a_disturbed_cloud(name, d):
    """Exact for polynomials up to ``order`` on any arrangement (``order_inside``: off the free surface), no more."""
    cloud = cloud_of(name, d)
    expected = claim(name).get("order_inside", claim(name)["order"])
    assert exact_degree(name, cloud, cloud.inner) == expected >= claim(name)["order"]


@of("gradient", "divergence", "laplacian")
@dimensions
def test_order_on_the_lattice(name, d):
    cloud = cloud_of(name, d, disturbance=0.0, cells=cells_of(name, d))
    assert full(cloud).any()
    assert exact_degree(name, cloud, full(cloud)) == claim(name)["order_on_lattice"]


@of("gradient", "divergence", "laplacian")
@dimensions
@pytest.mark.parametrize("arrangement", ["lattice", "disturbed"])
def test_rate_of_convergence(name, d, arrangement):
    """The arrangement is refined, the wave is not: error ~ l0^rate."""
    errors = [wave_error(name, d, arrangement, l0)[0] for l0 in (0.05, 0.025)]
    rate = np.log2(errors[0] / errors[1])
    expected = claim(name)["rates"][["lattice", "disturbed"].index(arrangement)]
    assert rate == pytest.approx(expected, abs=0.35)


# -------------------------------------------------------------------------------------------- conservation


def conserved(force, *moments):
    """Return which sums vanish: of the forces, and of their moments [(arm, force) ...]."""
    turning = sum(x[:, :, None] * f[:, None, :] for x, f in moments)
    sums = {"momentum": (force, force), "angular momentum": (turning - turning.transpose(0, 2, 1), turning)}
    return {word for word, (v, size) in sums.items() if np.abs(v.sum(axis=0)).max() < 1e-11 * np.abs(size).sum()}


@of("gradient", "viscosity", "collision")
@dimensions
def test_momentum(name, d):
    """Conserved are the quantities that the entry says, and no others."""
    cloud = cloud_of(name, d)
    family = name.split(".")[0]
    force = asked.ASK[family](SCHEMES[name](), cloud)
    if family != "gradient":  # accelerations and changes of velocity
        force *= cloud.rho[:, None]
    if name.endswith(".none"):
        assert not force.any()
    else:
        assert np.abs(force).max() > 0
        moments = [(cloud.x, force)]
        if family == "collision":  # moves the rows, too
            moments.append((DT * force / cloud.rho[:, None], cloud.rho[:, None] * cloud.u + force))
        assert conserved(force, *moments) == {"momentum", "angular momentum"} & set(claim(name).get("conserves", []))


@of("gradient")
@dimensions
def test_a_pair_alone(name, d):
    """Two rows of a conservative model pull on each other along the line that joins them, equally."""
    cloud = cloud_of(name, d)
    if "momentum" not in claim(name).get("conserves", []):
        return
    pair = Cloud(d, cells=2)
    pair.x, pair.u, pair.phi = cloud.x[:2], cloud.u[:2], np.array([300.0, -100.0])
    pair.rho, pair.nu = cloud.rho[:2], cloud.nu[:2]
    force = asked.gradient(made(name), pair)
    assert force[0] == pytest.approx(-force[1], rel=1e-12)
    along = (pair.x[1] - pair.x[0]) / np.linalg.norm(pair.x[1] - pair.x[0])
    assert np.abs(force[0]).max() > 0
    assert force[0] == pytest.approx((force[0] @ along) * along, rel=1e-9, abs=1e-9 * np.abs(force[0]).max())


# ------------------------------------------------------------------------------------------------- matrices


@of("laplacian")
@dimensions
def test_matrix(name, d):
    """Symmetry and sign as claimed, constants in its kernel."""
    cloud = cloud_of(name, d)
    matrix, _ = asked.system(made(name), cloud)
    largest = np.abs(matrix).max()
    assert (np.abs(matrix - matrix.T).max() < 1e-12 * largest) == claim(name)["symmetric"]
    assert made(name).symmetric == claim(name)["symmetric"]
    beside = matrix - np.diag(np.diag(matrix))
    assert (beside.max() <= 0) == claim(name)["positive"], "every neighbour pulls towards its own value"
    assert (np.diag(matrix)[cloud.inner] > 0).all()
    assert np.abs(matrix.sum(axis=1)).max() < 1e-11 * largest
    lap = asked.laplacian(made(name), cloud)
    assert (abs(lap.sum()) < 1e-11 * np.abs(lap).sum()) == ("flux" in claim(name).get("conserves", []))


# ----------------------------------------------------------------------------------------------- invariance

TURNS = {2: np.array([[0, -1], [1, 0]]), 3: np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]) @ np.diag([-1, -1, 1])}
SHIFT = np.array([0.37, -1.213, 5.1])


@cache
def turned(cloud):
    """Return the cloud, turned about the origin and moved."""
    return transformed(cloud, TURNS[cloud.d], SHIFT[: cloud.d])


def transformed(cloud, turn, shift):
    other = Cloud(cloud.d, re=cloud.re / cloud.l0, cells=2, l0=cloud.l0)
    other.x, other.u, other.slope = cloud.x @ turn.T + shift, cloud.u @ turn.T, cloud.slope @ turn.T
    other.before, other.u_before = [x @ turn.T + shift for x in cloud.before], cloud.u_before @ turn.T
    for name in ("phi", "rho", "nu", "share", "inner", "cells"):
        setattr(other, name, getattr(cloud, name))
    return other


@of(*asked.ASK)
@dimensions
def test_rotation_and_translation(name, d):
    """By 90 degrees (in 3D about two axes), and somewhere else: the same scalars, vectors turned alike."""
    assert np.linalg.det(TURNS[d]) == pytest.approx(1.0)
    family, scheme = name.split(".")[0], made(name)
    cloud = cloud_of(name, d)
    there = turned(cloud)
    one = asked.ASK[family](scheme, cloud, share=cloud.share)
    other = asked.ASK[family](scheme, there, share=cloud.share)
    expected = one if one.ndim == 1 else one @ TURNS[d].T
    # Rows of the outermost layer may have a system that is nearly singular: rounding decides there.
    scale = np.abs(expected).max() + 1e-30
    rows = compared(family, cloud)
    assert other[rows] == pytest.approx(expected[rows], rel=1e-7, abs=1e-9 * scale)


# ---------------------------------------------------------------------------- scale of Laplacian and source


def compression(cloud):
    """Return a velocity field with the divergence -3 1/s in every dimension, isotropic."""
    return -3.0 / cloud.d * cloud.x


@of("laplacian")
@dimensions
def test_scale_of_the_laplacian(name, d):
    """What it gives for |x|^2/(2 d) on the lattice, where the Laplacian is 1."""
    for entry in values(name):
        cloud = cloud_of(name, d, disturbance=0.0, cells=cells_of(name, d))
        phi = (cloud.x**2).sum(axis=1) / (2 * d)
        found = asked.laplacian(made(name, entry), cloud, phi, slope=cloud.x / d)[full(cloud)]
        assert found == pytest.approx(entry.get("scale", [1.0, 1.0])[d - 2], rel=1e-3)


@of("source")
@dimensions
def test_scale_of_the_source(name, d):
    """What it gives for a uniform compression, relative to div(u)/dt; a change of n is that of the moved rows."""
    cloud = copy(cloud_of(name, d, disturbance=0.0, cells=cells_of(name, d)))
    cloud.u_before = np.zeros_like(cloud.x)
    if "displacement" in claim(name):
        moved = transformed(cloud, np.eye(d), 0.0)
        moved.before = [cloud.x, cloud.x]
        tiny = 1e-6
        moved.x = cloud.x + tiny * asked.DT * compression(cloud)
        found = (asked.source(made(name), moved, tiny * compression(cloud))[full(cloud)]) / tiny
    else:
        found = asked.source(made(name), cloud, compression(cloud))[full(cloud)]
    expected = claim(name).get("scale", [1.0, 1.0])[d - 2]
    assert found * asked.DT / -3.0 == pytest.approx(expected, rel=1e-3)


@cache
def box():
    """A periodic square of 16 x 16 cells at rest on the lattice."""
    cloud = Cloud(2, disturbance=0.0, cells=16)
    cloud.period, cloud.before, cloud.u_before = 16 * cloud.l0, [cloud.x, cloud.x], np.zeros_like(cloud.x)
    return cloud


def left(name, laplacian):
    """Return the part of the source of a wave of 16 l0 that a projection leaves."""
    cloud, scheme = box(), made(name)
    u = np.zeros_like(cloud.x)
    u[:, 0] = np.sin(2 * np.pi * cloud.x[:, 0] / cloud.period)

    def of_velocity(u):
        if "displacement" not in claim(name):
            return asked.source(scheme, cloud, u)
        tiny = 1e-6
        return asked.source(scheme, cloud.moved(cloud.x + tiny * DT * u), tiny * u) / tiny

    before = of_velocity(u)
    matrix, _ = asked.system(laplacian, cloud)
    pressure = np.linalg.lstsq(-matrix, before, rcond=None)[0]  # of a fluid with density 1
    u = u - DT * asked.gradient(find("gradient", "original")(), cloud, pressure)
    return np.linalg.norm(of_velocity(u)) / np.linalg.norm(before)


@of("source")
def test_a_matching_laplacian_leaves_no_divergence(name):
    """Source, matrix and gradient of one scale: what is left is the error of the operators at this wave length."""
    partner = claim(name)["partner"]
    scheme = find("laplacian", partner["name"]).model_validate({k: v for k, v in partner.items() if k != "name"})
    assert left(name, scheme) < 0.12
    other = find("laplacian", "higher-order")(form="published")
    assert left(name, other) > 0.25, "a Laplacian of another scale does not fit"


# ---------------------------------------------------------------------------------------- free surface


@cache
def water(shape, d):
    return Water(shape, d)


def counted(flags, cloud):
    """Return how many rows of the surface were missed, and how many rows inside were taken for it."""
    return [int((~flags & cloud.surface).sum()), int((flags & cloud.inside).sum())]


@of("free_surface", with_claim="detection")
@dimensions
@pytest.mark.parametrize("shape", SHAPES)
def test_detection(name, d, shape):
    """Rows missed and false ones are as many as the equation itself gives, on surfaces that are known."""
    cloud = water(shape, d)
    assert cloud.surface.sum() >= 5
    assert cloud.inside.any()
    expected = claim(name)["detection"][f"{d}D"][shape]
    entry = values(name)[0]
    key = name.split(".")[1] if "ask" in entry else entry.get("function", name.split(".")[1])
    flags = loop("free_surface", key, claim(name).get("loop"))(cloud) > 0.5
    assert counted(flags, cloud) == expected
    assert counted(asked.free_surface(made(name), cloud) > 0.5, cloud) == expected


# --------------------------------------------------------------------------------------- documentation, ids


@pytest.mark.skipif(not (DOCS / "generate_schemes.py").exists(), reason="no docs folder beside the tests")
def test_pages_of_the_families_are_up_to_date():
    """What is measured may differ in the last digit shown; words may not."""
    generate = importlib.import_module("generate_schemes")
    assert generate.stale() == [], "run python docs/generate_schemes.py"


ROWS = {
    "gradient": "B1 B2 B3 B4 B5 B6 B7 B8 B9",
    "laplacian": "C1 C2 C3 C4 C5 C6",
    "source": "S1 S2 S3 S4 S5 S6",
    "shifting": "D1 D2 D3 D4",
    "free_surface": "E1 E2 E3 E4 E5 E6 E7",
    "step": "A5",
    "viscosity": "A6",
    "turbulence": "A6",
}
"""Rows of the review's table of systems, and the families that must have a model of each."""
PAIRS = [(family, row) for family, rows in ROWS.items() for row in rows.split()]


@pytest.mark.parametrize(("family", "row"), PAIRS)
def test_every_row_of_the_review_has_an_entry_with_reference_values(family, row):
    entries = {key: entry for key, entry in CLAIMS.get(family, {}).items() if row in entry["ids"]}
    assert entries, f"no entry [{family}.*] of tests/claims.toml has the id {row}"
    for key in entries:
        numbers = [entry[d] for entry in values(f"{family}.{key}") for d in ("2D", "3D")]
        assert numbers, f"{family}.{key}: no reference value"
        assert np.all(np.abs(numbers) > 1e-3), f"{family}.{key}: a reference value of nothing"
        assert loop(family, values(f"{family}.{key}")[0].get("function", key), claim(f"{family}.{key}").get("loop"))


def test_the_double_loops_import_nothing_of_spume():
    """Not even through each other: only NumPy, the standard library and the folder itself."""
    allowed = re.compile(r"^(from|import) (reference|numpy|math|copy|functools|importlib|itertools|sys)\b")
    for path in (Path(__file__).parent / "reference").glob("*.py"):
        lines = [s.strip() for s in path.read_text("utf-8").splitlines() if re.match(r"\s*(from|import) \S+", s)]
        assert [s for s in lines if not allowed.match(s)] == [], path.name


@pytest.mark.parametrize(("family", "row"), PAIRS)
def test_every_row_of_the_review_can_be_selected(family, row, listed):
    """``spume schemes`` lists a model of the right family for it, whose publications are in the bibliography."""
    chosen = [scheme for scheme in listed if row in scheme["ids"] and scheme["family"] == family]
    assert chosen, f"no {family} has the id {row}"
    assert [s["name"] for s in chosen if not s["sources"] or set(s["sources"]) - set(bibliography())] == []


def test_the_rows_of_the_review_are_34(listed):
    """Counted: what ``spume schemes --json`` lists of the families A5, A6, B, C, S, D and E is the whole list."""
    expected = {row for _, row in PAIRS}
    assert len(expected) == 34
    found = {row for scheme in listed for row in scheme["ids"]}
    assert {row for row in found if row[0] in "BCDES" or row in ("A5", "A6")} == expected


@pytest.fixture(scope="module")
def listed():
    """What ``spume schemes --json`` prints."""
    return json.loads(CliRunner().invoke(app, ["schemes", "--json"]).output)
