"""The run loop: folders, endings, progress. The simulation is a stand-in."""

import io
import os
import signal
import tomllib

import pytest
from rich.console import Console

import spume
from spume import progress as progress_module
from spume import run as run_module
from spume.progress import Progress, duration
from spume.run import FolderExistsError, make_folder, run_folder
from spume.simulation import Diverged


class StandIn:
    """A simulation of ten steps that may fail."""

    def __init__(self, fail_at=None, error=None):
        self.step_index, self.time, self.dt = 0, 0.0, 0.1
        self.statistics = {"iterations": 7}
        self.fail_at, self.error = fail_at, error

    @property
    def done(self):
        return self.step_index == 10

    def advance(self):
        if self.step_index == self.fail_at:
            raise self.error
        self.step_index += 1
        self.time += self.dt


class Recorder:
    checkpoint = None

    def __init__(self):
        self.said, self.at_step = [], {}
        self.fail_at_end = False

    def start(self, run):
        self.said.append("start")

    def after_step(self, run):
        self.said.append(run.simulation.step_index)
        self.at_step.get(run.simulation.step_index, lambda: None)()

    def finish(self, run):
        self.said.append(run.status)
        self.reason = run.reason
        if self.fail_at_end:
            raise RuntimeError("secondary")


@pytest.fixture
def case():
    return spume.Case(
        spacing=0.1,
        time=spume.Time(end=1.0),
        fluid=[{"name": "a", "shape": spume.Box(lower=[0, 0], upper=[1, 1])}],
    )


@pytest.fixture
def recorder(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    recorder = Recorder()
    monkeypatch.setattr(run_module, "build", lambda *_: StandIn())
    monkeypatch.setattr(run_module, "outputs_of", lambda case: recorder)
    return recorder


def test_a_run_to_its_end(case, recorder, tmp_path):
    run = case.run()
    assert recorder.said == ["start", *range(1, 11), "finished"]
    assert run.status == "finished"
    assert run.folder == tmp_path / "case"
    assert tomllib.loads((run.folder / "case.toml").read_text()) == case.table()
    assert run.threads >= 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_after_the_step(case, recorder, number):
    before = signal.getsignal(number)
    recorder.at_step[3] = lambda: os.kill(os.getpid(), number)
    run = case.run()
    assert recorder.said == ["start", 1, 2, 3, "interrupted"]
    assert run.status == "interrupted"
    assert signal.getsignal(number) is before


def test_a_second_signal_ends_it_at_once(case, recorder):
    def twice():
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)

    recorder.at_step[3] = twice
    with pytest.raises(KeyboardInterrupt):
        case.run()
    assert recorder.said[-1] == "interrupted"


def test_a_failure_is_written_then_raised(case, recorder, monkeypatch):
    monkeypatch.setattr(run_module, "build", lambda *_: StandIn(4, Diverged("too fast")))
    recorder.fail_at_end = True
    with pytest.raises(Diverged, match="too fast"):
        case.run()
    assert recorder.said == ["start", 1, 2, 3, 4, "failed"]
    assert recorder.reason == "too fast"


def test_nothing_is_overwritten(case, recorder, tmp_path):
    first, second, third = case.run().folder, case.run().folder, case.run().folder
    assert [f.name for f in (first, second, third)] == ["case", "case-2", "case-3"]
    with pytest.raises(FolderExistsError, match="case-4"):
        case.run(first)
    (tmp_path / "empty").mkdir()
    assert case.run(tmp_path / "empty").folder == tmp_path / "empty"
    with pytest.raises(FolderExistsError):
        make_folder(tmp_path / "empty" / "case.toml")


def test_a_file_where_a_folder_would_be_is_named(tmp_path):
    (tmp_path / "notes").write_text("precious")
    with pytest.raises(FolderExistsError, match=r"notes is a file, not a folder; choose another \(--out\)$"):
        make_folder(tmp_path / "notes" / "a" / "b")


def test_folder_names(tmp_path):
    assert run_folder("a", tmp_path) == tmp_path / "a"
    (tmp_path / "a").mkdir()
    (tmp_path / "a-2").mkdir()
    assert run_folder("a", tmp_path) == tmp_path / "a-3"


def lines(terminal):
    text = io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=120)
    simulation = StandIn()
    with Progress(console, 1.0) as progress:
        while not simulation.done:
            simulation.advance()
            progress.step(simulation)
    return text.getvalue()


def test_progress_without_a_terminal_is_a_line_a_tenth():
    said = lines(terminal=False).splitlines()
    assert len(said) == 10
    assert said[0] == " 10 %  t = 0.1 / 1 s, dt = 0.1 s, 7 iterations"
    assert "\x1b" not in "".join(said)


def test_progress_in_a_terminal_is_a_bar():
    said = lines(terminal=True)
    assert "\x1b" in said
    assert "7 iterations" in said


def test_time_left_is_the_rest_over_the_recent_speed(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress_module.wall, "monotonic", lambda: now[0])
    progress = Progress(None, 100.0)
    simulation = StandIn()
    simulation.dt = 1.0
    assert progress.left() is None
    for step in range(10):
        now[0] += 5.0 if step < 4 else 2.0  # the first steps compile: they must not count
        simulation.advance()
        progress.step(simulation)
    assert progress.left() == pytest.approx(90 * 2.0)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(3.2, "3 s"), (89, "89 s"), (120, "2 min"), (5999, "1 h 40 min"), (12000, "3 h 20 min")],
)
def test_duration(seconds, words):
    assert duration(seconds) == words
