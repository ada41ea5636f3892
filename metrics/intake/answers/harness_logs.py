"""Answers that come back from harnesses: their logs become one submission.

Read are logs of Inspect (.eval, .json), which `bench ask` runs, samples of lmms-eval (.jsonl),
result sheets of VLMEvalKit (.tsv, .csv, .xlsx), and what `bench ask` kept before it ran Inspect
(.jsonl).
"""

import csv
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from iqtt.files.reader import QuestionsFile
from iqtt.vlm.export import CIRCULAR
from iqtt.vlm.reading import ENDINGS, Outcome, read_reply, unread_note
from metrics.submissions.rules import NOT_ASKED, OUTCOMES
from metrics.submissions.writer import write_answers
from scenegen.common.errors import FileFormatError, SceneGenError

ABSTAINED = -1
ASKED = b"pix2shape-bench/asked"  # format of what `bench ask` kept
REASONS, LONGEST_REASON = 3, 120  # reasons of failures that are told, and their characters
# What lmms-eval and VLMEvalKit write in place of a reply that never came.
FAILED = re.compile(r"\s*(?:\[LMMS_EVAL_REQUEST_FAILED|Fail(?:ed)? to obtain answer|Error: )")
BLOCKED = "[SAFETY_BLOCKED"  # lmms-eval, where a server refuses
NO_TEXT = ("nan", "NaN", "None", "<NA>")  # what Python and pandas write for nothing


Place = tuple[int, int]  # question and rotation


@dataclass(frozen=True)
class ReturnedAnswer:
    """A model's answer to a row.

    Attributes:
        question: row of the question in its file.
        rotation: letter k showed the answer (k + rotation) mod K of the file.
        answer: of the file, from 0; ABSTAINED where there is none.
        outcome: "answered", "unparsed", "refused" or "cut off".
        digest: of the table that was asked; "" where the log does not tell.
        text: of the model.
    """

    question: int
    rotation: int
    answer: int
    outcome: Outcome
    digest: str
    text: str = ""


@dataclass(frozen=True)
class Log:
    """A log of a harness.

    Attributes:
        path: of the log.
        harness: its name.
        model: its name; "" where the log does not tell.
        settings: how the model was asked; no prompt and no key.
        answers: in the order of questions and rotations.
        tokens: of prompts and of replies, by the model; empty where the log does not tell.
        failures: why a row has no answer, by question and rotation: the model, or the harness,
            failed. These rows are left out of `answers`.
    """

    path: Path
    harness: str
    model: str
    settings: str
    answers: tuple[ReturnedAnswer, ...]
    tokens: tuple[int, ...] = ()
    failures: Mapping[Place, str] = field(default_factory=dict)

    @property
    def failure_note(self) -> str:
        """How many rows failed, and how often each reason came; "" where none failed."""
        if not self.failures:
            return ""
        rows = len(self.answers) + len(self.failures)
        reasons = Counter(self.failures.values()).most_common(REASONS)
        told = "; ".join(f"{reason} ({count})" for reason, count in reasons)
        return f"{len(self.failures)} of {rows} samples failed in {self.harness}: {told}"

    @property
    def notes(self) -> list[str]:
        """What to tell of a log: failures, replies without a letter or an end, and tokens."""
        unread = [
            (f"{answer.question}-{answer.rotation}", answer.text)
            for answer in self.answers
            if answer.answer == ABSTAINED
        ]
        notes = [self.failure_note, unread_note(unread, len(self.answers))]
        cut_off = sum(answer.outcome == "cut off" for answer in self.answers)
        if cut_off:
            notes.append(f"{cut_off} of {len(self.answers)} replies reached --max-tokens")
        if any(self.tokens):
            notes.append(f"{self.tokens[0]:,} input and {self.tokens[1]:,} output tokens")
        return list(filter(None, notes))


