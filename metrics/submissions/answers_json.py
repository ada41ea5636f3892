"""Answers to questions as JSON: a list, or an object from index to answer, as 3D-IQTT took them."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from metrics.submissions.array_checks import Ids, answer_problems, id_problems
from metrics.submissions.layout import ATTRIBUTES, MOST_ROWS, text_fault
from metrics.submissions.problems import Problem, first_ids

MOST_BYTES = 32 * 2**20
TEXTS = ("method", "run", "notes")
_EXPECTED = "0, 1, 2 or -1 for each question"


class _NotAnswersError(Exception):
    """Why a text is no JSON that we take; the reader turns it into a `Problem`."""


def looks_like_json(path: Path) -> bool:
    """Whether a file is to be read as JSON: by its first character, or else its name."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        start = file.read(64)
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip()
    return text[:1] in (b"[", b"{") or (path.suffix == ".json" and start[1:4] != b"HDF")


def read_answers(path: Path) -> tuple[dict[str, str], Ids, Ids, list[Problem]]:
    """Read a file of answers: its texts, ids (M,), answers (M,), and what is wrong with them.

    The texts are `method`, which is the file's name where it is not told, `run` and `notes`. What
    is wrong with the content is returned, never raised. Raises OSError.
    """
    nothing = np.zeros(0, np.int64)
    size = path.stat().st_size
    if size > MOST_BYTES:
        got, expected = f"{size} bytes of JSON", f"at most {MOST_BYTES}; HDF5 holds more"
        return {}, nothing, nothing, [Problem("file", "size", expected, got)]
    try:
        content = _parse(path.read_bytes())
        texts, listed = _unwrap(content, path.stem)
        ids, answers = _pairs(listed)
    except _NotAnswersError as error:
        return {}, nothing, nothing, [Problem("file", "JSON", _EXPECTED, str(error))]
    problems = [
        Problem(a.name, "value", fault[1], fault[0])
        for a in ATTRIBUTES
        if a.name in texts and (fault := text_fault(a, texts[a.name])) is not None
    ]
    whole = [type(value) is int and abs(value) < 2**31 for value in answers]
    if not all(whole):
        first = whole.index(False)
        got = f"{whole.count(False)} values that are no such number, such as {answers[first]!r:.40}"
        at = first_ids(int(ids[i]) for i, good in enumerate(whole) if not good)
        return texts, nothing, nothing, [*problems, Problem("answers", "type", _EXPECTED, got, at)]
    numbers = np.array(answers, np.int64)
    problems += id_problems(ids, "answers") or answer_problems(numbers, ids, "answers")
    return texts, ids, numbers, problems


def _parse(data: bytes) -> Any:
    try:
        return json.loads(data, parse_constant=_refuse_constant, object_pairs_hook=_unique)
    except RecursionError as error:
        raise _NotAnswersError("JSON that is nested too deeply") from error
    except ValueError as error:
        raise _NotAnswersError(f"no JSON ({' '.join(str(error).split())[:80]})") from error


def _refuse_constant(name: str) -> Any:
    raise _NotAnswersError(f"the value {name}")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise _NotAnswersError(f"the key {name!r:.40} twice")
        found[name] = value
    return found


def _unwrap(content: Any, name: str) -> tuple[dict[str, str], Any]:
    """Return the texts, and the list or object of answers."""
    if not isinstance(content, dict) or "answers" not in content:
        return {"method": name}, content
    texts = {"method": name}
    for key, value in content.items():
        if key == "answers":
            continue
        if key not in TEXTS:
            raise _NotAnswersError(f"the key {key!r:.40} beside 'answers'")
        if not isinstance(value, str):
            raise _NotAnswersError(f"{key} {value!r:.40}, which is no text")
        texts[key] = value
    return texts, content["answers"]


def _pairs(listed: Any) -> tuple[Ids, list[Any]]:
    """Return the indices of the questions and what was given as their answers."""
    if isinstance(listed, list):
        return np.arange(len(listed), dtype=np.int64), listed
    if not isinstance(listed, dict):
        raise _NotAnswersError(f"{type(listed).__name__}, neither a list nor an object")
    for key in listed:
        if not re.fullmatch(r"0|[1-9][0-9]{0,7}", key) or int(key) > MOST_ROWS:
            raise _NotAnswersError(f"the key {key!r:.40}, which is no index of a question")
    return np.array([int(key) for key in listed], np.int64), list(listed.values())
