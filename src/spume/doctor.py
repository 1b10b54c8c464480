"""What an installation of Spume finds on this machine, and what to do about what is missing.

Whatever may crash (a driver, a library) or would disturb the caller (another device, a window) is tried in a
process of its own.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

FOUND, MISSING, BROKEN = "found", "missing", "broken"

ROOM = 1 << 30
"""Space on a disk that is thought enough [bytes]: some hundred frames of a hundred thousand particles."""

TOLERANCE = 0.02
"""Largest relative error of the self-test's pressure [1]; it came to 0.0002 when it was written."""

_SECONDS = 120.0  # that one attempt may take, compilation of kernels included


@dataclass(frozen=True)
class Check:
    """One thing that was looked for.

    Attributes:
        subject: what it belongs to: ``installation``, ``device`` …
        name: what was looked for.
        state: ``found``, ``missing`` or ``broken``.
        value: what was found, or why not.
        remedy: what to do about it; empty where nothing is to be done.
        needed: whether a simulation on this machine needs it.
    """

    subject: str
    name: str
    state: str
    value: str
    remedy: str = ""
    needed: bool = False

    @property
    def ok(self) -> bool:
        """Whether a simulation can run in spite of it."""
        return self.state == FOUND or not self.needed

    def to_json(self) -> dict[str, Any]:
        """Return the attributes as JSON takes them."""
        return asdict(self)


def examine(quick: bool = False, folder: Path | None = None) -> Iterator[Check]:
    """Yield what is found, one thing after the other.

    Args:
        quick: leave out what takes seconds: off-screen rendering and the self-test.
        folder: where results would be written; default: the current folder.
    """
    with contextlib.suppress(ImportError):  # imported first, it keeps the kernel language from printing its version
        from spume import kernels  # noqa: F401
    parts: list[tuple[str, Callable[[], Iterable[Check]]]] = [
        ("installation", installation),
        ("devices", devices),
        ("machine", lambda: machine(Path.cwd() if folder is None else folder)),
        ("pictures", lambda: pictures(quick)),
        ("self-test", lambda: [] if quick else [self_test()]),
    ]
    for subject, part in parts:
        try:
            yield from part()
        except ImportError as error:  # a library that is missing, which the first part has named, hides the others
            yield Check(subject, "all", BROKEN, str(error), "mend the libraries first", needed=True)


# --------------------------------------------------------------------------------------- installation


def installation() -> Iterator[Check]:
    """Yield Python, Spume, the libraries that it needs and the extras that it can use."""
    import spume

    version = platform.python_version()
    known = sys.version_info >= (3, 11)
    yield Check(
        "installation", "Python", FOUND if known else BROKEN, f"{version}, {sys.executable}",
        "" if known else "install Python 3.11 or later", needed=True,
    )  # fmt: skip
    yield Check("installation", "Spume", FOUND, f"{spume.__version__}, {Path(spume.__file__).parent}", needed=True)
    base, extras = requirements()
    for name in base:
        yield _library(name)
    for extra, names in sorted(extras.items(), key=lambda item: [*_SERVES, item[0]].index(item[0])):
        gone = [name for name in names if _version(name) is None]
        there = [f"{name} {_version(name)}" for name in names if name not in gone]
        yield Check(
            "extras", extra, MISSING if gone else FOUND,
            f"without {', '.join(gone)}" if gone else ", ".join(there),
            f'for {_SERVES.get(extra, "it")}: pip install "spume[{extra}]"' if gone else "",
        )  # fmt: skip


_SERVES = {
    "view": "rendered pictures and films of 3D runs",
    "report": "spume report",
    "notebook": "gauges as pandas frames, and notebooks",
    "mpi": "several machines",
    "cluster": "many runs on a cluster",
    "test": "the tests",
    "dev": "development",
    "docs": "the documentation",
}


def requirements() -> tuple[list[str], dict[str, list[str]]]:
    """Return the names of the libraries that every installation needs, and those of each extra, by its name."""
    base: dict[str, None] = {}
    extras: dict[str, list[str]] = {}
    try:
        lines = importlib.metadata.requires("spume") or []
    except importlib.metadata.PackageNotFoundError:  # used from a source tree without being installed
        lines = []
    for line in lines:
        found = re.match(r"[\w.-]+", line)
        extra = re.search(r"extra\s*==\s*['\"]([\w-]+)['\"]", line)
        if found is None:
            continue
        if extra is None:
            base[found[0]] = None
        else:
            extras.setdefault(extra[1], []).append(found[0])
    return list(base), extras


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _library(name: str) -> Check:
    """Look for a library, and import it: one that is installed may still lack something of the system."""
    version = _version(name)
    if version is None:
        return Check("libraries", name, MISSING, "not installed", f"pip install {name}", needed=True)
    try:
        importlib.import_module(name.replace("-", "_"))
    except Exception as error:
        why = f"{version} cannot be imported: {type(error).__name__}: {error}"
        return Check("libraries", name, BROKEN, why, f"pip install --force-reinstall {name}", needed=True)
    return Check("libraries", name, FOUND, version, needed=True)


