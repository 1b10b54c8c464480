import numpy as np
import pytest

from report.unpacked import unpacked
from spume.report.packed import Packed


def walk(frames, rows, seed=0):
    return np.cumsum(np.random.default_rng(seed).normal(0.0, 1.0, (frames, rows)), axis=0)


CHANNELS = {
    "irregular": walk(20, 50),
    "straight": np.arange(30.0)[:, None] * np.linspace(-3.0, 7.0, 40) + walk(1, 40),
    "one frame": walk(1, 30),
    "two frames": walk(2, 30),
    "from end to end": np.where(np.indices((9, 12)).sum(axis=0) % 2, 0.0, 65535.0),
    "negative": walk(10, 5) - 1e4,
}


@pytest.mark.parametrize("values", CHANNELS.values(), ids=CHANNELS)
def test_numbers_come_back_to_half_a_step(values):
    stream = Packed()
    before = stream.add(walk(3, 7, seed=5), 0.1)
    channel = stream.add(values, 0.01)
    assert before["offset"] == 0
    found = unpacked(channel, values.shape[1], stream.text())
    assert np.abs(found - values).max() <= 0.5 * channel["step"] * (1.0 + 1e-9)
    assert channel["step"] == pytest.approx(max(0.01, np.ptp(values) / 65535))


def test_what_does_not_change_is_stored_once():
    stream = Packed()
    channel = stream.add(np.repeat(walk(1, 9), 50, axis=0), 0.01)
    assert (channel["frames"], stream.size) == (1, 18)


def test_even_motion_is_predicted():
    rng = np.random.default_rng(1)
    even = rng.uniform(0, 100, (1, 500)) + np.arange(50.0)[:, None] * rng.uniform(-5, 5, (1, 500))
    sizes = []
    for values in (even, rng.permuted(even, axis=0)):
        stream = Packed()
        order = stream.add(values, 0.01)["order"]
        sizes.append(len(stream.text()))
    assert sizes[0] < 0.25 * sizes[1]
    assert order == 1
    assert Packed().add(even, 0.01)["order"] == 2
