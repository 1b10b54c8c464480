"""From Python: pictures, callbacks between steps, fields as arrays, gauges as tables, how objects show themselves."""

import base64
import io
import re
import sys

import numpy as np
import pytest
from PIL import Image

import spume
from run_folders import write_run
from spume.outputs.gauges import Elevation, Pressure, Volume


@pytest.fixture(scope="module")
def case():
    return spume.Case(
        title="A <small> tank",
        spacing=0.025,
        time=spume.Time(end=0.1),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.1, 0.1]))],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[0.2, 0.2], open=["top"]))],
        gauge=[Volume(name="volume"), Pressure(name="toe", at=[0.2, 0.02])],
    )


@pytest.fixture
def simulation(case):
    return case.build(threads=1)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return spume.open(write_run(tmp_path_factory.mktemp("notebook") / "run"))


def shown(html):
    """The picture in an HTML representation."""
    data = re.search(r'src="data:image/png;base64,([^"]+)"', html)[1]
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))


def test_a_callback_comes_at_multiples_of_its_interval_and_at_the_end(simulation):
    times = []
    simulation.run(every=0.03, callback=lambda s: times.append(s.time))
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(0.1)
    assert len(times) == 5
    # At the first step at or after each multiple: at most a step late.
    assert np.all(np.array(times[1:4]) - np.array([0.03, 0.06, 0.09]) < 0.02)
    assert np.all(np.array(times[1:4]) - np.array([0.03, 0.06, 0.09]) > -1e-4)


def test_a_callback_without_interval_comes_after_each_step_and_can_stop(simulation):
    steps = []
    simulation.run(until=0.05, callback=lambda s: steps.append(s.step_index))
    assert steps == list(range(simulation.step_index + 1))
    assert simulation.time >= 0.05
    before = simulation.step_index
    simulation.run(callback=lambda s: s.step_index >= before + 2)
    assert simulation.step_index == before + 2
    with pytest.raises(ValueError, match=r"every = -1"):
        simulation.run(every=-1.0)


def test_no_step_follows_the_end(case):
    simulation = case.build()
    simulation.run()
    with pytest.raises(RuntimeError, match=r"no step is left: the end, t = .* s, is reached .*later time\.end"):
        simulation.advance()


def test_a_field_is_an_array_that_stays_as_it_was(simulation):
    simulation.advance()
    before = simulation["velocity"]
    kept = before.copy()
    assert before.shape == (len(simulation.snapshot()), 2)
    with pytest.raises(ValueError, match="read-only"):
        before[0] = 0.0
    simulation.advance()
    assert np.array_equal(before, kept)
    assert not np.array_equal(simulation["velocity"], kept)


def test_gauges_become_tables_in_memory(case, simulation):
    history = spume.History(case.gauge)
    simulation.run(every=0.05, callback=history)
    table = history["volume"]
    assert list(history) == ["volume", "toe"]
    assert list(table.columns) == ["time", "volume"]
    assert table.attrs["units"] == {"time": "s", "volume": "m^2"}
    assert table["volume"].iloc[0] == pytest.approx(0.01)
    assert len(table) == 3
    with pytest.raises(KeyError, match="there are volume, toe"):
        history["heel"]
    with pytest.raises(ValueError, match="different names"):
        spume.History([Volume(name="a"), Volume(name="a")])
    with pytest.raises(ValueError, match="1 number in 2D"):
        spume.History([Elevation(name="a", at=[0.1, 0.1])])(simulation)


def test_plots_are_figures_with_units(case, simulation, results):
    for figure in (simulation.plot("pressure"), case.plot(), results[-1].plot("pressure")):
        labels = [axes.get_ylabel() for axes in figure.axes]
        assert "pressure [Pa]" in labels
        assert "y [m]" in labels
        assert figure._repr_png_().startswith(b"\x89PNG")
    assert "speed [m/s]" in [axes.get_ylabel() for axes in simulation.plot().axes]
    with pytest.raises(KeyError, match="colour = 'presure'"):
        simulation.plot("presure")


def test_objects_show_themselves(case, simulation, results):
    assert "A &lt;small&gt; tank" in case._repr_html_()
    assert "0.025 m, 2D" in case._repr_html_()
    simulation.advance()
    for thing, words in (
        (simulation, ("0.1 s, 1 steps", "16 of them fluid")),
        (results, ("finished", "level, volume, energy")),
        (results[0], ("t = 0 s", "pressure", "Pa")),
    ):
        html = thing._repr_html_()
        assert all(word in html for word in words), html[:2000]
        assert np.ptp(shown(html), axis=2).max() > 50  # water is coloured
    assert "0 of 0.1 s" in repr(case.build(threads=1))


def test_results_follow_from_a_run(case, tmp_path):
    run = case.model_copy(update={"output": case.output.model_copy(update={"pictures": False})})
    results = run.run(tmp_path / "run", threads=1).results
    assert results.status == "finished"
    assert results.gauges["volume"]["volume"].iloc[0] == pytest.approx(0.01)


def test_export_to_meshio_and_pyvista(results):
    frame = results[3]
    mesh = frame.to_meshio()
    assert mesh.points.shape == (len(frame), 3)
    assert np.allclose(mesh.points[:, :2], frame.position)
    assert np.allclose(mesh.point_data["velocity"][:, :2], frame["velocity"])
    cloud = frame.to_pyvista()
    assert cloud.n_points == len(frame)
    assert np.allclose(cloud["pressure"], frame["pressure"])
    assert cloud.field_data["time"][0] == frame.time


@pytest.mark.parametrize("name", ["meshio", "pyvista"])
def test_export_without_the_library_names_the_command(results, monkeypatch, name):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(spume.CaseError, match=r'not installed: pip install "spume\[view\]"'):
        getattr(results[0], f"to_{name}")()
