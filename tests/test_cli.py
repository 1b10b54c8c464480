"""The command line: what it prints, which exit code it ends with, that bad input has no traceback."""

import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

import spume.run
from spume import kernels
from spume.case import built_in_cases, load
from spume.cli import app
from spume.outputs.disk import NotWritten
from spume.simulation import Diverged


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def call(*words):
        result = CliRunner().invoke(app, [str(word) for word in words])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result

    return call


def test_cases_lists_every_case(call):
    result = call("cases")
    assert result.exit_code == 0
    for name in ("hydrostatic", "dam-break", "dam-break-3d", "dam-break-martin-moyce"):
        assert name in built_in_cases()
        assert name in result.output


def test_check_draws_and_predicts_and_computes_nothing(call, tmp_path):
    result = call("check", "dam-break", "--set", "spacing=0.01")
    assert result.exit_code == 0, result.output
    assert "1,800 particles, 0.18 m^2" in result.output
    assert "2,661, 1,800 of them fluid" in result.output
    assert "steps" in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["dam-break-initial.png"]
    assert (tmp_path / "dam-break-initial.png").stat().st_size > 5000


def test_check_predicts_for_as_many_threads_as_a_run_would_have(call):
    few = call("check", "dam-break", "--set", "spacing=0.05")
    assert "with 1 thread " in few.output  # a small table is not worth more
    many = call("check", "dam-break", "--set", "spacing=0.05", "--threads", "100000")
    assert many.exit_code == 0
    assert f"with {kernels.processors()} thread" in many.output


def test_check_in_3d_writes_where_it_is_told(call, tmp_path):
    result = call("check", "hydrostatic-3d", "--set", "spacing=0.1", "--out", "a/b.png")
    assert result.exit_code == 0, result.output
    assert (tmp_path / "a" / "b.png").exists()


@pytest.mark.parametrize("source", [None, *built_in_cases()])
def test_new_writes_a_case_that_is_in_order(call, tmp_path, source):
    result = call("new", "mine", *(() if source is None else ("--from", source)))
    assert result.exit_code == 0
    text = (tmp_path / "mine.toml").read_text()
    assert text.startswith("#")
    if source is None:
        load(tmp_path / "mine.toml")
        assert "spume run mine.toml" in text
    else:
        assert load(tmp_path / "mine.toml") == load(source)


def test_new_overwrites_nothing(call, tmp_path):
    (tmp_path / "mine.toml").write_text("precious")
    result = call("new", "mine")
    assert result.exit_code == 2
    assert "nothing is overwritten" in result.output
    assert (tmp_path / "mine.toml").read_text() == "precious"


@pytest.mark.parametrize("name", ["a b", "../a", "", ".a", "a/b"])
def test_new_wants_a_file_name(call, tmp_path, name):
    assert call("new", name).exit_code == 2
    assert list(tmp_path.iterdir()) == []


def test_every_commented_key_of_the_template_exists(call, tmp_path):
    """Uncommenting each example of the template gives a case that is in order."""
    call("new", "mine")
    text = (tmp_path / "mine.toml").read_text()
    keys = [line for line in text.splitlines() if line.startswith("# ") and " = " in line.split("  #")[0]]
    assert len(keys) > 12
    one_by_one = {
        "# dimension": "dimension=2",
        "# face": "gauge.wall-pressure.face=0.005",
        "# interval": "gauge.wall-pressure.interval=0.001",
    }
    for line in keys:
        key, value = (part.strip() for part in line[2:].split("#")[0].split("=", 1))
        table = text[: text.index(line)].rsplit("\n[", 1)
        header = "" if len(table) == 1 else table[1].split("]")[0].strip("[")
        prefix = {"fluid": "fluid.water.", "body": "body.tank.", "gauge": "gauge.wall-pressure."}.get(
            header, f"{header}." if header else ""
        )
        commented = text[: text.index(line)].rsplit("\n# [", 1)
        if len(commented) > 1 and len(commented[1]) < len(table[-1]):
            continue  # inside a table that is itself commented out: tested below
        changes = [one_by_one.get(f"# {key}", f"{prefix}{key}={value}")]
        load(tmp_path / "mine.toml", changes)
    whole = text.replace('# [[body]]\n# name = "sill"', '[[body]]\nname = "sill"').replace("  # reaches", "  # r")
    whole = whole.replace('# kind = "wall"\n# shape', 'kind = "wall"\nshape')
    whole = (
        whole.replace("# [step]\n# name", "[step]\nname")
        .replace("# gradient", "gradient")
        .replace("# solver", "solver")
    )
    (tmp_path / "whole.toml").write_text(whole)
    case = load(tmp_path / "whole.toml")
    assert [body.name for body in case.body] == ["tank", "sill"]
    assert case.step.gradient.key == "original"


def test_schemes(call):
    listed = json.loads(call("schemes", "--json").output)
    families = {scheme["family"] for scheme in listed}
    assert {"weight", "gradient", "step", "shape", "gauge", "gravity", "initial", "body"} <= families
    assert all({"family", "name", "ids", "sources", "order", "conserves"} <= set(scheme) for scheme in listed)
    only = json.loads(call("schemes", "--json", "--family", "gradient").output)
    assert {scheme["family"] for scheme in only} == {"gradient"}
    assert "gradient" in call("schemes").output
    wrong = call("schemes", "--family", "gradent")
    assert wrong.exit_code == 2
    assert "did you mean" in wrong.output


