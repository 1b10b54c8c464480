"""What limits a time step."""

import pytest

from spume.clock import Clock
from spume.lattice import Lattice

LATTICE = Lattice(2, 0.1)


@pytest.mark.parametrize(
    ("speed", "relative", "acceleration", "dt", "limiter"),
    [
        (10.0, 1.0, 0.0, 0.5 * 0.1 / 10.0, "travel"),  # a jet whose particles move together
        (10.0, 10.0, 0.0, 0.2 * 0.1 / 10.0, "courant"),
        (0.0, 0.0, 10.0, 0.2 * 0.1, "acceleration"),
    ],
)
def test_the_smallest_limit_decides(speed, relative, acceleration, dt, limiter):
    clock = Clock(100.0)
    assert clock.next_dt(LATTICE, speed, relative, acceleration) == pytest.approx(dt)
    assert clock.limiter == limiter
    assert "time.courant and time.travel (now 0.2 and 0.5)" in clock.shorter


def test_a_step_grows_by_a_fifth():
    clock = Clock(100.0)
    clock.advance(0.001)
    assert clock.next_dt(LATTICE, 1.0, 0.0, 0.0) == pytest.approx(0.0012)
    assert clock.limiter == "growth"
