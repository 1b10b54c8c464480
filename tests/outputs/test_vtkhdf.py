import os
import signal
import subprocess
import sys
import textwrap
import time

import h5py
import numpy as np
import pytest

from outputs.fake_run import snapshot_of, tank
from spume.outputs import vtkhdf

FIELDS = ("velocity", "pressure", "kind", "to_surface")


def moving(step, width=None):
    """Rows of step k: the fluid lifted by k; from step 2 on one particle less, from 4 on three more."""
    rows = tank(0.1, 1.0, 0.5, 0.6, width)
    fluid = rows["kind"] == 1
    rows["position"] = rows["position"] + np.where(fluid, 1.0, 0.0)[:, None] * step
    rows["pressure"] = rows["pressure"] + 10.0 * step
    gone = np.flatnonzero(fluid)[:1] if step >= 2 else np.zeros(0, dtype=int)
    rows = {name: np.delete(values, gone, axis=0) for name, values in rows.items()}
    if step >= 4:
        rows = {name: np.concatenate([values, values[:3]]) for name, values in rows.items()}
        rows["id"][-3:] = 10_000 + np.arange(3)
    return rows


def write(path, steps, width=None):
    writer = vtkhdf.Writer(path, FIELDS, {"title": "test"}, frames=steps)
    for step in range(steps):
        writer.write(snapshot_of(moving(step, width), 0.1, time=0.5 * step, step=step))
    return writer


def assert_frame(frame, step, width=None):
    rows = moving(step, width)
    order = np.argsort(rows["id"])
    assert frame.time == pytest.approx(0.5 * step)
    for name in ("position", "id", *FIELDS):
        np.testing.assert_allclose(frame[name], rows[name][order], rtol=1e-6, atol=1e-6, err_msg=name)


@pytest.mark.parametrize("width", [None, 0.3])
def test_every_frame_reads_back(tmp_path, width):
    path = tmp_path / "run.vtkhdf"
    write(path, 7, width).close()
    with vtkhdf.Reader(path) as reader:
        assert len(reader) == 7
        assert reader.units["pressure"] == "Pa"
        assert reader.attributes["title"] == "test"
        for step in range(7):
            assert_frame(reader.read(step), step, width)
    assert_frame(vtkhdf.read(path), 6, width)


def test_readable_after_every_frame_while_the_run_goes_on(tmp_path):
    path = tmp_path / "run.vtkhdf"
    writer = vtkhdf.Writer(path, FIELDS)
    for step in range(12):
        writer.write(snapshot_of(moving(step), 0.1, time=0.5 * step, step=step))
        with vtkhdf.Reader(path) as reader:  # the writer still has the file open
            assert len(reader) == step + 1
            assert_frame(reader.read(-1), step)
    writer.close()
    assert_frame(vtkhdf.read(path, 11), 11)


def test_what_does_not_change_is_stored_once(tmp_path):
    path = tmp_path / "run.vtkhdf"
    rows = tank(0.1, 1.0, 0.5, 0.6)
    writer = vtkhdf.Writer(path, FIELDS)
    for step in range(5):
        writer.write(snapshot_of(rows | {"pressure": rows["pressure"] + step}, 0.1, time=step, step=step))
    writer.close()
    with h5py.File(path) as file:
        data = file["VTKHDF/PointData"]
        assert data["pressure"].shape[0] == 5 * len(rows["id"])
        assert data["kind"].shape[0] == data["id"].shape[0] == len(rows["id"])
        assert file["VTKHDF/Vertices/Connectivity"].shape[0] == len(rows["id"])


def test_a_frame_counts_only_when_it_is_complete(tmp_path):
    path = tmp_path / "run.vtkhdf"
    writer = write(path, 3)
    counted = writer.steps
    arrays = {"position": np.zeros((5, 3), np.float32), "id": np.arange(5, dtype=np.int32)}
    rows = moving(0)
    arrays |= {name: vtkhdf._stored(rows[name][:5]) for name in FIELDS}
    writer._append(arrays)  # killed before the count was raised
    writer._file.flush()
    with vtkhdf.Reader(path) as reader:
        assert len(reader) == counted
        assert_frame(reader.read(-1), 2)
    if vtk_or_none() is not None:
        assert_vtk_frames(path, 3)


def test_readers_learn_of_a_frame_after_it_is_on_disk(tmp_path):
    """Data, then the number of steps, then the list of times, each flushed before the next."""
    writer = write(tmp_path / "run.vtkhdf", 2)
    file, seen = writer._file, []

    class Watched:
        def __getitem__(self, name):
            return file[name]

        def flush(self):
            file.flush()
            steps, points = file["VTKHDF/Steps"], file["VTKHDF/NumberOfPoints"]
            seen.append((points.shape[0], int(steps.attrs["NSteps"]), steps["Values"].shape[0]))

    writer._file = Watched()
    writer.write(snapshot_of(moving(2), 0.1, time=1.0, step=2))
    assert seen == [(3, 2, 2), (3, 3, 2), (3, 3, 3)]