@pytest.mark.parametrize("columns", [None, "60"])
def test_tables_are_cut_off_nowhere(call, monkeypatch, columns):
    """In a pipe, which has no width, and where a narrow one is asked for."""
    if columns is None:
        monkeypatch.delenv("COLUMNS")
    else:
        monkeypatch.setenv("COLUMNS", columns)
    lines = call("schemes").output.splitlines()
    assert not [line for line in lines if "…" in line]
    if columns is None:
        assert any("dummy-neighbour" in line and line.count("gradient") for line in lines)


def test_schema(call):
    found = json.loads(call("schema").output)
    assert "spacing" in found["required"]


def test_version(call):
    assert call("--version").output.startswith("spume ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("check", "dam-brek"), "did you mean 'dam-break'?"),
        (("check", "dam-break", "--set", "spacing=-1"), "spacing=-1: spacing = -1: must be greater than 0"),
        (("check", "dam-break", "--set", "spacing"), "must read key=value"),
        (("check", "dam-break", "--set", "fluid.water.shape.upper=[3, 0.3]"), "lie in body 'tank'"),
        (("run", "dam-break", "--precision", "quad"), "--precision: precision = \"quad\""),
        (("run", "dam-break", "--device", "abacus"), "--device: device = \"abacus\""),
        (("run", "dam-break", "--threads", "0"), "--threads"),
        (("run", "nothing.toml"), "no such file"),
        (("run",), "Missing argument"),
        (("run", "dam-break", "--max-wall-time", "90"), "'90': must be a time as 01:30:00"),
        (("run", "--resume", "nothing"), "no such run folder"),
        (("run", "dam-break", "--resume", "nothing"), "CASE does not go with --resume"),
        (("run", "--resume", "nothing", "--out", "a"), "--out does not go with --resume"),
        (("atlas", "--only", "nope", "--list"), "'nope' is part of no name: default, "),
        (("fly",), "No such command"),
        (("check", "dam-break", "--wrong"), "No such option"),
    ],
)  # fmt: skip
def test_bad_input_ends_with_2_and_one_message(call, tmp_path, words, message):
    result = call(*words)
    assert result.exit_code == 2
    assert message in " ".join(result.output.split())
    assert "Traceback" not in result.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["check", "run"])
def test_more_particles_than_fit_are_refused_before_anything_is_computed(call, tmp_path, monkeypatch, command):
    monkeypatch.setattr(kernels, "LONGEST_ARRAY", 500)
    result = call(command, "dam-break", "--set", "spacing=0.05")
    assert result.exit_code == 2
    assert "at most 100 fit, for the array of the solver's coarse levels has 5" in " ".join(result.output.split())
    assert not list(tmp_path.rglob("*.png"))


class Ended:
    step_index, time = 3, 0.5


@pytest.mark.parametrize(
    ("outcome", "code", "words"),
    [
        ("finished", 0, "Done: 3 steps"),
        ("interrupted", 4, "Interrupted after 3 steps"),
        (Diverged("step 7, t = 0.1 s: too fast"), 3, "error: step 7"),
        (kernels.ArrayTooLong("an array of 3e9 numbers"), 2, "error: an array of 3e9"),
        (KeyboardInterrupt(), 4, "interrupted"),
        (PermissionError("read-only"), 2, "read-only"),
        (
            NotWritten("checkpoint.h5 cannot be written: disk full"),
            4,
            "make room and continue with: spume run --resume",
        ),
    ],
)
def test_exit_codes_of_a_run(call, monkeypatch, outcome, code, words):
    def stand_in(case, folder, **_):
        if isinstance(outcome, BaseException):
            raise outcome
        return spume.run.Run(case, Ended(), folder, outcome)

    monkeypatch.setattr(spume.run, "run", stand_in)
    result = call("run", "dam-break")
    assert result.exit_code == code
    assert words in result.output


def test_a_folder_that_was_there_stays_where_a_run_is_refused(call, tmp_path):
    (tmp_path / "mine").mkdir()
    assert call("run", "dam-break", "--out", "mine", "--set", "spacing=3.0").exit_code == 2
    assert call("run", "dam-break", "--out", "new", "--set", "spacing=3.0").exit_code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_results_are_promised_once_they_have_a_place(call):
    result = call("run", "dam-break", "--set", "spacing=1e-5")
    assert result.exit_code == 2
    assert "results in" not in result.output


def test_a_folder_that_cannot_be_made(call, tmp_path, monkeypatch):
    def refused(folder, **_):
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr("pathlib.Path.mkdir", refused)
    result = call("run", "dam-break", "--out", tmp_path / "nowhere")
    assert result.exit_code == 2
    assert "nowhere cannot be made: No such file or directory; choose another folder (--out)" in result.output


def test_an_existing_run_is_not_touched(call, tmp_path, monkeypatch):
    monkeypatch.setattr(spume.run, "run", lambda case, folder, **_: spume.run.Run(case, Ended(), folder, "finished"))
    (tmp_path / "dam-break").mkdir()
    (tmp_path / "dam-break" / "log.csv").write_text("precious")
    assert "dam-break-2" in call("run", "dam-break").output
    result = call("run", "dam-break", "--out", "dam-break")
    assert result.exit_code == 2
    assert "nothing is overwritten" in result.output
    assert [path.name for path in (tmp_path / "dam-break").iterdir()] == ["log.csv"]


def test_help_and_cases_are_light():
    code = (
        "import sys; sys.argv = ['spume', 'cases']\n"
        "from spume.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print(sorted({'quadrants', 'matplotlib', 'scipy', 'h5py', 'numpy'} & set(sys.modules)))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.splitlines()[-1] == "[]"
