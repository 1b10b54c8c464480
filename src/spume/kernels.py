"""The one import of the kernel language: device, precision, decorators and array types.

Everything that runs per particle is compiled from Python by Quadrants. Kernels are made by
*factories*: functions that build a kernel for the current precision and dimension and that are
decorated with :func:`cached`, so that choosing another device or precision makes new ones.
"""

import atexit
import contextlib
import functools
import io
import linecache
import logging
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("ENABLE_QUADRANTS_HEADER_PRINT", "False")
os.environ.setdefault("QD_ENABLE_PYBUF", "0")  # in a notebook it would say that it takes over the output of kernels

import numpy as np
import quadrants as qd

from spume import affinity
from spume.fast_start import remember
from spume.launch import launcher

log = logging.getLogger("spume")

func = qd.func
static = qd.static
sqrt = qd.sqrt
i32, i64 = qd.i32, qd.i64
f32 = qd.f32

LONGEST_ARRAY = 2**31 - 1
"""Numbers that one array may hold; a vector of a row counts as d of them. Beyond, 32-bit indices would wrap around."""

DEVICES = ("cpu", "cuda", "vulkan", "metal", "amdgpu")
NEEDS = {
    "cuda": "an NVIDIA card and its driver: nvidia-smi must list it",
    "vulkan": "a driver with Vulkan: vulkaninfo must list the card; on Debian and Ubuntu mesa-vulkan-drivers has one "
    "that computes on the processor",
    "metal": "a Mac with an Apple card",
    "amdgpu": "an AMD card and ROCm: rocminfo must list it",
}
"""What a device needs of the machine."""
PRECISIONS = ("double", "single")


class DeviceError(RuntimeError):
    """The device or precision that was asked for is not to be had on this machine."""


class ArrayTooLong(RuntimeError):
    """More numbers were to go into one array than there are indices for."""


@dataclass(frozen=True)
class Runtime:
    """What the kernels are compiled for.

    Attributes:
        device: one of ``DEVICES``.
        threads: processor threads.
        precision: ``double`` or ``single``.
        wide: whether thousands of short threads work in place of a few long ones (see `spume.lanes`).
    """

    device: str
    threads: int
    precision: str
    wide: bool = False

    @property
    def serial(self) -> bool:
        """One CPU thread: loops are compiled without the thread pool, whose wake-up costs 10 to 20 µs each."""
        return self.device == "cpu" and self.threads == 1

    @property
    def real(self) -> Any:
        """The floating-point type of the kernel language."""
        return qd.f64 if self.precision == "double" else qd.f32

    @property
    def dtype(self) -> type[np.floating[Any]]:
        """The floating-point type of NumPy."""
        return np.float64 if self.precision == "double" else np.float32


_runtime: Runtime | None = None
_pool: affinity.Pool | None = None
_caches: list[Callable[[], None]] = []


def available_threads() -> int:
    """Return the number of CPU threads this process may use.

    The smaller of `processors` and of what the surroundings ask for: SLURM_CPUS_PER_TASK, or where that is not
    set OMP_NUM_THREADS.
    """
    asked = [text for name in ("SLURM_CPUS_PER_TASK", "OMP_NUM_THREADS") if (text := os.environ.get(name, "").strip())]
    first = asked[0].split(",")[0] if asked else ""  # OMP_NUM_THREADS may list nested levels: 4,2
    wanted = int(first) if first.isdecimal() else 0
    return min(processors(), wanted) if wanted > 0 else processors()


def processors() -> int:
    """Return the number of processors this process may use.

    The smaller of what the operating system allows (affinity) and what a container allows (the quota of its
    control group, rounded up).
    """
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    granted = quota(Path("/sys/fs/cgroup"))
    return min(allowed, granted) if granted > 0 else allowed


def possible_threads(asked: int) -> int:
    """Return a number of threads, at most one for each processor, beyond which threads only wait for each other."""
    if asked > (have := processors()):
        log.warning("threads = %d: this process may use %d processors; %d threads compute", asked, have, have)
        return have
    return asked


