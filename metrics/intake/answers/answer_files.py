"""Import answers to questions from CSV, JSON or JSON lines: an index, a letter, or scores."""

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from iqtt.questions.specs import LETTERS
from iqtt.vlm.reading import read_answer
from metrics.submissions.problems import JsonError
from metrics.submissions.rules import MOST_ROWS
from metrics.submissions.strict_json import parse_json, read_bytes
from metrics.submissions.writer import write_answers
from scenegen.common.errors import SceneGenError

if TYPE_CHECKING:
    from iqtt.files.reader import QuestionsFile

MOST_BYTES = 64 * 2**20
QUESTION = ("question", "id", "index", "row")  # names that the index of a question may have
ANSWER = ("scores", "answer", "prediction", "choice")


class AnswerFileError(SceneGenError):
    """A file of answers that is not as it should be."""


def import_answers(
    path: str | Path,
    questions: "str | Path | QuestionsFile",
    out: str | Path,
    *,
    method: str,
    run: str = "",
    notes: str = "",
    overwrite: bool = False,
) -> int:
    """Write a submission from a file of answers, and return how many there are.

    A CSV file has columns `question` (may be left out where all questions are answered in order)
    and `answer`, or a score of each answer: `A`, `B`, `C`. A line of JSON has the same keys, or
    `scores`. JSON is a list, or an object from question to answer. An answer is an index from 0, a
    letter from A, a text that `read_answer` reads, or -1 or nothing to abstain.

    Raises AnswerFileError, PredictionError, and OSError.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise AnswerFileError(path, f"the ending {path.suffix!r:.20}", " or ".join(READERS))
    rows, values = list[int | None](), list[Any]()
    try:
        for place, entry in reader(read_bytes(path, MOST_BYTES)):
            question, value = _parts(entry, place) if isinstance(entry, dict) else (None, entry)
            rows.append(None if question is None else _index(question, place))
            values.append(_value(value, place))
    except JsonError as error:
        raise AnswerFileError(f"{path}: {error.where}", error.found, error.expected) from error
    except AnswerFileError as error:
        raise error.inside(path) from error
    if not values:
        raise AnswerFileError(path, "no responses", "one for each question")
    if len({type(value) for value in values}) > 1 or len({type(row) for row in rows}) > 1:
        raise AnswerFileError(
            path, "entries of two types", "all with a question, or none; all with scores, or none"
        )
    ids = None if rows[0] is None else [row for row in rows if row is not None]
    form = "scores" if isinstance(values[0], list) else "answer"
    arrays: dict[str, Any] = {form: values}
    if form == "scores":
        if len({len(value) for value in values}) > 1:
            raise AnswerFileError(path, "different numbers of scores", "as many for each question")
        arrays[form] = np.array(values, np.float64)
    write_answers(
        out, questions, method=method, run=run, notes=notes, overwrite=overwrite, rows=ids, **arrays
    )
    return len(values)


Entries = Iterator[tuple[str, Any]]  # place, and an answer or an object with one


def _csv(data: bytes) -> Entries:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise AnswerFileError("text", "bytes that are not UTF-8", "text") from error
    lines = csv.DictReader(text.splitlines(), skipinitialspace=True, strict=True)
    try:
        for line in lines:
            place = f"line {lines.line_num}"
            if None in line.values():
                raise AnswerFileError(place, "too few columns", "as many as in line 1")
            entry = {(name or "").strip().lower(): value for name, value in line.items()}
            scores = [entry[letter.lower()] for letter in LETTERS if letter.lower() in entry]
            several = len(scores) > 1 and not any(name in entry for name in ANSWER)
            yield place, entry | ({"scores": scores} if several else {})
    except csv.Error as error:
        raise AnswerFileError(f"line {lines.line_num}", str(error), "CSV") from error


def _json(data: bytes) -> Entries:
    content = parse_json(data, MOST_ROWS)
    if isinstance(content, dict) and "answers" in content:
        content = content["answers"]
    if isinstance(content, dict):
        for key, value in content.items():
            yield f"key {key!r:.20}", {"question": key, "answer": value}
        return
    if not isinstance(content, list):
        raise AnswerFileError("JSON", type(content).__name__, "a list or an object")
    for number, entry in enumerate(content):
        yield f"entry {number}", entry


def _json_lines(data: bytes) -> Entries:
    for number, line in enumerate(data.splitlines(), 1):
        if line.strip():
            try:
                yield f"line {number}", parse_json(line, 100)
            except JsonError as error:
                raise AnswerFileError(f"line {number}", error.found, error.expected) from error


READERS = {".csv": _csv, ".json": _json, ".jsonl": _json_lines}


def _parts(entry: dict[str, Any], place: str) -> tuple[Any, Any]:
    """Return the question of an object, None where it names none, and its answer."""
    name = next((name for name in ANSWER if name in entry), None)
    if name is None:
        keys = ", ".join(map(repr, list(entry)[:8]))
        raise AnswerFileError(place, f"the keys {keys}", "answer, scores, or A, B, C")
    return next((entry[name] for name in QUESTION if name in entry), None), entry[name]


def _index(value: Any, place: str) -> int:
    index = _whole(value)
    if index is not None and 0 <= index <= MOST_ROWS:
        return index
    raise AnswerFileError(f"{place}: question", f"{value!r:.40}", "the index of a question, from 0")


def _whole(value: Any) -> int | None:
    """Return a whole number, also one that is written 1.0; None for anything else.

    pandas writes whole numbers so where a value of their column is missing.
    """
    if isinstance(value, str) and re.fullmatch(r"\s*[-+]?[0-9]{1,8}(\.0*)?\s*", value):
        value = float(value)
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def _value(value: Any, place: str) -> int | list[float]:
    """Return an answer, or scores."""
    if isinstance(value, list):
        try:
            return [_number(score) for score in value]
        except ValueError as error:
            raise AnswerFileError(f"{place}: scores", f"{value!r:.60}", "numbers") from error
    text = value.strip().upper() if isinstance(value, str) else "?"
    if value is None or text in ("", "NAN"):  # what pandas writes where a value is missing
        return -1
    index = _whole(value)
    if index is not None and -1 <= index < len(LETTERS):
        return index
    if text in LETTERS and len(text) == 1:
        return LETTERS.index(text)
    said = read_answer(value, len(LETTERS)).answer if isinstance(value, str) else None
    if said is not None:  # "B<|im_end|>", or another reply of a model
        return said
    expected = "an index from 0, a letter from A, or -1 to abstain"
    raise AnswerFileError(f"{place}: answer", f"{value!r:.40}", expected)


def _number(value: Any) -> float:
    if isinstance(value, bool) or value is None or isinstance(value, list | dict):
        raise ValueError(value)
    return float(value)
