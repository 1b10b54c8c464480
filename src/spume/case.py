"""The case: everything that a run needs to know, as frozen objects and as a TOML file."""

from __future__ import annotations

import math
import os
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from spume import named, presets, toml
from spume.bodies import Body
from spume.geometry import Shape
from spume.geometry.checks import mistaken_units
from spume.gravity import Constant, Gravity
from spume.initial import Initial, Rest
from spume.motion import Motion
from spume.named import Location, Parameters, nearest_match
from spume.outputs import Gauge, OutputSettings, Reference
from spume.particles import BASE_FIELDS
from spume.problems import CaseError, Origin, Problem
from spume.schemes.gradient.base import tension_bearing
from spume.steps.base import Step
from spume.steps.project_in_place import ProjectInPlace

if TYPE_CHECKING:
    from spume.run import Run

__all__ = ["Case", "CaseError", "Domain", "Fluid", "Time", "built_in_cases", "load", "schema"]

Positive = Annotated[float, Field(gt=0)]
Label = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\s./\\]+$")]
Initials = Annotated[tuple[Initial, ...], named.OneOrMore()]
AXES = ("x", "y", "z")
if TYPE_CHECKING:
    Preset = str
else:
    Preset = Literal[*presets.names()]  # a new file in the folder is a new preset


class Time(Parameters):
    """How long to simulate, and how long a step may be."""

    end: Positive
    """Time at which the run ends [s]; it starts at zero."""
    step_max: Positive | None = None
    """Largest time step [s]; default: no limit but the others'."""
    courant: Annotated[float, Field(gt=0, le=1)] = 0.2
    """Courant number: the part of a spacing by which two neighbours move against each other in a step [1]."""
    travel: Annotated[float, Field(gt=0, le=2)] = 0.5
    """Largest way of a particle in a step, as a multiple of the spacing [1]."""


class Domain(Parameters):
    """Where the case takes place."""

    gravity: Gravity | None = None
    """Acceleration of gravity [m/s^2]; default: 9.81 downwards, along -y in 2D and -z in 3D."""
    frame: Literal["laboratory", "tank"] = "laboratory"
    """Frame of reference of a tank that moves: its own, with fictitious accelerations, or the laboratory's."""
    motion: Motion | None = None
    """Motion of the whole tank: of every body (their own motions are relative to it) and of the initial fields."""
    periodic: tuple[Literal["x", "y", "z"], ...] = ()
    """Axes along which the domain repeats itself; they need lower and upper."""
    lower: tuple[float, ...] | None = None
    """Lower corner [m]: start of a period, and limit beyond which a particle is removed; default: none."""
    upper: tuple[float, ...] | None = None
    """Upper corner [m]: end of a period, and limit beyond which a particle is removed; default: none."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.lower is None) != (self.upper is None):
            raise ValueError("lower and upper belong together: give both or neither")
        if self.lower is not None and self.upper is not None:
            if len(self.lower) != len(self.upper):
                raise ValueError("lower and upper must have as many numbers")
            if any(a >= b for a, b in zip(self.lower, self.upper, strict=True)):
                raise ValueError(
                    f"lower {list(self.lower)} must be less than upper {list(self.upper)} along every axis"
                )
        if self.periodic and self.lower is None:
            raise ValueError(f"lower and upper must say how long the period along {self.periodic[0]} is")
        if self.frame == "tank" and self.motion is None:
            raise ValueError('frame = "tank" needs the motion of the tank: motion = { kind = …, … }')
        if self.frame == "tank" and getattr(self.motion, "interpolation", "spline") == "linear":
            raise ValueError('frame = "tank" needs a continuous acceleration: interpolation = "spline"')
        if self.frame == "laboratory" and self.motion is not None and self.periodic:
            raise ValueError('a periodic domain cannot move in the laboratory: choose frame = "tank"')
        return self

    def periods(self) -> dict[int, tuple[float, float]]:
        """Return for each periodic axis (0 is x) where a period starts [m] and how long it is [m]."""
        if self.lower is None or self.upper is None:
            return {}
        axes = [AXES.index(axis) for axis in self.periodic]
        return {k: (self.lower[k], self.upper[k] - self.lower[k]) for k in axes}


class Fluid(Parameters):
    """A fluid: what it is, where it is and how it moves at the start."""

    name: Label
    """Label of the fluid, unique in the case."""
    shape: Shape
    """Region that the fluid fills at the start."""
    density: Positive = 1000.0
    """Density [kg/m^3]."""
    viscosity: Annotated[float, Field(ge=0)] = 1.0e-6
    """Kinematic viscosity [m^2/s]."""
    initial: Initials = (Rest(),)
    """Velocity and pressure at the start; several fields are added up."""
    disturbance: Annotated[float, Field(ge=0, le=0.4)] = 0.0
    """Largest random displacement of each coordinate at the start, as a part of the spacing [1]."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the random displacements [1]."""


