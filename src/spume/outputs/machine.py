"""Where a run is computed: machine, versions of the libraries, process."""

from __future__ import annotations

import os
import platform
import socket
import sys
from datetime import datetime
from importlib import metadata
from typing import Any

_LIBRARIES = ("quadrants", "numpy", "scipy", "h5py", "pydantic", "trimesh", "matplotlib")


def environment() -> dict[str, Any]:
    """Return what ``summary.json`` says of the machine and the process that compute a run.

    Returns:
        ``host``, ``process`` (its number), ``started`` (local time of the call, ISO 8601), ``system``, ``processor``,
        ``cores``, ``python``, and ``libraries``, name to version.
    """
    versions = {}
    for name in _LIBRARIES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = ""
    return {
        "host": socket.gethostname(),
        "process": os.getpid(),
        "started": datetime.now().astimezone().isoformat(timespec="seconds"),
        "system": f"{platform.system()} {platform.release()}",
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "libraries": versions,
    }


def is_computing(environment: dict[str, Any]) -> bool | None:
    """Return whether the process that wrote an environment is there; None where this machine cannot know."""
    process = environment.get("process")
    if sys.platform == "win32" or not isinstance(process, int) or environment.get("host") != socket.gethostname():
        return None
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # another user's
        return True
    return True


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
