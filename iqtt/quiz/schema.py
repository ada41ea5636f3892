"""The SQLite file of answers: its tables, how it is made, opened and checked, and its errors.

study        name, value: the format's version, `study.Settings`, and the key of secret names
participant  a row each; of the session's token only the SHA-256 is kept
question     what each participant is asked, in order, with the right answer
answer       what was answered; never changed and never deleted
"""

import errno
import os
import re
import secrets
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from iqtt.quiz.study import Settings
from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.files.new_file import written_beside

FORMAT = "pix2shape-bench/quiz"
VERSION = 1
APPLICATION_ID = 0x71756971  # in the file's header, so that no other SQLite file is taken for one
MAGIC = b"SQLite format 3\0"
TABLES = {
    "study": "CREATE TABLE study (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID",
    "participant": """CREATE TABLE participant (
        number INTEGER PRIMARY KEY,
        name TEXT NOT NULL UNIQUE,
        token_sha256 BLOB NOT NULL UNIQUE,
        started_ms INTEGER NOT NULL,
        feedback_seen INTEGER NOT NULL DEFAULT 0)""",
    "question": """CREATE TABLE question (
        participant INTEGER NOT NULL REFERENCES participant,
        position INTEGER NOT NULL,
        calibration INTEGER NOT NULL,
        row INTEGER NOT NULL,
        kind TEXT NOT NULL,
        angle_degrees REAL,
        place INTEGER NOT NULL,
        shape TEXT NOT NULL,
        times_shown INTEGER NOT NULL DEFAULT 0,
        shown_ms INTEGER,
        PRIMARY KEY (participant, position)) WITHOUT ROWID""",
    "answer": """CREATE TABLE answer (
        sequence INTEGER PRIMARY KEY,
        participant INTEGER NOT NULL,
        position INTEGER NOT NULL,
        answer INTEGER NOT NULL,
        answered_ms INTEGER NOT NULL,
        response_ms REAL,
        UNIQUE (participant, position),
        FOREIGN KEY (participant, position) REFERENCES question)""",
}
SECRET = "secret"
LONGEST_VALUE = 100_000  # bytes
MOST_STEPS = 1_000_000  # of a thousand instructions each, that checking a file may take
SETTINGS_HINT = "repeat the settings that it was begun with, or name another --db"


class AnswersError(SceneGenError):
    """The file of answers cannot be written or read now: a full disk, a lock, no permission."""


def open_answers(path: str | Path, settings: Settings) -> sqlite3.Connection:
    """Open a file of answers for writing, from any one thread at a time; it is made if need be.

    A transaction that has ended is on the disk: write-ahead log, and a flush at each.

    Raises OSError for a path that cannot be written, FileFormatError where it is something else or
    damaged, SpecError where it belongs to another split or study, AnswersError as the disk.
    """
    path = Path(path)
    with explained(path):
        if not os.path.lexists(path):
            with written_beside(path) as temporary:
                _make(temporary, settings)
        check_file(path)
        db = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=10)
        try:
            check_content(db, path)
            _require_same(path, settings_of(db, path), settings)
            if db.execute("PRAGMA journal_mode = WAL").fetchone()[0] != "wal":
                raise AnswersError(path, "a disk without write-ahead log", "a local disk")
            db.execute("PRAGMA synchronous = FULL")
            db.execute("PRAGMA foreign_keys = ON")
            # A write that changes nothing shows now whether the file can be written at all.
            db.execute("UPDATE study SET value = value")
        except BaseException:
            db.close()
            raise
    return db


def _make(path: Path, settings: Settings) -> None:
    os.close(os.open(path, os.O_CREAT | os.O_WRONLY, 0o600))
    values = {"format": FORMAT, **asdict(settings), SECRET: secrets.token_hex(32)}
    with closing(sqlite3.connect(path)) as db, db:
        db.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        db.execute(f"PRAGMA user_version = {VERSION}")
        for statement in TABLES.values():
            db.execute(statement)
        pairs = [(name, str(value)) for name, value in values.items()]
        db.executemany("INSERT INTO study VALUES (?, ?)", pairs)