class Case(Parameters):
    """A simulation: what is simulated, how, and what is measured."""

    title: str = ""
    """What the case is, in one line."""
    spacing: Positive
    """Spacing of the particles l0 [m]."""
    dimension: Literal[2, 3] = 2
    """2: the x-y plane; 3: x, y, z with z up [1]."""
    device: Literal["cpu", "cuda", "vulkan", "metal", "amdgpu"] | None = None
    """Where to compute; default: the environment variable SPUME_DEVICE, else the processor."""
    threads: Annotated[int, Field(ge=1)] | None = None
    """Processor threads [1]; default: all that the process may use."""
    precision: Literal["double", "single"] = "double"
    """Floating-point numbers of 8 or of 4 bytes."""
    preset: Preset = "recommended"
    """Models for a class of problems: defaults of ``step`` and ``time``, before which goes what those say."""
    time: Time
    """End of the run and limits of the time step."""
    tensile: bool = False
    """Whether the flow holds negative pressures (a spinning drop, suction): models that repel or clip are refused."""
    domain: Domain = Domain()
    """Gravity, periodic axes and limits."""
    fluid: tuple[Fluid, ...]
    """The fluids."""
    body: tuple[Body, ...] = ()
    """Walls and everything else that is not fluid."""
    step: Step = ProjectInPlace()
    """The algorithm of a time step and its models."""
    gauge: tuple[Gauge, ...] = ()
    """What is measured."""
    reference: tuple[Reference, ...] = ()
    """Data that gauges are compared with."""
    output: OutputSettings = OutputSettings()
    """What is written, and when."""

    _origin: Origin = PrivateAttr(default_factory=Origin)

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, value: Any) -> Any:
        """Complete the tables with the defaults of the preset."""
        if not isinstance(value, Mapping) or value.get("preset") not in presets.names():
            return value  # a wrong name is answered like any other
        return presets.applied(value["preset"], value, ProjectInPlace.key)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.domain.gravity is None:
            down = Constant(vector=(0.0,) * (self.dimension - 1) + (-9.81,))
            # The object is frozen for its users; this is still its construction.
            self.__dict__["domain"] = self.domain.model_copy(update={"gravity": down})
        found = list(self._inconsistencies())
        if found:
            raise ValidationError.from_exception_data(
                "Case",
                [
                    InitErrorDetails(
                        type=PydanticCustomError("inconsistent", "{message}", {"message": message}),
                        loc=loc,
                        input=value,
                    )
                    for loc, message, value in found
                ],
            )
        return self

    def _inconsistencies(self) -> Iterator[tuple[Location, str, Any]]:
        """Yield place, message and value of everything that contradicts something else."""
        d = self.dimension
        if not self.fluid:
            yield ("fluid",), "a case needs at least one [[fluid]]", ()
        for key in ("fluid", "body", "gauge"):
            names = [item.name for item in getattr(self, key)]
            for index, name in enumerate(names):
                if name in names[:index]:
                    yield (key, index, "name"), f"another {key} already has this name", name
        for index, axis in enumerate(self.domain.periodic):
            if axis == "z" and d == 2:
                yield ("domain", "periodic", index), "must be x or y in a 2D case", axis
        for loc, vector in _vectors(self):
            if len(vector) != d:
                yield loc, f"must have {d} numbers in a {d}D case (dimension = {d})", vector
        for key in ("fluid", "body"):
            for index, item in enumerate(getattr(self, key)):
                yield from _dimensions(item, (key, index), d)
        yield from _sizes(self)
        radius = self.step.largest_radius()
        for index, body in enumerate(self.body):
            layers = getattr(body, "layers", None)
            if layers is not None and layers < math.floor(radius) + 1:
                message = f"must be at least {math.floor(radius) + 1}: the largest re is {radius:g} l0"
                yield ("body", index, "layers"), message, layers
        yield from self._impossible_motions()
        if self.tensile:
            yield from self._repulsive_models()
        yield from self._output_inconsistencies()

    def _impossible_motions(self) -> Iterator[tuple[Location, str, Any]]:
        """Yield what does not fit the case's dimension, or does not last until its end."""
        found: list[tuple[Location, Motion | None, float]]
        found = [(("domain", "motion"), self.domain.motion, self.time.end)]
        for index, body in enumerate(self.body):
            last = min(self.time.end, getattr(body, "until", None) or math.inf)
            found.append((("body", index, "motion"), getattr(body, "motion", None), last))
        for loc, motion, last in found:
            for key, message in () if motion is None else motion.problems(self.dimension, last):
                yield (*loc, key), message, getattr(motion, key)

    def _repulsive_models(self) -> Iterator[tuple[Location, str, Any]]:
        """Yield what turns negative pressures into something else."""
        gradient = self.step.gradient
        if gradient.repels:
            message = (
                f"{gradient.key!r} makes every pair of particles repel, where a flow with negative pressures "
                f"(tensile = true) needs attraction: choose one of {', '.join(tension_bearing())}, or tensile = false"
            )
            yield ("step", "gradient"), message, gradient.key
        if not self.step.negative_pressure:
            message = "sets negative pressures to zero, of which a case with tensile = true has many: choose true"
            yield ("step", "negative_pressure"), message, False

    def _output_inconsistencies(self) -> Iterator[tuple[Location, str, Any]]:
        """Yield what names a field or a gauge that does not exist."""
        every = (*BASE_FIELDS, *self.step.needed_fields())
        fields = {field.name: field for field in every if not field.scratch}
        for index, name in enumerate(self.output.fields):
            if name not in fields:
                message = f"must be a field: {', '.join(sorted(fields))}{nearest_match(name, fields)}"
                yield ("output", "fields", index), message, name
        written = [name for name in self.output.of_frame(fields) if name in fields]
        colours = ["speed"] if "velocity" in written else []
        colours += [name for name in written if fields[name].shape == ()]
        colour = self.output.colour
        if self.output.frames and self.output.pictures and colour not in colours:
            message = f"must be one of {', '.join(colours)}, the scalars among output.fields"
            yield ("output", "colour"), message + nearest_match(colour, colours), colour
        gauges = [gauge.name for gauge in self.gauge]
        for index, reference in enumerate(self.reference):
            name = reference.gauge
            if name not in gauges:
                message = f"must be the name of a gauge: {', '.join(gauges) or '(the case has none)'}"
                yield ("reference", index, "gauge"), message + nearest_match(name, gauges), name

    @property
    def origin(self) -> Origin:
        """Where the values come from: file, lines, overrides."""
        return self._origin

    def error(self, loc: Location, message: str) -> CaseError:
        """Return the error that names the key at `loc` with its file and line, and says what is wrong."""
        return CaseError([self.problem(loc, message)])

    def problem(self, loc: Location, message: str) -> Problem:
        """Return one mistake at a key, to be collected with others."""
        return self._origin.problem(loc, message)

    def build(self, device: str | None = None, threads: int | None = None, precision: str | None = None) -> Any:
        """Return the ``Simulation`` that the case describes; see `spume.build.build`."""
        from spume.build import build

        return build(self, device, threads, precision)

    def run(self, folder: str | os.PathLike[str] | None = None, **options: Any) -> Run:
        """Run the case to its end and write its results into a new folder; see `spume.run.run`."""
        from spume.run import run

        return run(self, folder, **options)

    def plot(self, colour: str | None = None, *, dpi: int = 110, **settings: Any) -> Any:
        """Return matplotlib's figure of the particles at the start; see `spume.simulation.Simulation.plot`.

        Raises:
            CaseError: the case cannot be set up.
        """
        from spume.build import initial_rows, initial_snapshot
        from spume.outputs.pictures import frame_of, plot

        snapshot = initial_snapshot(self, initial_rows(self))
        chosen = colour or ("speed" if snapshot["velocity"].any() else "pressure")  # one colour would show nothing
        return plot(frame_of(snapshot, None if chosen == "speed" else chosen), chosen, dpi, settings, self.title)

    def _repr_html_(self) -> str:
        from spume.notebook import case_html

        return case_html(self)

    def table(self, folder: Path | None = None) -> dict[str, Any]:
        """Return the completed case as the tables of a case file, every key with its value.

        Args:
            folder: files below it are named relative to it; default: all files have their absolute names.
        """
        context = None if folder is None else {"folder": folder.absolute()}
        document: dict[str, Any] = _without_none(self.model_dump(context=context))
        return document

    def to_toml(self, folder: Path | None = None) -> str:
        """Return the completed case as a case file, every key with its value; reading it gives this case.

        Args:
            folder: see `table`: that of the case file.
        """
        return toml.dumps(self.table(folder))


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _without_none(v) for k, v in value.items() if v is not None}
    if isinstance(value, list | tuple):
        return [_without_none(v) for v in value]
    return value


