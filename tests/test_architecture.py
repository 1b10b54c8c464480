"""The rules of ARCHITECTURE.md that can be read off the source: who imports whom, how long a file is."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import spume

PACKAGE = Path(spume.__file__).parent
REFERENCES = PACKAGE / "references.bib"

CORE = {"spume.particles", "spume.pairs", "spume.marks", "spume.lattice", "spume.named", "spume.kernels"}
# What the modules of a folder may import of Spume, beyond their own folder.
ALLOWED = {
    # An implicit model states a linear system and is handed its solver.
    "schemes": CORE | {"spume.pressure.matrix", "spume.pressure.base", "spume.voids"},
    # A wall model says which rows have an equation, and sums like any other model.
    "wall_models": CORE | {"spume.geometry", "spume.pressure.matrix", "spume.schemes.operator"},
    "bodies": CORE | {"spume.geometry", "spume.motion"},
}
MAY_IMPORT_SIMULATION = {"spume", "spume.build", "spume.run", "spume.bench", "spume.cli"}
KERNEL_LANGUAGE = {"quadrants", "taichi", "warp", "numba"}
# Not part of the base installation, so a module that imports one at its top breaks it.
EXTRAS = {
    "pyvista", "vtk", "vtkmodules", "trame", "imageio_ffmpeg", "plotly", "mpi4py", "petsc4py", "dask",
    "pandas", "meshio", "IPython",
}  # fmt: skip
# Part of it, but slow to import: the command line must answer at once.
SLOW = {"matplotlib", "trimesh", "rtree", "manifold3d", "scipy", "h5py", "quadrants"}
DUMPING_GROUNDS = {"utils", "util", "helpers", "common", "misc", "tools"}
LONGEST_FILE = 600


def modules(package: Path) -> Iterator[tuple[str, Path]]:
    """Yield dotted name and file of every module of a package."""
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package.parent).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def imports(name: str, path: Path, *, top: bool = False) -> Iterator[str]:
    """Yield the dotted name of everything a module imports; with ``top``, only when it is itself imported."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    for node in _walk(tree, top):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            base = [*base, *(node.module or "").split(".")] if node.module else base
            # "from spume import kernels" imports spume.kernels: judge by the longer name.
            yield from (".".join([*base, alias.name]) for alias in node.names)


def _walk(tree: ast.AST, top: bool) -> Iterator[ast.AST]:
    for node in ast.iter_child_nodes(tree):
        if top and isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if top and isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        yield node
        yield from _walk(node, top)


def inside(imported: str, allowed: set[str]) -> bool:
    """Whether an imported name is one of the allowed modules or something in it."""
    return any(imported == module or imported.startswith(module + ".") for module in allowed)


def own(name: str, package: Path) -> set[str]:
    """Return what a module may import of its own folder.

    A scheme knows its family, the types of the others (``schemes.<family>.base``), the weight functions
    and what all schemes share (a file directly in ``schemes``); other schemes are handed to it.
    """
    parts = name.split(".")
    if parts[1] != "schemes" or len(parts) < 4:
        return {".".join(parts[:2])}
    schemes = package / "schemes"
    shared = {f"{package.name}.schemes.{path.stem}" for path in schemes.glob("*.py")}
    types = {f"{package.name}.schemes.{path.parent.name}.base" for path in schemes.glob("*/base.py")}
    return {".".join(parts[:3]), f"{package.name}.schemes.weight"} | shared | types