def check_file(path: Path) -> None:
    """Raise OSError or FileFormatError unless a path is a regular file that begins as SQLite's."""
    if path.is_dir():
        raise OSError(errno.EISDIR, "is a folder; name a file in it", str(path))
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise OSError(errno.EINVAL, "is not a regular file", str(path))
    with path.open("rb") as file:
        start = file.read(72)
    if not start.startswith(MAGIC):
        raise FileFormatError(path, "no SQLite file", "a file of answers that `iqtt quiz` wrote")
    if start[68:72] != APPLICATION_ID.to_bytes(4, "big"):
        expected = "a file of answers that `iqtt quiz` wrote"
        raise FileFormatError(path, "an SQLite file of something else", expected)


def check_content(db: sqlite3.Connection, path: Path) -> None:
    """Raise FileFormatError unless an open file has our tables, and nothing else in its schema.

    So no view, trigger or generated column of a stranger's file is ever asked. A file that makes
    SQLite work for too long is refused as well.
    """
    for limit, most in (
        (sqlite3.SQLITE_LIMIT_LENGTH, LONGEST_VALUE * 10),
        (sqlite3.SQLITE_LIMIT_ATTACHED, 0),
        (sqlite3.SQLITE_LIMIT_TRIGGER_DEPTH, 1),
    ):
        db.setlimit(limit, most)
    for pragma in ("trusted_schema = OFF", "cell_size_check = ON", "mmap_size = 0"):
        db.execute(f"PRAGMA {pragma}")
    steps = iter(range(MOST_STEPS))
    db.set_progress_handler(lambda: next(steps, None) is None, 1000)
    try:
        version = db.execute("PRAGMA user_version").fetchone()[0]
        if version != VERSION:
            raise FileFormatError(path, f"version {version}", f"version {VERSION}")
        found = dict(db.execute("SELECT name, sql FROM sqlite_schema WHERE sql IS NOT NULL"))
        if found != TABLES:
            other = sorted(str(name) for name in found.items() ^ TABLES.items())[0]
            raise FileFormatError(path, f"another schema, such as {other:.60}", ", ".join(TABLES))
        trouble = db.execute("PRAGMA quick_check(1)").fetchone()[0]
        if trouble != "ok":
            raise FileFormatError(path, f"damage: {trouble:.200}", "a whole file")
    finally:
        db.set_progress_handler(None, 0)


def settings_of(db: sqlite3.Connection, path: Path) -> Settings:
    """Return the settings that a checked file was made with. Raises FileFormatError."""
    values = stored_values(db)
    found: dict[str, Any] = {}
    for field in fields(Settings):
        text, number = values.get(field.name), field.type in (int, "int")
        pattern = "[0-9]{1,19}" if number else "[0-9a-f]{64}"
        if not isinstance(text, str) or not re.fullmatch(pattern, text):
            raise FileFormatError(f"{path}: {field.name}", f"{text!r:.60}", "a setting of a study")
        found[field.name] = int(text) if number else text
    try:
        if found["answers"] not in (2, 3):
            raise SpecError("answers", found["answers"], "2 or 3")
        return Settings(**found)
    except SpecError as error:
        raise FileFormatError(f"{path}: {error.where}", error.found, error.expected) from error


def stored_values(db: sqlite3.Connection) -> dict[str, Any]:
    """Return the table `study`."""
    return dict(db.execute("SELECT name, value FROM study LIMIT 100"))


def _require_same(path: Path, found: Settings, expected: Settings) -> None:
    """Raise SpecError where a file was begun with other settings than those of now."""
    if found.fingerprint != expected.fingerprint:
        what = f"answers to another split, of fingerprint {found.fingerprint:.12}"
        told = f"answers to the split of fingerprint {expected.fingerprint:.12}"
        raise SpecError(path, what, told, "name another --db")
    for field in fields(Settings):
        one, other = (f"{getattr(each, field.name)!s:.20}" for each in (found, expected))
        if one != other:
            raise SpecError(f"{path}: {field.name}", one, other, SETTINGS_HINT)


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Raise what SQLite raises as AnswersError, or FileFormatError where the file is damaged."""
    try:
        yield
    except sqlite3.Error as error:
        text = str(error)
        damaged = isinstance(error, sqlite3.DatabaseError) and not isinstance(
            error, sqlite3.OperationalError
        )
        if damaged or "malformed" in text or text == "interrupted":
            what = "damage, or too much to read" if text == "interrupted" else text
            raise FileFormatError(path, f"{what:.200}", "a file of answers") from error
        hint = "free some space" if "full" in text else "see that it and its folder can be written"
        raise AnswersError(path, f"{text:.200}", "a file that can be written", hint) from error
