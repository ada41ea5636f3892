"""Answers that come back from harnesses: their logs become one submission.

Read are logs of `bench ask` (.jsonl), of Inspect (.eval, .json), samples of lmms-eval (.jsonl) and
result sheets of VLMEvalKit (.tsv, .csv, .xlsx).
"""

import csv
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from iqtt.files.reader import QuestionsFile
from iqtt.vlm.ask import FORMAT as ASKED
from iqtt.vlm.ask import read_heading, read_log
from iqtt.vlm.export import CIRCULAR
from iqtt.vlm.reading import Outcome, Reading, read_answer
from metrics.submissions.rules import OUTCOMES
from metrics.submissions.writer import write_answers
from scenegen.common.errors import FileFormatError, SceneGenError

ABSTAINED = -1


@dataclass(frozen=True)
class ReturnedAnswer:
    """A model's answer to a row.

    Attributes:
        question: row of the question in its file.
        rotation: letter k showed the answer (k + rotation) mod K of the file.
        answer: of the file, from 0; ABSTAINED where there is none.
        outcome: "answered", "unparsed" or "refused".
        digest: of the table that was asked; "" where the log does not tell.
    """

    question: int
    rotation: int
    answer: int
    outcome: Outcome
    digest: str


@dataclass(frozen=True)
class Log:
    """A log of a harness.

    Attributes:
        path: of the log.
        model: its name; "" where the log does not tell.
        settings: how the model was asked; no prompt and no key.
        answers: in the order of questions and rotations.
    """

    path: Path
    model: str
    settings: str
    answers: tuple[ReturnedAnswer, ...]


def is_log(path: str | Path) -> bool:
    """Return whether a file looks like a log of a harness, and not like a list of answers."""
    path = Path(path)
    if path.suffix == ".eval":
        return True
    with path.open("rb") as file:
        start = file.read(4096)
    if path.suffix == ".jsonl":
        return ASKED.encode() in start or b'"doc_id"' in start
    if path.suffix in (".tsv", ".csv"):
        columns = set(re.split(rb"[\t,]", start.split(b"\n")[0].strip()))
        return {b"index", b"prediction", b"A", b"B"} <= columns
    return path.suffix == ".xlsx" or (path.suffix == ".json" and b'"eval"' in start)


def read_returned(path: str | Path) -> Log:
    """Return the answers of a log.

    Raises OSError; FileFormatError for a log that is damaged, of a task that is not ours, or with
    two answers to a row.
    """
    path = Path(path)
    readers = {".eval": _of_inspect, ".json": _of_inspect, ".jsonl": _of_lines}
    try:
        log = readers.get(path.suffix, _of_sheet)(path)
    except (SceneGenError, OSError):
        raise
    except Exception as error:  # the file is a stranger's, and so may its fault be of any kind
        found = f"{type(error).__name__}: {error}"[:200]
        raise FileFormatError(path, found, "the log of a harness") from error
    seen: set[tuple[int, int]] = set()
    for answer in log.answers:
        row = answer.question, answer.rotation
        if row in seen:
            found = f"two answers to question {row[0]}, rotation {row[1]}"
            raise FileFormatError(path, found, "one each")
        seen.add(row)
    if not seen:
        raise FileFormatError(path, "no answers", "at least one")
    return replace(log, answers=tuple(sorted(log.answers, key=lambda a: (a.question, a.rotation))))


def write_returned(
    out: str | Path,
    questions_file: str | Path,
    log: Log,
    *,
    part: str | None = None,
    method: str = "",
    run: str = "",
    notes: str = "",
    overwrite: bool = False,
) -> int:
    """Write the answers of a log as a submission; return how many questions they answer.

    The answer to a question is that of rotation 0; where it has no letter it counts as wrong. The
    answers of all rotations are stored beside it, for circular accuracy, and so is the outcome.

    Raises FileFormatError where the log is of other questions; else as `write_answers`.
    """
    with QuestionsFile(questions_file, part) as questions:
        digest, count, offered = questions.fingerprint or "", len(questions), questions.answers
    for answer in log.answers:
        if answer.digest and digest and answer.digest != digest:
            found = f"answers to questions with the digest {answer.digest[:12]}"
            raise FileFormatError(log.path, found, f"{digest[:12]}, as {questions_file} has it")
        if not 0 <= answer.question < count:
            found = f"an answer to question {answer.question}"
            raise FileFormatError(log.path, found, f"questions 0 to {count - 1}")
        if not 0 <= answer.rotation < offered:
            found = f"question {answer.question} in rotation {answer.rotation}"
            raise FileFormatError(log.path, found, f"rotations 0 to {offered - 1}")
    first = [answer for answer in log.answers if answer.rotation == 0]
    order = {answer.question: i for i, answer in enumerate(first)}
    rotated = np.full((len(first), offered), ABSTAINED)
    for answer in log.answers:
        if answer.question in order:
            rotated[order[answer.question], answer.rotation] = answer.answer
    rotations = {answer.rotation for answer in log.answers}
    write_answers(
        out, questions_file,
        method=method or log.model or "model", run=run, notes=notes or log.settings,
        overwrite=overwrite,
        rows=[answer.question for answer in first],
        answer=[answer.answer for answer in first],
        outcome=[OUTCOMES.index(answer.outcome) for answer in first],
        rotated=rotated if len(rotations) > 1 else None,
    )  # fmt: skip
    return len(first)


