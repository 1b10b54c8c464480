"""Size of the page that ``spume report`` makes of a large run, time to open it, and how fast its animation is.

Makes a run folder with the package's own writer (no flow is computed: water that sloshes in a tank, with the
irregular motion that particles have), reports it, opens the page in headless Chromium and lets it play.

    python benchmarks/report_size.py
    python benchmarks/report_size.py --fluid 20000 --frames 50 --dimension 2
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from datetime import date
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import browser
from spume.outputs import vtkhdf
from spume.outputs.machine import _processor
from spume.outputs.snapshot import DUMMY, FLUID, WALL, Snapshot
from spume.report import write_report

LAYERS = 3
DEPTH = 0.5  # m
JITTER = 0.15  # of a spacing, from one frame to the next


def tank(fluid: int, dimension: int) -> tuple[dict[str, np.ndarray], float]:
    """Return rows at rest of a tank 2 m long, 1 m high, 0.4 m wide, filled to its half with so many rows."""
    size = np.array([2.0, 1.0] if dimension == 2 else [2.0, 0.4, 1.0])
    spacing = float((np.prod(size[:-1]) * DEPTH / fluid) ** (1.0 / dimension))
    counts = np.ceil(size / spacing).astype(int)
    ranges = [np.arange(-LAYERS, n + LAYERS) for n in counts[:-1]] + [np.arange(-LAYERS, counts[-1])]
    index = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, dimension)
    position = (index + 0.5) * spacing
    outside = np.any(index[:, :-1] < 0, axis=1) | np.any(index[:, :-1] >= counts[:-1], axis=1) | (index[:, -1] < 0)
    keep = outside | (position[:, -1] < DEPTH)
    position, outside = position[keep], outside[keep]
    upper = np.append(counts[:-1] * spacing, np.inf)
    to_surface = np.where(outside[:, None], np.clip(position, 0.0, upper) - position, 0.0)
    first = np.abs(to_surface).max(axis=1) < 0.6 * spacing
    kind = np.where(outside, np.where(first, WALL, DUMMY), FLUID)
    n = len(kind)
    zeros = np.zeros(n, dtype=int)
    rows = {
        "position": position, "velocity": np.zeros((n, dimension)), "pressure": np.zeros(n),
        "number_density": np.full(n, 6.5), "free_surface": zeros, "kind": kind, "body": np.where(outside, 0, -1),
        "material": zeros, "to_surface": to_surface, "id": np.arange(n),
    }  # fmt: skip
    return rows, spacing


def write_run(folder: Path, fluid: int, frames: int, dimension: int) -> int:
    """Write the run folder; return the number of fluid rows."""
    rows, spacing = tank(fluid, dimension)
    random = np.random.default_rng(0)
    water = rows["kind"] == FLUID
    start = rows["position"][water]
    k, omega = np.pi / 2.0, 4.0
    wander = np.zeros_like(start)
    with_gravity = np.append(np.zeros(dimension - 1), -9.81)
    writer = vtkhdf.Writer(folder / "run.vtkhdf", frames=frames)
    times = np.linspace(0.0, 3.0, frames)
    for number, t in enumerate(times):
        wander = 0.98 * wander + random.normal(0.0, JITTER * spacing, wander.shape)
        depth = start[:, -1] / DEPTH
        swing, rate = 0.35 * np.sin(omega * t), 0.35 * omega * np.cos(omega * t)
        shape = np.zeros_like(start)
        shape[:, 0] = np.sin(k * start[:, 0]) * (0.5 + 0.5 * depth)
        shape[:, -1] = np.cos(k * start[:, 0]) * depth
        position, velocity = rows["position"].copy(), rows["velocity"].copy()
        position[water] = start + swing * shape + wander
        velocity[water] = rate * shape + random.normal(0.0, 0.05, shape.shape)
        pressure = rows["pressure"].copy()
        pressure[water] = 9810.0 * (DEPTH * (1.0 - depth)) * (1.0 + random.normal(0.0, 0.05, len(start)))
        density = rows["number_density"].copy()
        density[water] += random.normal(0.0, 0.1, len(start))
        surface = rows["free_surface"].copy()
        surface[water] = (depth > 0.97).astype(int)
        now = rows | {
            "position": position, "velocity": velocity, "pressure": pressure, "number_density": density,
            "free_surface": surface,
        }  # fmt: skip
        writer.write(
            Snapshot(
                now.__getitem__, time=t, step=number, dt=0.001, spacing=spacing, dimension=dimension,
                gravity=with_gravity, fields={"pressure": SimpleNamespace(unit="Pa", doc="pressure", output=True)},
            )
        )  # fmt: skip
    writer.close()
    write_tables(folder, spacing, dimension, int(water.sum()))
    return int(water.sum())


def write_tables(folder: Path, spacing: float, dimension: int, fluid: int) -> None:
    """Write log, gauges, case and summary, as long as a real run's."""
    steps = 20_000
    t = np.linspace(0.0, 3.0, steps)
    random = np.random.default_rng(1)
    names = "step [1],time [s],dt [s],iterations [1],residual [1],volume [m^3],kinetic_energy [J],potential_energy [J]"
    kinetic = 100.0 * np.cos(4.0 * t) ** 2
    columns = (
        np.arange(steps), t, 1.5e-4 + 0 * t, random.integers(8, 14, steps), random.uniform(1e-6, 1e-5, steps),
        0.4 + 1e-4 * np.sin(t), kinetic, 1000.0 - kinetic,
    )  # fmt: skip
    np.savetxt(folder / "log.csv", np.column_stack(columns), delimiter=",", header=names, comments="", fmt="%.9g")
    (folder / "gauges").mkdir()
    case = ['title = "Water that sloshes, for a measurement"', f"spacing = {spacing!r}", f"dimension = {dimension}"]
    case += ["[time]", "end = 3.0", "[[fluid]]", 'name = "water"', "density = 1000.0", "viscosity = 1e-6"]
    for number in range(8):
        values = np.sin(4.0 * t + number) + random.normal(0.0, 0.05, steps)
        table = np.column_stack([t, values])
        file = folder / "gauges" / f"level-{number}.csv"
        np.savetxt(file, table, delimiter=",", header="time [s],elevation [m]", comments="", fmt="%.9g")
        case += ["[[gauge]]", f'name = "level-{number}"', 'kind = "elevation"']
    (folder / "case.toml").write_text("\n".join(case) + "\n", encoding="utf-8")
    summary = {
        "version": "0",
        "status": "finished",
        "particles_fluid": fluid,
        "dimension": dimension,
        "spacing": spacing,
    }
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")