_VECTOR_TYPES = (tuple[float, ...], tuple[float, ...] | None)


def _vectors(case: Case) -> list[tuple[Location, tuple[float, ...]]]:
    """Return every vector of the case that must have as many numbers as the case has dimensions."""
    found: list[tuple[Location, tuple[float, ...]]] = []

    def visit(parameters: Parameters, loc: Location) -> None:
        for name, field in type(parameters).model_fields.items():
            value = getattr(parameters, name)
            if value is None:
                continue
            if field.annotation in _VECTOR_TYPES:
                found.append(((*loc, name), value))
            elif field.annotation == tuple[tuple[float, ...], ...]:
                found.extend(((*loc, name, index), item) for index, item in enumerate(value))

    for key in ("domain", "fluid", "body"):  # gauges and steps check their own
        named.walk(getattr(case, key), visit, (key,))
    return found


def _dimensions(item: Parameters, loc: Location, d: int) -> Iterator[tuple[Location, str, Any]]:
    """Yield the schemes inside an item that do not exist in d dimensions, and faces of other dimensions."""
    found: list[tuple[Location, str, Any]] = []

    def visit(parameters: Parameters, at: Location) -> None:
        exists = getattr(parameters, "dimensions", (2, 3))
        if isinstance(parameters, named.Scheme) and d not in exists:
            message = f"{parameters.key!r} exists in {exists[0]}D only; the case has dimension = {d}"
            found.append((at, message, parameters.key))
        for index, face in enumerate(getattr(parameters, "open", ())):
            if d == 2 and face in ("front", "back"):
                found.append(((*at, "open", index), "must be left, right, bottom or top in a 2D case", face))

    named.walk(item, visit, loc)
    yield from found


