import math

import numpy as np
import pytest

from outputs.fake_run import Simulation, make_run
from spume.outputs import frames, vtkhdf
from spume.outputs.gauge import Recorder
from spume.outputs.gauges import Elevation, Volume
from spume.outputs.output import OutputSettings
from spume.outputs.record import Gauges
from spume.tables import read_columns


class Ramp:
    """Measures 3 t; no subclass of Gauge, or case files would know it while the tests run."""

    name = "ramp"
    reads = ()

    def __init__(self, interval):
        self.interval = interval

    def columns(self, dimension):
        return {"ramp": "m", "count": "1"}

    def measure(self, snapshot):
        CALLS.append(snapshot.step)
        return {"ramp": 3.0 * snapshot.time, "count": snapshot.step}


CALLS: list[int] = []


def record(path, interval, steps=40, dt=0.013):
    CALLS.clear()
    simulation = Simulation(dt=dt)
    recorder = Recorder(Ramp(interval), path)
    recorder.record(simulation.snapshot())
    for _ in range(steps):
        simulation.advance()
        recorder.record(simulation.snapshot())
    recorder.close()
    return read_columns(path)


def test_without_interval_every_step_is_written(tmp_path):
    columns, units = record(tmp_path / "r.csv", None, steps=5)
    np.testing.assert_allclose(columns["time"], 0.013 * np.arange(6))
    np.testing.assert_allclose(columns["ramp"], 3.0 * columns["time"])
    assert units == {"time": "s", "ramp": "m", "count": "1"}
    header = (tmp_path / "r.csv").read_text().splitlines()[0]
    assert header == "time [s],ramp [m],count [1]"


@pytest.mark.parametrize("interval", [0.1, 0.013, 0.004, 0.0131])
def test_an_interval_gives_its_own_instants_by_interpolation(tmp_path, interval):
    columns, _ = record(tmp_path / "r.csv", interval)
    end = 40 * 0.013
    np.testing.assert_allclose(columns["time"], interval * np.arange(len(columns["time"])))
    assert columns["time"][-1] > end - interval - 1e-6
    np.testing.assert_allclose(columns["ramp"], 3.0 * columns["time"], rtol=1e-4, atol=1e-9)


def test_a_gauge_is_measured_only_around_its_instants(tmp_path):
    record(tmp_path / "r.csv", 0.1)
    assert sorted(set(CALLS)) == [0, 7, 8, 15, 16, 23, 24, 30, 31, 38, 39]


def test_a_file_is_readable_after_a_line_was_cut(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("time [s],p [Pa]\n0,1\n0.1,2\n0.2")
    columns, units = read_columns(path)
    assert columns["p"].tolist() == [1.0, 2.0]
    assert units["p"] == "Pa"


def test_a_file_with_a_mistake_names_its_line(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("# comment\ntime,p\n0,1\n0.1,x\n0.2,3\n")
    with pytest.raises(ValueError, match=r"r\.csv:4: 0\.1,x: numbers are allowed"):
        read_columns(path)
    path.write_text("time,p\n0,1\n0.1\n0.2,3\n")
    with pytest.raises(ValueError, match=r"r\.csv:3: 1 numbers under 2 column names"):
        read_columns(path)


def test_gauges_interpolate_fields_of_a_state_that_is_gone(tmp_path):
    """The elevation at an instant between two steps, from the state before and the one after."""
    gauge = Elevation(name="level", at=(0.5,), interval=0.05)
    run = make_run(tmp_path, [gauge, Volume(name="volume")])
    output = Gauges(run.case.gauge)
    output.start(run)
    for _ in range(30):
        run.simulation.advance()
        output.after_step(run)
    output.finish(run)
    columns, _ = read_columns(tmp_path / "gauges" / "level.csv")
    expected = [0.5 + 0.02 * math.sin(10.0 * t) for t in columns["time"]]
    # The water of this simulation is lifted off its floor: what is missing there is seen in five rows of depth.
    np.testing.assert_allclose(columns["elevation"], expected, atol=0.003)
    assert len(read_columns(tmp_path / "gauges" / "volume.csv")[0]["time"]) == 31


def test_two_gauges_of_one_name_are_refused():
    with pytest.raises(ValueError, match="gauge name = 'a': given to two gauges"):
        Gauges([Volume(name="a"), Elevation(name="a", at=(0.5,))])


def test_frames_are_the_first_steps_at_or_after_the_interval(tmp_path):
    run = make_run(tmp_path, settings=OutputSettings(interval=0.05), end=0.3)
    output = frames.Frames(run.case.output)
    output.start(run)
    while run.simulation.time < 0.3:
        run.simulation.advance()
        output.after_step(run)
    output.finish(run)
    with vtkhdf.Reader(tmp_path / frames.FILE) as reader:
        instants = [0.0] + [math.ceil(0.05 * k / 0.013) * 0.013 for k in range(1, 7)]
        np.testing.assert_allclose(reader.times, instants)
        assert reader.attributes["title"] == "A tank"


def test_the_last_state_is_always_a_frame(tmp_path):
    run = make_run(tmp_path, settings=OutputSettings(interval=10.0), end=0.1)
    output = frames.Frames(run.case.output)
    output.start(run)
    for _ in range(3):
        run.simulation.advance()
        output.after_step(run)
    output.finish(run)
    with vtkhdf.Reader(tmp_path / frames.FILE) as reader:
        np.testing.assert_allclose(reader.times, [0.0, 0.039])
