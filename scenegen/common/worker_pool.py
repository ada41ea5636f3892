"""Pools of worker processes that end with the process that started them, however that ends."""

import multiprocessing
import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.context import SpawnContext, SpawnProcess


class _Worker(SpawnProcess):
    def start(self) -> None:
        """Start a process that never sees Ctrl-C, which a terminal sends to all processes."""
        if not hasattr(signal, "pthread_sigmask"):  # Windows
            super().start()
            return
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Spawning(SpawnContext):
    Process = _Worker


def worker_pool(count: int) -> ProcessPoolExecutor:
    """Return a pool of spawned processes: forked ones would share open files and threads' locks."""
    return ProcessPoolExecutor(count, _Spawning(), initializer=_follow_parent)


def _follow_parent() -> None:
    """End this process when the one that started it is gone."""
    threading.Thread(target=_end_after_parent, daemon=True).start()


def _end_after_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