def _sizes(case: Case) -> Iterator[tuple[Location, str, Any]]:
    """Yield drawings whose unit does not suit the rest of the case."""
    if case.dimension == 3:
        yield from mistaken_units(*extents(case), case.spacing)


def extents(case: Case) -> tuple[list[tuple[Location, Shape]], list[tuple[float, ...]]]:
    """Return the case's shapes with their places, and the corners [m] of its domain, if it has some."""
    items = [(key, index, item) for key in ("fluid", "body") for index, item in enumerate(getattr(case, key))]
    shapes: list[tuple[Location, Shape]]
    shapes = [((key, index, "shape"), item.shape) for key, index, item in items if hasattr(item, "shape")]
    corners = [corner for corner in (case.domain.lower, case.domain.upper) if corner is not None]
    return shapes, corners


# ------------------------------------------------------------------------------------- case files


def built_in_cases() -> dict[str, Path]:
    """Return name and file of every case that comes with Spume."""
    return {path.parent.name: path for path in sorted(named.CASES.glob("*/case.toml"))}


def find_case(source: str | os.PathLike[str]) -> tuple[Path, str]:
    """Return file and name of a case: a file, a built-in name, or a folder with a ``case.toml``.

    Raises:
        CaseError: there is no such case; the message lists the built-in ones and the nearest.
    """
    path, known = Path(source), built_in_cases()
    if str(source) in known and not path.is_file():
        return known[str(source)], str(source)  # also beside a run folder of that name
    if path.is_dir() and (path / "case.toml").is_file():
        path = path / "case.toml"
    if path.is_file():
        name = path.parent.name if path.name == "case.toml" else path.stem
        return path, name or "case"
    if path.is_dir():
        inside = ", ".join(file.name for file in sorted(path.glob("*.toml"))[:3])
        message = "is a folder, without a case.toml: name the case file in it"
        message += f", such as {inside}" if inside else ""
        raise CaseError([Problem("", f"case {str(source)!r}", "", message)])
    names = ", ".join(known)
    message = f"no such file and no built-in case; built-in: {names}{nearest_match(str(source), known)}"
    raise CaseError([Problem("", f"case {str(source)!r}", "", message)])


