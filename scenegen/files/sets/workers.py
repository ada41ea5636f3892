"""Work spread over threads and processes."""

import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any, TypeVar

from scenegen.files.pool import worker_pool

T = TypeVar("T")
Task = TypeVar("Task")
Made = Callable[[Task], Generator[T, None, Any]]
AHEAD = 2  # tasks for each process that are begun, or done and not yet taken


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


def in_processes(
    function: Callable[[Task], T],
    tasks: Iterable[Task],
    count: int,
    told: Callable[[Task], str] = str,
) -> Generator[T]:
    """Call a function for each task, in `count` processes; yield the results in order.

    The function is pickled once for each process. At most AHEAD tasks for each process are begun
    before their results are taken. Warnings are given again here, where Python drops repeated ones.

    Args:
        told: as of `Pool`.

    Raises what the function raises, and LostWorkerError where a task ended its process, twice if by
    a signal.
    """
    with worker_pool(count, partial(_with_warnings, function), told) as pool:
        for result, caught in _oldest_first(pool.submit, tasks, AHEAD * count - 1):
            for text, category in caught:
                warnings.warn(text, category, stacklevel=2)
            yield result


def _with_warnings(
    function: Callable[[Task], T], task: Task
) -> tuple[T, list[tuple[str, type[Warning]]]]:
    with warnings.catch_warnings(record=True) as caught:
        result = function(task)
    return result, [(str(warning.message), warning.category) for warning in caught]
