"""Make each scheme wrong on purpose and see that its claims notice: python tests/mutants.py [FAMILY] [--quick].

A mutant is a copy of the sources in which one formula of a scheme has a wrong factor, sign or radius. It is killed if
the tests of that scheme in tests/test_claims.py fail. Prints survivors and killed/total; exits with 1 if one survives.

Options:
    --quick        one factor, one sign and one radius per scheme
    --jobs N       processes (default 2)
    --limit S      seconds per mutant (default 240); a mutant that runs longer counts as killed by its limit
    --state FILE   where results are kept, so that a run can be resumed (default: in the temporary folder)
"""

import argparse
import ast
import concurrent.futures
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SCHEMES = ROOT / "src" / "spume" / "schemes"


def schemes_of(tree):
    """Return the names under which the classes of a module are registered."""
    classes = (node for node in tree.body if isinstance(node, ast.ClassDef))
    return [keyword.value.value for node in classes for keyword in node.keywords if keyword.arg == "name"]


def formulas(tree):
    """Yield the last return of each function of the kernel language: those without annotations of their arguments."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and not any(a.annotation for a in node.args.args) and node.args.args:
            if node.args.args[0].arg == "self" or node.name.startswith("__"):
                continue
            returns = [n for n in ast.walk(node) if isinstance(n, ast.Return) and n.value is not None]
            if returns and not (isinstance(returns[-1].value, ast.Name) and node.name == "decorate"):
                yield node.name, returns[-1].value


def mutations(text):
    """Yield (what, mutated text) for a module's text."""
    tree = ast.parse(text)
    for name, value in formulas(tree):
        compare = next((n for n in ast.walk(value) if isinstance(n, ast.Compare)), None)
        if compare is not None:
            limit = compare.comparators[0]
            old = ast.get_source_segment(text, compare)
            right = ast.get_source_segment(text, limit)
            sign = {ast.Lt: ">=", ast.Gt: "<=", ast.LtE: ">", ast.GtE: "<", ast.Eq: "!="}.get(type(compare.ops[0]))
            left = ast.get_source_segment(text, compare.left)
            if sign:
                yield f"sign of {name}", swap(text, compare, f"{left} {sign} {right}")
            if not isinstance(compare.ops[0], ast.Eq):
                yield f"factor of {name}", swap(text, compare, old[: -len(right)] + f"(0.8 * {right})")
        else:
            expression = ast.get_source_segment(text, value)
            yield f"factor of {name}", swap(text, value, f"({expression}) * 1.1")
            yield f"sign of {name}", swap(text, value, f"({expression}) * (-1.0)")
    for owner in ("self", "operator", "model", "number_density"):
        word = f"{owner}.radius(lattice)"
        if word in text:
            yield f"radius {word}", text.replace(word, f"0.8 * {word}")


def swap(text, node, new):
    """Return the text with a node's source replaced."""
    lines = text.splitlines(keepends=True)
    first = sum(len(line.encode()) for line in lines[: node.lineno - 1]) + node.col_offset
    last = sum(len(line.encode()) for line in lines[: node.end_lineno - 1]) + node.end_col_offset
    raw = text.encode()
    return (raw[:first] + new.encode() + raw[last:]).decode()


def mutants(family, quick):
    """Yield (path, names of the schemes that must notice, what, text)."""
    for path in sorted(SCHEMES.glob(f"{family or '*'}/*.py")):
        text = path.read_text(encoding="utf-8")
        names = [f"{path.parent.name}.{name}" for name in schemes_of(ast.parse(text))]
        if not names:
            continue
        seen = set()
        for what, mutated in mutations(text):
            kind = what.split()[0]
            if not (quick and kind in seen):
                seen.add(kind)
                yield path, names, what, mutated


def judged(path, names, text, limit):
    """Return "killed", "killed by the limit" or "survived"."""
    with tempfile.TemporaryDirectory(prefix="spume-mutant-") as folder:
        copy = Path(folder)
        for part in ("src", "tests", "pyproject.toml"):
            source = ROOT / part
            ignore = shutil.ignore_patterns("__pycache__", ".*")
            shutil.copytree(source, copy / part, ignore=ignore) if source.is_dir() else shutil.copy(source, copy / part)
        (copy / path.relative_to(ROOT)).write_text(text, encoding="utf-8")
        environment = os.environ | {"PYTHONPATH": str(copy / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "tests/test_claims.py", "-k"]
        left = limit
        # The reference values first: they find nearly every mutant and need the fewest kernels.
        every = " or ".join(f"{name}-" for name in names), " or ".join(names)
        for words in (f"the_scheme_gives and 2D and ({every[0]})", f"({every[1]}) and not double_loop"):
            try:
                answer = subprocess.run([*command, words], cwd=copy, env=environment, capture_output=True, timeout=left)
            except subprocess.TimeoutExpired:
                return "killed by the limit"
            if answer.returncode == 1:
                return "killed"
            if answer.returncode not in (0, 5):  # 5: no test of that kind
                return "killed"
        return "survived"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("family", nargs="?")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--limit", type=float, default=240.0)
    parser.add_argument("--state", type=Path, default=Path(tempfile.gettempdir()) / "spume-mutants.jsonl")
    options = parser.parse_args()
    tests = b"".join(p.read_bytes() for p in sorted((ROOT / "tests").rglob("*")) if p.suffix in (".py", ".toml"))
    known = {}
    if options.state.exists():
        known = {e["key"]: e["result"] for e in map(json.loads, options.state.read_text().splitlines())}
    killed = total = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        waiting = {}
        for path, names, what, text in mutants(options.family, options.quick):
            key = hashlib.sha256(text.encode() + tests).hexdigest()
            if key in known:
                total, killed = total + 1, killed + known[key].startswith("killed")
                if known[key] == "survived":
                    print(f"survived: {path.relative_to(SCHEMES)}: {what}")
            else:
                waiting[pool.submit(judged, path, names, text, options.limit)] = path, what, key
        for future in concurrent.futures.as_completed(waiting):
            path, what, key = waiting[future]
            result = future.result()
            with options.state.open("a") as file:
                file.write(json.dumps({"key": key, "result": result}) + "\n")
            total, killed = total + 1, killed + result.startswith("killed")
            print(f"{result}: {path.relative_to(SCHEMES)}: {what}", flush=True)
    print(f"{killed}/{total} killed")
    return int(killed < total)


if __name__ == "__main__":
    sys.exit(main())