def only_a_default(class_name: str, path: Path) -> bool:
    """Whether a class serves only as the default of parameters: ``laplacian: Laplacian = Original()``."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    parameters = [
        statement.value
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
        for statement in node.body
        if isinstance(statement, ast.AnnAssign) and statement.value is not None
    ]

    def uses(node: ast.AST) -> int:
        return sum(isinstance(n, ast.Name) and n.id == class_name for n in ast.walk(node))

    return uses(tree) > 0 and uses(tree) == sum(uses(value) for value in parameters)


def broken(package: Path) -> list[str]:
    """Return one sentence for every rule that a package breaks."""
    root = package.name
    found = []
    for name, path in modules(package):
        parts = name.split(".")
        folder = parts[1] if len(parts) > 1 else ""
        for imported in imports(name, path):
            if imported.split(".")[0] in KERNEL_LANGUAGE and name != f"{root}.kernels":
                found.append(f"{name} imports {imported}: only {root}.kernels may import a kernel language")
            if imported.split(".")[0] != root:
                continue
            if inside(imported, {f"{root}.simulation"}) and name not in MAY_IMPORT_SIMULATION:
                found.append(f"{name} imports {imported}: nobody does but {sorted(MAY_IMPORT_SIMULATION)}")
            if folder not in ALLOWED or inside(imported, ALLOWED[folder] | own(name, package)):
                continue
            if inside(imported, {f"{root}.schemes", f"{root}.pressure"}) and only_a_default(
                imported.split(".")[-1], path
            ):
                continue
            found.append(f"{name} imports {imported}: {folder} may import {sorted(ALLOWED[folder])}")
        found += [
            f"{name} imports {imported} at its top: an extra, import it where it is used"
            for imported in imports(name, path, top=True)
            if imported.split(".")[0] in EXTRAS
        ]
        if path.stem in DUMPING_GROUNDS:
            found.append(f"{name}: name a module after what it holds")
        lines = len(path.read_text(encoding="utf-8").splitlines())
        if lines > LONGEST_FILE:
            found.append(f"{name}: {lines} lines, at most {LONGEST_FILE}")
    return found


def test_rules_hold():
    assert broken(PACKAGE) == []


@pytest.mark.parametrize(
    ("module", "text", "complaint"),
    [
        ("schemes/gradient/corrected.py", "from spume.simulation import Simulation", "nobody does"),
        (
            "schemes/gradient/corrected.py",
            "from spume.schemes.source.mixed import Mixed",
            "schemes may import",
        ),
        (
            "schemes/viscosity/explicit.py",
            "from spume.schemes.laplacian.plain import Plain\nclass E:\n    l: L = Plain()\nPlain()",
            "schemes may import",
        ),
        ("schemes/gradient/corrected.py", "from ..source.mixed import Mixed", "schemes may import"),
        ("schemes/gradient/corrected.py", "from spume import geometry", "schemes may import"),
        ("bodies/wall.py", "def f():\n    from spume.case import Case", "bodies may import"),
        ("wall_models/rows.py", "import spume.outputs.log", "wall_models may import"),
        ("outputs/log.py", "from ..simulation import Simulation", "nobody does"),
        ("pairs.py", "import quadrants as qd", "kernel language"),
        ("outputs/pictures.py", "import pyvista", "an extra"),
        ("utils.py", "", "name a module"),
        ("pairs.py", "x = 1\n" * 601, "601 lines"),
    ],
)
def test_each_rule_can_fail(tmp_path, module, text, complaint):
    path = tmp_path / "spume" / module
    path.parent.mkdir(parents=True)
    path.write_text(text)
    assert any(complaint in sentence for sentence in broken(tmp_path / "spume"))


@pytest.mark.parametrize(
    ("module", "text"),
    [
        ("schemes/gradient/corrected.py", "from spume.schemes.gradient.base import Gradient"),
        (
            "schemes/viscosity/explicit.py",
            "from spume.schemes.laplacian.original import Original\nclass E:\n    l: L = Original()",
        ),
        ("schemes/gradient/corrected.py", "from spume.pairs import pair_sum\nfrom spume import kernels"),
        ("bodies/wall.py", "from spume.geometry.shapes import Box\nfrom .base import Body"),
        ("kernels.py", "import quadrants"),
        ("cli.py", "from spume.simulation import Simulation"),
        ("outputs/pictures.py", "def show():\n    import pyvista"),
    ],
)
def test_what_is_allowed_passes(tmp_path, module, text):
    path = tmp_path / "spume" / module
    path.parent.mkdir(parents=True)
    path.write_text(text)
    assert broken(tmp_path / "spume") == []


def references(package: Path) -> Iterator[tuple[str, str]]:
    """Yield class and key of every ``reference`` that is a constant of a class (not a parameter of one)."""
    for name, path in modules(package):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ClassDef):
                continue
            for statement in node.body:
                if isinstance(statement, ast.AnnAssign) and "ClassVar" in ast.dump(statement.annotation):
                    target, value = statement.target, statement.value
                elif isinstance(statement, ast.Assign):
                    target, value = statement.targets[0], statement.value
                else:
                    continue
                if isinstance(target, ast.Name) and target.id == "reference" and value is not None:
                    for constant in ast.walk(value):
                        if isinstance(constant, ast.Constant) and isinstance(constant.value, str):
                            yield f"{name}.{node.name}", constant.value


def test_references_are_in_the_bibliography():
    known = re.findall(r"^@\w+\{([^,\s]+),", REFERENCES.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(known) == len(set(known)), "a key stands twice in references.bib"
    used = [(where, key) for where, key in references(PACKAGE) if key]
    assert used, "no scheme names its publication"
    assert [f"{where}: {key}" for where, key in used if key not in known] == []


def test_a_reference_is_found_however_it_is_written(tmp_path):
    (tmp_path / "spume").mkdir()
    (tmp_path / "spume" / "a.py").write_text(
        "class A:\n    reference: ClassVar[str] = 'a2001'\nclass B:\n    reference = 'b2002'\n"
        "class C:\n    reference: str = 'not a constant'\n"
    )
    assert [key for _, key in references(tmp_path / "spume")] == ["a2001", "b2002"]


@pytest.mark.parametrize("module", ["spume", "spume.cli"])
def test_import_is_light(module):
    code = f"import sys, {module}; print(*sorted({{m.split('.')[0] for m in sys.modules}} & {SLOW | EXTRAS}))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.split() == []