SCREENS = {
    "1280 x 900": (1280, 900, 1.0),
    "1280 x 900, two pixels per CSS pixel": (1280, 900, 2.0),
    "390 x 844, three pixels per CSS pixel": (390, 844, 3.0),
}


def opened(page: Path, seconds: float, repeats: int) -> dict[str, Any]:
    """Return times to open the page [s], medians (``worked``: of the processor), and what it does on every screen.

    That is: pictures per second; processor time of the page's thread for a picture [ms], which does not depend on what
    else the machine does; size of the picture [pixels], which the page makes smaller where pictures come too slowly.
    """
    ready, worked, charted, screens = [], [], [], {}
    with browser.chromium() as driver:
        driver.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
        for _ in range(repeats):
            browser.screen(driver, 1280, 900)
            driver.get("about:blank")
            begin = time.perf_counter()
            driver.get(page.as_uri())
            wait(driver, "return window.spume && window.spume.ready")
            ready.append(time.perf_counter() - begin)
            worked.append(state(driver)["ThreadTime"])  # the page's process is new
            driver.execute_script("document.querySelector('#gauges').scrollIntoView()")
            wait(driver, "return window.spume.charted > 1")
            charted.append(time.perf_counter() - begin)
        for name, (width, height, ratio) in SCREENS.items():
            browser.screen(driver, width, height, ratio)
            driver.get(page.as_uri())  # anew: it remembers how fine it may draw
            wait(driver, "return window.spume && window.spume.ready")
            driver.execute_script("document.querySelector('#particles').scrollIntoView()")
            driver.execute_script("document.getElementById('rate').value = '0.125'; spume.player.play();")
            time.sleep(1.0)
            before = state(driver)
            time.sleep(seconds)
            after = state(driver)
            count = after["drawn"] - before["drawn"]
            screens[name] = {
                "rate": 1000.0 * count / (after["now"] - before["now"]),
                "work": 1000.0 * (after["ThreadTime"] - before["ThreadTime"]) / count,
                "size": after["size"],
            }
        return {
            "ready": float(np.median(ready)), "worked": float(np.median(worked)),
            "charted": float(np.median(charted)), "screens": screens,
            "complaints": browser.complaints(driver),
        }  # fmt: skip


