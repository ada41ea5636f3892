"""The one thread that reads and writes the file of answers.

What waits is done in one transaction, so that a flush of the disk serves many participants.
Nobody is told that something is done before it is on the disk.
"""

import queue
import sqlite3
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, Self, TypeVar

from iqtt.quiz.sessions import RefusedError

Result = TypeVar("Result")
Operation = Callable[[sqlite3.Connection], Any]
Waiting = tuple[Operation, "Future[Any]"]
MOST_AT_ONCE = 128


class Commits:
    """Runs operations on a connection, one after the other; a context manager."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db
        self._waiting: queue.SimpleQueue[Waiting | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="answers", daemon=True)

    def run(self, operation: Callable[[sqlite3.Connection], Result]) -> "Future[Result]":
        """Return what an operation gives, once it is on the disk.

        The future raises what the operation raises, and sqlite3.Error where it could not be
        written. An operation that raises RefusedError must not have changed anything. It may be run
        again after its changes were undone.
        """
        future: Future[Result] = Future()
        self._waiting.put((operation, future))
        return future

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._waiting.put(None)
        self._thread.join()
        self._db.close()

    def _work(self) -> None:
        ending = False
        while not ending:
            batch, ending = self._next_batch()
            if batch and not self._done(batch):
                for waiting in batch:  # so that one who fails is no harm to the others
                    self._done([waiting], last=True)

    def _next_batch(self) -> tuple[list[Waiting], bool]:
        """Wait for something to do; return all that waits, and whether the end has come."""
        batch: list[Waiting] = []
        try:
            while len(batch) < MOST_AT_ONCE:
                waiting = self._waiting.get(block=not batch)
                if waiting is None:
                    return batch, True
                if waiting[1].set_running_or_notify_cancel():  # else nobody waits for it any more
                    batch.append(waiting)
        except queue.Empty:
            pass
        return batch, False

    def _done(self, batch: list[Waiting], last: bool = False) -> bool:
        """Run operations in one transaction; return whether they are on the disk.

        Where they are not, their changes are undone; with `last`, the futures learn why.
        """
        outcomes: list[tuple[Any, RefusedError | None]] = []
        try:
            self._db.execute("BEGIN IMMEDIATE")
            for operation, _ in batch:
                try:
                    outcomes.append((operation(self._db), None))
                except RefusedError as error:
                    outcomes.append((None, error))
            self._db.execute("COMMIT")
        except Exception as trouble:
            with suppress(sqlite3.Error):  # SQLite may have undone it already
                self._db.execute("ROLLBACK")
            for _, future in batch if last else ():
                future.set_exception(trouble)
            return False
        for (_, future), (result, refused) in zip(batch, outcomes, strict=True):
            if refused is None:
                future.set_result(result)
            else:
                future.set_exception(refused)
        return True
