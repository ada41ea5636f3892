"""The SQLite file of answers: its tables, how it is made, opened and checked, and its errors.

study        the settings, and the key that signs cookies; one row
participant  a row each, with a random name
question     what each participant is asked, in order, with the right answer
answer       what was answered; never changed and never deleted

The rules for values stand in the tables, so that SQLite keeps them when a quiz writes and checks
them when a stranger's file is read. `CONTRADICTIONS` adds those between several rows.
"""

import errno
import os
import secrets
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import astuple, fields
from pathlib import Path

from iqtt.quiz.study import MOST_QUESTIONS, Settings
from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.common.text_table import printable
from scenegen.files.new_file import written_beside

VERSION = 1
APPLICATION_ID = 0x71756971  # in the file's header, so that no other SQLite file is taken for one
MAGIC = b"SQLite format 3\0"
TIME = "BETWEEN 0 AND 9007199254740991"  # milliseconds since 1970
TABLES = {
    "study": f"""CREATE TABLE study (
        fingerprint TEXT NOT NULL
            CHECK (length(fingerprint) = 64 AND fingerprint NOT GLOB '*[^0-9a-f]*'),
        calibration_fingerprint TEXT NOT NULL CHECK (length(calibration_fingerprint) = 64
            AND calibration_fingerprint NOT GLOB '*[^0-9a-f]*'),
        answers INTEGER NOT NULL CHECK (answers IN (2, 3)),
        questions INTEGER NOT NULL CHECK (questions BETWEEN 1 AND {MOST_QUESTIONS}),
        calibrations INTEGER NOT NULL CHECK (calibrations BETWEEN 0 AND {MOST_QUESTIONS}),
        seed INTEGER NOT NULL CHECK (seed >= 0),
        secret TEXT NOT NULL CHECK (length(secret) = 64)) STRICT""",
    "participant": f"""CREATE TABLE participant (
        number INTEGER PRIMARY KEY CHECK (number >= 0),
        name TEXT NOT NULL UNIQUE CHECK (length(name) = 16 AND name NOT GLOB '*[^0-9a-f]*'),
        started_ms INTEGER NOT NULL CHECK (started_ms {TIME}),
        feedback_seen INTEGER NOT NULL DEFAULT 0) STRICT""",
    "question": f"""CREATE TABLE question (
        participant INTEGER NOT NULL REFERENCES participant,
        position INTEGER NOT NULL CHECK (position >= 0),
        calibration INTEGER NOT NULL CHECK (calibration IN (0, 1)),
        row INTEGER NOT NULL CHECK (row BETWEEN 0 AND 2147483647),
        kind TEXT NOT NULL
            CHECK (length(kind) BETWEEN 1 AND 40 AND kind NOT GLOB '*[^a-z0-9 -]*'),
        angle_degrees REAL CHECK (angle_degrees BETWEEN 0 AND 180),
        place INTEGER NOT NULL CHECK (place BETWEEN 0 AND 2),
        shape TEXT NOT NULL CHECK (length(shape) IN (0, 12) AND shape NOT GLOB '*[^0-9a-f]*'),
        times_shown INTEGER NOT NULL DEFAULT 0 CHECK (times_shown BETWEEN 0 AND 2147483647),
        shown_ms INTEGER CHECK (shown_ms {TIME}),
        PRIMARY KEY (participant, position)) STRICT, WITHOUT ROWID""",
    "answer": f"""CREATE TABLE answer (
        sequence INTEGER PRIMARY KEY CHECK (sequence > 0),
        participant INTEGER NOT NULL,
        position INTEGER NOT NULL,
        answer INTEGER NOT NULL CHECK (answer BETWEEN 0 AND 2),
        answered_ms INTEGER NOT NULL CHECK (answered_ms {TIME}),
        response_ms REAL CHECK (response_ms BETWEEN 0 AND 1e10),
        UNIQUE (participant, position),
        FOREIGN KEY (participant, position) REFERENCES question) STRICT""",
}
CONTRADICTIONS = {  # by what is wrong, queries that find nothing in a file that a quiz wrote
    "rows that belong to nothing": "PRAGMA foreign_key_check",
    "questions that are not those of the settings": "SELECT 1 FROM question JOIN study"
    " WHERE place >= answers OR calibration <> (position < calibrations)"
    " OR position >= calibrations + questions",
    "answers that are not offered, or to what was not shown": "SELECT 1 FROM study, answer a"
    " JOIN question q ON q.participant = a.participant AND q.position = a.position"
    " WHERE answer >= answers OR shown_ms IS NULL OR times_shown = 0",
    "answers out of turn": "SELECT 1 FROM answer GROUP BY participant"
    " HAVING count(*) <> max(position) + 1",
}
MOST_BYTES = 2**30  # of a file
MOST_STEPS = 1_000_000  # of a thousand instructions each, that checking a file may take
SPLIT_HINT = "these are answers to another split; name another --db"
SETTINGS_HINT = "repeat the settings that it was begun with, or name another --db"
EXPECTED = "a file of answers that `iqtt quiz` wrote"


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
            _require_same(path, settings_of(db), settings)
            if db.execute("PRAGMA journal_mode = WAL").fetchone()[0] != "wal":
                raise AnswersError(path, "a disk without write-ahead log", "a local disk")
            db.execute("PRAGMA synchronous = FULL")
            db.execute("PRAGMA foreign_keys = ON")
            # A write that changes nothing shows now whether the file can be written at all.
            db.execute("UPDATE study SET seed = seed")
        except BaseException:
            db.close()
            raise
    return db


