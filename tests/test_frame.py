"""Fictitious accelerations: what is at rest or in free motion in the laboratory, seen from a moving frame."""

import numpy as np
import pytest

from spume.frame import body_force
from spume.gravity import Central, Constant
from spume.motion import Composed, Sinusoid, Uniform

RNG = np.random.default_rng(3)
STEP = 1e-4


def motions(d):
    axis = None if d == 2 else (1.0, 2.0, -0.5)
    roll = Sinusoid(amplitude=(0.1, -0.2, 0.05)[:d], amplitude_deg=25.0, period=1.3, centre=(0.3, -0.2, 0.1)[:d],
                    axis=axis)  # fmt: skip
    spin = Uniform(velocity=(0.1, -0.2, 0.05)[:d], rate_deg=200.0, axis=None if d == 2 else (0.0, 0.3, 1.0))
    return [roll, spin, Composed(outer=roll, inner=spin)]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("which", [0, 1, 2])
@pytest.mark.parametrize("gravity", ["constant", "central"])
def test_a_particle_in_flight_obeys_the_frame(d, which, gravity):
    """Its path in the laboratory, seen from the frame, has the acceleration that the frame gives it."""
    motion = motions(d)[which]
    pull = {"constant": Constant(vector=(0.4, -9.81, 1.0)[:d]), "central": Central(strength=3.0, centre=(0.1,) * d)}
    g = pull[gravity]
    x0, u0, t0 = RNG.uniform(-1, 1, d), RNG.uniform(-2, 2, d), 0.37
    a0 = g.at(t0) - g.stiffness * (x0 - np.asarray(g.focus))

    def seen(t):
        return motion.pose(t, d).origin(x0 + u0 * (t - t0) + 0.5 * a0 * (t - t0) ** 2)

    before, now, after = seen(t0 - STEP), seen(t0), seen(t0 + STEP)
    velocity, acceleration = (after - before) / (2 * STEP), (after - 2 * now + before) / STEP**2
    force = body_force(g, motion, t0)
    spin = np.zeros(3)
    spin[:d] = velocity
    given = force.uniform + force.gradient @ (now - force.focus) - 2.0 * np.cross(force.spin, spin)[:d]
    assert given == pytest.approx(acceleration, abs=2e-3)


def test_without_motion_there_is_gravity_alone():
    force = body_force(Constant(vector=(0.0, -9.81)), None, 1.0)
    assert force.numbers() == (0.0, -9.81, 0.0, *([0.0] * 15))


def test_gravity_turns_with_the_frame():
    force = body_force(Constant(vector=(0.0, -9.81)), Uniform(rate_deg=90.0), 1.0)
    assert force.gravity == pytest.approx([-9.81, 0.0])
