"""The thread that writes: one that fails is no harm to others, and what is told is on the disk."""

import sqlite3
import threading
from concurrent.futures import Future

import pytest

from iqtt.quiz.commits import Commits
from iqtt.quiz.sessions import RefusedError


@pytest.fixture
def path(tmp_path):
    with sqlite3.connect(tmp_path / "x.db") as db:
        db.execute("CREATE TABLE t (x UNIQUE)")
    db.close()
    return tmp_path / "x.db"


def insert(value):
    return lambda db: db.execute("INSERT INTO t VALUES (?)", (value,)).rowcount


def refuse(_db):
    raise RefusedError(409, "no")


def stored(path):
    db = sqlite3.connect(path)
    found = sorted(row[0] for row in db.execute("SELECT x FROM t"))
    db.close()
    return found


def test_all_that_waits_is_done_and_each_learns_its_own_outcome(path):
    gate = threading.Event()
    db = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    with Commits(db) as commits:
        commits.run(lambda db: gate.wait())
        found = [commits.run(insert(k)) for k in (1, 2, 1, 3)]  # of one batch
        refused = commits.run(refuse)
        last = commits.run(insert(4))
        left = commits.run(insert(5))
        assert left.cancel()
        gate.set()
        assert [found[k].result(5) for k in (0, 1, 3)] == [1, 1, 1]
        with pytest.raises(sqlite3.IntegrityError):
            found[2].result(5)
        with pytest.raises(RefusedError):
            refused.result(5)
        assert last.result(5) == 1
        assert stored(path) == [1, 2, 3, 4]


def test_nothing_is_told_before_it_is_on_the_disk(path, monkeypatch):
    seen = []
    tell = Future.set_result

    def look_first(future, result):
        seen.append(stored(path))
        tell(future, result)

    monkeypatch.setattr(Future, "set_result", look_first)
    with Commits(sqlite3.connect(path, isolation_level=None, check_same_thread=False)) as commits:
        for k in range(3):
            commits.run(insert(k)).result(5)
    assert seen == [[0], [0, 1], [0, 1, 2]]