def _make(path: Path, settings: Settings) -> None:
    os.close(os.open(path, os.O_CREAT | os.O_WRONLY, 0o600))
    with closing(sqlite3.connect(path)) as db, db:
        db.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        db.execute(f"PRAGMA user_version = {VERSION}")
        for statement in TABLES.values():
            db.execute(statement)
        values = (*astuple(settings), secrets.token_hex(32))
        db.execute("INSERT INTO study VALUES (?, ?, ?, ?, ?, ?, ?)", values)


def check_file(path: Path) -> None:
    """Raise OSError or FileFormatError unless a path is a regular file that begins as SQLite's.

    A file above MOST_BYTES is refused, as it is read into memory.
    """
    if path.is_dir():
        raise OSError(errno.EISDIR, "is a folder; name a file in it", str(path))
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise OSError(errno.EINVAL, "is not a regular file", str(path))
    with path.open("rb") as file:
        start, size = file.read(72), path.stat().st_size
    if size > MOST_BYTES:
        raise FileFormatError(path, f"{size:,} bytes", f"at most {MOST_BYTES:,}")
    if not start.startswith(MAGIC):
        raise FileFormatError(path, "no SQLite file", EXPECTED)
    if start[68:72] != APPLICATION_ID.to_bytes(4, "big"):
        raise FileFormatError(path, "an SQLite file of something else", EXPECTED)


def check_content(db: sqlite3.Connection, path: Path) -> None:
    """Raise FileFormatError unless an open file holds what a quiz writes, and nothing else.

    No view, trigger or generated column of a stranger's file is ever asked. A file that makes
    SQLite work for too long is refused as well.
    """
    for limit, most in (
        (sqlite3.SQLITE_LIMIT_LENGTH, 1_000_000),
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
        schema = dict(db.execute("SELECT name, sql FROM sqlite_schema WHERE sql IS NOT NULL"))
        if schema != TABLES:
            other = sorted(str(name) for name in schema.items() ^ TABLES.items())[0]
            raise FileFormatError(path, f"another schema, such as {other:.60}", ", ".join(TABLES))
        trouble = db.execute("PRAGMA quick_check(1)").fetchone()[0]  # of the tables' rules, too
        if trouble != "ok":
            raise FileFormatError(path, f"damage: {_line(trouble):.200}", "a whole file")
        if db.execute("SELECT count(*) FROM study").fetchone() != (1,):
            raise FileFormatError(f"{path}: study", "no settings, or several", "one row")
        for problem, query in CONTRADICTIONS.items():
            if db.execute(query).fetchone() is not None:
                raise FileFormatError(path, problem, EXPECTED)
    finally:
        db.set_progress_handler(None, 0)


def settings_of(db: sqlite3.Connection) -> Settings:
    """Return the settings that a checked file was made with."""
    names = ", ".join(field.name for field in fields(Settings))
    return Settings(*db.execute(f"SELECT {names} FROM study").fetchone())


def secret_of(db: sqlite3.Connection) -> str:
    """Return the key of a checked file, which signs the cookies of its participants."""
    return str(db.execute("SELECT secret FROM study").fetchone()[0])


def _require_same(path: Path, begun: Settings, now: Settings) -> None:
    """Raise SpecError where a file was begun with other settings than those of now."""
    for field in fields(Settings):
        stored, expected = (f"{getattr(each, field.name)!s:.20}" for each in (begun, now))
        if stored != expected:
            hint = SPLIT_HINT if field.name == "fingerprint" else SETTINGS_HINT
            raise SpecError(f"{path}: {field.name}", stored, expected, hint)


def _line(text: object) -> str:
    """Return what SQLite says in one line that a terminal may show; it quotes the file."""
    return printable(" ".join(str(text).split()))


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Raise what SQLite raises as AnswersError, or FileFormatError where the file is damaged."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:
        text = _line(error)
        damaged = isinstance(error, sqlite3.DatabaseError | UnicodeDecodeError) and not isinstance(
            error, sqlite3.OperationalError
        )
        if damaged or "malformed" in text or text == "interrupted":
            what = "damage, or too much to read" if text == "interrupted" else text
            raise FileFormatError(path, f"{what:.200}", "a file of answers") from error
        hint = "free some space" if "full" in text else "see that it and its folder can be written"
        raise AnswersError(path, f"{text:.200}", "a file that can be written", hint) from error
