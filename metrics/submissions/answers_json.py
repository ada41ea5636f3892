"""Answers to questions as JSON: a list, or an object from index to answer, as 3D-IQTT took them.

This module imports pydantic: import it only where a JSON file is really read.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ConfigDict

from metrics.submissions.layout import ATTRIBUTES, text_fault
from metrics.submissions.problems import JsonError, Problem, first_ids
from metrics.submissions.rules import MOST_ROWS, Ids, value_problems
from metrics.submissions.strict_json import (
    parse_json,
    read_bytes,
    refusal,
    shown,
    validated,
)

MOST_BYTES = 32 * 2**20
SCORES = "pix2shape-bench/scores"
ADVICE = "`bench leaderboard` and `bench compare` read them"
_EXPECTED = "a whole number for each question: the answer from 0, or -1"


@dataclass(frozen=True)
class NamedAnswers:
    """Answers with what the submission says of itself; the list or object is checked later."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    answers: Any
    method: str
    run: str = ""
    notes: str = ""


def read_answers(path: Path) -> tuple[dict[str, str], Ids, Ids, list[Problem]]:
    """Read a file of answers: its texts, ids (M,), answers (M,), and what is wrong with them.

    The texts are `method`, which defaults to the file's name, `run` and `notes`. What is wrong with
    the content is returned, never raised. Raises OSError.
    """
    nothing = np.zeros(0, np.int64)
    try:
        content = parse_json(read_bytes(path, MOST_BYTES), MOST_ROWS)
        if isinstance(content, dict) and content.get("format") == SCORES:
            raise JsonError("", f"the scores of a submission: {ADVICE}", "a submission")
        if not isinstance(content, dict) or "answers" not in content:
            content = {"answers": content}
        submission = validated(NamedAnswers, {"method": path.stem, **content})
        ids, answers = _pairs(submission.answers)
    except JsonError as error:
        what = f"{error.where}: {error.found}" if error.where else error.found
        return {}, nothing, nothing, [Problem("file", "JSON", error.expected, what)]
    texts = {name: getattr(submission, name) for name in ("method", "run", "notes")}
    problems = [
        Problem(a.name, "value", fault[1], fault[0])
        for a in ATTRIBUTES
        if a.name in texts and (fault := text_fault(a, texts[a.name])) is not None
    ]
    whole = [type(value) is int and abs(value) < 2**31 for value in answers]
    if not all(whole):
        first = shown(answers[whole.index(False)])
        what = f"{whole.count(False)} values that are no such number, such as {first}"
        at = first_ids(int(ids[i]) for i, good in enumerate(whole) if not good)
        return texts, nothing, nothing, [*problems, Problem("answers", "type", _EXPECTED, what, at)]
    numbers = np.array(answers, np.int64)
    problems += value_problems("question", ids, ids) or value_problems("answer", numbers, ids)
    return texts, ids, numbers, problems


def _pairs(listed: Any) -> tuple[Ids, list[Any]]:
    """Return the indices of the questions and what was given as their answers."""
    if isinstance(listed, list):
        return np.arange(len(listed), dtype=np.int64), listed
    if not isinstance(listed, dict):
        raise refusal("", shown(listed), f"a list or an object: {_EXPECTED}")
    for key in listed:
        if not re.fullmatch(r"0|[1-9][0-9]{0,7}", key) or int(key) > MOST_ROWS:
            raise refusal("", f"the key {key!r:.40}", "the index of a question")
    return np.array([int(key) for key in listed], np.int64), list(listed.values())
