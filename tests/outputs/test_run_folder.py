import json
import time

import numpy as np
import pytest
from PIL import Image

from outputs.fake_run import Simulation, complete, make_run, snapshot_of, tank
from outputs.test_reference import write_csv
from spume.outputs import OutputSettings, Reference, film, outputs_of, pictures, raster, vtkhdf
from spume.outputs.gauges import Elevation, Force, Volume
from spume.outputs.log import Log
from spume.outputs.output import Output, Outputs
from spume.tables import read_columns


def colours_of(path):
    return np.asarray(Image.open(path).convert("RGB"), dtype=int)


@pytest.mark.parametrize("width", [None, 0.3])
def test_a_whole_run_leaves_a_complete_folder(tmp_path, width):
    t = np.linspace(0.0, 0.5, 30)
    file = write_csv(tmp_path / "level_reference.csv", "t,h,low,high", t, 0.5 + 0 * t, 0.45 + 0 * t, 0.55 + 0 * t)
    place = (0.5,) if width is None else (0.5, 0.15)
    gauges = [
        Elevation(name="level", at=place, interval=0.02),
        Volume(name="volume"),
        Force(name="f", body="tank"),
    ]
    reference = Reference(gauge="level", file=str(file), lower="low", upper="high", label="h [m]", source="Nobody")
    folder = tmp_path / "out"
    folder.mkdir()
    settings = OutputSettings(interval=0.05, animation="gif")
    run = make_run(folder, gauges, [reference], settings, simulation=Simulation(width=width))
    complete(run, outputs_of(run.case))

    made = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    assert made == sorted(
        ["animation.gif", "checkpoint.h5", "log.csv", "run.vtkhdf", "snapshot.png", "summary.json"]
        + [f"gauges/{g}.{ending}" for g in ("level", "volume", "f") for ending in ("csv", "png")]
    )
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "finished"
    assert summary["steps"] == run.simulation.step_index == 39
    assert summary["simulated_time"] == pytest.approx(run.simulation.time)
    assert summary["particles_total"] == len(run.simulation.rows["id"])
    assert summary["particles_fluid"] == int(np.sum(run.simulation.rows["kind"] == 1))
    assert summary["pressure_iterations_mean"] == pytest.approx(20.0)
    assert summary["pressure_iterations_max"] == 39
    assert summary["volume_drift"] == pytest.approx(0.0, abs=1e-12)
    assert summary["counts"] == {"removed": 0, "collisions": 78, "clipped": 36}
    assert summary["stage_times"] == {"pressure": 0.25}
    assert (summary["device"], summary["threads"], summary["precision"]) == ("cpu", 2, "double")
    assert 0.0 < summary["wall_time_steps"] < summary["wall_time"]
    expected = 1e6 * summary["wall_time_steps"] / (39 * summary["particles_fluid"])
    assert summary["us_per_fluid_particle_step"] == pytest.approx(expected)
    assert summary["peak_memory_bytes"] > 1e7
    assert summary["comparison"][0]["gauge"] == "level"
    assert summary["comparison"][0]["rms"] == pytest.approx(0.02 / np.sqrt(2), rel=0.2)
    assert summary["version"]

    with Image.open(folder / "animation.gif") as animation:
        assert animation.n_frames == 11
    with vtkhdf.Reader(folder / "run.vtkhdf") as reader:
        assert len(reader) == 11


def test_time_of_steps_leaves_out_outputs_and_compilation(tmp_path):
    class Slow(Output):
        def after_step(self, run):
            time.sleep(0.02)

    run = make_run(tmp_path, settings=OutputSettings(frames=False, pictures=False))
    chosen = outputs_of(run.case).outputs
    outputs = Outputs([Slow(), *chosen])
    outputs.start(run)
    for step in range(12):
        time.sleep(0.2 if step == 0 else 0.005)  # the first step compiles
        run.simulation.advance()
        outputs.after_step(run)
    outputs.finish(run)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["wall_time_compilation"] == pytest.approx(0.195, abs=0.08)
    assert summary["wall_time_steps"] < 0.2
    assert summary["wall_time_outputs"] > 12 * 0.02


def test_log_has_units_every_limiter_and_is_readable_while_the_run_goes_on(tmp_path):
    run = make_run(tmp_path)
    log = Log()
    log.start(run)
    for _ in range(6):
        run.simulation.advance()
        log.after_step(run)
    log.finish(run)
    columns, units = read_columns(tmp_path / "log.csv")
    assert columns["step"].tolist() == [1, 2, 3, 4, 5, 6]
    assert columns["iterations"].tolist() == [1, 2, 3, 4, 5, 6]
    assert columns["clipped"].tolist() == [0, 0, 0, 1, 1, 1]  # a limiter that is used from step 4 on
    assert columns["removed"].tolist() == [0] * 6
    assert columns["residual"][0] == pytest.approx(1e-7)
    assert columns["volume"][-1] == pytest.approx(0.5)
    assert (units["volume"], units["kinetic_energy"], units["time"]) == ("m^2", "J/m", "s")
    assert np.all(np.diff(columns["kinetic_energy"]) > 0.0)


def test_a_log_line_for_several_steps_adds_up_what_was_counted(tmp_path):
    run = make_run(tmp_path)
    log = Log(interval=3)
    log.start(run)
    for _ in range(6):
        run.simulation.advance()
        log.after_step(run)
    log.finish(run)
    columns, _ = read_columns(tmp_path / "log.csv")
    assert columns["step"].tolist() == [3, 6]
    assert columns["collisions"].tolist() == [6, 6]
    assert columns["clipped"].tolist() == [0, 3]