# -------------------------------------------------------------------------------------------- devices

_OF_SYSTEM = {"cpu": "", "cuda": "not-darwin", "vulkan": "", "metal": "darwin", "amdgpu": "linux"}

_TRY_DEVICE = (
    "import sys; from spume import kernels\n"
    "try: kernels.initialize(sys.argv[1], 1)\n"
    "except kernels.DeviceError as error: print(error); sys.exit(7)\n"
)


def devices() -> Iterator[Check]:
    """Yield every device of the kernel language: whether kernels can run there."""
    from spume.kernels import DEVICES, NEEDS

    wanted = os.environ.get("SPUME_DEVICE") or "cpu"
    if wanted not in DEVICES:
        yield Check(
            "devices", "SPUME_DEVICE", BROKEN, f"{wanted!r} is no device",
            f"set it to one of {', '.join(DEVICES)}, or unset it", needed=True,
        )  # fmt: skip
    there = [device for device in DEVICES if _possible(device)]
    tried = {device: _start("-c", _TRY_DEVICE, device) for device in there}  # all at a time
    for device in DEVICES:
        needed = device in (wanted, "cpu")
        if device not in there:
            remedy = f"set SPUME_DEVICE to one of {', '.join(there)}, or unset it" if needed else ""
            yield Check("devices", device, MISSING, f"does not exist on {platform.system()}", remedy, needed=needed)
            continue
        code, text = _end(tried[device])
        if code == 0:
            default = ", the default" if device == wanted else ""
            yield Check("devices", device, FOUND, f"kernels run there{default}", needed=needed)
        else:
            why = _reason(text) if code == 7 else f"the attempt crashed ({code})"
            remedy = f"needs {NEEDS[device]}" if device in NEEDS else "report it: pip install failed half-way?"
            yield Check("devices", device, MISSING if code == 7 else BROKEN, why, remedy, needed=needed)


def _possible(device: str) -> bool:
    system = _OF_SYSTEM[device]
    return system in ("", sys.platform) or (system.startswith("not-") and system[4:] != sys.platform)


def _reason(text: str) -> str:
    """Return a device's complaint without what it repeats, and without warnings before it."""
    plain = "not available on this machine"
    return plain if plain in text else (text.strip().splitlines() or [""])[-1]


# -------------------------------------------------------------------------------------------- machine


def machine(folder: Path) -> Iterator[Check]:
    """Yield processors, the cache of kernels and the room on the disks.

    Args:
        folder: where results would be written.
    """
    from spume import kernels

    have, use = kernels.processors(), kernels.available_threads()
    limit = next((n for n in ("SLURM_CPUS_PER_TASK", "OMP_NUM_THREADS") if os.environ.get(n)), "")
    less = f", {use} by {limit}" if use < have else ""
    yield Check("machine", "threads", FOUND, f"{have} processors{less}", needed=True)
    cache = kernels.wanted_cache()
    problem = _not_writable(cache)
    yield Check(
        "machine", "cache of kernels", BROKEN if problem else FOUND, f"{cache}{problem}",
        "kernels are compiled anew in every run: set SPUME_CACHE to a folder that can be written" if problem else "",
    )  # fmt: skip
    rooms = [("room for results", folder)] + ([] if problem else [("room for kernels", cache)])
    problem = _not_writable(folder)
    yield Check(
        "machine", "results", BROKEN if problem else FOUND, f"{folder}{problem}",
        "change to a folder that can be written, or run with --out" if problem else "", needed=True,
    )  # fmt: skip
    for name, place in rooms:
        free = _free(place)
        few = free is not None and free < ROOM
        value = "unknown" if free is None else f"{free / 2**30:,.1f} GiB free"
        remedy = "make room: a run stops, with its last checkpoint, when the disk is full" if few else ""
        yield Check("machine", name, BROKEN if few else FOUND, value, remedy)


