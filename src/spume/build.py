"""From a case to the rows of the particle table, and to a simulation."""

from __future__ import annotations

import itertools
import logging
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spume import advice
from spume.case import AXES, Case, CaseError, extents
from spume.geometry import Grid, Shape, fill
from spume.geometry.checks import unlikely_sizes, unresolved, volume_of
from spume.geometry.grid import TooManyCellsError
from spume.geometry.layers import masters
from spume.geometry.thickness import other_face
from spume.initial.base import Setting
from spume.moving import bodies_of, moving_together, set_in_motion
from spume.named import Location, nearest_match
from spume.occupied import among, keys_of
from spume.outputs import Snapshot
from spume.particles import BASE_FIELDS, DUMMY, FLUID, WALL
from spume.prediction import host_bytes_per_row, memory
from spume.problems import Problem, point_text
from spume.region import region
from spume.stacked import loads

if TYPE_CHECKING:
    from spume.simulation import Simulation

log = logging.getLogger("spume")

Rows = dict[str, NDArray[Any]]

LARGEST_SPEED = 1e4
"""Largest component of a fluid's initial velocity [m/s]: far beyond where any liquid flows incompressibly."""


def grid_of(case: Case) -> Grid:
    """Return the common lattice of a case's shapes.

    Along a periodic axis it starts at the domain's lower bound, else at the lower corner of the
    first body that the fluid fills (a tank), else of the first fluid.

    Raises:
        CaseError: the period is no multiple of the spacing.
    """
    inner = [getattr(body, "shape", None) for body in case.body if getattr(body, "wet_inside", False)]
    first: Shape = next((shape for shape in inner if shape is not None), case.fluid[0].shape)
    origin = [float(x) for x in first.bounds()[0]]
    problems = []
    for k, (start, period) in case.domain.periods().items():
        origin[k] = start
        cells = period / case.spacing
        if not 0.5 <= cells < 1e9 or abs(cells - round(cells)) > 1e-6 * cells:
            problems.append(
                case.problem(
                    ("spacing",),
                    f"the period along {AXES[k]} is {cells:g} spacings; it must be a whole number of them",
                )
            )
    if problems:
        raise CaseError(problems)
    return Grid(tuple(origin), case.spacing, largest=memory() // host_bytes_per_row(case))


def initial_rows(case: Case) -> Rows:
    """Return all rows of a case at the start: fluids in the case's order, then bodies.

    Returns:
        ``position``, ``velocity``, ``to_surface`` (n, d); ``pressure``, ``density``,
        ``kinematic_viscosity`` (n,); ``kind``, ``body``, ``material``, ``id``, ``master``, ``exposed`` (n,) integers.
        SI units; ``master`` is the id of the wall row that a dummy copies, for other rows their own.

    Raises:
        CaseError: a fluid without particles, fluids that overlap, fluid inside a wall, shapes that the
            spacing cannot resolve, more particles than memory holds.
    """
    grid = grid_of(case)
    for loc, sentence in unlikely_sizes(*extents(case)) if case.dimension == 3 else ():  # before anything is filled
        log.warning("%s: %s", case.origin.name(loc), sentence)
    expected = sum(fluid.shape.measure() for fluid in case.fluid) / case.spacing**case.dimension
    expected += sum(body.expected_rows(case.spacing, case.dimension) for body in case.body)
    _check_memory(case, expected)  # before anything is filled
    wet = _fluid_cells(case, grid)
    solid = _body_rows(case, grid)
    _check_plates(case, grid, solid)
    _check_fluid_and_walls(case, grid, wet, solid)
    above = loads(case, grid, wet)
    rows = _join([*_fluid_rows(case, grid, wet, above), *solid], case.dimension)
    _adopt_fluid(case, rows, np.concatenate(above))
    _check_memory(case, len(rows["kind"]))
    return rows


def _check_memory(case: Case, count: float) -> None:
    """Refuse more particles than this machine's memory holds."""
    need, have = count * host_bytes_per_row(case), memory()
    if need > have:
        message = f"{count:.3g} particles need about {need / 2**30:,.0f} GiB, this machine has "
        message += f"{have / 2**30:,.0f} GiB: choose a larger spacing"
        raise case.error(("spacing",), message)


# ------------------------------------------------------------------------------------------ fluids


def _fluid_cells(case: Case, grid: Grid) -> list[NDArray[np.float64]]:
    """Return the cell centres [m] of each fluid at rest."""
    found: list[NDArray[np.float64]] = []
    problems: list[Problem] = []
    taken: dict[str, NDArray[np.int64]] = {}
    for index, fluid in enumerate(case.fluid):
        loc: Location = ("fluid", index, "shape")
        points = np.empty((0, grid.dimension))
        try:
            shape, moved = fluid.shape.snapped(grid)
            for sentence in moved:
                log.warning("%s: %s", case.origin.name(loc) or f"fluid {fluid.name}", sentence)
            points = fill(shape, grid)
            for sentence in volume_of(shape, grid, len(points)) if len(points) else []:
                log.warning("%s: %s", case.origin.name(loc) or f"fluid {fluid.name}", sentence)
        except TooManyCellsError as error:
            problems.append(case.problem(("spacing",), f"too small for fluid {fluid.name!r}: {error}"))
        except ValueError as error:
            problems.append(case.problem(loc, str(error)))
        else:
            if len(points) == 0:
                problems.append(
                    case.problem(loc, f"no particle fits: it holds no cell of the spacing {grid.spacing:g} m")
                )
        keys = keys_of(grid.cells(points), grid, case)
        if case.domain.periodic and len(np.unique(keys)) < len(keys):
            problems.append(case.problem(loc, "longer than a period of the domain: it overlaps itself"))
        for name, others in taken.items():
            shared = among(keys, others)
            if shared.any():
                first = point_text(points[shared][0])
                message = f"{int(shared.sum())} of the {len(keys)} particles of fluid {fluid.name!r} lie in "
                problems.append(case.problem(loc, f"{message}fluid {name!r}, the first at {first} m"))
        taken[fluid.name] = keys
        found.append(points)
    if problems:
        raise CaseError(problems)
    return found


def _fluid_rows(
    case: Case, grid: Grid, wet: Sequence[NDArray[np.float64]], above: Sequence[NDArray[np.float64]]
) -> list[Rows]:
    """Return the rows of each fluid: displaced, disturbed and set in motion by its initial fields."""
    tables = []
    for index, (fluid, cells) in enumerate(zip(case.fluid, wet, strict=True)):
        setting = _setting(case, index, grid, above[index])
        points = cells
        try:
            for field in fluid.initial:
                points = field.displaced(points, setting)
        except ValueError as error:
            raise case.error(("fluid", index, "initial"), str(error)) from None
        if fluid.disturbance > 0.0:
            reach = fluid.disturbance * case.spacing
            points = points + np.random.default_rng(fluid.seed).uniform(-reach, reach, points.shape)
        points = _wrapped(case, points)
        n = len(points)
        velocity = sum((f.velocity(points, setting) for f in fluid.initial), np.zeros_like(points))
        speed = float(np.abs(velocity).max(initial=0.0))
        if not speed <= LARGEST_SPEED:  # nor is one that is not a number
            message = f"gives a velocity of {speed:.3g} m/s; at most {LARGEST_SPEED:g} m/s is allowed"
            raise case.error(("fluid", index, "initial"), message)
        tables.append(
            {
                "position": points,
                "velocity": velocity,
                "pressure": sum((f.pressure(points, setting) for f in fluid.initial), np.zeros(n)),
                "kind": np.full(n, FLUID),
                "body": np.full(n, -1),
                "material": np.full(n, index),
                "master": np.arange(n),
            }
        )
    return tables


def _setting(case: Case, index: int, grid: Grid, above: NDArray[np.float64]) -> Setting:
    fluid = case.fluid[index]
    lower, upper = fluid.shape.snapped(grid)[0].bounds()
    assert case.domain.gravity is not None
    return Setting(fluid.density, case.domain.gravity.at(0.0), lower, upper, above)


def _wrapped(case: Case, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points moved into the first period of the domain."""
    points = points.copy()
    for k, (low, period) in case.domain.periods().items():
        points[:, k] = low + np.mod(points[:, k] - low, period)
        points[points[:, k] >= low + period, k] = low  # the remainder of -1e-17 is the period itself
    return points


# ------------------------------------------------------------------------------------------ bodies


def _body_rows(case: Case, grid: Grid) -> list[Rows]:
    """Return the rows of each body, without those that coincide with rows of another one."""
    tables: list[Rows] = []
    problems: list[Problem] = []
    for index, body in enumerate(case.body):
        loc: Location = ("body", index)
        try:
            shape = getattr(body, "shape", None)
            for sentence in [] if shape is None else shape.snapped(grid)[1]:
                log.warning("%s: %s", case.origin.name((*loc, "shape")) or f"body {body.name}", sentence)
            rows = body.rows(grid.spacing, grid.dimension, grid.origin)
            if shape is not None and not getattr(body, "wet_inside", True):
                for sentence in unresolved(shape.snapped(grid)[0], grid, rows["position"]):
                    log.warning("%s: %s", case.origin.name((*loc, "shape")) or f"body {body.name}", sentence)
        except TooManyCellsError as error:
            problems.append(case.problem(("spacing",), f"too small for body {body.name!r}: {error}"))
            continue
        except ValueError as error:
            problems.append(case.problem((*loc, "shape"), str(error)))
            continue
        rows["body"] = np.full(len(rows["kind"]), index)
        tables.append(_in_one_period(case, rows))
    if problems:
        raise CaseError(problems)
    return _beside_each_other(case, grid, tables)


def _beside_each_other(case: Case, grid: Grid, tables: list[Rows]) -> list[Rows]:
    """Return the rows of all bodies; those that move together are merged, and yield to none that parts from them.

    What moves away must leave the others whole, so it gives way wherever rows coincide.
    """
    taken = np.empty(0, dtype=np.int64)
    result: dict[int, Rows] = {}
    for members in moving_together(case):
        merged = _merged(case, grid, [tables[i] for i in members], members)
        for index, rows in zip(members, merged, strict=True):
            keep = ~among(keys_of(grid.cells(rows["position"]), grid, case), taken)
            if not keep.all():
                name = case.body[index].name
                log.warning("body %s: %d rows lie in other bodies and are left out", name, int((~keep).sum()))
            result[index] = rows if keep.all() else _kept(rows, keep)
        cells = [keys_of(grid.cells(result[i]["position"]), grid, case) for i in members]
        taken = np.concatenate([taken, *cells])
    return [result[index] for index in range(len(tables))]


def _in_one_period(case: Case, rows: Rows) -> Rows:
    """Return the rows that lie in the first period of a periodic axis; the others are their images."""
    keep = np.ones(len(rows["kind"]), dtype=bool)
    for k, (low, period) in case.domain.periods().items():
        x = rows["position"][:, k]
        keep &= (x > low) & (x < low + period)
    return rows if keep.all() else _kept(rows, keep)


def _kept(rows: Rows, keep: NDArray[np.bool_]) -> Rows:
    """Return some of a body's rows; a dummy that lost its master copies the nearest wall row left."""
    number = np.cumsum(keep) - 1
    lost = ~keep[rows["master"]]
    master = np.where(lost, -1, number[rows["master"]])[keep]
    rows = {name: values[keep] for name, values in rows.items()}
    nearest = masters(rows["position"], rows["kind"] == WALL, rows["to_surface"])
    rows["master"] = np.where(master < 0, nearest, master)
    return rows


def _merged(case: Case, grid: Grid, tables: list[Rows], members: list[int]) -> list[Rows]:
    """Return the rows of several bodies with one row a cell, and dummies where no fluid can reach.

    Where rows coincide a wall row goes before a dummy, then the earlier body. A wall row all of whose
    neighbouring cells are solid (the floor under a block) becomes a dummy.
    """
    if len(tables) == 1:
        return tables
    size = [len(table["kind"]) for table in tables]
    kind = np.concatenate([table["kind"] for table in tables])
    position = np.concatenate([table["position"] for table in tables])
    cells = grid.cells(position)
    keys = keys_of(cells, grid, case)
    order = np.lexsort((np.arange(len(keys)), kind == DUMMY))  # wall rows first, then earlier bodies
    _, first = np.unique(keys[order], return_index=True)
    keep = np.zeros(len(keys), dtype=bool)
    keep[order[first]] = True

    candidates = np.flatnonzero(keep & (kind == WALL))
    enclosed = np.ones(len(candidates), dtype=bool)
    for offset in itertools.product((-1, 0, 1), repeat=grid.dimension):
        near = cells[candidates] + np.array(offset)
        solid = among(keys_of(near, grid, case), keys)
        for body in (case.body[index] for index in members):
            solid |= body.core(grid.centres(near), grid.spacing, grid.origin)
        enclosed &= solid
    demoted = np.zeros(len(keys), dtype=bool)
    demoted[candidates[enclosed]] = True

    result = []
    for table, kept, down in zip(
        tables, np.split(keep, np.cumsum(size)[:-1]), np.split(demoted, np.cumsum(size)[:-1]), strict=True
    ):
        table = dict(table)
        if down.any():
            table["kind"] = np.where(down, DUMMY, table["kind"])
            fresh = masters(table["position"], (table["kind"] == WALL) & kept, table["to_surface"])
            table["master"] = np.where(down | down[table["master"]], fresh, table["master"])
        result.append(table if kept.all() else _kept(table, kept))
    return result


def _check_fluid_and_walls(case: Case, grid: Grid, wet: Sequence[NDArray[np.float64]], solid: Sequence[Rows]) -> None:
    """Refuse fluid in cells of a body's rows or deep inside a body."""
    problems = []
    cells = [keys_of(grid.cells(table["position"]), grid, case) for table in solid]
    for index, (fluid, points) in enumerate(zip(case.fluid, wet, strict=True)):
        keys = keys_of(grid.cells(points), grid, case)
        for body, rows in zip(case.body, cells, strict=True):
            hit = among(keys, rows) | body.core(points, grid.spacing, grid.origin)
            if hit.any():
                first = point_text(points[hit][0])
                message = f"{int(hit.sum())} of the {len(points)} particles of fluid {fluid.name!r} lie in "
                message += f"body {body.name!r}, the first at {first} m"
                if hit.all() and not getattr(body, "wet_inside", True):
                    message += '; if its shape is the room that holds the water, say wetted = "inside"'
                problems.append(case.problem(("fluid", index, "shape"), message))
    if problems:
        raise CaseError(problems)


def _check_plates(case: Case, grid: Grid, solid: Sequence[Rows]) -> None:
    """Refuse plates so thin that the fluids on their two sides would see each other."""
    least = case.step.largest_radius() * grid.spacing
    occupied = np.concatenate([np.empty(0, np.int64), *(keys_of(grid.cells(t["position"]), grid, case) for t in solid)])
    problems = []
    for index, (body, rows) in enumerate(zip(case.body, solid, strict=True)):
        wall = (rows["kind"] == WALL) & np.any(rows["to_surface"] != 0.0, axis=1)
        shape: Shape | None = getattr(body, "shape", None)
        if shape is None or getattr(body, "wet_inside", True) or not wall.any():
            continue
        face, normal = (rows["position"] + rows["to_surface"])[wall], rows["to_surface"][wall]
        normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        across, there, thin = other_face(shape.snapped(grid)[0], face, normal, least)
        behind = grid.cells(there - 0.5 * grid.spacing * normal)
        thin &= ~among(keys_of(behind, grid, case), occupied)  # no fluid can be where another body is
        if thin.any():
            message = f"{across[thin].min():.3g} m thick at {point_text(face[thin][0])} m; a plate must be at least as "
            message += f"thick as the largest re, {least:.3g} m, or the fluids beside it see each other through it"
            problems.append(case.problem(("body", index, "shape"), message))
    if problems:
        raise CaseError(problems)


# ------------------------------------------------------------------------------------- all together


def _join(tables: Sequence[Rows], dimension: int) -> Rows:
    """Return the tables one after the other, numbered; `master` becomes an id."""
    parts: dict[str, list[NDArray[Any]]] = {}
    start = 0
    for table in tables:
        n = len(table["kind"])
        fallback: Rows = {
            "to_surface": np.zeros((n, dimension)),
            "velocity": np.zeros((n, dimension)),
            "pressure": np.zeros(n),
            "exposed": np.zeros(n, dtype=np.int32),
            "material": np.zeros(n, dtype=int),
        }
        for name in ("position", "velocity", "pressure", "to_surface", "exposed", "kind", "body", "material"):
            parts.setdefault(name, []).append(np.asarray(table.get(name, fallback.get(name))))
        parts.setdefault("master", []).append(table["master"] + start)
        start += n
    rows = {name: np.concatenate(values) for name, values in parts.items()}
    rows["id"] = np.arange(start)
    for name in ("kind", "body", "material", "master", "id"):
        rows[name] = rows[name].astype(np.int32)
    return rows


def _adopt_fluid(case: Case, rows: Rows, above: NDArray[np.float64]) -> None:
    """Give every solid row the material of the nearest fluid, and its initial pressure where it is wet.

    `above` is what stands on the fluid's rows [Pa], shape (fluid rows,); a wall row's column is that of the nearest.
    """
    from scipy.spatial import cKDTree

    fluid = rows["kind"] == FLUID
    solid = np.flatnonzero(~fluid)
    # A single fluid that begins at rest and without pressure leaves nothing to look for.
    if len(solid) and (len(case.fluid) > 1 or any(entry.initial for entry in case.fluid)):
        # A tree that is not balanced is built in a third of the time.
        tree = cKDTree(rows["position"][fluid], balanced_tree=False, compact_nodes=False)
        reach = 1.5 * case.spacing if len(case.fluid) == 1 else math.inf
        distance, nearest = tree.query(rows["position"][solid], distance_upper_bound=reach, workers=-1)
        if len(case.fluid) > 1:
            rows["material"][solid] = rows["material"][fluid][nearest]
        near = distance < 1.5 * case.spacing
        wet, above = solid[near], above[nearest[near]]
        grid = grid_of(case)
        for index, entry in enumerate(case.fluid):
            of_it = rows["material"][wet] == index
            mine, setting = wet[of_it], _setting(case, index, grid, above[of_it])
            for field in entry.initial:
                rows["pressure"][mine] += field.pressure(rows["position"][mine], setting)
    density = np.array([entry.density for entry in case.fluid])
    viscosity = np.array([entry.viscosity for entry in case.fluid])
    rows["density"] = density[rows["material"]]
    rows["kinematic_viscosity"] = viscosity[rows["material"]]


def initial_snapshot(case: Case, rows: Rows) -> Snapshot:
    """Return the initial rows as outputs see them."""
    assert case.domain.gravity is not None
    fields = {field.name: field for field in BASE_FIELDS}

    def fetch(name: str) -> NDArray[Any]:
        if name in rows:
            return rows[name]
        shape = (len(rows["kind"]), *fields[name].value_shape(case.dimension))
        return np.full(shape, fields[name].initial)

    return Snapshot(
        fetch,
        time=0.0,
        step=0,
        dt=0.0,
        spacing=case.spacing,
        dimension=case.dimension,
        gravity=case.domain.gravity.at(0.0),
        bodies=tuple(body.name for body in case.body),
        fields=fields,
        periods={k: length for k, (_, length) in case.domain.periods().items()},
    )


def check_gauges(case: Case, rows: Rows) -> None:
    """Refuse gauges and references that do not fit the case, and gauges outside the domain.

    Raises:
        CaseError: every such gauge and reference.
    """
    snapshot = initial_snapshot(case, rows)
    lower = rows["position"].min(axis=0) - case.spacing / 2
    upper = rows["position"].max(axis=0) + case.spacing / 2
    for k, (start, period) in case.domain.periods().items():
        lower[k], upper[k] = start, start + period
    if not case.body and not case.domain.periodic:  # free to go anywhere
        lower, upper = lower - math.inf, upper + math.inf
    problems = []
    for index, gauge in enumerate(case.gauge):
        try:
            gauge.check(snapshot)
        except ValueError as error:
            text = str(error).removeprefix(f"gauge {gauge.name!r}: ")
            problems.append(case.problem(("gauge", index), text))
            continue
        at = np.asarray(getattr(gauge, "at", ()), dtype=float)
        m = min(len(at), case.dimension)
        if m and not np.all((at[:m] >= lower[:m] - 1e-9) & (at[:m] <= upper[:m] + 1e-9)):
            box = f"{point_text(lower[:m])} … {point_text(upper[:m])}"
            problems.append(case.problem(("gauge", index, "at"), f"must lie in the domain, {box} m"))
    columns = {gauge.name: list(gauge.columns(case.dimension)) for gauge in case.gauge}
    for index, reference in enumerate(case.reference):
        try:
            reference.load()
        except ValueError as error:
            problems.append(case.problem(("reference", index, "file"), str(error)))
        known = columns[reference.gauge]
        if reference.value and reference.value not in known:
            near = nearest_match(reference.value, known)
            message = f"must be a column of the gauge: {', '.join(known)}{near}"
            problems.append(case.problem(("reference", index, "value"), message))
    if problems:
        raise CaseError(problems)


def build(
    case: Case, device: str | None = None, threads: int | None = None, precision: str | None = None
) -> Simulation:
    """Return the simulation that a case describes, ready for its first step.

    Args:
        case: the case.
        device: overrides the case's; default: SPUME_DEVICE, else ``cpu``.
        threads: overrides the case's; default: all that the process may use.
        precision: ``double`` or ``single``; overrides the case's.

    Raises:
        CaseError: the case cannot be set up.
        DeviceError: this machine lacks the device or precision.
    """
    from spume import kernels

    if device is not None:
        case = case.model_copy(update={"device": device})
    rows = initial_rows(case)
    check_gauges(case, rows)
    check_size(case, len(rows["kind"]))
    advice.warn(case, initial_snapshot(case, rows))
    threads = threads or case.threads or kernels.worthwhile_threads(len(rows["kind"]))
    kernels.initialize(device or case.device, threads, precision or case.precision)
    return _simulation(case, rows)


def check_size(case: Case, rows: int) -> None:
    """Refuse a case of which one array would have more numbers than the kernel language has indices for.

    Lists of neighbours and matrices lie in several arrays, a field and the coarse levels of the solver in one each.

    Raises:
        CaseError: too many rows.
    """
    from spume.kernels import LONGEST_ARRAY
    from spume.pressure.multigrid import ROOM

    fields = (*BASE_FIELDS, *case.step.needed_fields())
    per_row = {f"the field {f.name!r}": math.prod(f.value_shape(case.dimension)) for f in fields}
    per_row["the solver's coarse levels"] = math.ceil(ROOM[1])
    longest = max(per_row, key=lambda name: per_row[name])
    most = LONGEST_ARRAY // per_row[longest]
    if rows > most:
        message = (
            f"gives {rows:,} particles, walls included; with these models at most {most:,} fit, for the array of "
            f"{longest} has {per_row[longest]} numbers a particle, at most {LONGEST_ARRAY:,}: choose a larger spacing"
        )
        raise CaseError([case.problem(("spacing",), message)])


def _simulation(case: Case, rows: Rows) -> Simulation:
    """Hand the rows to the particle table and put the parts of a simulation together."""
    from spume.clock import Clock
    from spume.domain import Domain
    from spume.lattice import Lattice
    from spume.pairs import Pairs
    from spume.particles import Particles
    from spume.simulation import Simulation

    bodies = bodies_of(case)
    fields = dict.fromkeys(case.step.needed_fields())
    for body in bodies:
        if getattr(body, "motion", None) is not None:
            fields |= dict.fromkeys(body.motion_fields)
    set_in_motion(case, bodies, rows)
    names = [body.name for body in bodies]
    particles = Particles(case.dimension, case.spacing, fields, capacity=len(rows["kind"]), bodies=names)
    solid = rows["kind"] != FLUID
    slip = np.array([getattr(body, "slip", "") == "free-slip" for body in case.body] or [False])
    rows["slip"] = np.where(solid, slip[rows["body"]], False).astype(np.int32)
    rows["wall_velocity"] = np.where(solid[:, None], rows["velocity"], 0.0)
    particles.insert({name: values for name, values in rows.items() if name in particles.fields})
    lower, upper = region(case, rows)
    periodic = [axis in case.domain.periodic for axis in AXES[: case.dimension]]
    radius = case.step.largest_radius() * case.spacing
    try:
        pairs = Pairs(radius, _SKIN * case.spacing, lower, upper, periodic)
    except ValueError as error:
        raise CaseError(
            [case.problem(("spacing",), f"{error}: choose a smaller spacing or a longer period")]
        ) from error
    lattice = Lattice(case.dimension, case.spacing)
    frame = case.domain.motion if case.domain.frame == "tank" else None
    domain = Domain(lattice, particles, pairs, bodies, case.domain.gravity, motion=frame)
    particles.set("wall_acceleration", domain.force(0.0).at_rest(rows["position"]))
    clock = Clock(case.time.end, case.time.courant, case.time.travel, case.time.step_max or math.inf)
    return Simulation(domain, case.step, clock)


_SKIN = 0.2  # of the neighbour lists, as a part of the spacing