def test_a_file_cut_short_gives_the_frame_before(tmp_path):
    path = tmp_path / "run.vtkhdf"
    write(path, 3).close()
    with h5py.File(path, "r+") as file:
        points = file["VTKHDF/Points"]
        points.resize(points.shape[0] - 4, axis=0)
    assert_frame(vtkhdf.read(path), 1)
    with pytest.raises(OSError, match="not complete"):
        vtkhdf.read(path, 2)


def test_results_are_never_overwritten(tmp_path):
    path = tmp_path / "run.vtkhdf"
    write(path, 1).close()
    with pytest.raises(FileExistsError, match="never overwritten"):
        vtkhdf.Writer(path)


def test_unknown_frames_and_fields_are_named(tmp_path):
    path = tmp_path / "run.vtkhdf"
    write(path, 1).close()
    with pytest.raises(IndexError, match="frame 4 of 1"):
        vtkhdf.read(path, 4)
    with pytest.raises(KeyError, match="no field 'presure'"):
        vtkhdf.read(path, 0, ["presure"])
    with pytest.raises(FileNotFoundError):
        vtkhdf.read(tmp_path / "none.vtkhdf")


def vtk_or_none():
    try:
        import vtk
    except ImportError:
        return None
    return vtk


def assert_vtk_frames(path, steps, width=None):
    """Compare what VTK, hence ParaView, reads."""
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import vtk_to_numpy

    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == steps
    information = reader.GetOutputInformation(0)
    key = vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    times = [information.Get(key, i) for i in range(information.Length(key))]
    np.testing.assert_allclose(times, 0.5 * np.arange(steps))
    for step in range(steps):
        reader.SetStep(step)
        reader.Update()
        data = reader.GetOutput()
        rows = moving(step, width)
        order = np.argsort(rows["id"])
        d = rows["position"].shape[1]
        points = vtk_to_numpy(data.GetPoints().GetData())
        np.testing.assert_allclose(points[:, :d], rows["position"][order], rtol=1e-6, atol=1e-6)
        assert data.GetNumberOfVerts() == len(order)
        assert data.GetCell(len(order) - 1).GetPointId(0) == len(order) - 1
        arrays = data.GetPointData()
        np.testing.assert_allclose(vtk_to_numpy(arrays.GetArray("pressure")), rows["pressure"][order], rtol=1e-6)
        assert np.array_equal(vtk_to_numpy(arrays.GetArray("id")), rows["id"][order])
        assert arrays.GetArray("velocity").GetNumberOfComponents() == 3


@pytest.mark.parametrize("width", [None, 0.3])
def test_vtk_reads_every_step(tmp_path, width):
    pytest.importorskip("vtk")
    path = tmp_path / "run.vtkhdf"
    write(path, 7, width).close()
    assert_vtk_frames(path, 7, width)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no kill -9 on this system")
def test_readable_after_kill_at_any_instant(tmp_path):
    """A process that writes as fast as it can is killed without warning, again and again."""
    program = textwrap.dedent(
        """
        import sys
        import numpy as np
        from spume.outputs import vtkhdf
        from spume.outputs.snapshot import Snapshot

        writer = vtkhdf.Writer(sys.argv[1], ("pressure",), frames=1000)
        for step in range(10**9):
            rows = 500 + step  # the file grows by more than was expected, so its structure changes often
            fields = {"position": np.full((rows, 2), step), "id": np.arange(rows)}
            fields["pressure"] = np.arange(rows) + step
            writer.write(Snapshot(fields.__getitem__, time=step, step=step, dt=1, spacing=1, dimension=2,
                                  gravity=[0, -1]))
        """
    )
    seen = 0
    waits = np.random.default_rng().uniform(0.0, 0.4, 6)
    for trial, wait in enumerate(waits):
        path = tmp_path / f"{trial}.vtkhdf"
        process = subprocess.Popen([sys.executable, "-c", program, str(path)])
        try:
            deadline = time.monotonic() + 60.0
            while not path.exists() and time.monotonic() < deadline:
                assert process.poll() is None, "the writer failed"
                time.sleep(0.002)
            time.sleep(wait)
        finally:
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
        with vtkhdf.Reader(path) as reader:
            assert len(reader) >= 1
            for step in {0, len(reader) // 2, len(reader) - 1}:
                frame = reader.read(step)
                assert frame.time == step
                assert np.all(frame["position"] == step)
                assert np.array_equal(frame["pressure"], np.arange(500 + step) + step)
            seen += len(reader)
        vtk = vtk_or_none()
        if vtk is not None and trial == 0:
            reader = vtk.vtkHDFReader()
            reader.SetFileName(str(path))
            reader.Update()
            assert reader.GetOutput().GetNumberOfPoints() == 500
    assert seen > len(waits)
