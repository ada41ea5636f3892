"""Spread tasks over the workers of a Dask cluster, on this machine or on others.

Dask gives the task of a worker that is lost to another one. It is an optional extra, which is
imported only here. Each worker does its tasks in a process of `pool`, so that a crash costs no
worker, and is told as anywhere.
"""

import importlib
import logging
import secrets
import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from scenegen.common.errors import SceneGenError
from scenegen.files.places import lacking
from scenegen.files.pool import LostWorkerError, Pool

T = TypeVar("T")
Task = TypeVar("Task")
LOCAL = "local"
BATCH = 200  # tasks that the scheduler is told of at once, as each message costs milliseconds
PATIENCE = 10  # seconds in which a scheduler must answer
# Of each worker of this process, by its address: it does one task at a time, and has a pool for
# the work of some name.
_turns = defaultdict[str, threading.Lock](threading.Lock)
_pools: dict[str, tuple[str, Pool]] = {}
_threads = 1  # of the worker that this is a process of
Versions = Callable[[], Mapping[str, str]]


@dataclass(frozen=True, eq=False)
class Cluster:
    """A scheduler that this process is connected to; `connected` makes one.

    Attributes:
        client: of Dask.
        versions: tells what the results of a process depend on; each worker must say the same.
    """

    client: Any
    versions: Versions

    def results(
        self,
        function: Callable[[Task], T],
        tasks: Iterable[Task],
        told: Callable[[Task], str] = str,
        in_order: bool = True,
    ) -> Generator[T]:
        """Call a function for each task on the workers; yield results in order, or as they come.

        Each worker does one task at a time. `told` is as of `Pool`.

        Raises what the function raises, LostWorkerError where a task ended its process twice, or
        several workers, and SceneGenError where a worker has other versions, or where the scheduler
        is gone.
        """
        from distributed import KilledWorker, as_completed
        from distributed.comm import CommClosedError

        # The function travels as the result of a task: workers pass it on to each other, and Dask
        # makes it again where all that had it are gone.
        work = _Work(secrets.token_hex(8), function, told, self.versions, dict(self.versions()))
        work_there = self.client.submit(_as_is, work)
        all_tasks = list(tasks)
        futures = self.client.map(_call, all_tasks, work=work_there, pure=False, batch_size=BATCH)
        try:
            for future in futures if in_order else as_completed(futures):
                try:
                    result = future.result()
                except KilledWorker as error:
                    what = told(all_tasks[futures.index(future)])
                    where = f"{what}: all workers that were to make them ended"
                    raise LostWorkerError(where, hint="see the workers' logs") from error
                future.release()
                yield result
        except (CancelledError, CommClosedError) as error:
            hint = "run the same command again to continue"
            raise SceneGenError("The Dask scheduler disconnected", hint=hint) from error
        finally:
            with suppress(Exception):  # the scheduler may be gone; nothing depends on it
                self.client.cancel([*futures, work_there])


@dataclass(frozen=True, eq=False)
class _Work:
    """What workers do with each task; `name` tells it from other work."""

    name: str
    function: Callable[[Any], Any]
    told: Callable[[Any], str]
    versions: Versions
    expected: Mapping[str, str]

    def done(self, worker: str, threads: int, task: Any) -> Any:
        """Do a task in a process of a worker, which may have joined at any time."""
        global _threads  # noqa: PLW0603
        _threads = threads
        here = dict(self.versions())
        differences = [
            f"{name} {here.get(name)}, not {self.expected.get(name)}"
            for name in sorted(here.keys() | self.expected.keys())
            if here.get(name) != self.expected.get(name)
        ]
        if differences:
            hint = (
                "install the same versions on all machines, or the bits of the files could differ"
            )
            found, expected = "; ".join(differences), "the versions of the main process"
            raise SceneGenError(f"worker {worker}", found, expected, hint)
        return self.function(task)


def threads_of_worker() -> int:
    """Return how many threads the worker has whose process calls this, as it was started with."""
    return _threads


def _as_is(work: T) -> T:
    return work


def _call(task: Any, work: _Work) -> Any:
    """Do a task on a worker, in a process that ends with it."""
    from distributed import get_worker

    worker = get_worker()
    with _turns[worker.address]:
        name, pool = _pools.get(worker.address, ("", None))
        if pool is None or name != work.name:
            if pool is not None:
                pool.close()
            done = partial(work.done, worker.address, int(worker.state.nthreads))
            pool = Pool(1, done, work.told)
            _pools[worker.address] = work.name, pool
        return pool.do(task)


@contextmanager
def connected(
    scheduler: str,
    workers: int,
    versions: Versions,
    print_note: Callable[[str], Any] = lambda text: print(text, file=sys.stderr),
) -> Iterator[Cluster]:
    """Connect to a scheduler.

    Args:
        scheduler: its address, such as `tcp://host:8786`, or LOCAL for one of this process with
            `workers` workers.
        versions: as in `Cluster`.
        print_note: is called with a line where the scheduler has no workers yet, which are waited
            for.

    Raises SceneGenError where Dask is not installed, or no scheduler answers.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise lacking(f"--scheduler {scheduler}", "distributed") from error
    with _quiet(), _client(distributed, scheduler, workers) as client:
        if not client.scheduler_info(n_workers=-1)["workers"]:
            print_note(f"{scheduler}: no workers yet; waiting for the first one")
            client.wait_for_workers(1)
        yield Cluster(client, versions)


@contextmanager
def _client(distributed: Any, scheduler: str, workers: int) -> Iterator[Any]:
    if scheduler == LOCAL:
        # Its workers are threads: each has a process for its tasks anyway.
        how = {"processes": False, "threads_per_worker": 1, "memory_limit": 0}
        address = "127.0.0.1:0"
        with (
            distributed.LocalCluster(max(1, workers), dashboard_address=address, **how) as cluster,
            distributed.Client(cluster) as client,
        ):
            try:
                yield client
            finally:
                for worker in cluster.workers.values():
                    if worker.address in _pools:
                        _pools[worker.address][1].kill()
        return
    try:
        client = distributed.Client(scheduler, timeout=PATIENCE)
    except Exception as error:  # Dask raises whatever its transports do
        what = f"--scheduler {scheduler}: no scheduler answers ({type(error).__name__})"
        expected = "the address of a Dask scheduler, such as tcp://host:8786, or local"
        hint = "tell Dask where its certificates are: distributed.comm.tls in its configuration"
        hint = hint if scheduler.startswith("tls:") else ""
        raise SceneGenError(what, expected=expected, hint=hint) from error
    with client:
        yield client


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's own lines from the terminal: lost workers are its business."""
    loggers = [logging.getLogger(name) for name in ("distributed", "tornado", "asyncio")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
