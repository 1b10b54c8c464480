"""Pressure systems of any size, on which the solver is measured: what an MPS step assembles, without the step.

Positions are in units of the spacing. Rows of a wall have no equation (state FLUX), as with the default wall model; the
free surface draws the rows there (``Blended``); the right side is 1 plus noise of the same size, so that it excites the
smoothest and the roughest parts of the pressure.

* column: a cube on a floor between side walls, disturbed by up to 0.1 spacings;
* walls: the same, cut by thin walls with a gap at the floor;
* film: four spacings thick, on a floor;
* drops: a column under clusters of 1 to 200 rows;
* disturbed: a column disturbed by up to 0.4 spacings;
* flat, disordered: a column whose upper half is a thousand times lighter; in the second the rows within three spacings
  of the interface are mixed at random;
* dam break: what the built-in case assembles after some time (``dam_break``).
"""

from typing import Any

import numpy as np

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import FLUID, WALL, Particles
from spume.pressure.components import COMPONENT
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.matrix import FLUX, SYSTEM_FIELDS, UNKNOWN, LinearSystem
from spume.pressure.multigrid import Multigrid
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.free_surface.blended import Blended
from spume.schemes.laplacian.original import Original
from spume.schemes.number_density.base import Original as NumberDensity
from spume.schemes.source.base import SOURCE

ARRANGEMENTS = ("column", "walls", "film", "drops", "disturbed")
INTERFACES = ("flat", "disordered", "overturned", "bubbles", "salt")
LAYERS = 2
"""Rows of a wall."""


def lattice_of(shape: tuple[int, ...]) -> np.ndarray:
    """Return the centres of a block of cells whose lower corner is the origin, (n, d)."""
    axes = [np.arange(m) + 0.5 for m in shape]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(shape))


def contained(shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return (position, wall) of a block of water on a floor between side walls that rise above it."""
    d = len(shape)
    outer = (*[m + 2 * LAYERS for m in shape[:-1]], shape[-1] + 2 * LAYERS)
    position = lattice_of(outer) - LAYERS
    size = np.array(shape)
    sides = ((position[:, : d - 1] < 0) | (position[:, : d - 1] > size[: d - 1])).any(axis=1)
    wall = sides | (position[:, -1] < 0)
    kept = wall | (position[:, -1] < size[-1])
    return position[kept], wall[kept]


def clusters(n: int, d: int, width: float, rng: np.random.Generator) -> np.ndarray:
    """Return about n rows in clusters of 1 to 200, far enough apart to be isolated, above z = 0."""
    parts, found, height = [], 0, 0.0
    while found < n:
        columns = lattice_of((max(int(width / 12), 1),) * (d - 1)) * 12.0
        for c in columns:
            radius = rng.uniform(0.5, 4.0)
            drop = lattice_of((8,) * d) - 4.0
            drop = drop[(drop**2).sum(axis=1) < radius**2]
            parts.append(drop + np.append(c, height + 6.0))
            found += len(drop)
        height += 12.0
    return np.vstack(parts)


def arrangement(name: str, n: int, d: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (position [l0], wall, density [kg/m^3]) of about n fluid rows."""
    rng = np.random.default_rng(seed)
    m = max(round(n ** (1 / d)), 6)
    disturbance = 0.4 if name == "disturbed" else 0.1
    if name == "film":
        m = max(round((n / 4) ** (1 / (d - 1))), 6)
        position, wall = contained((*[m] * (d - 1), 4))
    elif name == "drops":
        m = max(round((0.7 * n) ** (1 / d)), 6)
        position, wall = contained((m,) * d)
        drops = clusters(n - m**d, d, m, rng)
        drops[:, -1] += m + 2 * LAYERS + 3
        position, wall = np.vstack([position, drops]), np.append(wall, np.zeros(len(drops), bool))
    else:
        position, wall = contained((m,) * d)
    if name == "walls":
        within = (position[:, 0] % max(m // 4, 8) < 2) & (position[:, -1] > 4) & (position[:, 0] > 2)
        wall |= within & (position[:, -1] < 0.9 * m)
    density = np.full(len(position), 1000.0)
    if name in INTERFACES:
        height = position[:, -1] - 0.5 * m
        mixed = rng.uniform(-3, 3, len(position)) if name == "disordered" else 0.0
        light = height > mixed
        if name == "overturned":
            light = ~light
        elif name == "bubbles":
            light = (((position + 6.0) % 12.0 - 6.0) ** 2).sum(axis=1) < 4.0**2
        elif name == "salt":
            light = rng.uniform(size=len(position)) < 0.3
        density[light] = 1.0
    position = position + rng.uniform(-disturbance, disturbance, position.shape) * ~wall[:, None]
    return position, wall, density


def assembled(name: str, n: int, d: int, seed: int = 0, fields: tuple[Any, ...] = ()) -> tuple[Particles, LinearSystem]:
    """Return (particles, system) of an arrangement of about n fluid rows, the pressure being zero."""
    position, wall, density = arrangement(name, n, d, seed)
    count, spacing = len(position), 1.0
    surface, number_density, laplacian = Blended(), NumberDensity(), Original()
    needs = (
        *SYSTEM_FIELDS, SURFACE_SHARE, SOURCE, COMPONENT, *ConjugateGradient.needs, *Multigrid.needs,
        *surface.needs, *number_density.needs, *fields,
    )  # fmt: skip
    lattice, particles = Lattice(d, spacing), Particles(d, spacing, tuple(dict.fromkeys(needs)), capacity=count)
    rng = np.random.default_rng(seed + 1)
    particles.insert({"position": position, "kind": np.where(wall, WALL, FLUID), "density": density})
    low, high = position.min(axis=0) - 3.0, position.max(axis=0) + 3.0
    pairs = Pairs(laplacian.radius(lattice), 0.0, list(low), list(high), [False] * d)
    pairs.update(particles)  # sorts the rows
    particles.set("source", 1.0 + rng.normal(size=count))
    particles.set("row_state", np.where(particles.numpy("kind") == WALL, FLUX, UNKNOWN))
    number_density(lattice, particles, pairs)
    surface(lattice, particles, pairs, number_density)
    surface.draw(lattice, particles, laplacian, number_density)
    system = LinearSystem(single=True)
    system.assemble(laplacian, lattice, particles, pairs)
    return particles, system


def dam_break(spacing: float, time: float, d: int = 3, threads: int = 1) -> tuple[Particles, LinearSystem]:
    """Return (particles, system) of the built-in dam break at a time [s], the first guess being zero."""
    from spume.build import build
    from spume.case import load

    case = load("dam-break-3d" if d == 3 else "dam-break", [f"spacing={spacing!r}"])
    simulation = build(case, threads=threads)
    while simulation.time < time:
        simulation.advance()
    particles, system = simulation.domain.particles, simulation.domain.system
    reset(particles, system)
    return particles, system


def reset(particles: Particles, system: LinearSystem) -> None:
    """Set the first guess to zero."""
    pressure = particles.numpy(system.solution)
    pressure[particles.numpy(system.state) == UNKNOWN] = 0.0
    particles.set(system.solution, pressure)


def sparse(particles: Particles, system: LinearSystem) -> tuple[Any, np.ndarray]:
    """Return matrix (SciPy, compressed rows) and right side of the unknown rows."""
    unknown = np.flatnonzero(particles.numpy(system.state) == UNKNOWN)
    matrix = system.sparse(particles)
    return matrix[unknown][:, unknown], particles.numpy(system.rhs)[unknown]
