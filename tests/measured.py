"""What tests and documentation measure of a scheme: the polynomials that are exact, the error of a wave."""

import tomllib
from pathlib import Path

import numpy as np

import asked
from reference.cloud import cloud_for
from spume import named

CLAIMS = tomllib.loads((Path(__file__).parent / "claims.toml").read_text(encoding="utf-8"))
named.load_all()
SCHEMES = {
    f"{scheme.family}.{scheme.key}": scheme
    for scheme in named.schemes()
    if scheme.__module__.startswith(("spume.schemes.", "spume.steps.weakly_compressible"))
}
"""Every scheme of the families of models, and the one step that is a row of the review by itself."""
FAMILIES = tuple(dict.fromkeys(scheme.family for scheme in SCHEMES.values()))


def claim(name):
    """Return the entry of a scheme in claims.toml; empty where there is none."""
    family, key = name.split(".")
    return CLAIMS.get(family, {}).get(key, {})


def values(name):
    """Return the entries ``value`` of a claim: parameters, 2D, 3D."""
    entries = claim(name).get("value", [])
    return entries if isinstance(entries, list) else [entries]


def made(name, entry=None):
    """Return the scheme with the parameters of an entry (default: those that the claims hold for)."""
    entry = entry if entry is not None else (values(name) or [{}])[0]
    return SCHEMES[name].model_validate(entry.get("parameters", {}))


def cloud_of(name, d, **changes):
    """Return the cloud that a claim is about; its radius is the scheme's."""
    own = {key: claim(name)[key] for key in ("re", "disturbance", "weight") if key in claim(name)}
    return cloud_for(d, **(own | {"shore": name.startswith("shifting")} | changes))


def cells_of(name, d):
    """Return how many cells leave rows with every neighbour, also with a large radius."""
    return int(2 * claim(name).get("re", 2.1)) + {2: 4, 3: 2}[d]


def polynomial(cloud, degree):
    """Return values, gradient and Laplacian of a polynomial with every term of that degree and below."""
    direction = np.array([0.9, -0.7, 0.4])[: cloud.d] / cloud.l0
    other = np.array([-0.3, 0.8, 0.6])[: cloud.d] / cloud.l0
    s, t = cloud.x @ direction, cloud.x @ other
    phi, slope, curve = np.zeros(len(cloud)), np.zeros((len(cloud), cloud.d)), np.zeros(len(cloud))
    for k in range(degree + 1):
        for z, v, c in ((s, direction, 1.0), (t, other, 0.6)):
            phi += c * z**k
            slope += c * (k * z ** max(k - 1, 0))[:, None] * v
            curve += c * k * (k - 1) * z ** max(k - 2, 0) * (v @ v)
    return phi, slope, curve


WAVE_NUMBER = 0.4
"""|k| l0 of the wave that is differentiated: 16 spacings are one wavelength."""


def waves(cloud, l0=0.1):
    """Return values, gradient and Laplacian of a wave whose length does not depend on the spacing."""
    k = np.array([0.31, 0.23, -0.17])[: cloud.d]
    k *= WAVE_NUMBER / np.linalg.norm(k) / l0
    s = cloud.x @ k + 0.7
    return np.sin(s), np.cos(s)[:, None] * k, -np.sin(s) * (k @ k)


def error(name, cloud, field, rows):
    """Return the largest error over some rows, and the largest value of what is approximated."""
    family = name.split(".")[0]
    phi, slope, curve = field
    scheme = made(name)
    if family == "gradient":
        found, exact = asked.gradient(scheme, cloud, phi), slope
    elif family == "divergence":
        u = np.stack([phi * c for c in (1.0, -0.4, 0.7)[: cloud.d]], axis=1)
        exact = slope @ np.array([1.0, -0.4, 0.7][: cloud.d])
        found = asked.divergence(scheme, cloud, u)
    else:
        found, exact = asked.laplacian(scheme, cloud, phi, slope=slope), curve
    return np.abs(found - exact)[rows].max(), np.abs(exact).max()


def full(cloud):
    """Return the rows of an undisturbed cloud that miss no neighbour."""
    return np.abs(cloud.x).max(axis=1) < (cloud.cells / 2) * cloud.l0 - cloud.re


def exact_degree(name, cloud, rows):
    """Return the highest degree up to which every polynomial is exact; -1 if not even constants are."""
    for degree in range(5):
        field = polynomial(cloud, degree)
        worst, _ = error(name, cloud, field, rows)
        if worst > 1e-9 * np.abs(field[0]).max() / cloud.l0 ** (2 if name.startswith("laplacian") else 1):
            return degree - 1
    return degree


def wave_error(name, d, arrangement, l0=0.1):
    """Return the largest error of a wave, and that relative to the largest value, on the lattice or a disturbed one."""
    cells = cells_of(name, d) if arrangement == "lattice" else None
    cloud = cloud_of(name, d, disturbance=0.2 * (arrangement == "disturbed"), l0=l0, cells=cells)
    worst, largest = error(name, cloud, waves(cloud), full(cloud) if arrangement == "lattice" else cloud.inner)
    return worst, worst / largest