def is_log(path: str | Path) -> bool:
    """Return whether a file looks like a log of a harness, and not like a list of answers."""
    path = Path(path)
    if path.suffix == ".eval":
        return True
    with path.open("rb") as file:
        start = file.read(4096)
    if path.suffix == ".jsonl":
        return ASKED in start or b'"doc_id"' in start
    if path.suffix in (".tsv", ".csv"):
        columns = set(re.split(rb"[\t,]", start.split(b"\n")[0].strip()))
        return {b"index", b"prediction", b"A", b"B"} <= columns
    return path.suffix == ".xlsx" or (path.suffix == ".json" and b'"eval"' in start)


def read_returned(path: str | Path) -> Log:
    """Return the answers of a log.

    Rows that failed are left out and counted. A failed row that was answered at another try is an
    answer.

    Raises OSError; FileFormatError for a log that is damaged, of a task that is not ours, in which
    all rows failed, or with two answers to a row.
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
            found = f"two responses to question {row[0]}, rotation {row[1]}"
            raise FileFormatError(path, found, "one each")
        seen.add(row)
    failed = {place: reason for place, reason in log.failures.items() if place not in seen}
    log = replace(
        log,
        answers=tuple(sorted(log.answers, key=lambda a: (a.question, a.rotation))),
        failures=failed,
    )
    if not seen:
        raise FileFormatError(path, log.failure_note or "no responses", "at least one response")
    return log


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
    A question whose rotation 0 failed is left out.

    Raises FileFormatError where the log is of other questions; else as `write_answers`.
    """
    with QuestionsFile(questions_file, part) as questions:
        digest, count, offered = questions.fingerprint or "", len(questions), questions.answers
    for answer in log.answers:
        if answer.digest and digest and answer.digest != digest:
            found = f"responses to questions with the recipe hash {answer.digest[:12]}"
            raise FileFormatError(log.path, found, f"{digest[:12]}, as {questions_file} has it")
        if not 0 <= answer.question < count:
            found = f"a response to question {answer.question}"
            raise FileFormatError(log.path, found, f"questions 0 to {count - 1}")
        if not 0 <= answer.rotation < offered:
            found = f"question {answer.question} in rotation {answer.rotation}"
            raise FileFormatError(log.path, found, f"rotations 0 to {offered - 1}")
    first = [answer for answer in log.answers if answer.rotation == 0]
    if not first:
        found = log.failure_note or "no question with its options in the order of the file"
        raise FileFormatError(log.path, found, "at least one response to a question in rotation 0")
    order = {answer.question: i for i, answer in enumerate(first)}
    rotated = np.full((len(first), offered), NOT_ASKED)
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


def _answer(
    row: Mapping[str, Any], text: str, answers: int, ended: Outcome | None = None
) -> ReturnedAnswer:
    reading, rotation = read_reply(text, answers, ended), int(row["rotation"])
    shown = ABSTAINED if reading.answer is None else (reading.answer + rotation) % answers
    digest, question = str(row.get("digest") or ""), int(row["question_index"])
    return ReturnedAnswer(question, rotation, shown, reading.outcome, digest, text)


def _place(row: Mapping[str, Any]) -> Place:
    return int(row["question_index"]), int(row["rotation"])


def _reason(text: str) -> str:
    """Return what went wrong as one short line."""
    return " ".join(text.split()).encode(errors="replace").decode()[:LONGEST_REASON]


def _of_inspect(path: Path) -> Log:
    from inspect_ai.log import read_eval_log

    log = read_eval_log(str(path))
    answers, failures = [], dict[Place, str]()
    for sample in log.samples or ():
        row, output = sample.metadata, sample.output
        if "question_index" not in row:
            raise FileFormatError(path, "samples of another task", "pix2shape_bench/iqtt")
        failure = _failure_in_inspect(sample)
        if failure:
            failures[_place(row)] = _reason(failure)
            continue
        ended = "refusal" if output.error else output.stop_reason
        answers.append(_answer(row, output.completion, len(row["choices"]), ENDINGS.get(ended)))
    if not (answers or failures) and log.error is not None:
        raise FileFormatError(path, f"no sample: {_reason(log.error.message)}", "samples")
    settings = log.eval.model_generate_config.model_dump(exclude_none=True)
    settings |= log.plan.config.model_dump(exclude_none=True)
    settings |= log.eval.task_args_passed  # how pictures were made
    names = ("temperature", "max_tokens", "layout", "size", "control")
    kept = {name: settings[name] for name in names if name in settings}
    usage = log.stats.model_usage.values()
    tokens = sum(u.input_tokens for u in usage), sum(u.output_tokens for u in usage)
    how = f"asked with Inspect, {json.dumps(kept)}"
    return Log(path, "Inspect", log.eval.model, how, tuple(answers), tokens, failures)


