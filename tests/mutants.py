"""Make each scheme wrong on purpose and see that its claims notice: python tests/mutants.py [FAMILY] [--quick].

A mutant is the source of one file in which one formula of a scheme, or one that schemes share, has a wrong factor, sign
or radius. First the schemes that it is part of are made anew from it, in this process, and held to the reference values
in tests/claims.toml; the same is done with the source as it is, which must pass. A mutant that gives these values is
written into a copy of the tree whose tests are run: those of its family in tests/schemes, then those of its schemes in
tests/test_claims.py. It is killed if one of them fails, and is not if they end otherwise or not at all. Prints
killed/total; exits with 1 if one is not killed.

Results are kept, so that a run can be resumed: a mutant that was killed is not made again unless its file or the
entries of its schemes in tests/claims.toml changed; one that was not is always judged again.

Options:
    --quick        one factor, one sign and one radius per scheme
    --here         leave out the runs of whole tests, which take minutes for each mutant that gives reference values
    --limit S      seconds for the tests of one mutant (default 1200)
    --state FILE   where results are kept (default: in the temporary folder)
    --table FILE   write what was found as a page, one line a family
"""

import argparse
import ast
import contextlib
import functools
import hashlib
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import types
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

import measured
import test_claims
from spume import kernels, named

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
            if not isinstance(compare.ops[0], ast.Eq) and right != "0.0":
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
    for path in own:
        if path not in names:
            names[path] = [name for user in [*names] if path in reach(user) for name in names[user]]
    names[SOURCES / "steps" / "weakly_compressible.py"] = ["step.weakly-compressible"]
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


WHOLE = ("by_both_stages", "class_of_row", "state_of")
"""Formulas whose value is a whole number."""

EQUIVALENT = {
    ("free_surface/asymmetry.py", "sign of offset"): "only the length of the sum counts",
    ("free_surface/hybrid.py", "factor of candidate"): "only whether it is positive counts",
    ("free_surface/umbrella.py", "factor of _found"): "what is compared with 1/2 is 0 or 1",
    ("free_surface/umbrella.py", "factor of in_cone"): "what is compared with 1/2 is 0 or 1",
    ("free_surface/vector.py", "sign of _scaled"): "only the length of the sum counts",
    ("free_surface/vector.py", "sign of direction"): "only the length of the sum counts",
    ("turbulence/smagorinsky.py", "sign of dyad"): "the strain is squared",
    ("shifting/classes.py", "factor of _exists"): "what is compared with 1/2 is 0 or 1",
    ("shifting/classes.py", "factor of on_surface"): "what is compared with 1/2 is 0 or 1",
    ("shifting/classes.py", "factor of off_surface"): "what is compared with 1/2 is 0 or 1",
    ("normal.py", "factor of softened"): "cancels in B^-1 b",
    ("normal.py", "factor of neighbour_mean"): "the normal is scaled to length 1",
    ("normal.py", "factor of neighbour_moment"): "the normal is scaled to length 1",
    ("normal.py", "factor of _inverse_or_nothing"): "the normal is scaled to length 1",
    ("viscosity/implicit.py", "value of no_guess"): "only the first guess of an iteration that converges",
    (
        "viscosity/implicit.py",
        "value of _nothing",
    ): "no missing neighbours, and the right side is written later",
    ("viscosity/implicit.py", "value of _nothing_yet"): "the right side is written later",
    ("viscosity/implicit.py", "value of _no_flux"): "the right side is written later",
}
"""Mutants that compute the same."""


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


def own_tests(path):
    """Return the files of tests that are about a file's formulas, beside the claims."""
    names = (path.parent.name, path.stem)
    found = [ROOT / "tests" / folder / f"test_{name}.py" for folder in ("schemes", "steps") for name in names]
    return [str(file.relative_to(ROOT)) for file in found if file.exists()][:1]


