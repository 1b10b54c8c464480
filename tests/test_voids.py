"""Voids between rows: what is enclosed, its volume, and what becomes of it from step to step."""

import numpy as np
import pytest

from arrangements import block, table
from spume.particles import FLUID, WALL
from spume.voids import Voids

L0 = 0.1
CELLS = {2: 16, 3: 12}


def hollow(d, width=5, shift=0.0, disturbance=0.0, cells=None):
    """Return a block of rows from whose middle a cube of ``width`` rows is missing."""
    position = block(d, cells or CELLS[d] + width % 2, L0)
    middle = np.abs(position).max(axis=1) > width * L0 / 2
    moved = np.random.default_rng(3).uniform(-1, 1, position.shape) * disturbance * L0
    return (position + moved)[middle] + shift * L0


def found(position, voids=None, periods=None, **rows):
    """Return the voids between rows, and their table."""
    _, particles, _ = table(position, L0, **rows)
    return (voids or Voids()).find(L0, particles, periods or {}), particles


def only(volumes):
    (volume,) = volumes.values()
    return volume


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("shift", [0.0, 0.31, [0.5, -3.2, 0.17]])
def test_volume_does_not_depend_on_where_the_cells_lie(every_runtime, d, shift):
    now, _ = found(hollow(d, shift=np.broadcast_to(shift, 3)[:d]))
    assert only(now.volumes) == pytest.approx((5 * L0) ** d, rel=1e-4)


@pytest.mark.parametrize("d", [2, 3])
def test_a_row_inside_takes_its_volume_wherever_it_is(runtime, d):
    around = hollow(d)
    for place in (np.zeros(d), np.full(d, 0.07), np.full(d, 0.155)):
        now, _ = found(np.vstack([around, place]))
        assert only(now.volumes) == pytest.approx((5**d - 1) * L0**d, rel=1e-4)


def test_disorder_changes_the_volume_little_and_encloses_nothing_else(runtime):
    now, _ = found(hollow(2, disturbance=0.2))
    assert only(now.volumes) == pytest.approx(25 * L0**2, rel=0.06)


def test_no_void_in_what_is_full(runtime):
    now, _ = found(block(2, 16, L0, disturbance=0.2))
    assert now.volumes == {}


def test_what_is_too_small_is_left_out(runtime):
    _, particles, _ = table(hollow(2), L0)
    for least, number in ((30 * L0**2, 1), (55 * L0**2, 0)):
        assert len(Voids().find(L0, particles, {}, least).volumes) == number


def test_a_film_of_one_row_closes_a_void_until_a_row_is_missing(runtime):
    position = hollow(2, width=5, cells=7)  # the outermost rows are all that is left
    assert len(found(position)[0].volumes) == 1
    gap = np.argmin(np.abs(position - [0.0, 0.3]).sum(axis=1))
    assert found(np.delete(position, gap, axis=0))[0].volumes == {}


def test_of_a_closed_tank_the_largest_void_is_outside(runtime):
    """Fluid in the middle of a box of solid rows parts it into voids of 40 and 60 cells."""
    position = block(2, 16, L0) + 0.8
    x, y = position.T / L0
    walls = (x < 3) | (x > 13) | (y < 3) | (y > 13)
    water = ~walls & (x > 7) & (x < 9)  # two rows thick, nearer to the left
    water |= ~walls & (x > 9) & (x < 10) & (y < 13)
    position, kind = position[walls | water], np.where(walls, WALL, FLUID)[walls | water]
    now, _ = found(position, kind=kind)
    assert only(now.volumes) == pytest.approx(30 * L0**2, rel=1e-3)


def test_a_dry_void_is_none(runtime):
    """The inside of a hollow body touches no fluid."""
    position = hollow(2)
    ring = np.abs(position).max(axis=1) < 5.4 * L0
    kind = np.where(ring, WALL, FLUID)
    assert found(position, kind=kind)[0].volumes == {}


def test_through_a_periodic_boundary(runtime):
    """A hole that reaches over the end of the period is one, and its air is shown on both sides."""
    period = 16 * L0
    position = hollow(2, width=6) + 0.8
    position[:, 0] = (position[:, 0] + 0.8 - 0.03) % period
    region = ([0.0, -5.0], [period, 5.0])
    voids = Voids()
    now, particles = found(position, voids, {0: period}, region=region, periodic=[True, False])
    assert only(now.volumes) == pytest.approx(36 * L0**2, rel=1e-4)
    voids.show({next(iter(now.volumes)): 7.0}, now, particles, "scalar", 2.1)
    shown, x = particles.numpy("scalar"), particles.numpy("position")
    beside = np.abs(x[:, 1] - 0.8) < 0.2
    nearest = np.minimum(np.abs(x[:, 0] - 0.35), np.abs(x[:, 0] - 1.25))
    assert shown[beside & (nearest < 0.06)] == pytest.approx(7.0)
    assert np.all(shown[beside & (x[:, 0] > 0.6) & (x[:, 0] < 1.0)] == 0.0)


