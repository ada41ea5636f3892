"""Answers to questions as JSON: a list, or an object from index to answer, as 3D-IQTT took them.

This module imports pydantic: import it only where a JSON file is really read.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import ConfigDict, FailFast, Field, TypeAdapter

from metrics.submissions.inspection import Inspection, take_texts, take_values
from metrics.submissions.problems import JsonError, Problem
from metrics.submissions.rules import MOST_ROWS
from metrics.submissions.strict_json import parse_json, read_bytes, refusal, shown, validated

MOST_BYTES = 32 * 2**20
SCORES = "pix2shape-bench/scores"
ADVICE = "`bench leaderboard` and `bench compare` read them"
_EXPECTED = (
    "a list or an object with a whole number for each question: the selected option from 0, or -1"
)
_ANSWERS = TypeAdapter(
    Annotated[list[Annotated[int, Field(strict=True, gt=-(2**31), lt=2**31)]], FailFast()]
)


@dataclass(frozen=True)
class NamedAnswers:
    """Answers with what the submission says of itself; the list or object is checked later."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    answers: Any
    method: str
    run: str = ""
    notes: str = ""


def read_answers(path: Path) -> Inspection:
    """Read a file of answers, and what is wrong with it, which is never raised. Raises OSError.

    The method defaults to the file's name.
    """
    result = Inspection(task="iqtt")
    try:
        content = parse_json(read_bytes(path, MOST_BYTES), MOST_ROWS)
        if isinstance(content, dict) and content.get("format") == SCORES:
            raise JsonError("", f"the scores of a submission: {ADVICE}", "a submission")
        if not isinstance(content, dict) or "answers" not in content:
            content = {"answers": content}
        submission = validated(NamedAnswers, {"method": path.stem, **content})
        ids, answers = _pairs(submission.answers)
    except JsonError as error:
        found = f"{error.where}: {error.found}" if error.where else error.found
        result.problems.append(Problem("file", "JSON", error.expected, found))
        return result
    take_texts(result, {name: getattr(submission, name) for name in ("method", "run", "notes")})
    result.arrays = {"question": ids, "answer": answers}
    take_values(result)
    return result


def _pairs(answers: Any) -> tuple[Any, Any]:
    """Return the indices of the questions, (M,), and the answers to them, (M,)."""
    if not isinstance(answers, list | dict):
        raise refusal("", shown(answers), _EXPECTED)
    for key in answers if isinstance(answers, dict) else ():
        if not re.fullmatch(r"0|[1-9][0-9]{0,7}", key) or int(key) > MOST_ROWS:
            raise refusal("", f"the key {key!r:.40}", "the index of a question")
    ids = list(map(int, answers)) if isinstance(answers, dict) else range(len(answers))
    values = list(answers.values()) if isinstance(answers, dict) else answers
    try:
        numbers = validated(_ANSWERS, values)
    except JsonError as error:
        raise refusal(f"answers{error.where}", error.found, _EXPECTED) from error
    return np.array(ids, np.int64), np.array(numbers, np.int64)
