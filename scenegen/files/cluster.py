"""Spread tasks over the workers of a Dask cluster, on this machine or on others.

Dask gives the task of a worker that died to another one. It is an optional extra, which is imported
only here.
"""

import importlib
import itertools
import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any, TypeVar

from scenegen.common.errors import SceneGenError
from scenegen.common.signals import without_interrupts
from scenegen.files.places import lacking

T = TypeVar("T")
Task = TypeVar("Task")
LOCAL = "local"
LOGGING = "DASK_DISTRIBUTED__LOGGING__DISTRIBUTED"  # which Dask's processes read as they start
AHEAD = 2000  # tasks that the scheduler knows, or whose results were not taken
BATCH = 200  # tasks that it is told of at once
PATIENCE = 10  # seconds in which a scheduler must answer, or that pass without a worker
MOMENT = 0.002  # seconds
_one_at_a_time = threading.Lock()  # Mitsuba and HDF5 take one task in a process
Versions = Callable[[], Mapping[str, str]]


@dataclass(frozen=True, eq=False)
class Cluster:
    """A scheduler that this process is connected to; `connected` makes one.

    Attributes:
        client: of Dask.
        versions: tells what the results of a process depend on; each worker must say the same.
        told: is called with a line where there are no workers.
    """

    client: Any
    versions: Versions
    told: Callable[[str], Any]

    def in_any_order(self, function: Callable[[Task], T], tasks: Iterable[Task]) -> Generator[T]:
        """Call a function for each task on the workers; yield results as they come.

        Each worker process does one task at a time.

        Raises what the function raises, and SceneGenError where a task has ended several workers,
        or where a worker has other versions.
        """
        for _, result in self._done(function, tasks, {}):
            yield result

    def in_order(self, function: Callable[[Task], T], tasks: Iterable[Task]) -> Generator[T]:
        """Call a function for each task as `in_any_order`, but yield results in order."""
        waiting, following = dict[int, T](), 0
        for number, result in self._done(function, tasks, waiting):
            waiting[number] = result
            while following in waiting:
                yield waiting.pop(following)
                following += 1

    def _done(
        self, function: Callable[[Task], T], tasks: Iterable[Task], waiting: Mapping[int, T]
    ) -> Generator[tuple[int, T]]:
        """Yield results with the numbers of their tasks; `waiting` are those not taken yet."""
        from distributed import KilledWorker, as_completed
        from distributed.comm import CommClosedError

        # The function travels as the result of a task: workers pass it on to each other, and Dask
        # makes it again where all that had it are gone.
        work = self.client.submit(_as_is, (function, self.versions, dict(self.versions())))
        numbers, running, numbered = dict[str, int](), as_completed(), enumerate(tasks)
        try:
            while True:
                room = len(numbers) + len(waiting) <= AHEAD - BATCH
                # Many at once: each message costs milliseconds.
                if room and (some := list(itertools.islice(numbered, BATCH))):
                    some_tasks = [task for _, task in some]
                    futures = self.client.map(_call, some_tasks, work=work, pure=False)
                    numbers.update({f.key: i for f, (i, _) in zip(futures, some, strict=True)})
                    running.update(futures)
                if not numbers:
                    return
                self._wait_for(running)
                done = next(running)
                yield numbers.pop(done.key), done.result()
        except KilledWorker as error:
            hint = "memory may be short there; see the workers' logs"
            raise SceneGenError("cluster", "a task that ended several workers", "", hint) from error
        except (CancelledError, CommClosedError) as error:
            hint = "the same command goes on, with another one or without"
            raise SceneGenError("scheduler", "none any more", "", hint) from error
        finally:
            with suppress(Exception):  # the scheduler may be gone; nothing depends on it
                self.client.cancel([*running.futures, work])

    def _wait_for(self, running: Any) -> None:
        """Wait for a result; say so where there has been no worker for a while."""
        begun, alone = time.monotonic(), False
        while not running.has_ready():
            time.sleep(MOMENT)
            if not alone and time.monotonic() - begun > PATIENCE:
                begun = time.monotonic()
                alone = not self.client.scheduler_info(n_workers=-1)["workers"]
                if alone:
                    self.told("the cluster has no workers any more; waiting for one")


def threads_of_worker() -> int:
    """Return how many threads the worker has that calls this, as it was started with."""
    from distributed import get_worker

    return int(get_worker().state.nthreads)


def _as_is(work: T) -> T:
    return work


def _call(task: Task, work: tuple[Callable[[Task], T], Versions, dict[str, str]]) -> T:
    """Do a task on a worker, which may have joined after the others were asked for versions."""
    function, versions, expected = work
    with _one_at_a_time:
        differ = _differences(dict(versions()), expected)
        if differ:
            raise _refused("a worker", differ)
        return function(task)


@contextmanager
def connected(
    scheduler: str,
    workers: int,
    versions: Versions,
    told: Callable[[str], Any] = lambda text: print(text, file=sys.stderr),
) -> Iterator[Cluster]:
    """Connect to a scheduler; its workers must tell the versions that this process has.

    Args:
        scheduler: its address, such as `tcp://host:8786`, or LOCAL for one that is started here
            with `workers` processes.
        told: is called with a line where the scheduler has no workers yet, which are waited for.

    Raises SceneGenError where Dask is not installed, no scheduler answers or a worker is refused.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise lacking(f"--scheduler {scheduler}", "distributed") from error
    with _quiet(), _client(distributed, scheduler, workers) as client:
        if not client.scheduler_info(n_workers=-1)["workers"]:
            told(f"{scheduler}: no workers yet; waiting for the first one")
            client.wait_for_workers(1)
        expected = dict(versions())
        for name, found in sorted(client.run(versions, on_error="return").items()):
            differ = [f"no versions ({found!r:.100})"]
            if isinstance(found, Mapping):
                differ = _differences(dict(found), expected)
            if differ:
                raise _refused(f"worker {name}", differ)
        yield Cluster(client, versions, told)


@contextmanager
def _client(distributed: Any, scheduler: str, workers: int) -> Iterator[Any]:
    if scheduler == LOCAL:
        resource_tracker.ensure_running()  # else a worker starts it, which lets Ctrl-C through
        with without_interrupts():
            cluster = distributed.LocalCluster(
                n_workers=max(1, workers), threads_per_worker=1, dashboard_address="127.0.0.1:0"
            )
        with cluster, distributed.Client(cluster) as client:
            yield client
        return
    try:
        client = distributed.Client(scheduler, timeout=PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        expected = "the address of a Dask scheduler, such as tcp://host:8786, or local"
        found = f"none that answers ({type(error).__name__})"
        raise SceneGenError(f"--scheduler {scheduler}", found, expected) from error
    with client:
        yield client


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's own lines from the terminal: lost workers are its business."""
    loggers = [logging.getLogger(name) for name in ("distributed", "tornado", "asyncio")]
    levels, told = [logger.level for logger in loggers], os.environ.get(LOGGING)
    os.environ.setdefault(LOGGING, "critical")
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        if told is None:
            del os.environ[LOGGING]
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _differences(found: dict[str, str], expected: dict[str, str]) -> list[str]:
    names = sorted(found.keys() | expected.keys())
    return [
        f"{n} {found.get(n)}, here {expected.get(n)}"
        for n in names
        if found.get(n) != expected.get(n)
    ]


def _refused(worker: str, differ: list[str]) -> SceneGenError:
    hint = "install the same versions on all machines, or the bits of the files could differ"
    return SceneGenError(worker, "; ".join(differ), "the same versions as here", hint)
