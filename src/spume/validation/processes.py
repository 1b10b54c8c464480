"""Runs in processes of their own, none of which outlives the one that started it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

from spume.signals import handled

_SIGNALS = ("SIGTERM", "SIGHUP")


@contextmanager
def workers(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes; whatever ends the block early ends their runs, each after its step.

    Signals that ask this process to end become a KeyboardInterrupt inside the block. If it is killed outright, the
    workers see that it is gone.
    """
    with handled(_SIGNALS, _interrupt):
        pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), initializer=_follow_parent)
        try:
            yield pool
        except BaseException:
            for process in multiprocessing.active_children():
                process.terminate()  # a run writes a checkpoint and ends after its step
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def leave_if_orphaned() -> None:
    """End this process if the one that started it is gone: what else waits in its queue is nobody's work any more."""
    parent = multiprocessing.parent_process()
    if parent is not None and not parent.is_alive():
        os._exit(1)


def _follow_parent() -> None:
    """Have the run of this process stop when the process that started it is gone."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def follow() -> None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=follow, daemon=True).start()


def _interrupt(number: int, frame: Any) -> None:
    """Do as SIGINT does."""
    raise KeyboardInterrupt