def state(driver: Any) -> dict[str, Any]:
    metrics = driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    view = "spume.player.views[0]"
    names = f"{{drawn: {view}.drawn, now: performance.now(), size: [{view}.canvas.width, {view}.canvas.height]}}"
    return driver.execute_script(f"return {names}") | {m["name"]: m["value"] for m in metrics}


def wait(driver: Any, script: str, limit: float = 60.0) -> None:
    begin = time.perf_counter()
    while not driver.execute_script(script):
        if time.perf_counter() - begin > limit:
            raise TimeoutError(script)
        time.sleep(0.01)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fluid", type=int, default=100_000, help="fluid particles")
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--dimension", type=int, default=3, choices=(2, 3))
    parser.add_argument("--seconds", type=float, default=5.0, help="wall time that the animation plays")
    parser.add_argument("--repeats", type=int, default=3, help="times the page is opened")
    parser.add_argument("--keep", type=Path, help="folder in which the run folder stays")
    given = parser.parse_args()
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    with tempfile.TemporaryDirectory() as temporary:
        folder = (given.keep or Path(temporary)) / "sloshing"
        folder.mkdir(parents=True)
        fluid = write_run(folder, given.fluid, given.frames, given.dimension)
        begin = time.perf_counter()
        page = write_report(folder)
        made = time.perf_counter() - begin
        print(f"{date.today()}, {_processor()}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, "
              f"Python {platform.python_version()}; load when it began {load:.1f}")  # fmt: skip
        print(f"run: {fluid:,} fluid particles, {given.frames} frames, {given.dimension}D, "
              f"{(folder / 'run.vtkhdf').stat().st_size / 1e6:.0f} MB of frames")  # fmt: skip
        data = json.loads(page.read_text("utf-8").split('id="report">')[1].split("</script>")[0])
        known = data["runs"][0]["particles"]
        shown = {name: group["rows"] for name, group in known["groups"].items()}
        print(f"page: {page.stat().st_size / 1e6:.2f} MB (at most 15), made in {made:.1f} s; shown: {shown} particles, "
              f"{len(known['frames'])} frames")  # fmt: skip
        lacking = browser.missing()
        if lacking:
            print(f"not opened: {lacking}")
            return
        found = opened(page, given.seconds, given.repeats)
        print(f"opens: particles and page in {found['ready']:.2f} s (at most 3), of which the page's thread computes "
              f"{found['worked']:.2f} s; first charts in {found['charted']:.2f} s")  # fmt: skip
        for name, screen in found["screens"].items():
            width, height = screen["size"]
            print(f"animation, {name}: {screen['rate']:.0f} pictures per second (at least 30), "
                  f"{screen['work']:.1f} ms of the processor for each of {width} x {height} pixels")  # fmt: skip
        print(f"console: {found['complaints'] or 'no complaints'}")


if __name__ == "__main__":
    main()
