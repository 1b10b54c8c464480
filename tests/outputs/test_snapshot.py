import numpy as np
import pytest

from outputs.fake_run import snapshot_of, tank
from spume.outputs import snapshot as snapshot_module
from spume.outputs.snapshot import Snapshot


def counting_snapshot():
    calls = []

    def fetch(name):
        calls.append(name)
        return np.zeros((3, 2)) if name == "position" else np.arange(3.0)

    made = Snapshot(fetch, time=0, step=0, dt=0.1, spacing=0.1, dimension=2, gravity=[0, -9.81])
    return made, calls


def test_a_field_is_fetched_once_and_only_when_asked():
    made, calls = counting_snapshot()
    assert calls == []
    made["pressure"]
    made["pressure"]
    assert calls == ["pressure"]


def test_arrays_are_read_only():
    made, _ = counting_snapshot()
    with pytest.raises(ValueError, match="read-only"):
        made["pressure"][0] = 1.0


def test_kept_snapshot_lives_on_its_own_copy():
    made, calls = counting_snapshot()
    kept = made.keep(("pressure",))
    assert np.array_equal(kept["pressure"], [0, 1, 2])
    assert calls == ["pressure"]
    with pytest.raises(KeyError, match=r"velocity.*not kept"):
        kept["velocity"]


def test_masks_and_up():
    s = snapshot_of(tank(0.1, 0.5, 0.3, 0.5), 0.1)
    assert s.fluid.sum() == 15
    assert np.array_equal(s.wall, s["kind"] == 2)
    assert np.array_equal(s.up, [0.0, 1.0])


def test_kinds_are_those_of_the_particle_table():
    particles = pytest.importorskip("spume.particles")
    for name in ("FLUID", "WALL", "DUMMY"):
        assert getattr(snapshot_module, name) == getattr(particles, name)
