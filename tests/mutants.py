"""Make each scheme wrong on purpose and see that its claims notice: python tests/mutants.py [FAMILY] [--quick].

A mutant is a copy of the sources in which one formula of a scheme, or one that schemes share, has a wrong factor, sign
or radius. It is killed if a test of that scheme in tests/test_claims.py fails, or one of its file of tests in
tests/schemes; one whose tests do not end, or end otherwise than with failures, is not. Mutants of schemes that do not
depend on each other share a run; one that the reference values do not find is then run alone. Prints killed/total;
exits with 1 if one is not killed.

Results are kept, so that a run can be resumed: a mutant that was killed is not made again unless its file or the
entries of its schemes in tests/claims.toml changed; one that was not is always judged again.

Options:
    --quick        one factor, one sign and one radius per scheme
    --jobs N       processes (default 1)
    --limit S      seconds for the tests of one mutant (default 1200)
    --state FILE   where results are kept (default: in the temporary folder)
    --table FILE   write what was found as a page, one line a family
"""

import argparse
import ast
import concurrent.futures
import functools
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import tomllib
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / "src" / "spume"
SCHEMES = SOURCES / "schemes"


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
        chosen = "select(" in ast.get_source_segment(text, value)  # the condition only chooses
        compare = None if chosen else next((n for n in ast.walk(value) if isinstance(n, ast.Compare)), None)
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
        elif isinstance(value, ast.Constant):
            yield f"value of {name}", swap(text, value, f"{value.value} + 1.0")
        else:
            expression = ast.get_source_segment(text, value)
            factor = 2 if name in WHOLE or "i32" in expression else 1.1  # a whole number would lose a tenth again
            yield f"factor of {name}", swap(text, value, f"({expression}) * {factor}")
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


def files(family):
    """Return {file: names of the schemes that must notice}: its own, or all that use it if it has none."""
    own = {path: schemes_of(ast.parse(path.read_text(encoding="utf-8"))) for path in sorted(SCHEMES.rglob("*.py"))}
    names = {path: [f"{path.parent.name}.{name}" for name in found] for path, found in own.items() if found}
    names[SOURCES / "steps" / "weakly_compressible.py"] = ["step.weakly-compressible"]
    for path in own:
        if path not in names:
            names[path] = [name for user in [*names] if path in reach(user) for name in names[user]]
    return {path: found for path, found in names.items() if found and family in (None, family_of(path))}


def family_of(path):
    """Return the word that a file's results are listed under."""
    folder = path.parent.relative_to(SOURCES).parts
    return "shared" if folder == ("schemes",) else folder[-1].removesuffix("s") if folder[0] == "steps" else folder[-1]


def mutants(family, quick):
    """Yield (path, names of the schemes that must notice, what, text)."""
    for path, names in files(family).items():
        seen = set()
        for what, mutated in mutations(path.read_text(encoding="utf-8")):
            kind = what.split()[0]
            equivalent = (shown(path), what) in EQUIVALENT
            if not equivalent and not (quick and kind in seen):
                seen.add(kind)
                yield path, names, what, mutated


def shown(path):
    """Return how a file is called in results."""
    return str(path.relative_to(SCHEMES if path.is_relative_to(SCHEMES) else SOURCES))


WHOLE = ("class_of_row", "state_of")
"""Formulas whose value is a whole number."""

EQUIVALENT = {
    ("free_surface/asymmetry.py", "sign of offset"): "only the length of the sum counts",
    ("free_surface/vector.py", "sign of _scaled"): "only the length of the sum counts",
    ("free_surface/vector.py", "sign of direction"): "only the length of the sum counts",
    ("turbulence/smagorinsky.py", "sign of _scaled"): "the strain is squared",
    ("turbulence/smagorinsky.py", "sign of dyad"): "the strain is squared",
    ("turbulence/smagorinsky.py", "sign of corrected"): "the strain is squared",
    ("shifting/classes.py", "factor of _exists"): "what is compared with 1/2 is 0 or 1",
    ("shifting/classes.py", "factor of on_surface"): "what is compared with 1/2 is 0 or 1",
    ("shifting/classes.py", "factor of off_surface"): "what is compared with 1/2 is 0 or 1",
    ("normal.py", "factor of softened"): "cancels in B^-1 b",
    ("normal.py", "factor of neighbour_mean"): "the normal is scaled to length 1",
    ("normal.py", "factor of neighbour_moment"): "the normal is scaled to length 1",
    ("normal.py", "factor of _inverse_or_nothing"): "the normal is scaled to length 1",
    ("viscosity/implicit.py", "value of no_guess"): "only the first guess of an iteration that converges",
}
"""Mutants that compute the same."""

ALONE = ("weight/inverse.py", "number_density/base.py", "divergence/original.py")
"""Files that the tests of other families use."""


def reach(path):
    """Return the files of schemes that a file imports, directly or through others."""
    found, waiting = set(), [path]
    while waiting:
        text = waiting.pop().read_text(encoding="utf-8")
        for words in re.findall(r"^from spume\.schemes\.([\w.]+) import", text, re.MULTILINE):
            other = SCHEMES / f"{words.replace('.', '/')}.py"
            if other.exists() and other not in found:
                found.add(other)
                waiting.append(other)
    return found


def batches(chosen):
    """Group mutants so that no scheme of a group depends on the file of another: then one run judges them all."""
    groups = []
    for mutant in chosen:
        path, needed = mutant[0], reach(mutant[0])
        for group in groups:
            others = [other[0] for other in group]
            alone = any(shown(p) in ALONE for p in (path, *others))
            if not alone and path not in others and not any(p in needed or path in reach(p) for p in others):
                group.append(mutant)
                break
        else:
            groups.append([mutant])
    return groups


