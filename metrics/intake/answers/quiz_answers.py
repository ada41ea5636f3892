"""Answers of people, as the page of `iqtt quiz` saves them, become submissions: a run a person."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from iqtt.files.reader import QuestionsFile
from iqtt.quiz.page import MOST_QUESTIONS, questions_digest, quiz_name
from metrics.submissions.problems import JsonError
from metrics.submissions.rules import MOST_ROWS
from metrics.submissions.strict_json import parse_json, read_bytes, validated
from metrics.submissions.writer import write_answers
from scenegen.common.errors import SceneGenError
from scenegen.files.new_file import folder_written_beside

FORMAT = "pix2shape-bench/quiz-answers"
MOST_BYTES = 2**20
NO_MORE = ConfigDict(extra="forbid")

Name = Annotated[str, Field(pattern="^[0-9a-f]{16}$")]


class QuizError(SceneGenError):
    """A file of a participant's answers that is not as it should be."""


@dataclass(frozen=True, config=NO_MORE)
class PracticeAnswer:
    """An answer, from 0, the seconds that it took, and how often its page was shown."""

    answer: Annotated[int, Field(strict=True, ge=0)]
    seconds: Annotated[float, Field(strict=True, ge=0)]
    times_shown: Annotated[int, Field(strict=True, ge=1)]


@dataclass(frozen=True, config=NO_MORE)
class Answer(PracticeAnswer):
    """An answer to a question that counts: a row of its file."""

    question: Annotated[int, Field(strict=True, ge=0, le=MOST_ROWS)]


@dataclass(frozen=True, config=NO_MORE)
class Answers:
    """What the page saves: answers in the order in which they were given.

    Attributes:
        quiz, digest: of the page and of its questions, as `iqtt.quiz.page` has them.
        participant: a random number.
    """

    format: Literal["pix2shape-bench/quiz-answers"]
    format_version: Literal["1.0"]
    quiz: Name
    digest: str
    participant: Name
    answers: Annotated[list[Answer], Field(min_length=1, max_length=MOST_QUESTIONS)]
    practice: list[PracticeAnswer]


def import_quiz(
    paths: Sequence[str | Path],
    questions_file: str | Path,
    folder: str | Path,
    *,
    method: str = "people",
    notes: str = "",
    overwrite: bool = False,
) -> list[Path]:
    """Write the answers of each participant as a submission, all runs of one method.

    Args:
        paths: files of the same quiz.
        questions_file: the questions that were asked.
        folder: of the submissions, each with the participant's number for its name.

    Raises QuizError where a file is broken, of other questions, incomplete or a participant's
    second one; else as `write_answers`.
    """
    with QuestionsFile(questions_file) as questions:
        digest, count, offered = questions_digest(questions), len(questions), questions.answers
    people: dict[str, tuple[Path, Answers]] = {}
    for path in map(Path, paths):
        answers = read_answers(path)
        _check(path, answers, digest, count, offered)
        if answers.participant in people:
            found = f"participant {answers.participant}, as in {people[answers.participant][0]}"
            raise QuizError(path, found, "each participant once")
        people[answers.participant] = path, answers
        first, other = next(iter(people.values()))
        if answers.quiz != other.quiz:
            expected = f"{other.quiz}, as in {first}"
            raise QuizError(f"{path}: quiz", answers.quiz, expected, "import each quiz by itself")
    names = {f"{name}.h5": answers for name, (_, answers) in people.items()}
    with folder_written_beside(folder, list(names), overwrite) as made:
        for name, answers in names.items():
            write_answers(
                made / name, questions_file,
                method=method, run=answers.participant, notes=notes,
                rows=[answer.question for answer in answers.answers],
                answer=[answer.answer for answer in answers.answers],
            )  # fmt: skip
    return [Path(folder) / name for name in names]


def read_answers(path: str | Path) -> Answers:
    """Read a file of a participant's answers. Raises OSError, and QuizError for no such file."""
    try:
        content = parse_json(read_bytes(Path(path), MOST_BYTES), 100)
        if not isinstance(content, dict) or content.get("format") != FORMAT:
            raise QuizError(path, "no responses of a quiz", "a file that the page of a quiz saved")
        return validated(Answers, content)
    except JsonError as error:
        place = f"{path}: {error.where}" if error.where else str(path)
        raise QuizError(place, error.found, error.expected) from error


def _check(path: Path, answers: Answers, digest: str, count: int, offered: int) -> None:
    """Raise QuizError unless all questions of a quiz about these ones are answered, each once."""
    if answers.digest != digest:
        found = f"responses to questions with the recipe hash {answers.digest:.12}"
        raise QuizError(path, found, f"{digest:.12}, that of the questions")
    rows = [answer.question for answer in answers.answers]
    for i, answer in enumerate(answers.answers):
        if answer.question >= count:
            place = f"{path}: answers[{i}].question"
            raise QuizError(place, answer.question, f"at most {count - 1}")
        if answer.answer >= offered:
            place = f"{path}: answers[{i}].answer"
            raise QuizError(place, answer.answer, f"at most {offered - 1}")
        if answer.question in rows[:i]:
            place = f"{path}: answers[{i}].question"
            raise QuizError(place, f"question {answer.question} twice", "each question once")
    if quiz_name(digest, rows) != answers.quiz:
        found = f"{len(rows)} responses that do not belong to the quiz {answers.quiz}"
        raise QuizError(path, found, "a response to each of its questions")