class TestFromStepToStep:
    def test_carried_is_what_left_the_cells(self, runtime):
        """The water on one side of a gap across a periodic strip moves away by a fifth of a row."""
        period, voids = 16 * L0, Voids()
        x, y = np.meshgrid(np.concatenate([np.arange(4), np.arange(9, 13)]) * L0, np.arange(0.5, 16) * L0)
        lines = np.stack([x.ravel(), y.ravel()], axis=1)
        now, particles = found(lines, voids, {1: period}, region=([-5.0, 0.0], [5.0, period]), periodic=[False, True])
        # The outside has two parts, left and right; the gap touches neither.
        (number,) = now.volumes
        assert only(now.volumes) == pytest.approx(5 * L0 * period, rel=1e-4)
        voids.keep(now, {number: (0.3, 1.0)})
        x = particles.numpy("position")
        x[x[:, 0] > 0.6, 0] += 0.02
        particles.set("position", x)
        after = voids.find(L0, particles, {1: period})
        assert voids.carried(after)[number] == pytest.approx(1.0 + 0.02 * period, rel=1e-4)
        assert only(after.volumes) == pytest.approx(only(now.volumes) + 0.02 * period, rel=1e-3)

    def test_parts_share_by_volume(self, runtime):
        """A wall of two rows comes between: a third of the void on one side, two thirds on the other."""
        voids = Voids()
        whole = hollow(2, width=10, cells=20)
        now, _ = found(whole, voids)
        (number,) = now.volumes
        voids.keep(now, {number: (1.0, 1.0)})
        x, y = np.meshgrid([-0.25, -0.15], np.arange(-4.5, 5.0) * L0)
        after, _ = found(np.vstack([whole, np.stack([x.ravel(), y.ravel()], axis=1)]), voids)
        parts = voids.parts(after)
        volumes = sorted(after.volumes.values())
        assert volumes == pytest.approx([20 * L0**2, 60 * L0**2], rel=1e-3)
        assert sorted(parts.values()) == pytest.approx(volumes, rel=1e-9)
        assert {before for _, before in parts} == {number}

    def test_what_rows_leave_brings_no_air(self, runtime):
        """Rows at the edge of a void go away: their cells say nothing of where the air in them comes from."""
        voids = Voids()
        whole = hollow(2, width=6, cells=20)
        now, _ = found(whole, voids)
        (number,) = now.volumes
        voids.keep(now, {number: (1.0, 1.0)})
        edge = (np.abs(whole[:, 0]) < 0.35) & (whole[:, 1] > 0) & (whole[:, 1] < 0.55)
        after, _ = found(whole[~edge], voids)
        (larger,) = after.volumes
        assert after.volumes[larger] == pytest.approx(48 * L0**2, rel=1e-3)
        assert voids.parts(after) == {(larger, number): pytest.approx(after.volumes[larger])}

    def test_what_opens_is_outside(self, runtime):
        voids = Voids()
        closed = hollow(2)
        now, _ = found(closed, voids)
        (number,) = now.volumes
        voids.keep(now, {number: (1.0, 1.0)})
        channel = (np.abs(closed[:, 0]) < 0.16) & (closed[:, 1] > 0)
        after, _ = found(closed[~channel], voids)
        assert after.volumes == {}
        assert set(voids.parts(after)) == {(0, number)}

    def test_state_comes_back(self, runtime):
        voids, other = Voids(), Voids()
        now, particles = found(hollow(2), voids)
        voids.keep(now, {next(iter(now.volumes)): (0.3, 0.2)})
        other.restore(voids.state())
        assert other.air == voids.air
        particles.set("position", particles.numpy("position") * 1.01)
        after = voids.find(L0, particles, {})
        assert other.carried(after) == voids.carried(after)
        assert other.parts(after) == voids.parts(after)
        other.restore({})
        assert other.state() == {}
        assert other.carried(after) == {}


def test_rows_that_fly_far_do_not_make_the_grid_large(runtime):
    position = np.vstack([hollow(2), [[1e5, 1e5]]])
    kind = np.where(np.abs(position).max(axis=1) > 0.75, WALL, FLUID)
    kind[-1] = FLUID
    now, _ = found(position, kind=kind, region=([-1e6] * 2, [1e6] * 2))
    assert now.label.size < 1e5
    assert only(now.volumes) == pytest.approx(25 * L0**2, rel=1e-4)
