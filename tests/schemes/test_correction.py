"""The corrective matrix is computed once for divergence and gradient of a step, and never kept too long."""

import numpy as np
import pytest

from arrangements import cloud
from spume.build import build
from spume.particles import ANY, FLUID, WALL, Particles
from spume.schemes import correction
from spume.schemes.correction import CORRECTION, bounded_correction_matrix, correction_matrix
from spume.schemes.divergence.blended import Blended as BlendedDivergence
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.free_surface.blended import Blended
from spume.schemes.gradient.completed import Completed
from spume.schemes.operator import Operator
from tanks import STEPS, dam_break

pytestmark = pytest.mark.usefixtures("runtime")


@pytest.fixture
def counted(monkeypatch):
    """Return a list that grows with every matrix that is computed."""
    done = []

    def counting(term, *arguments, **more):
        done.append(term.name)
        return original(term, *arguments, **more)

    original = correction.pair_sum
    monkeypatch.setattr(correction, "pair_sum", counting)
    return done


def test_what_makes_it_stale(counted):
    lattice, particles, pairs, _ = cloud(2, 0.2, (CORRECTION, SURFACE_SHARE))
    operator = Operator()

    def computed(function=bounded_correction_matrix, asked=operator, over=ANY, **more):
        """Whether asking for a matrix computes one."""
        before = len(counted)
        function(asked, lattice, particles, pairs, over, **more)
        return len(counted) > before

    assert computed()
    assert not computed()
    assert computed(floor=0.2)
    assert computed(over=FLUID)
    assert computed(rows=FLUID | WALL)
    assert computed(asked=Operator(re=1.9))
    assert computed(function=correction_matrix)
    assert not computed(function=correction_matrix)
    assert computed()
    particles.set("surface_share", np.full(particles.count, 0.5))
    assert computed()
    particles.set("velocity", particles.numpy("position"))
    assert not computed()
    particles.set("position", 1.01 * particles.numpy("position"))
    assert computed()
    pairs.update(particles)
    assert computed()
    particles.set("correction", np.zeros((particles.count, 2, 2)))
    assert computed()
    particles.insert({"position": [[0.01, 0.02]]})
    pairs.update(particles)
    assert computed()
    particles.remove(particles.numpy("position")[:, 0] > 0.3)
    pairs.update(particles)
    assert computed()


def advanced_positions(step, steps=15):
    simulation = build(dam_break(step=step), threads=1)
    for _ in range(steps):
        simulation.advance()
    return simulation.fetch("position"), simulation


def test_once_a_step_and_the_same_trajectory(counted, monkeypatch):
    models = {"divergence": BlendedDivergence(), "gradient": Completed(), "free_surface": Blended(), "volume_order": 1}
    step = STEPS["project-in-place"](**models)
    kept, simulation = advanced_positions(step)
    assert counted.count("bounded_moment") == simulation.step_index
    counted.clear()
    monkeypatch.setattr(Particles, "keeps", lambda *_: False)
    fresh, _ = advanced_positions(step)
    assert counted.count("bounded_moment") == 2 * simulation.step_index
    # A sum that shares its pass with others is rounded otherwise than one that is made alone.
    assert np.allclose(kept, fresh, rtol=0.0, atol=1e-11)