def _failure_in_inspect(sample: Any) -> str:
    """Return why a sample of Inspect has no answer; "" where it has one.

    Retries that came before the answer do not count.
    """
    if sample.error is not None:
        return str(sample.error.message) or "error"
    if sample.limit is not None:
        return f"limit of {sample.limit.type}"
    if sample.invalidation is not None:
        return f"invalidated {sample.invalidation.reason or ''}"
    return "no output" if sample.output.empty and not sample.output.error else ""


def _of_lines(path: Path) -> Log:
    lines = path.read_bytes().split(b"\n")
    if ASKED in lines[0]:
        return _of_ask(lines[:-1], path)
    answers, failures = [], dict[Place, str]()
    for line in map(json.loads, filter(bytes.strip, lines)):
        # lmms-eval 0.7 leaves the row out, but for what `process_results` returned of it.
        doc = line["doc"] if "doc" in line else line["accuracy"]
        if "question_index" not in doc:
            raise FileFormatError(path, "samples of another task", "the task iqtt")
        # A text that is all thoughts is empty once they are filtered.
        text = _first_text(line.get("filtered_resps")) or _first_text(line.get("resps"))
        failure = _failure_in_text(text)
        if failure:
            failures[_place(doc)] = failure
            continue
        ended: Outcome | None = "refused" if text.startswith(BLOCKED) else None
        answers.append(_answer(doc, text, len(doc["choices"]), ended))
    return Log(path, "lmms-eval", "", "asked with lmms-eval", tuple(answers), failures=failures)


def _first_text(value: Any) -> str:
    while isinstance(value, list):
        value = value[0] if value else None
    return value if isinstance(value, str) else ""


def _failure_in_text(text: str) -> str:
    """Return what a harness writes in place of a reply that never came; "" for a reply."""
    return _reason(text) if FAILED.match(text) else "" if text.strip() else "no response"


def _of_ask(lines: list[bytes], path: Path) -> Log:
    """Return what `bench ask` kept: a heading, then replies; a last line may have been cut off."""
    heading, *rows = map(json.loads, lines)
    replies: dict[str, Any] = {}
    for row in rows:
        if "id" in row:  # two processes may have begun the log; the first reply to a row counts
            replies.setdefault(row["id"], row)
    answers = tuple(
        ReturnedAnswer(
            question=row["question_index"],
            rotation=row["rotation"],
            answer=ABSTAINED if row["answer"] is None else row["answer"],
            outcome=row["outcome"],
            digest=str(heading["digest"]),
            text=row["text"],
        )
        for row in replies.values()
    )
    names = ("temperature", "max_tokens", "layout", "size", "control")
    how = f"asked with bench ask, {json.dumps({name: heading[name] for name in names})}"
    return Log(path, "bench ask", str(heading["model"]), how, answers)


def _of_sheet(path: Path) -> Log:
    answers, failures = [], dict[Place, str]()
    for row in _sheet_rows(path):
        rotation, question = divmod(int(row["index"]), CIRCULAR)
        offered = sum(letter in row and str(row[letter]).strip() != "" for letter in "ABC")
        place = {**row, "question_index": question, "rotation": rotation}
        text = "" if row["prediction"] is None else str(row["prediction"])
        failure = "no response" if text in NO_TEXT else _failure_in_text(text)
        if failure:
            failures[question, rotation] = failure
        else:
            answers.append(_answer(place, text, offered))
    how = "asked with VLMEvalKit"
    return Log(path, "VLMEvalKit", "", how, tuple(answers), failures=failures)


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
