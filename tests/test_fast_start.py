"""Compiled kernels of an earlier process: taken where nothing has changed, and only there."""

import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from spume import fingerprint, kernels
from spume.fingerprint import Unknown
from spume.pairs import PairTerm, pair_term

FIRST_STEP = """\
import hashlib, sys
import quadrants

generator = sys.modules["quadrants.lang.kernel"].ASTGenerator
translated, translate = 0, generator.__call__

def counting(self, kernel):
    global translated
    ours = not (self.current_kernel.func.__module__ or "").startswith("quadrants")
    translated += ours and not self.only_parse_function_def
    return translate(self, kernel)

generator.__call__ = counting
from spume.build import build
from spume.case import load

simulation = build(load("hydrostatic", ["spacing=0.25", *sys.argv[1:]]), threads=1)
for _ in range(3):
    simulation.advance()
print(translated, hashlib.sha256(simulation.particles.numpy("position").tobytes()).hexdigest())
"""


def first_step(cache: Any, *settings: str) -> tuple[int, str]:
    """Return how many translations of kernels a new process makes, and what it computes."""
    command = [sys.executable, "-c", FIRST_STEP, *settings]
    environment = {**os.environ, "SPUME_CACHE": str(cache)}
    lines = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.splitlines()
    number, digest = lines[-1].split()
    return int(number), digest


def test_second_process_translates_nothing_and_computes_the_same_bits(tmp_path):
    some, bits = first_step(tmp_path)
    assert some > 50
    assert first_step(tmp_path) == (0, bits)
    # Other models share most kernels with these, and find their own.
    more, others = first_step(tmp_path, "step.number_density.weight=wendland")
    assert 0 < more < some
    assert others != bits


def made_for(number: Any) -> Any:
    def inner(x: float) -> float:
        return x + number

    def outer(x: float) -> float:
        return inner(x) * 2.0

    return outer


def test_same_code_and_closure_have_the_same_fingerprint():
    assert fingerprint.fingerprint(made_for(1.0)) == fingerprint.fingerprint(made_for(1.0))


@pytest.mark.parametrize(
    "other",
    [
        2.0,
        1,
        True,
        "1.0",
        None,
        (1.0,),
        {"a": 1.0},
        kernels.f32,
        kernels.vector(2),
        SimpleNamespace(a=1.0),
        made_for(1.0),
    ],
)
def test_what_a_function_within_holds_is_part_of_it(other):
    assert fingerprint.fingerprint(made_for(1.0)) != fingerprint.fingerprint(made_for(other))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (kernels.vector(2), kernels.vector(3)),
        (kernels.i32, kernels.i64),
        (kernels.array_type(kernels.i32), kernels.array_type(kernels.f32)),
        (kernels.array_type(kernels.vector(2)), kernels.array_type(kernels.vector(3))),
        (made_for(1.0), made_for(2.0)),
        ([1, 2], [2, 1]),
    ],
)
def test_types_and_functions_are_told_apart_by_their_parts(one, other):
    assert fingerprint.fingerprint(made_for(one)) != fingerprint.fingerprint(made_for(other))


def of_text(text: str, **names: Any) -> str:
    """Return the fingerprint of the function ``f`` that a text defines."""
    scope: dict[str, Any] = {"__name__": "somewhere", **names}
    exec(text, scope)
    return fingerprint.fingerprint(scope["f"])


@pytest.mark.parametrize(
    "text",
    [
        "def f(x): return x - 1",
        "def f(x): return x + 2",
        "def f(x): return x + 1 if x > 0 else x",
        "def f(x, y): return x + 1",
        "def f(x: int): return x + 1",
        "def f(x=2): return x + 1",
        "def f(x):\n    def g(y): return y + 1\n    return g(x)",
    ],
)
def test_code_is_part_of_it(text):
    assert of_text(text) != of_text("def f(x): return x + 1")


def test_comments_and_places_are_not():
    assert of_text("\n\ndef f(x):\n    # why\n    return x + 1") == of_text("def f(x): return x + 1")


def test_global_names_are_followed():
    text = "def f(x): return g(x) + size"
    same = of_text(text, g=made_for(1.0), size=3, unused=object())
    assert same == of_text(text, g=made_for(1.0), size=3)
    assert same != of_text(text, g=made_for(2.0), size=3)
    assert same != of_text(text, g=made_for(1.0), size=4)


def test_numbers_of_our_modules_are_part_of_it():
    ours, text = ModuleType("spume.somewhere"), "def f(x): return x * ours.SIZE"
    ours.SIZE = 3
    before = of_text(text, ours=ours)
    ours.SIZE = 4
    assert of_text(text, ours=ours) != before


def test_pair_terms_are_their_formulas():
    def term(factor: float) -> PairTerm:
        @pair_term(reads=("pressure",))
        def difference(a, b, r, w):
            return factor * (b.pressure - a.pressure) * w

        return difference

    one, same, other = (fingerprint.fingerprint(made_for(term(factor))) for factor in (1.0, 1.0, 2.0))
    assert one == same
    assert one != other


def test_what_cannot_be_described_is_refused():
    with pytest.raises(Unknown, match="object"):
        fingerprint.fingerprint(made_for(object()))
    with pytest.raises(Unknown):
        fingerprint.fingerprint(made_for(iter([])))


def test_recursive_function_has_one():
    def again(x: float) -> float:
        return again(x - 1.0) if x > 0.0 else x

    assert fingerprint.fingerprint(again)


def test_kernel_that_takes_a_function_is_another_one_for_each():
    n, qd = 4, kernels.qd
    out = kernels.array(kernels.i32, n)
    for number in (1, 2):

        @kernels.func
        def value():
            return number  # noqa: B023

        @kernels.kernel
        def write(target: kernels.array_type(kernels.i32), function: qd.template()):
            for i in range(n):
                target[i] = function()

        write(out, value)
        assert out.to_numpy().tolist() == [number] * n


def test_cache_that_cannot_be_read_is_left_alone(monkeypatch):
    def refuse(key: str) -> None:
        raise PermissionError(key)

    monkeypatch.setattr(kernels.qd.lang._fast_caching.src_hasher, "load", refuse)
    out = kernels.array(kernels.i32, 4)

    @kernels.kernel
    def write(target: kernels.array_type(kernels.i32)):
        for i in range(4):
            target[i] = 7 * i

    write(out)
    assert out.to_numpy().tolist() == [0, 7, 14, 21]


def test_a_source_file_that_changes_comes_or_goes_gives_another_digest(tmp_path):
    (tmp_path / "part").mkdir()
    (tmp_path / "a.py").write_text("x = 1\n")
    (tmp_path / "part" / "b.py").write_text("y = 2\n")
    found = [fingerprint.digest_of(tmp_path)]
    (tmp_path / "a.pyc").write_text("no source")
    assert fingerprint.digest_of(tmp_path) == found[0]
    (tmp_path / "part" / "b.py").write_text("y = 3\n")
    found.append(fingerprint.digest_of(tmp_path))
    (tmp_path / "part" / "b.py").rename(tmp_path / "part" / "c.py")
    found.append(fingerprint.digest_of(tmp_path))
    (tmp_path / "part" / "c.py").unlink()
    found.append(fingerprint.digest_of(tmp_path))
    # What ends one file and begins the next must not be taken for each other.
    (tmp_path / "a.py").write_text("x = 1\npart/c.py")
    found.append(fingerprint.digest_of(tmp_path))
    assert len(set(found)) == len(found)


def test_the_digest_of_the_package_is_that_of_its_files():
    assert fingerprint.package_digest() == fingerprint.digest_of(Path(kernels.__file__).parent)
