"""Schemes: registration, spelling in tables, errors, JSON Schema."""

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from pydantic import Field, ValidationError

from spume import named, planned
from spume.named import File, Parameters, Scheme
from spume.problems import CaseError


class Fruit(Scheme, family="test-fruit", selector="kind"):
    pass


class Apple(Fruit, name="apple"):
    weight: float = Field(default=0.2, gt=0)
    """Weight [kg]."""
    spots: tuple[int, ...] = ()


class Cherry(Fruit, name="cherry"):
    pair: Fruit = Apple()


class Bowl(Parameters):
    fruit: Fruit = Apple()
    more: tuple[Fruit, ...] = ()
    size: float = 1.0


@pytest.fixture(autouse=True)
def _forget():
    yield
    for key in list(named._registry["test-fruit"]):
        if key not in ("apple", "cherry"):
            del named._registry["test-fruit"][key]


def errors(caught):
    return {".".join(map(str, e["loc"])): e["msg"] for e in caught.value.errors()}


def test_name_table_and_object_are_the_same():
    expected = Bowl(fruit=Cherry(pair=Apple(weight=3.0)))
    assert Bowl.model_validate({"fruit": {"kind": "cherry", "pair": {"kind": "apple", "weight": 3}}}) == expected
    assert Bowl.model_validate({"fruit": "cherry"}) == Bowl(fruit=Cherry())


def test_a_table_without_a_name_means_the_default():
    assert Bowl.model_validate({"fruit": {"weight": 3.0}}).fruit == Apple(weight=3.0)


def test_lists_and_arrays_become_tuples():
    bowl = Bowl(more=["apple", {"kind": "apple", "spots": [1, 2]}])
    assert bowl.more == (Apple(), Apple(spots=(1, 2)))
    assert Apple(spots=np.array([1, 2])).spots == (1, 2)
    assert hash(bowl) == hash(Bowl(more=("apple", Apple(spots=(1, 2)))))


def test_whole_numbers_are_real_numbers_but_text_is_not():
    assert Bowl(size=2).size == 2.0
    for value in ("2", True, float("nan"), float("inf"), None, [1.0]):
        with pytest.raises(CaseError, match="Bowl: size"):
            Bowl(size=value)


def test_objects_are_frozen():
    with pytest.raises(ValidationError):
        Bowl().size = 2.0


def test_every_mistake_is_found_at_its_place():
    with pytest.raises(ValidationError) as caught:
        Bowl.model_validate(
            {
                "fruit": {"kind": "appel"},
                "more": ["apple", {"kind": "apple", "weigth": 1, "spots": "x"}],
                "sise": 1,
            }
        )
    found = errors(caught)
    assert found["fruit.kind"] == "one of apple, cherry; did you mean 'apple'?"
    assert found["more.1.weigth"] == "no such key; allowed: weight, spots; did you mean 'weight'?"
    assert "sise" in found
    assert "tuple" in found["more.1.spots"]
    assert len(found) == 4


def test_a_misspelt_required_key_is_one_mistake():
    class Needs(Parameters):
        spacing: float

    with pytest.raises(CaseError) as caught:
        Needs(spacin=1.0)
    assert [problem.key for problem in caught.value.problems] == ["spacin"]


@pytest.mark.parametrize("value", [3, {}, {"kind": 3}, ["apple"], None])
def test_what_is_no_scheme_is_told_the_names(value):
    class Needs(Parameters):
        fruit: Fruit

    with pytest.raises(CaseError, match="apple, cherry"):
        Needs(fruit=value)


def test_claims_and_selectors_cannot_become_keys():
    with pytest.warns(UserWarning, match="shadows"), pytest.raises(TypeError, match="ClassVar"):

        class Wrong(Fruit, name="wrong"):
            ids: tuple[str, ...] = ("B1",)

    with pytest.raises(TypeError, match="selects the scheme"):

        class AlsoWrong(Fruit, name="also-wrong"):
            kind: str = "x"

    with pytest.raises(TypeError, match="already"):

        class Apple2(Fruit, name="apple"):
            pass

    with pytest.raises(TypeError, match="family"):

        class Homeless(Scheme, name="homeless"):
            pass

    class Right(Fruit, name="right"):
        ids: ClassVar[tuple[str, ...]] = ("B1",)

    assert list(Right.model_fields) == []