def load(
    source: str | os.PathLike[str], overrides: Sequence[str] = (), options: Mapping[str, Any] | None = None
) -> Case:
    """Return the case of a file or of a built-in name, with keys replaced.

    Args:
        source: a TOML file, a built-in name, or a folder that holds ``case.toml`` (as a run's does).
        overrides: ``"time.end=0.1"``, ``"fluid.water.viscosity=0"``: dotted keys, elements of
            arrays of tables by name or number from zero, values as in TOML (text may go without
            quotes).
        options: top-level keys given as options of the command line (``{"threads": 2}``).

    Raises:
        CaseError: every mistake that was found, with ``file:line: key = value: what is allowed``.
    """
    path, label = find_case(source)
    shown = f"{path.parent.name}/{path.name}" if path in built_in_cases().values() else str(source)
    shown = str(path) if Path(source).is_dir() else shown
    try:
        text = path.read_bytes().decode("utf-8-sig")
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CaseError([_syntax(shown, text, error)]) from None
    except (OSError, UnicodeDecodeError, RecursionError) as error:
        raise CaseError([Problem(shown, "", "", f"cannot be read as TOML: {error}")]) from None
    origins: dict[Location, str] = {}
    problems = list(_apply(document, overrides, origins))
    for key, value in (options or {}).items():
        document[key] = value
        origins[key,] = f"--{key}"
    if problems:
        raise CaseError(problems)
    origin = Origin(shown, document, toml.key_lines(text), origins, label)
    return read(document, origin, folder=path.parent)


def read(document: Mapping[str, Any], origin: Origin, *, folder: Path | None = None) -> Case:
    """Return the case that a document describes; files it names are relative to `folder`.

    Raises:
        CaseError: every mistake that was found.
    """
    named.load_all()
    try:
        case = Case.model_validate(document, context={"folder": folder})
    except ValidationError as error:
        raise CaseError(origin.problems(error, Case.table_keys())) from None
    case._origin = origin
    return case


def _syntax(file: str, document: str, error: tomllib.TOMLDecodeError) -> Problem:
    text, _, place = str(error).partition(" (at ")
    line = "".join(c for c in place.partition("line ")[2].partition(",")[0] if c.isdigit())
    message = f"not TOML: {text[:1].lower()}{text[1:]}"
    comma = re.search(r"=\s*([+-]?\d+),(\d+)", document.splitlines()[int(line) - 1]) if line else None
    if comma is not None:
        message += f"; a number has a point, not a comma: {comma[1]}.{comma[2]}"
    return Problem(f"{file}:{line}" if line else file, "", "", message)


def _apply(document: Any, overrides: Iterable[str], origins: dict[Location, str]) -> Iterator[Problem]:
    """Set keys of a document in place, note which, and yield what cannot be done."""
    for override in overrides:
        key, equals, text = override.partition("=")
        option = f"--set {override}"
        parts = [part.strip() for part in key.strip().split(".")]
        if not equals or not all(parts):
            yield Problem(option, "", "", "must read key=value, as time.end=0.1")
            continue
        node: Any = document
        loc: Location = ()
        for number, part in enumerate(parts):
            last = number == len(parts) - 1
            if isinstance(node, list):
                index = _element(node, part)
                if index is None:
                    yield Problem(option, "", "", _no_such_element(node, parts[number - 1], part))
                    break
                at: str | int = index
            else:
                at = part
                if not last and isinstance(node.get(at), str):  # a scheme by name becomes a table of it
                    node[at] = {_selector(node[at]): node[at]}
                if not last and at not in node:
                    node[at] = {}
                    origins[*loc, at] = option
            loc = (*loc, at)
            if last:
                node[at] = toml.read_value(text.strip())
                origins[loc] = option
            else:
                node = node[at]
                if not isinstance(node, dict | list):
                    yield Problem(option, "", "", f"{'.'.join(parts[: number + 1])} has no keys")
                    break


def _element(items: Sequence[Any], part: str) -> int | None:
    if part.isdecimal():
        return int(part) if int(part) < len(items) else None
    return next((i for i, e in enumerate(items) if isinstance(e, dict) and e.get("name") == part), None)


def _no_such_element(items: Sequence[Any], key: str, part: str) -> str:
    names = [str(e.get("name", i)) if isinstance(e, dict) else str(i) for i, e in enumerate(items)]
    there = f"there {'is' if len(names) == 1 else 'are'} {', '.join(names)}" if names else "there is none"
    return f"no {key} is called {part!r}; {there}{nearest_match(part, names)}"


def _selector(name: str) -> str:
    return next((scheme.selector for scheme in named.schemes() if scheme.key == name), "name")


def schema() -> dict[str, Any]:
    """Return the JSON Schema of case files."""
    named.load_all()
    result = named.json_schema(Case)
    result["title"] = "Spume case file"
    return result
