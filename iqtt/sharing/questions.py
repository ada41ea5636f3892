"""Files of questions, handed on: what exports and data cards tell of them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from iqtt.files.layout import answer_column, question_columns, truth_columns
from iqtt.files.reader import QuestionsFile
from iqtt.perspective.specs import PerspectiveSpec
from iqtt.questions.specs import SplitSpec
from iqtt.sharing.published import handed_out
from scenegen.common.text_table import piped
from scenegen.files.schema import Column
from scenegen.sharing.card import Publication, write_card
from scenegen.sharing.task import Task

KEYWORDS = (
    "synthetic", "3d", "mental-rotation", "visual-reasoning", "multiple-choice",
    "single-image-3d", "3d-iqtt", "pix2shape-bench",
)  # fmt: skip
TEMPLATES = Path(__file__).parent / "templates"


def write_questions_card(
    path: str | Path,
    tables: Sequence[QuestionsFile],
    publication: Publication,
    overwrite: bool = False,
) -> None:
    """Write the data card of a split, whole or in shards, as `write_card`.

    The answers of the test questions are handed out too where they were opened with these.

    Args:
        tables: as from `published.open_split`.

    Raises as `write_card`.
    """
    answers = [table.beside for table in tables if table.beside is not None]
    facts = [
        {
            "file": table.path.name,
            "part": table.part,
            "split": str(table.split),
            "questions": str(len(table)),
            "labelled": "yes" if table.has_answers else "no",
            "image": f"{table.height}x{table.width}, {table.image_dtype}",
            "fingerprint": table.fingerprint or "",
        }
        for table in tables
    ]
    of_rooms = isinstance(tables[0].spec, PerspectiveSpec)
    template = TEMPLATES / ("perspective.md" if of_rooms else "questions.md")
    write_card(
        path, publication, template, tables, handed_out(tables), overwrite,
        answers=answers,
        keywords=KEYWORDS,
        facts=facts,
        columns=_columns(tables[-1]),
        has_test=any(table.split == "test" for table in tables),
        with_answers=bool(answers),
    )  # fmt: skip


def exported_columns(questions: QuestionsFile) -> list[Column]:
    """Return the columns: each image, the right answer and the truth, as far as told."""
    stored = question_columns(questions.spec or SplitSpec())[0]
    image = Column(
        "reference",
        (questions.height, questions.width, 3),
        questions.image_dtype,
        stored.unit,
        stored.frame,
        "RGB",
        own_chunk=True,
        more={"scale": 1 / 255 if questions.image_dtype == "uint8" else 1.0},
    )
    columns = [image, *(replace(image, name=f"answer_{k}") for k in range(questions.answers))]
    if questions.has_answers:
        columns.append(replace(answer_column(), name="answer"))
    if questions.has_truth:
        assert questions.spec is not None  # truth is read only where there is one
        columns += truth_columns(questions.spec)
    return columns


def _exported_values(stored: Mapping[str, Any]) -> dict[str, Any]:
    reference, *answers = stored["questions"]
    values = {**stored, "reference": reference}
    values |= {f"answer_{k}": image for k, image in enumerate(answers)}
    return {**values, "answer": stored["answers"]} if "answers" in stored else values


def _columns(table: QuestionsFile) -> str:
    """Return a Markdown table of the data sets; those of the truth lie in the group `truth`."""
    spec = table.spec
    assert spec is not None  # `open_split` refuses released files
    rows = [("dataset", "row", "type", "unit", "meaning")]
    truth = [replace(column, name=f"truth/{column.name}") for column in truth_columns(spec)]
    for column in (*question_columns(spec), answer_column(), *truth):
        shape = "(" + ", ".join(map(str, column.shape)) + ")"
        rows.append((f"`{column.name}`", shape, column.dtype, column.unit, column.meaning))
    return "\n".join(piped(rows))


QUESTIONS = Task("a file of 3D-IQTT questions", exported_columns, _exported_values)