def _not_writable(folder: Path) -> str:
    """Return why a folder cannot be written, or an empty text."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return f": {error.strerror or error}"


def _free(folder: Path) -> int | None:
    for place in (folder, *folder.parents):
        if place.exists():
            try:
                return shutil.disk_usage(place).free
            except OSError:
                return None
    return None


# ------------------------------------------------------------------------------------------- pictures


def pictures(quick: bool = False) -> Iterator[Check]:
    """Yield what films and rendered pictures need: ffmpeg, and OpenGL without a screen."""
    from spume.outputs import render
    from spume.outputs.film import ffmpeg

    path = ffmpeg()
    yield Check(
        "pictures", "ffmpeg", FOUND if path else MISSING, path or "animations are GIF files",
        "" if path else 'for MP4 files: pip install "spume[view]", or install ffmpeg',
    )  # fmt: skip
    if quick:
        return
    if _version("pyvista") is None:
        yield Check(
            "pictures", "off-screen rendering", MISSING, "needs the extra view",
            'for spume render: pip install "spume[view]"',
        )  # fmt: skip
        return
    works, said = render.available()
    remedy = "" if works else f"OpenGL without a screen is missing: {render.NO_OPENGL}"
    yield Check("pictures", "off-screen rendering", FOUND if works else BROKEN, said, remedy)


# ------------------------------------------------------------------------------------------ self-test

DEPTH = 0.2
"""Depth of the water of the self-test [m]."""


def self_test() -> Check:
    """Run a small tank of water at rest and compare the pressure at its bottom with ρ g H.

    60 steps of 100 fluid particles with the default models; where kernels must be compiled first, that takes some
    ten seconds more, once.
    """
    code, text = _end(_start("-m", "spume.doctor"))
    try:
        figures = json.loads(text.strip().splitlines()[-1])
    except (ValueError, IndexError):
        last = (text.strip().splitlines() or [f"it crashed ({code})"])[-1]
        why = f"no answer within {_SECONDS:g} s" if code is None else last[:200]
        return Check("self-test", "pressure at rest", BROKEN, why, _REPORT, needed=True)
    error = figures["pressure"] / figures["exact"] - 1.0
    value = (
        f"{figures['pressure']:.1f} Pa, exact {figures['exact']:.1f} Pa ({100 * error:+.2f} %); "
        f"{figures['steps']} steps in {figures['seconds']:.1f} s, kernels ready after {figures['compilation']:.1f} s"
    )
    state, remedy = (FOUND, "") if abs(error) <= TOLERANCE else (BROKEN, _REPORT)
    return Check("self-test", "pressure at rest", state, value, remedy, needed=True)


_REPORT = "pip install --force-reinstall spume; if it stays, report it with what spume doctor --json prints"


def run_self_test() -> dict[str, float]:
    """Return pressure [Pa] at the bottom of a tank at rest, the exact one, and what it took [s]."""
    import time

    from spume.bodies.wall import Wall
    from spume.case import Case, Fluid, Time
    from spume.geometry import Box, Tank
    from spume.outputs.gauges.pressure import Pressure

    begin = time.perf_counter()
    width, density, gravity = 0.2, 1000.0, 9.81
    case = Case(
        spacing=0.02,
        time=Time(end=10.0),
        fluid=(Fluid(name="water", density=density, shape=Box(lower=(0.0, 0.0), upper=(width, DEPTH))),),
        body=(Wall(name="tank", shape=Tank(lower=(0.0, 0.0), upper=(width, 1.5 * DEPTH), open=("top",))),),
    )
    simulation = case.build(threads=1)
    simulation.advance()
    ready = time.perf_counter()
    while simulation.step_index < 60 and time.perf_counter() - ready < 10.0:
        simulation.advance()
    measured = Pressure(name="bottom", at=(0.5 * width, 0.0)).measure(simulation.snapshot())
    return {
        "pressure": measured["pressure"],
        "exact": density * gravity * DEPTH,
        "steps": simulation.step_index,
        "seconds": time.perf_counter() - ready,
        "compilation": ready - begin,
    }


# ---------------------------------------------------------------------------------- processes of their own


def _start(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, errors="replace",
    )  # fmt: skip


def _end(process: subprocess.Popen[str], seconds: float = _SECONDS) -> tuple[int | None, str]:
    """Return exit code and output; no exit code where the process had to be killed."""
    try:
        text, _ = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        text, _ = process.communicate()
        return None, text
    return process.returncode, text


if __name__ == "__main__":
    sys.stdout.write(json.dumps(run_self_test()) + "\n")