def own_tests(path):
    """Return the files of tests that are about a file's formulas, beside the claims."""
    names = (path.parent.name, path.stem)
    found = [ROOT / "tests" / folder / f"test_{name}.py" for folder in ("schemes", "steps") for name in names]
    return [str(file.relative_to(ROOT)) for file in found if file.exists()][:1]


def failed(group, limit, *arguments):
    """Return the names of the tests that fail with the mutants of a group, None if there was no such answer."""
    with tempfile.TemporaryDirectory(prefix="spume-mutants-") as folder:
        copy = Path(folder)
        for part in ("src", "tests", "pyproject.toml"):
            source = ROOT / part
            ignore = shutil.ignore_patterns("__pycache__", ".*")
            shutil.copytree(source, copy / part, ignore=ignore) if source.is_dir() else shutil.copy(source, copy / part)
        for path, _, _, text in group:
            (copy / path.relative_to(ROOT)).write_text(text, encoding="utf-8")
        environment = os.environ | {"PYTHONPATH": str(copy / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "pytest", "-q", "-rfE", "--tb=no", "-n", "0", "-p", "no:cacheprovider"]
        command += arguments
        try:
            answer = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, timeout=limit)
        except subprocess.TimeoutExpired:
            return None
    if answer.returncode not in (0, 1, 5):  # 5: no test of that kind
        return None
    return re.findall(r"^(?:FAILED|ERROR) \S+?::(.*)$", answer.stdout, re.MULTILINE)


def noticed(names, tests):
    """Whether a test of one of the schemes is among those that failed."""
    return any(re.search(rf"{re.escape(name)}(?![\w-]*[a-z])", test) for name in names for test in tests)


def judge(group, limit):
    """Yield (mutant, "killed", "survived" or "no answer")."""
    # The reference values first: they find nearly every mutant and need the fewest kernels.
    names = " or ".join(f"{name}-" for mutant in group for name in mutant[1])
    words = f"the_scheme_gives and 2D and ({names})"
    tests = failed(group, limit * len(group), "tests/test_claims.py", "-k", words)
    for mutant in group:
        killed = tests is not None and noticed(mutant[1], tests)
        if not killed:
            words = f"({' or '.join(mutant[1])}) and not double_loop"
            every = failed([mutant], limit, "-x", *own_tests(mutant[0])) if own_tests(mutant[0]) else []
            if not every:
                every = failed([mutant], limit, "-x", "tests/test_claims.py", "-k", words)
            result = "no answer" if every is None else "killed" if every else "survived"
        yield mutant, "killed" if killed else result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("family", nargs="?")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--limit", type=float, default=1200.0)
    parser.add_argument("--state", type=Path, default=Path(tempfile.gettempdir()) / "spume-mutants.jsonl")
    parser.add_argument("--table", type=Path)
    options = parser.parse_args()
    known = {}
    if options.state.exists():
        known = {e["key"]: e["result"] for e in map(json.loads, options.state.read_text().splitlines())}
    found = {}
    waiting = []
    for mutant in mutants(options.family, options.quick):
        if known.get(key(mutant)) == "killed":
            report(mutant, "killed", found)
        else:
            waiting.append(mutant)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:

        def work(group):
            for mutant, result in judge(group, options.limit):
                with lock, options.state.open("a") as file:
                    file.write(json.dumps({"key": key(mutant), "result": result}) + "\n")
                    report(mutant, result, found)

        lock = threading.Lock()
        list(pool.map(work, batches(waiting)))
    killed = sum(result == "killed" for _, _, result in found.values())
    print(f"{killed}/{len(found)} killed")
    if options.table:
        options.table.write_text(page(found, options.quick), encoding="utf-8")
    return int(killed < len(found))


def key(mutant):
    """Return what a result is kept under: file, text, and what its schemes are compared with."""
    claims = compared_with()
    entries = [claims.get(family, {}).get(name) for family, _, name in (n.partition(".") for n in mutant[1])]
    return hashlib.sha256(f"{shown(mutant[0])}{mutant[3]}{entries}".encode()).hexdigest()


@functools.cache
def compared_with():
    """Return tests/claims.toml, read."""
    return tomllib.loads((ROOT / "tests" / "claims.toml").read_text(encoding="utf-8"))


def report(mutant, result, found):
    """Note a result, and print it."""
    found[key(mutant)] = mutant[0], mutant[2], result
    print(f"{result}: {shown(mutant[0])}: {mutant[2]}", flush=True)


def page(found, quick):
    """Return what was found as a page: one line a family, then those that were not killed, and what is equivalent."""
    every, killed = Counter(), Counter()
    for path, _, result in found.values():
        every[family_of(path)] += 1
        killed[family_of(path)] += result == "killed"
    lines = [
        "# Schemes made wrong on purpose",
        "",
        f"Written by `python tests/mutants.py{' --quick' * quick} --table tests/mutants.md` on "
        f"{datetime.now(UTC):%Y-%m-%d}: {killed.total()} of {every.total()} killed.",
        "A mutant has a wrong factor, sign or radius in one formula; it is killed if the claims of its scheme fail.",
        "",
        "| family | mutants | killed |",
        "|---|---|---|",
        *(f"| {family} | {every[family]} | {killed[family]} |" for family in sorted(every)),
        "",
    ]
    if left := [f"- `{shown(path)}`: {what}: {r}" for path, what, r in found.values() if r != "killed"]:
        lines += ["Not killed:", "", *left, ""]
    lines += ["Left out, because they compute the same:", ""]
    lines += [f"- `{path}`: {what}: {reason}" for (path, what), reason in EQUIVALENT.items()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