def test_one_failing_output_does_not_keep_the_others_from_finishing(tmp_path):
    class Failing(Output):
        def finish(self, run):
            raise RuntimeError("no ink")

    run = make_run(tmp_path, settings=OutputSettings(frames=False, pictures=False))
    outputs = Outputs([Failing(), *outputs_of(run.case).outputs])
    with pytest.raises(RuntimeError, match="no ink"):
        complete(run, outputs)
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "finished"


def test_an_interruption_at_the_end_leaves_a_summary_and_no_pictures(tmp_path):
    """A second Ctrl-C comes while outputs are finished after the first."""

    class Interrupted(Output):
        def finish(self, run):
            raise KeyboardInterrupt

    run = make_run(tmp_path, settings=OutputSettings(frames=False, pictures=True))
    outputs = Outputs([Interrupted(), *outputs_of(run.case).outputs])
    with pytest.raises(KeyboardInterrupt):
        complete(run, outputs)
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "finished"
    assert not list(tmp_path.rglob("*.png"))


# ----------------------------------------------------------------------------------------- pictures


def test_discs_fill_a_lattice_without_gaps_and_show_the_nearest():
    l0 = 0.1
    centres = (np.stack(np.meshgrid(np.arange(10), np.arange(10)), axis=-1).reshape(-1, 2) + 0.5) * l0
    window = raster.Window(np.zeros(2), np.ones(2), 100.0)
    owner, distance = raster.paint_cells(window, centres, 0.9 * l0)
    assert owner.shape == (100, 100)
    y, x = np.mgrid[0:100, 0:100]
    pixel = np.stack([x + 0.5, 99.5 - y], axis=-1) / 100.0  # the first row of an image is its top
    away = np.linalg.norm(pixel[:, :, None] - centres, axis=3)
    np.testing.assert_allclose(distance, away.min(axis=2), atol=1e-6)
    assert np.array_equal(np.linalg.norm(pixel - centres[owner], axis=2) <= away.min(axis=2) + 1e-6, owner >= 0)


def test_a_disc_has_its_size():
    window = raster.Window(np.zeros(2), np.ones(2), 200.0)
    owner, _ = raster.paint_cells(window, np.array([[0.4, 0.6]]), 0.2)
    assert np.mean(owner == 0) == pytest.approx(np.pi * 0.2**2, rel=0.01)


def test_the_nearer_ball_hides_the_farther():
    camera = raster.Camera(np.zeros(3), np.ones(3), -90.0, 0.0, (200, 200))  # looking along +y
    position = np.array([[0.5, 0.1, 0.5], [0.5, 0.9, 0.5]])
    colours = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], dtype=np.float32)
    for order in ([0, 1], [1, 0]):
        image = raster.paint_spheres(camera, position[order], np.full(2, 0.1), colours[order], np.zeros(2, bool))
        assert image[100, 100].tolist() == [255, 0, 0]
        assert image[5, 5].tolist() == [255, 255, 255]


def test_a_picture_shows_water_wall_and_air_where_they_are(tmp_path):
    rows = tank(0.1, 1.0, 0.5, 1.0)
    frame = pictures.frame_of(snapshot_of(rows, 0.1))
    view = pictures.view_of([frame], OutputSettings(colour_range=(0.0, 1.0)))
    image = pictures.paint(frame, view, (160, 160))
    size = 1.6  # 1 m and three rows of wall on each side; 1.3 m high

    def at(x, y):
        scale = 160 / size
        return image[round(view.size[1] * scale - (y + 0.3) * scale), round((x + 0.3) * scale)].astype(int)

    assert at(0.5, 0.8).tolist() == [255, 255, 255]
    water = at(0.5, 0.2)
    assert water[2] > water[0] + 30  # blue
    wall = at(0.5, -0.05)
    assert np.ptp(wall) < 20  # grey
    assert wall.max() < 200


def test_mp4_falls_back_to_gif_without_ffmpeg(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "ffmpeg", lambda: None)
    monkeypatch.setattr(film, "ffmpeg", lambda: None)
    path = tmp_path / "run.vtkhdf"
    writer = vtkhdf.Writer(path)
    for step in range(3):
        writer.write(snapshot_of(tank(0.1, 1.0, 0.5, 0.6), 0.1, time=step, step=step))
    writer.close()
    with vtkhdf.Reader(path) as reader:
        made = pictures.animate(reader, tmp_path / "animation.mp4")
    assert made.name == "animation.gif"
    assert made.exists()


def test_an_unknown_colour_is_refused_with_the_choices():
    frame = pictures.frame_of(snapshot_of(tank(0.1, 1.0, 0.5, 0.6), 0.1))
    with pytest.raises(KeyError, match=r"colour = 'presure': speed or one of .*pressure"):
        pictures.values_of(frame, "presure")


def test_a_3d_picture_shows_the_water_through_the_front_wall(tmp_path):
    rows = tank(0.1, 1.0, 0.5, 0.7, width=0.3)
    path = pictures.draw_frames([pictures.frame_of(snapshot_of(rows, 0.1))], tmp_path / "p.png", dpi=50)
    image = colours_of(path)
    blue = (image[:, :, 2] > image[:, :, 0] + 40).mean()
    assert 0.05 < blue < 0.8