def failed(mutant, limit, *arguments):
    """Return the names of the tests that fail with a mutant, None if there was no such answer."""
    with tempfile.TemporaryDirectory(prefix="spume-mutants-") as folder:
        copy = Path(folder)
        for part in ("src", "tests", "pyproject.toml"):
            source = ROOT / part
            ignore = shutil.ignore_patterns("__pycache__", ".*")
            shutil.copytree(source, copy / part, ignore=ignore) if source.is_dir() else shutil.copy(source, copy / part)
        (copy / mutant[0].relative_to(ROOT)).write_text(mutant[3], encoding="utf-8")
        environment = os.environ | {"PYTHONPATH": str(copy / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-rfE", "--tb=no", "-n", "0", "-p", "no:cacheprovider"]
        command += arguments
        try:
            answer = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, timeout=limit)
        except subprocess.TimeoutExpired:
            return None
    if answer.returncode not in (0, 1, 5):  # 5: no test of that kind
        return None
    return re.findall(r"^(?:FAILED|ERROR) \S+?::(.*)$", answer.stdout, re.MULTILINE)


def module_name(path):
    """Return the name under which a file is imported."""
    return ".".join(path.relative_to(SOURCES.parent).with_suffix("").parts)


@contextlib.contextmanager
def made_anew(path, text):
    """Execute a file's text, and after it every file of schemes that imports it; then take all of that back."""
    users = [p for p in sorted(SCHEMES.rglob("*.py")) if path in reach(p)]
    users.sort(key=lambda p: len(reach(p)))  # what a file imports reaches fewer than it
    registry = {family: dict(known) for family, known in named._registry.items()}
    modules, families, schemes = dict(sys.modules), dict(named._family), dict(measured.SCHEMES)
    with tempfile.TemporaryDirectory(prefix="spume-mutants-") as folder:
        try:
            for file in (path, *users):
                copy = Path(folder) / f"{module_name(file)}.py"  # the kernel language reads the source from the file
                copy.write_text(text if file == path else file.read_text(encoding="utf-8"), encoding="utf-8")
                module = types.ModuleType(module_name(file))
                module.__file__ = str(copy)
                sys.modules[module.__name__] = module
                exec(compile(copy.read_text(encoding="utf-8"), str(copy), "exec"), module.__dict__)
            for name in measured.SCHEMES:
                measured.SCHEMES[name] = named.find(*name.split("."))
            yield
        finally:
            sys.modules.update({name: modules[name] for name in modules if name.startswith("spume.")})
            measured.SCHEMES.update(schemes)
            named._family.update(families)
            for family, known in registry.items():
                named._registry[family].clear()
                named._registry[family].update(known)


def differs(path, text, names):
    """Return the first reference value that schemes made of a text do not give, or nothing."""
    try:
        with made_anew(path, text):
            for d, name in itertools.product((2, 3), names):
                for entry in measured.values(name):
                    found, expected = test_claims.given(name, entry, d), entry[f"{d}D"]
                    if not abs(found - expected) <= max(1e-8 * abs(expected), 1e-11):
                        return f"{name} gives {found:.9g}, not {expected:.9g}"
    except Exception as error:  # whatever a wrong formula leads to
        return f"{name if names else path}: {type(error).__name__}"
    return ""


def judge(waiting, options):
    """Yield (mutant, "killed", "survived" or "no answer")."""
    kernels.initialize("cpu", 1, "double")
    for path, group in itertools.groupby(waiting, key=lambda mutant: mutant[0]):
        mutants_of_file = list(group)
        names = mutants_of_file[0][1]
        wrong = differs(path, path.read_text(encoding="utf-8"), names)
        if wrong:
            print(f"as it is, {shown(path)} cannot be judged by reference values: {wrong}")
        for mutant in mutants_of_file:
            found = "" if wrong else differs(path, mutant[3], names)
            result = "killed" if found else "survived"
            if result == "survived" and not options.here:
                result = by_tests(mutant, options.limit)
            yield mutant, result


def by_tests(mutant, limit):
    """Return what the tests of a mutant's family and schemes say."""
    words = f"({' or '.join(mutant[1])}) and not double_loop"
    for arguments in (own_tests(mutant[0]), ["tests/test_claims.py", "-k", words]):
        found = failed(mutant, limit, *arguments) if arguments else []
        if found is None:
            return "no answer"
        if found:
            return "killed"
    return "survived"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("family", nargs="?")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--here", action="store_true")
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
    for mutant, result in judge(waiting, options):
        with options.state.open("a") as file:
            file.write(json.dumps({"key": key(mutant), "result": result}) + "\n")
        report(mutant, result, found)
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
        "A mutant has a wrong factor, sign or radius in one formula; it is killed if the claims of its scheme or the",
        "tests of its family fail.",
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