def _answer(row: Mapping[str, Any], text: str, answers: int) -> ReturnedAnswer:
    return _from_reading(row, read_answer(text, answers), answers)


def _from_reading(row: Mapping[str, Any], reading: Reading, answers: int) -> ReturnedAnswer:
    rotation = int(row["rotation"])
    shown = ABSTAINED if reading.answer is None else (reading.answer + rotation) % answers
    digest = str(row.get("digest") or "")
    return ReturnedAnswer(int(row["question_index"]), rotation, shown, reading.outcome, digest)


def _of_inspect(path: Path) -> Log:
    from inspect_ai.log import read_eval_log

    log = read_eval_log(str(path))
    answers = []
    for sample in log.samples or ():
        row = sample.metadata
        if "question_index" not in row:
            raise FileFormatError(path, "samples of another task", "pix2shape_bench/iqtt")
        answers.append(_answer(row, sample.output.completion, len(row["choices"])))
    settings = log.eval.model_generate_config.model_dump(exclude_none=True)
    kept = {name: settings[name] for name in ("temperature", "max_tokens") if name in settings}
    return Log(path, log.eval.model, f"asked with Inspect, {json.dumps(kept)}", tuple(answers))


def _of_lines(path: Path) -> Log:
    lines = path.read_bytes().splitlines()
    if lines and ASKED.encode() in lines[0]:
        return _of_ask(path)
    answers = []
    for line in map(json.loads, filter(bytes.strip, lines)):
        # lmms-eval 0.7 leaves the row out, but for what `process_results` returned of it.
        doc, text = line["doc"] if "doc" in line else line["accuracy"], line["filtered_resps"]
        while isinstance(text, list):
            text = text[0]
        if "question_index" not in doc:
            raise FileFormatError(path, "samples of another task", "the task iqtt")
        answers.append(_answer(doc, text, len(doc["choices"])))
    return Log(path, "", "asked with lmms-eval", tuple(answers))


def _of_ask(path: Path) -> Log:
    heading = read_heading(path)
    digest = str(heading["digest"])
    answers = tuple(
        ReturnedAnswer(
            line["question_index"],
            line["rotation"],
            ABSTAINED if line["answer"] is None else line["answer"],
            line["outcome"],
            digest,
        )
        for line in read_log(path).values()
    )
    names = ("temperature", "max_tokens", "layout", "size", "control")
    kept = json.dumps({name: heading[name] for name in names})
    return Log(path, str(heading["model"]), f"asked with bench ask, {kept}", answers)


def _of_sheet(path: Path) -> Log:
    answers = []
    for row in _sheet_rows(path):
        question, rotation = int(row["index"]) % CIRCULAR, int(row["index"]) // CIRCULAR
        offered = sum(letter in row and str(row[letter]).strip() != "" for letter in "ABC")
        place = {**row, "question_index": question, "rotation": rotation}
        answers.append(_answer(place, str(row["prediction"] or ""), offered))
    return Log(path, "", "asked with VLMEvalKit", tuple(answers))


def _sheet_rows(path: Path) -> Iterator[Mapping[str, Any]]:
    if path.suffix == ".xlsx":
        from openpyxl import load_workbook

        with closing(load_workbook(path, read_only=True)) as book:
            heading, *rows = book.active.values
        yield from (dict(zip(heading, row, strict=True)) for row in rows)
        return
    csv.field_size_limit(1 << 30)  # pictures in base64
    with path.open(encoding="utf-8", newline="") as file:
        delimiter = "\t" if path.suffix == ".tsv" else ","
        yield from csv.DictReader(file, delimiter=delimiter)
