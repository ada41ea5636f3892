"""Work in threads and processes; processes end with the one that started them, however it ends."""

import math
import multiprocessing
import os
import threading
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any, TypeVar

from scenegen.common.errors import SceneGenError
from scenegen.common.signals import without_interrupts

T = TypeVar("T")
Task = TypeVar("Task")
Made = Callable[[Task], Generator[T, None, Any]]
PATIENCE = 5.0  # seconds, until a killed process is gone
AHEAD = 2  # tasks for each process that are begun, or done and not yet taken


def processors() -> int:
    """Return how many processors this process may use: its affinity and its cgroup limit both."""
    count = os.cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        count = len(os.sched_getaffinity(0))
    return max(1, math.ceil(min(count, _cgroup_processors())))


def _cgroup_processors(
    root: Path = Path("/sys/fs/cgroup"), self_file: str = "/proc/self/cgroup"
) -> float:
    """Return the least limit on processor time of this process's cgroups, v2 or v1; inf for none.

    `docker --cpus 1.5` sets 1.5. A container may see its own cgroup at `root`, too.
    """
    limits = [math.inf]
    try:
        lines = Path(self_file).read_text().splitlines()
    except OSError:
        return math.inf
    for line in lines:
        _, kinds, path = line.split(":", 2)
        home = root if not kinds else root / "cpu"
        if kinds and "cpu" not in kinds.split(","):
            continue
        place = home / path.lstrip("/")
        for folder in (place, *place.parents):
            limits.append(_limit_in(folder))
            if folder == home:
                break
    return min(limits)


def _limit_in(folder: Path) -> float:
    with suppress(OSError, ValueError):
        quota, period = (folder / "cpu.max").read_text().split()
        return int(quota) / int(period)  # "max" is none
    with suppress(OSError, ValueError):
        quota, period = ((folder / f"cpu.cfs_{n}_us").read_text() for n in ("quota", "period"))
        return int(quota) / int(period) if int(quota) > 0 else math.inf
    return math.inf


def in_threads(
    function: Callable[[Task], T], tasks: Iterable[Task], count: int, ahead: int
) -> Generator[T]:
    """Call a function for each task, in `count` threads; yield the results in order.

    The tasks are made in the caller's thread. At most `ahead` of them wait for one of the threads,
    or to be taken. Raises what the function raises.
    """
    with ThreadPoolExecutor(count) as pool:
        yield from _oldest_first(lambda task: pool.submit(function, task), tasks, ahead)


def _oldest_first(
    submit: Callable[[Task], Future[T]], tasks: Iterable[Task], ahead: int
) -> Generator[T]:
    running: deque[Future[T]] = deque()
    for task in tasks:
        running.append(submit(task))
        if len(running) > ahead:
            yield running.popleft().result()
    while running:
        yield running.popleft().result()


def in_order(
    make: Made[Task, T], tasks: Iterable[Task], workers: int, note: Callable[[Any], Any]
) -> Generator[T]:
    """Yield what a generator function makes of each task, in order, here or in processes.

    What the generator returns at the end of a task goes to `note`.

    Raises what the function raises, and as `in_processes`.
    """
    if workers == 1:
        for task in tasks:
            note((yield from make(task)))
        return
    for results, end in in_processes(partial(_listed, make), tasks, workers):
        note(end)
        yield from results


def _listed(make: Made[Task, T], task: Task) -> tuple[list[T], Any]:
    made, results = make(task), list[T]()
    while True:
        try:
            results.append(next(made))
        except StopIteration as end:
            return results, end.value


def in_processes(function: Callable[[Task], T], tasks: Iterable[Task], count: int) -> Generator[T]:
    """Call a function for each task, in `count` processes; yield the results in order.

    The function is pickled once for each process. At most AHEAD tasks for each process are begun
    before their results are taken. Warnings are given again here, where Python drops repeated ones.

    Raises what the function raises, and SceneGenError where a process ends by itself.
    """
    done = False
    try:
        with worker_pool(count, function) as pool:
            ahead = AHEAD * count - 1
            results = _oldest_first(lambda task: pool.submit(_do, task), tasks, ahead)
            for result, caught in results:
                for text, category in caught:
                    warnings.warn(text, category, stacklevel=2)
                yield result
                done = True
    except BrokenProcessPool as error:
        what = "A worker process was killed, probably because memory ran out"
        guard = 'call it inside `if __name__ == "__main__":`, or use one worker'
        hint = "use fewer --workers"
        hint = hint if done else f"{hint}; in a script of your own, {guard}"
        raise SceneGenError(what, hint=hint) from error


class _Worker(SpawnProcess):
    def start(self) -> None:
        """Start a process that never sees Ctrl-C, which a terminal sends to all processes."""
        with without_interrupts():
            super().start()


class _Spawning(SpawnContext):
    Process = _Worker


@contextmanager
def worker_pool(
    count: int, function: Callable[[Any], Any] | None = None
) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of spawned processes: forked ones would share open files and threads' locks.

    The block waits for them at its end. Where it ends by an error, they are killed instead.
    """
    with _processes_to_be_had():
        pool = ProcessPoolExecutor(count, _Spawning(), _begin, (function,))
    try:
        yield pool
    except BaseException:
        # A process that was being started when Ctrl-C came is not listed; it ends by itself.
        processes = list((pool._processes or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.kill()
        for process in processes:
            process.join(PATIENCE)
        raise
    pool.shutdown()


@contextmanager
def _processes_to_be_had() -> Iterator[None]:
    """Turn an error of the system about processes into one that does not blame the output."""
    try:
        yield
    except (OSError, ImportError, NotImplementedError) as error:
        what = f"Worker processes cannot be started here ({error})"
        hint = "use --workers 1; in a container, let /dev/shm be written to"
        raise SceneGenError(what, hint=hint) from error


_Warning = tuple[str, type[Warning]]
_work: list[Callable[[Any], Any]] = []  # of this process, if it is a worker of `in_processes`


def _do(task: Any) -> tuple[Any, list[_Warning]]:
    with warnings.catch_warnings(record=True) as caught:
        result = _work[0](task)
    return result, [(str(warning.message), warning.category) for warning in caught]


def _begin(function: Callable[[Any], Any] | None) -> None:
    """Keep what this process is to do, and end it when the one that started it is gone."""
    _work[:] = [] if function is None else [function]
    threading.Thread(target=_end_after_parent, daemon=True).start()


def _end_after_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