def test_round_trip_through_tables():
    bowl = Bowl(fruit=Cherry(pair=Apple(weight=3.0)), more=(Apple(),))
    assert Bowl.model_validate(bowl.model_dump()) == bowl


def test_json_schema_holds_every_scheme_once_and_nests():
    schema = named.json_schema(Bowl)
    choices = schema["$defs"]["family-test-fruit"]["anyOf"]
    assert choices[0] == {"enum": ["apple", "cherry"]}
    apple, cherry = choices[1:]
    assert apple["properties"]["kind"] == {"const": "apple"}
    assert apple["properties"]["weight"]["description"] == "Weight [kg]."
    assert apple["properties"]["weight"]["default"] == 0.2
    assert apple["additionalProperties"] is False
    assert cherry["properties"]["pair"]["$ref"] == "#/$defs/family-test-fruit"
    assert "x-family" not in str(schema)


def test_files_are_found_beside_the_case_then_among_the_built_in_ones(tmp_path):
    class Reads(Parameters):
        file: File

    (tmp_path / "a.csv").write_text("x")
    read = Reads.model_validate({"file": "a.csv"}, context={"folder": tmp_path})
    assert read.file == tmp_path / "a.csv"
    built_in = Reads.model_validate({"file": "dam-break/case.toml"}, context={"folder": tmp_path})
    assert built_in.model_dump() == {"file": "dam-break/case.toml"}
    for wrong in ("b.csv", "", 3, "a\0b", "."):
        with pytest.raises(ValidationError, match="file"):
            Reads.model_validate({"file": wrong}, context={"folder": tmp_path})


def test_a_misspelt_key_does_not_lose_the_folder_of_the_files(tmp_path):
    class Reads(Parameters):
        file: File

    (tmp_path / "a.csv").write_text("x")
    with pytest.raises(ValidationError) as caught:
        Reads.model_validate({"file": "a.csv", "colum": 1}, context={"folder": tmp_path})
    assert list(errors(caught)) == ["colum"]


@pytest.mark.parametrize(
    ("word", "known", "answer"),
    [
        ("spacin", ["spacing", "time"], "; did you mean 'spacing'?"),
        ("CORRECTED", ["corrected"], "; did you mean 'corrected'?"),
        ("hydro", ["hydrostatic", "rest"], "; did you mean 'hydrostatic'?"),
        ("xyz", ["spacing"], ""),
        ("xyz", [], ""),
    ],
)
def test_nearest_match(word, known, answer):
    assert named.nearest_match(word, known) == answer


def test_what_a_scheme_does_not_use_is_no_key_of_its_table():
    class Peeled(Apple, name="peeled"):
        unused: ClassVar = {"spots": "they are on the peel"}

    assert Peeled.table_keys() == ("weight",)
    assert named.to_table(Peeled()) == {"kind": "peeled", "weight": 0.2}
    assert Bowl(fruit={"kind": "peeled", "spots": []}).fruit == Peeled()
    with pytest.raises(ValidationError) as caught:
        Bowl.model_validate({"fruit": {"kind": "peeled", "spots": [1]}})
    said = "has no effect on test-fruit 'peeled': they are on the peel; leave it out"
    assert errors(caught) == {"fruit.spots": said}
    with pytest.raises(ValidationError) as caught:
        Bowl.model_validate({"fruit": {"kind": "peeled", "sports": 1, "spots": [1]}})
    assert errors(caught) == {"fruit.spots": said, "fruit.sports": "no such key; allowed: weight"}
    choices = named.json_schema(Bowl)["$defs"]["family-test-fruit"]["anyOf"]
    assert [list(c["properties"]) for c in choices[1:]] == [
        ["kind", "weight", "spots"],
        ["kind", "pair"],
        ["kind", "weight"],
    ]
    with pytest.raises(TypeError, match="it has no peel to leave unused"):

        class Wrong(Fruit, name="wrong"):
            unused: ClassVar = {"peel": "x"}


def test_what_is_called_planned_is_neither_there_nor_off_the_list():
    named.load_all()
    listed = (Path(__file__).parents[1] / "docs" / "systems.md").read_text()
    for family, names in planned.PLANNED.items():
        there = {scheme.key for scheme in named.schemes(family)}
        assert there
        assert not there & set(names)
        for row in filter(None, names.values()):
            (line,) = [line for line in listed.splitlines() if line.startswith(f"| {row} |")]
            assert line.endswith("| planned |"), line
