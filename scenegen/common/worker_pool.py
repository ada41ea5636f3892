"""Pools of worker processes that end with the process that started them, however that ends."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, TypeVar

from scenegen.common.errors import SceneGenError

T = TypeVar("T")
AHEAD = 2  # tasks for each process that are begun, or done and not yet taken


def processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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
    """Starts workers, and remembers them."""

    def __init__(self) -> None:
        self.started: list[_Worker] = []

    def Process(self, *args: Any, **kwargs: Any) -> _Worker:  # type: ignore[override]  # noqa: N802
        worker = _Worker(*args, **kwargs)
        self.started.append(worker)
        return worker


@contextmanager
def worker_pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of spawned processes: forked ones would share open files and threads' locks.

    The block waits for them at its end. Where it ends by an error, they are killed instead.
    """
    context = _Spawning()
    with ProcessPoolExecutor(count, context, initializer=_follow_parent) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in context.started:
                worker.kill()
            raise


def in_processes(
    function: Callable[..., T], tasks: Iterable[tuple[Any, ...]], count: int
) -> Iterator[T]:
    """Call a function with the arguments of each task, in `count` processes; yield in order.

    No more than AHEAD tasks for each process are begun before their results are taken. Raises what
    the function raises, and SceneGenError where a process ends by itself.
    """
    done = False
    try:
        with worker_pool(count) as pool:
            running: deque[Future[T]] = deque()
            for task in tasks:
                running.append(pool.submit(function, *task))
                if len(running) >= AHEAD * count:
                    yield running.popleft().result()
                    done = True
            while running:
                yield running.popleft().result()
                done = True
    except BrokenProcessPool as error:
        short = "memory may be short: use fewer workers"
        guard = 'call it inside `if __name__ == "__main__":`, or use one worker'
        hint = short if done else f"{short}; in a script of your own, {guard}"
        raise SceneGenError("worker processes", "one that was killed", "", hint) from error


def _follow_parent() -> None:
    """End this process when the one that started it is gone."""
    threading.Thread(target=_end_after_parent, daemon=True).start()


def _end_after_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
