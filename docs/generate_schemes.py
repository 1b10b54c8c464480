"""Write docs/schemes/<family>.md from the docstrings, the claims and what is measured of the schemes.

    python docs/generate_schemes.py           write the pages
    python docs/generate_schemes.py --check   fail if a page is not what would be written

Needs an installed Spume and the tests of the clone, whose functions measure.
"""

import functools
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS), str(DOCS.parent / "tests")]

from keys import prose, publications, rows  # noqa: E402

import measured  # noqa: E402
from spume import kernels  # noqa: E402
from spume.case import schema  # noqa: E402
from spume.named import Scheme  # noqa: E402

UP = "../"

TITLES = {
    "air": "Enclosed air", "collision": "Collisions", "divergence": "Divergence", "free_surface": "Free surface",
    "gradient": "Gradient",
    "laplacian": "Laplacian", "number_density": "Number density", "shifting": "Particle shifting",
    "source": "Source of the pressure equation", "step": "Weakly compressible step", "turbulence": "Turbulence",
    "viscosity": "Viscosity", "wall_function": "Wall functions", "weight": "Weight functions",
}  # fmt: skip
MEASURED = ("gradient", "divergence", "laplacian")
WAVE = f"wave of {2 * 3.14159265 / measured.WAVE_NUMBER:.0f} l0"


def page(family: str) -> str:
    """Return the text of a family's page."""
    names = [name for name, scheme in measured.SCHEMES.items() if scheme.family == family]
    base = next(
        c for c in measured.SCHEMES[names[0]].__mro__ if c.family == family and not c.key and issubclass(c, Scheme)
    )
    books = publications()
    parts = [
        "<!-- Written by docs/generate_schemes.py: change docstrings or tests/claims.toml instead. -->",
        f"# {TITLES.get(family, family.capitalize())}",
        prose(base.__doc__ or ""),
        f"Key of case files: `{family}`. `tests/test_claims.py` holds every row of the table to `tests/claims.toml`, "
        "whose numbers come from the equations alone.",
        table(family, names),
    ]  # fmt: skip
    for name in names:
        scheme = measured.SCHEMES[name]
        parts += [f"## `{scheme.key}`", prose(scheme.__doc__ or "")]
        parameters = rows(scheme_table(scheme), UP)
        if parameters:
            parts.append(parameters)
        parts += [f"Source: {books[key]}" for key in scheme.publications()]
    return "\n\n".join(parts) + "\n"


def table(family: str, names: list[str]) -> str:
    """Return the claims of a family's schemes, with measured errors where a wave can be differentiated."""
    head = ["model", "systems", "conserves"]
    if family in MEASURED:
        head = ["model", "systems", "exact degree: any, lattice", "rate: lattice, disturbed"]
        head += [f"error of a {WAVE}, 2D: lattice, disturbed", "3D", "conserves"]
    if family == "laplacian":
        head += ["symmetric", "all coefficients positive", "scale 2D, 3D"]
    if family == "source":
        head += ["scale 2D, 3D"]
    if family == "free_surface":
        head += [f"missed, false: {shape}" for shape in ("flat", "corner", "film", "drop", "bubble")]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row(family, name)) + " |" for name in names]
    return "\n".join(lines)


def row(family: str, name: str) -> list[str]:
    """Return the cells of a scheme."""
    claim = measured.claim(name)
    conserves = ", ".join(sorted(claim.get("conserves", []))) or "–"
    cells = [f"`{name.split('.')[1]}`", " ".join(claim.get("ids", [])) or "–"]
    if family in MEASURED:
        inside = claim.get("order_inside", claim["order"])
        order = f"{claim['order']}" if inside == claim["order"] else f"{claim['order']} ({inside} off the surface)"
        cells += [f"{order}, {claim['order_on_lattice']}", "{}, {}".format(*claim["rates"])]
        for d in (2, 3):
            errors = [measured.wave_error(name, d, where)[1] for where in ("lattice", "disturbed")]
            cells.append(", ".join(f"{two_digits(100 * error)} %" for error in errors))
    cells.append(conserves)
    if family == "laplacian":
        cells += ["yes" if claim[key] else "no" for key in ("symmetric", "positive")]
    if family in ("laplacian", "source"):
        entries = measured.values(name) if family == "laplacian" else [claim]
        cells.append("; ".join("{:g}, {:g}".format(*entry.get("scale", [1, 1])) for entry in entries))
    if family == "free_surface":
        for shape in ("flat", "corner", "film", "drop", "bubble"):
            counts = [claim.get("detection", {}).get(d, {}).get(shape) for d in ("2D", "3D")]
            cells.append("; ".join("–" if c is None else f"{c[0]}, {c[1]}" for c in counts))
    return cells


@functools.cache
def definitions() -> dict[str, Any]:
    """Return the definitions of the JSON Schema of case files."""
    return dict(schema()["$defs"])


def scheme_table(scheme: type[Scheme]) -> dict[str, Any]:
    """Return the JSON Schema of the table of a scheme, without the key that selects it."""
    models = (m for m in definitions()[f"family-{scheme.family}"]["anyOf"] if "properties" in m)
    found = next(m for m in models if m["properties"][scheme.selector]["const"] == scheme.key)
    return {**found, "properties": {k: v for k, v in found["properties"].items() if k != scheme.selector}}


def two_digits(value: float) -> str:
    """Return a number with two significant digits and without an exponent."""
    return np.format_float_positional(value, 2, fractional=False, trim="-")


NUMBER = re.compile(r"\d[\d.]*(?= %)")


def same(found: str, expected: str) -> bool:
    """Whether two pages agree: words to the letter, measured errors to the rounding of their last digit."""
    if NUMBER.sub("#", found) != NUMBER.sub("#", expected):
        return False
    pairs = zip(NUMBER.findall(found), NUMBER.findall(expected), strict=True)
    return all(abs(float(a) - float(b)) <= 0.06 * abs(float(b)) + 1e-9 for a, b in pairs)


def stale() -> list[str]:
    """Return the names of the pages that are not what would be written."""
    pages = {DOCS / "schemes" / f"{family}.md": family for family in measured.FAMILIES}
    gone = sorted(path.name for path in (DOCS / "schemes").glob("*.md") if path not in pages)
    return gone + [
        path.name
        for path, family in pages.items()
        if not path.exists() or not same(path.read_text(encoding="utf-8"), page(family))
    ]


def main() -> None:
    """Write the pages, or check them."""
    kernels.initialize("cpu", 1, "double")
    if "--check" in sys.argv:
        found = stale()
        if found:
            sys.exit(f"out of date: {', '.join(found)}; run python docs/generate_schemes.py")
        return
    (DOCS / "schemes").mkdir(exist_ok=True)
    for family in measured.FAMILIES:
        (DOCS / "schemes" / f"{family}.md").write_text(page(family), encoding="utf-8")


if __name__ == "__main__":
    main()
