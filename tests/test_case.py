"""Case files: reading, replacing, completing, writing, and the message for each mistake."""

import tomllib

import pytest

import spume
from spume.case import CaseError, built_in_cases, load, schema

CASE = """\
title = "a tank"
spacing = 0.02

[time]
end = 1.0

[[fluid]]
name = "water"
shape = { kind = "box", lower = [0.0, 0.0], upper = [0.6, 0.3] }

[[body]]
name = "tank"
kind = "wall"
shape = { kind = "tank", lower = [0.0, 0.0], upper = [1.6, 0.6], open = ["top"] }

[[gauge]]
name = "p"
kind = "pressure"
at = [1.6, 0.01]
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "tank.toml"
    path.write_text(CASE)
    return path


def complaint(file, text=None, overrides=()):
    """Return the problems of a case file, without its folder."""
    if text is not None:
        file.write_text(text)
    with pytest.raises(CaseError) as caught:
        load(file, overrides)
    return str(caught.value).replace(f"{file.parent}/", "").splitlines()


def test_defaults_are_completed(file):
    case = load(file)
    assert case.dimension == 2
    assert case.fluid[0].density == 1000.0
    assert case.domain.gravity.at(0.0).tolist() == [0.0, -9.81]
    assert case.body[0].layers == 3
    assert case.origin.label == "tank"


def test_gravity_points_down_in_3d(file):
    text = CASE.replace("0.0, 0.0]", "0.0, 0.0, 0.0]").replace("0.3]", "0.3, 0.3]").replace("0.6]", "0.3, 0.6]")
    file.write_text("dimension = 3\n" + text.replace("1.6, 0.01", "1.6, 0.1, 0.01"))
    assert load(file).domain.gravity.at(0.0).tolist() == [0.0, 0.0, -9.81]


def test_ten_lines_of_python_are_the_same_case(file):
    case = spume.Case(
        title="a tank",
        spacing=0.02,
        time=spume.Time(end=1.0),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0, 0], upper=[0.6, 0.3]))],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0, 0], upper=[1.6, 0.6], open=["top"]))],
        gauge=[{"name": "p", "kind": "pressure", "at": [1.6, 0.01]}],
    )
    assert case == load(file)


def test_overrides(file):
    changes = [
        "spacing=0.01",
        "time.end=0.5",
        "fluid.water.viscosity=0",
        "fluid.0.initial=hydrostatic",
        "body.tank.slip=free-slip",
        "step.gradient.re=3.1",
        "domain.gravity=[1, 2]",
        "body.0.layers=4",
    ]
    case = load(file, changes)
    assert case.spacing == 0.01
    assert case.time.end == 0.5
    assert case.fluid[0].viscosity == 0.0
    assert case.fluid[0].initial[0].key == "hydrostatic"
    assert case.body[0].slip == "free-slip"
    assert case.step.gradient.re == 3.1
    assert case.domain.gravity.at(0.0).tolist() == [1.0, 2.0]


def test_a_scheme_by_name_can_be_given_parameters(file):
    file.write_text(CASE.replace("spacing", 'step = "project-in-place"\nspacing'))
    case = load(file, ["step.negative_pressure=false"])
    assert case.step.key == "project-in-place"
    assert case.step.negative_pressure is False


@pytest.mark.parametrize("name", built_in_cases())
def test_a_completed_case_is_read_back(name, tmp_path):
    case = load(name)
    text = case.to_toml()
    (tmp_path / "copy.toml").write_text(text)
    assert load(tmp_path / "copy.toml") == case
    document = tomllib.loads(text)
    assert document["domain"]["gravity"]["kind"] == ("central" if name == "oscillating-drop" else "constant")
    assert document["fluid"][0]["density"] == 1000.0


def test_a_run_folder_does_not_hide_the_built_in_case_of_its_name(file, monkeypatch):
    folder = file.parent / "dam-break"
    folder.mkdir()
    (folder / "case.toml").write_text(CASE)
    monkeypatch.chdir(file.parent)
    assert load("dam-break").title.startswith("Dam break")
    assert load("./dam-break").title == "a tank"
    assert load("dam-break/case.toml").title == "a tank"


def test_folders_and_byte_order_marks(file):
    (file.parent / "here").mkdir()
    (file.parent / "here" / "case.toml").write_bytes(b"\xef\xbb\xbf" + CASE.encode().replace(b"\n", b"\r\n"))
    assert load(file.parent / "here") == load(file)
    assert load(file.parent / "here").origin.label == "here"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "spacing = 0.02\n\n[time]",
            "[time]\nspacing = 0.02",
            "tank.toml:3: time.spacing = 0.02: no such key here; it stands at the top of the file, before",
        ),
        ("[[gauge]]", "[[output.gauge]]", "no such key here; these are tables of their own: [[gauge]]"),
        ("[time]", "[domain.output]\ninterval = 1.0\n[time]", "here; it is a table of its own: [output]"),
        (
            'spacing = 0.02',
            'spacin = 0.02',
            'tank.toml:2: spacin = 0.02: no such key; allowed: title, spacing',
        ),
        ("spacing = 0.02", "spacing = -1", "tank.toml:2: spacing = -1: must be greater than 0"),
        ("spacing = 0.02", "spacing = 0", "tank.toml:2: spacing = 0: must be greater than 0"),
        ("spacing = 0.02", "spacing = nan", "tank.toml:2: spacing = nan: must be a finite number"),
        ("spacing = 0.02", "spacing = inf", "tank.toml:2: spacing = inf: must be a finite number"),
        ("spacing = 0.02", 'spacing = "0.02"', 'tank.toml:2: spacing = "0.02": must be a number'),
        ("spacing = 0.02", "", "tank.toml: spacing: this key is required"),
        ("spacing = 0.02", "spacing = 1985-10-26", "tank.toml:2: spacing = 1985-10-26: must be a number"),
        ("spacing = 0.02", "spacing = ", "tank.toml:2: not TOML: invalid value"),
        ("spacing = 0.02", "spacing = 0,02", "a statement; a number has a point, not a comma: 0.02"),
        ("end = 1.0", "end = 0", "tank.toml:5: time.end = 0: must be greater than 0"),
        ("end = 1.0", "", "tank.toml:4: time.end: this key is required"),
        ("end = 1.0", "end = 1.0\nend = 2.0", "tank.toml:6: not TOML: cannot overwrite a value"),
        (
            'kind = "box"',
            'kind = "bx"',
            'tank.toml:9: fluid.water.shape.kind = "bx": one of box, cylinder, difference',
        ),
        ('kind = "box"', 'kin = "box"', "tank.toml:9: fluid.water.shape"),
        (
            'kind = "wall"',
            'kind = "floating"',
            'body.tank.kind = "floating": planned, not there yet (L8 of docs/systems.md); one of wall',
        ),
        (
            'kind = "box"',
            'kind = "bathymetry"',
            'shape.kind = "bathymetry": planned, not there yet; a polygon, an extrusion or a drawing (stl) can',
        ),
        (
            'kind = "wall"',
            'kind = "wal"',
            'tank.toml:13: body.tank.kind = "wal": one of wall; did you mean \'wall\'?',
        ),
        ("upper = [0.6, 0.3]", "upper = [0.6, 0.3, 1]", "must have as many numbers"),
        (
            'upper = [0.6, 0.3]',
            'upper = [0.6, "x"]',
            'tank.toml:9: fluid.water.shape.upper.1 = "x": must be a number',
        ),
        ("upper = [0.6, 0.3]", "upper = [0.6, 0.0]", "must be less than upper"),
        (
            'open = ["top"]',
            'open = ["topp"]',
            'tank.toml:14: body.tank.shape.open.0 = "topp": must be \'left\'',
        ),
        ('open = ["top"]', 'open = ["front"]', "front"),
        ("at = [1.6, 0.01]", "", "tank.toml:16: gauge.p.at: this key is required"),
        ('name = "water"', "name = 3", "tank.toml:8: fluid.0.name = 3: must be text"),
        ('name = "water"', 'name = "a b"', "tank.toml:8: fluid.a b.name"),
        ("[[gauge]]", '[[gauge]]\nbodies = "x"', "tank.toml:17: gauge.p.bodies = \"x\": no such key"),
        (
            '[time]',
            '[domain]\nperiodic = ["z"]\nlower=[0,0]\nupper=[1,1]\n[time]',
            'must be x or y in a 2D case',
        ),
        ("[time]", '[domain]\nperiodic = ["x"]\n[time]', "lower and upper must say how long"),
        ("[time]", "[domain]\nlower = [0, 0]\n[time]", "give both or neither"),
        ("[time]", '[domain]\ngravity = { kind = "table", file = "g.csv" }\n[time]', "no such file"),
        ("[time]", "[domain]\ngravity = [0, 0, -9.81]\n[time]", "must have 2 numbers in a 2D case"),
        ("[time]", "[output]\ncolour = \"presure\"\n[time]", "did you mean 'pressure'?"),
        (
            '[time]',
            '[output]\nfields = ["velocity", "vorticity"]\n[time]',
            'tank.toml:5: output.fields.1 = "vorticity"',
        ),
        (
            '[time]',
            '[[reference]]\ngauge = "q"\nfile = "dam-break/level-1.csv"\n[time]',
            'must be the name of a gauge: p',
        ),
        (
            '[time]',
            '[step]\ngradient = { name = "original", re = 3.5 }\n[time]',
            'body.tank.layers = 3: must be at least 4',
        ),
        ("[time]", '[step]\ngradient = "orginal"\n[time]', "did you mean 'original'?"),
    ],
)  # fmt: skip
def test_each_mistake_has_its_message(file, old, new, message):
    assert CASE.count(old) == 1
    text = "\n".join(complaint(file, CASE.replace(old, new)))
    assert message in text


def test_no_fluid(file):
    start, end = CASE.index("[[fluid]]"), CASE.index("[[body]]")
    assert complaint(file, CASE[:start] + CASE[end:]) == ["tank.toml: fluid: this key is required"]
    assert complaint(file, "fluid = []\n" + CASE[:start] + CASE[end:]) == [
        "tank.toml:1: fluid = []: a case needs at least one [[fluid]]"
    ]


def test_names_are_unique(file):
    second = '\n[[fluid]]\nname = "water"\nshape = { kind = "sphere", centre = [1, 0.3], radius = 0.1 }\n'
    assert complaint(file, CASE + second) == [
        'tank.toml:22: fluid.water.name = "water": another fluid already has this name'
    ]


def test_shapes_of_other_dimensions(file):
    text = CASE.replace('kind = "box", lower = [0.0, 0.0], upper = [0.6, 0.3]',
                        'kind = "cylinder", start = [0, 0, 0], end = [0, 0, 1], radius = 1')  # fmt: skip
    assert any("'cylinder' exists in 3D only" in line for line in complaint(file, text))


def test_several_mistakes_come_together_in_the_order_of_the_file(file):
    text = CASE.replace("0.02", "-1").replace("end = 1.0", "ende = 1.0").replace('"wall"', '"wal"')
    assert [line.split(":")[1] for line in complaint(file, text)] == ["2", "5", "13"]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("spacing=-1", "--set spacing=-1: spacing = -1: must be greater than 0"),
        ("spacing", "--set spacing: must read key=value, as time.end=0.1"),
        ("=1", "--set =1: must read key=value"),
        ("time..end=1", "must read key=value"),
        ("fluid.watr.density=1", "no fluid is called 'watr'; there is water; did you mean 'water'?"),
        ("fluid.7.density=1", "no fluid is called '7'; there is water"),
        ("spacing.x=1", "spacing has no keys"),
        ("time=1", "--set time=1: time = 1: must be a table"),
        ("tim.end=1", "--set tim.end=1: tim: no such key"),
        ("fluid=1", "must be a list"),
        ("step=nonsense", "one of"),
        ("step.gradient.order=3", "no such key"),
        ("body.tank.shape=tank", "lower: this key is required"),
    ],
)
def test_mistakes_of_the_command_line(file, override, message):
    assert message in "\n".join(complaint(file, overrides=[override]))


def test_options_are_named_as_given(file):
    with pytest.raises(CaseError, match="--device: device = \"gpu\": must be 'cpu'"):
        load(file, options={"device": "gpu"})


@pytest.mark.parametrize(
    "content", [b"\xff\xfe\x00", b"[", b"a = " + b"[" * 3000, b"\x00", b"a = 1\na = 2", b"fluid = 3", b""]
)
def test_what_is_no_case_file_is_refused(file, content):
    file.write_bytes(content)
    with pytest.raises(CaseError) as caught:
        load(file)
    assert str(caught.value).startswith(str(file))


def test_a_missing_file_names_the_nearest_case(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CaseError, match="did you mean 'dam-break'"):
        load("dam-brek")
    with pytest.raises(CaseError, match="no such file"):
        load(tmp_path / "nothing.toml")


def test_what_a_beginner_writes_is_answered_with_what_is_meant(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(
        "spacing = 0.1\ngravity = [0.0, -1.0]\nend = 3\n[time]\nend = 1.0\n[domain]\ngravity = -9.81\n"
        '[fluid]\nname = "w"\nshape = {kind = "box", lower = [0.0, 0.0], upper = [1.0, 1.0]}\n'
    )
    with pytest.raises(CaseError) as caught:
        load(path)
    lines = str(caught.value).replace(str(path), "a.toml").splitlines()
    assert [line.partition(" ")[0] for line in lines] == ["a.toml:2:", "a.toml:3:", "a.toml:7:", "a.toml:8:"]
    assert lines[0].endswith("did you mean 'domain.gravity'?")
    assert lines[1].endswith("did you mean 'time.end'?")
    assert "domain.gravity = -9.81: must be a vector such as [0.0, -9.81] in 2D or" in lines[2]
    assert "fluid: write [[fluid]]" in lines[3]


def test_a_folder_that_holds_no_case_says_so(tmp_path):
    with pytest.raises(CaseError, match=r"is a folder, without a case\.toml: name the case file in it$"):
        load(tmp_path)
    (tmp_path / "tank.toml").write_text("")
    with pytest.raises(CaseError, match=r"name the case file in it, such as tank\.toml$"):
        load(tmp_path)


def test_mistakes_in_python_are_said_as_those_of_a_file_are():
    with pytest.raises(CaseError, match=r"^Case: spacing = -1\.0: must be greater than 0$"):
        spume.Case(spacing=-1.0, time=spume.Time(end=1.0), fluid=())
    with pytest.raises(CaseError) as caught:
        spume.Case(spcing=1.0, time={"end": "soon"})
    assert [problem.key for problem in caught.value.problems] == ["spcing", "time.end", "fluid"]
    assert "did you mean 'spacing'?" in str(caught.value)
    with pytest.raises(CaseError, match=r"^Box: uper = \[1, 1\]: no such key; allowed: lower, upper"):
        spume.Box(lower=[0, 0], uper=[1, 1])
    shape = {"kind": "box", "lower": [0, 0], "uper": [1, 1]}
    with pytest.raises(CaseError, match=r"^Case: fluid\.a\.shape\.uper = \[1, 1\]: no such key"):
        spume.Case(spacing=0.1, time=spume.Time(end=1.0), fluid=[{"name": "a", "shape": shape}])


def test_every_key_is_documented_with_its_unit():
    """In the schema every property has a description, and lengths, times … name their unit."""
    found = schema()
    undocumented, without_unit = [], []

    def look(node, where):
        for key, value in node.get("properties", {}).items():
            if "const" in value:
                continue
            text = value.get("description", "")
            if not text:
                undocumented.append(f"{where}.{key}")
            number = value.get("type") == "number" or any(c.get("type") == "number" for c in value.get("anyOf", []))
            if number and "[" not in text and "reference" not in text and "multiple" not in text:
                without_unit.append(f"{where}.{key}: {text}")

    look(found, "case")
    mine = ("Time", "Domain", "Fluid", "family-shape", "family-body", "family-initial", "family-gravity")
    for name in mine:
        for node in [found["$defs"][name], *found["$defs"][name].get("anyOf", [])]:
            look(node, node.get("title", name))
    assert undocumented == []
    assert without_unit == []


def test_schema_accepts_what_the_loader_accepts():
    jsonschema = pytest.importorskip("jsonschema")
    for path in built_in_cases().values():
        jsonschema.validate(tomllib.loads(path.read_text()), schema())


@pytest.mark.parametrize("gradient", ["minimum", "cmps", "sum", "corrected-minimum"])
def test_a_flow_under_tension_refuses_what_only_repels(file, gradient):
    found = complaint(file, "tensile = true\n" + CASE, [f"step.gradient={gradient}"])
    assert len(found) == 1
    assert f'step.gradient = "{gradient}"' in found[0]
    assert "tensile = true" in found[0]
    assert "choose one of completed, corrected, dummy-neighbour, imaged, original, second-order, stabilised" in found[0]
    load(file, ["tensile=false", f"step.gradient={gradient}"])


def test_a_flow_under_tension_refuses_to_clip(file):
    found = complaint(file, "tensile = true\n" + CASE, ["step.negative_pressure=false"])
    assert len(found) == 1
    assert "step.negative_pressure = false: sets negative pressures to zero" in found[0]
    load(file, ["step.negative_pressure=true", "step.gradient=corrected"])