def quota(root: Path) -> int:
    """Return the whole number of processors that a control group's quota allows, zero without one.

    Args:
        root: where the control group's files are; both versions of the interface are understood.
    """
    try:
        if (root / "cpu.max").is_file():
            share, period = (root / "cpu.max").read_text(encoding="ascii").split()
        else:
            share = (root / "cpu" / "cpu.cfs_quota_us").read_text(encoding="ascii")
            period = (root / "cpu" / "cpu.cfs_period_us").read_text(encoding="ascii")
        return max(0, -(-int(share) // int(period)))
    except (OSError, ValueError, ZeroDivisionError):  # no such files, or "max"
        return 0


def wanted_cache() -> Path:
    """Return where compiled kernels should go, whether or not that folder can be written.

    That of the environment variable SPUME_CACHE, else ``spume`` in the user's cache folder (XDG_CACHE_HOME,
    else ``~/.cache``).
    """
    if os.environ.get("SPUME_CACHE"):
        return Path(os.environ["SPUME_CACHE"])
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(home) / "spume"


def cache_folder() -> Path:
    """Return the folder of compiled kernels, which exists and can be written.

    That of `wanted_cache`; where it cannot be written, a temporary one of this process, which goes with it.
    """
    wanted = wanted_cache()
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except OSError as error:
        folder = _temporary_cache()
        log.warning(
            "%s cannot hold compiled kernels (%s): they go to %s and are compiled again next time; "
            "set SPUME_CACHE to a folder that can be written",
            wanted,
            error.strerror or error,
            folder,
        )
        return folder


@functools.cache
def _temporary_cache() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="spume-cache-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def worthwhile_threads(rows: int) -> int:
    """Return how many threads pay for a table of that many rows.

    Waking the thread pool costs 10 to 20 µs a loop, of which a step has a hundred.
    """
    return available_threads() if rows > 8_000 else 1


def light(rows: int) -> bool:
    """Return whether a loop of few operations a row runs faster on one thread than through the thread pool."""
    return runtime().serial or (runtime().device == "cpu" and rows < 40_000)


def spread(parts: int) -> int:
    """Return how many iterations a loop over so many long parts must have for each of them, for all threads to work.

    The kernel language hands a thread 512 iterations at a time, whatever the ``block_dim``: a loop over fewer parts
    would run on one thread alone. So ``for t in range(parts * spread)`` does part t // spread where t % spread == 0.
    """
    if runtime().device != "cpu" or runtime().serial:
        return 1
    return max(1, 512 * min(parts, 8 * runtime().threads) // parts)


def default_device() -> str:
    """Return the device that is taken where none is asked for: that of ``SPUME_DEVICE``, else ``cpu``."""
    return os.environ.get("SPUME_DEVICE") or "cpu"


def initialize(device: str | None = None, threads: int | None = None, precision: str = "double") -> Runtime:
    """Choose device, threads and precision; return what was chosen.

    Arrays made before are lost, so a program calls this once, before it makes particles. Calling it
    again with the same choice changes nothing.

    Args:
        device: one of ``DEVICES``; default: the environment variable ``SPUME_DEVICE``, else ``cpu``.
        threads: CPU threads, at most one for each processor; default: all that the process may use.
        precision: ``double`` or ``single``.

    Raises:
        DeviceError: unknown name, or a device that is not there.
    """
    global _runtime, _pool
    device = device or default_device()
    if device not in DEVICES:
        raise DeviceError(f"device = {device!r}: one of {', '.join(DEVICES)}")
    if precision not in PRECISIONS:
        raise DeviceError(f"precision = {precision!r}: one of {', '.join(PRECISIONS)}")
    if threads is not None and threads < 1:
        raise DeviceError(f"threads = {threads}: at least 1")
    threads = available_threads() if threads is None else possible_threads(threads)
    # For tests, SPUME_WIDE=1 asks the processor to work as other devices do, which is slow there.
    wanted = Runtime(device, threads, precision, device != "cpu" or os.environ.get("SPUME_WIDE") == "1")
    if wanted == _runtime:
        return wanted
    folder = cache_folder()
    before = affinity.threads_of_process()
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            qd.init(
                arch=getattr(qd, device),
                default_fp=wanted.real,
                default_ip=qd.i32,
                cpu_max_num_threads=wanted.threads,
                fast_math=True,
                enable_fallback=False,
                log_level="error",
                offline_cache=True,
                offline_cache_file_path=str(folder),
            )
    except Exception as error:
        lacking = device in NEEDS and "not supported" in str(error)  # the language names itself only
        needs = f"it needs {NEEDS[device]}" if lacking else str(error)
        raise DeviceError(f"device = {device!r}: not available on this machine: {needs}") from error
    _runtime, _pool = wanted, affinity.Pool(before, threads if device == "cpu" else 1)
    for clear in _caches:
        clear()
    return wanted


def runtime() -> Runtime:
    """Return what the kernels are compiled for; initialise with the defaults if nothing was chosen."""
    return _runtime if _runtime is not None else initialize()


def cached(factory: Callable[..., Any]) -> Callable[..., Any]:
    """Remember what a kernel factory made, by its arguments, until device or precision change."""
    wrapped = functools.cache(factory)
    _caches.append(wrapped.cache_clear)
    return wrapped


def vector(d: int) -> Any:
    """Return the type of a vector of d reals."""
    return qd.types.vector(d, runtime().real)


def value_type(shape: tuple[int, ...], integer: bool = False) -> Any:
    """Return the kernel language's type of one value: scalar, vector or matrix."""
    scalar = qd.i32 if integer else runtime().real
    if shape == ():
        return scalar
    if len(shape) == 1:
        return qd.types.vector(shape[0], scalar)
    return qd.types.matrix(shape[0], shape[1], scalar)


def accumulator() -> Any:
    """Return the type for sums of many rows: double precision wherever there is such a thing."""
    return qd.f32 if runtime().device == "metal" else qd.f64


def array_type(value: Any) -> Any:
    """Return the annotation of a kernel argument that is a one-dimensional array of such values."""
    return qd.types.ndarray(dtype=value, ndim=1)


def array(value: Any, size: int) -> Any:
    """Return a new device array of ``size`` zero values.

    Raises:
        ArrayTooLong: more than ``LONGEST_ARRAY`` numbers, which the kernel language would not refuse but overrun.
    """
    numbers = size * getattr(value, "n", 1) * getattr(value, "m", 1)
    if numbers > LONGEST_ARRAY:
        raise ArrayTooLong(f"an array of {numbers:,} numbers ({size:,} values): at most {LONGEST_ARRAY:,} fit into one")
    return qd.ndarray(value, (size,))  # the language makes it of zeros


def host(data: Any) -> np.ndarray[Any, Any]:
    """Return a device array as a NumPy array, shape (size, *shape of a value).

    It is the device's own memory where that is the processor, else a copy.

    Use :func:`publish` after writing to it.
    """
    qd.sync()
    return np.asarray(data.to_numpy(copy=None))


def value(data: Any, index: int) -> Any:
    """Return one number of a device array of numbers, without a copy of the others."""
    return host(data)[index] if runtime().device == "cpu" else data[index]


def publish(data: Any, values: np.ndarray[Any, Any]) -> None:
    """Make what was written to the array from :func:`host`, of its shape, the device array's content."""
    if values.flags.owndata:
        data.from_numpy(values)


def scalar_array(value: Any) -> Any:
    """Return a new device array that holds one value and has no index (a loop counter)."""
    return qd.ndarray(value, ())


def struct(**members: Any) -> Any:
    """Return a struct type of the kernel language."""
    return qd.types.struct(**members)


def compiled(name: str, source: str, *, graph: bool = False, **namespace: Any) -> Any:
    """Compile generated source text of one function into a kernel; ``graph`` as in `kernel`."""
    return kernel(_defined(name, source, namespace), graph=graph)


def compiled_function(name: str, source: str, **namespace: Any) -> Any:
    """Compile generated source text into a function that kernels call."""
    return qd.func(_defined(name, source, namespace))


def _defined(name: str, source: str, namespace: dict[str, Any]) -> Any:
    """Return the function that a text defines, registered with ``linecache``: errors of the compiler show the line."""
    file = f"<spume kernel {name} {abs(hash(source)):x}>"
    linecache.cache[file] = (len(source), None, source.splitlines(True), file)
    scope = {"qd": qd, **namespace}
    exec(compile(source, file, "exec"), scope)
    return scope[name]


def kernel(function: Callable[..., Any] | None = None, *, graph: bool = False) -> Any:
    """Make a function a kernel; ``graph``: one with a loop over launches (``qd.graph.do_while``).

    All types of a kernel's arguments stand in its annotations, and are looked at when it is called first (see
    `spume.launch`). The language looks at them in every call, and never forgets what it saw of each combination of
    argument objects: a step's new numbers are such, and cost 0.1 MB a step.
    """
    if function is None:
        return lambda function: kernel(function, graph=graph)
    made = qd.kernel(function, graph=graph)
    remember(made, function, qd, _circumstances)
    mapper = getattr(getattr(made, "_primal", None), "mapper", None)
    if mapper is None:  # another version of the language: as it is
        return made
    lookup = mapper.lookup
    found: list[Any] = []

    def looked_up(*arguments: Any) -> Any:
        if not found:
            found.append(lookup(*arguments))
        return found[0]

    mapper.lookup = looked_up
    return launcher(made, qd)


@cached
def _circumstances() -> str:
    """Return what the compiler depends on beside the code."""
    caching = qd.lang._fast_caching.config_hasher
    return f"{qd.__version__} {runtime()} {caching.hash_compile_config()} {caching.hash_device_caps()}"


def review_threads() -> None:
    """See to it that threads do not wait for processors of their own which others use; to be called once a step."""
    if _pool is not None:
        _pool.review(time.monotonic())


def wait() -> None:
    """Wait until the device has finished all that was launched."""
    qd.sync()
