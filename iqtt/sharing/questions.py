"""Files of questions, handed on: exported rows, and the data card of a split."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from iqtt.files.layout import answer_column, question_columns, truth_columns
from iqtt.files.reader import AnswersFile, QuestionsFile
from iqtt.files.split import MANIFEST
from iqtt.questions.specs import DISTRACTOR_KINDS, SplitSpec
from iqtt.sharing.published import PublishedSplit, published_split
from iqtt.sharing.texts import (
    GIVEN,
    HELD,
    KEYWORDS,
    READING,
    RESPONSIBLE,
    SPLITS_TEXT,
    SUMMARY,
)
from scenegen.common.text_table import piped
from scenegen.files.schema import Column
from scenegen.sharing.card import (
    HDF5,
    JSON,
    DataDescription,
    Publication,
    shared_file,
    tool,
    write_card,
)
from scenegen.sharing.export import ExportedTable, write_export
from scenegen.sharing.index import IndexKind, Line, Tally, counts_table, write_index


def export_questions(
    path: str | Path, form: str, folder: str | Path, part: str | None = None, **how: Any
) -> list[Path]:
    """Write a table of questions, ours or a released one, as `write_export`; return its files.

    Files are called `iqtt-train-labeled-00000-of-00003.parquet` after `iqtt-train.h5` and its part
    "labeled". Only what the file itself tells is written: a file of test questions has no answers.

    Args:
        how: `encoding`, `rows_per_file`, `overwrite` and `progress` of `write_export`.

    Raises as `write_export` and `QuestionsFile`.
    """
    with QuestionsFile(path, part) as questions:
        which = f", {questions.part}" if questions.part else ""
        table = ExportedTable(
            stem="-".join(filter(None, (Path(path).stem, questions.part))),
            what=f"rows of {questions.path.name}{which}, a file of 3D-IQTT questions",
            file=questions,
            columns=exported_columns(questions),
            values=_exported_values,
        )
        return write_export(table, form, folder, **how)


def exported_columns(questions: QuestionsFile) -> list[Column]:
    """Return the columns: each image, the right answer and the truth, as far as told."""
    image = Column(
        "reference",
        (questions.height, questions.width, 3),
        questions.image_dtype,
        "linear radiance, times `scale`",
        "pixels: row 0 on top",
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


def make_questions_card(
    folder: str | Path,
    card: str | Path,
    publication: Publication,
    *,
    with_answers: bool = False,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write the data card of a split, whole or in shards, to a folder; return its files.

    The same split and the same publication give the same bytes, as of `make_rooms_card`.

    Args:
        folder: of the split, as `iqtt make-split` writes it.
        card: folder to make; with `overwrite`, an older card is replaced.
        publication: what only the person who publishes the data knows.
        with_answers: whether the answers of the test questions are handed out too.
        progress: is told the number of questions that were read since the last call.

    Raises as `write_card` and `published_split`; FileFormatError where a file is damaged.
    """
    split = published_split(folder, with_answers)

    def describe(index: Path) -> DataDescription:
        tables = [table.open for table in split.tables]
        return _description(split, write_index(index, QUESTIONS, tables, progress))

    return write_card(card, publication, describe, overwrite)


def _line(questions: QuestionsFile, stored: Mapping[str, Any]) -> Line:
    """Return what the file tells of a question beside its images; None where it does not."""
    line: Line = dict.fromkeys(column.name for column in QUESTIONS.columns)
    line |= {"split": questions.split, "part": questions.part, "answer_count": questions.answers}
    if questions.has_answers:
        line["answer"] = int(stored["answers"])
    if questions.has_truth:
        kinds = [DISTRACTOR_KINDS[kind] for kind in stored["distractor_kind"] if kind >= 0]
        line |= {
            "cube_count": int(stored["cube_count"]),
            "camera_distance": float(stored["camera_distance"]),
            "angle_degrees": float(stored["angle_degrees"]),
            "distractor_kinds": kinds,
        }
    return line


def _told(name: str) -> Callable[[Line], Sequence[Any]]:
    """Count a value of a line where it is told."""
    return lambda line: [] if line[name] is None else [line[name]]


# fmt: off
QUESTIONS = IndexKind(
    columns=(
        Column("split", (), "text", meaning="what the questions are for: train, val or test"),
        Column("part", (), "text", meaning="table of the file: labeled or unlabeled; empty where it"
               " has only one"),
        Column("answer_count", (), "int32", meaning="number of answers that are offered"),
        Column("answer", (), "int32", meaning="which of them shows the reference's shape, from 0;"
               " null where the files do not tell, as in the columns that follow"),
        Column("cube_count", (), "int32", meaning="cubes of each of the shapes"),
        Column("camera_distance", (), "float64", meaning="from the camera of all images to the"
               " world's origin, cube edges"),
        Column("angle_degrees", (), "float64", meaning="smallest rotation from the reference's view"
               " to the right answer's, degrees"),
        Column("distractor_kinds", (-1,), "text",
               meaning="kinds of the wrong answers, in their order"),
    ),
    digested=("questions",),
    line=_line,
    counts={
        "right answers by place": _told("answer"),
        "questions by number of cubes": _told("cube_count"),
        "wrong answers by kind": lambda line: line["distractor_kinds"] or [],
        "questions by angle, in steps of 30 degrees": lambda line: [
            int(angle // 30) * 30 for angle in _told("angle_degrees")(line)
        ],
    },
    same="questions_sha256",
    verify="iqtt verify",
)
# fmt: on


def _description(split: PublishedSplit, tallies: Sequence[Tally]) -> DataDescription:
    """Return what is to be told of a split, given the tallies of its tables.

    Every byte of the files that are handed out is read, for their SHA-256.
    """
    facts = [("file", "part", "split", "questions", "answers told", "image", "fingerprint")]
    requests, commands, tools = {}, {}, set()
    for table, tally in zip(split.tables, tallies, strict=True):
        with table.open() as file:
            assert file.spec is not None  # `published_split` refuses released files
            spec, name = file.spec.public(), table.path.name
            size = f"{file.height}x{file.width}, {file.image_dtype}"
            counts = str(tally.rows), str(tally.counters["right answers by place"].total())
            facts.append((name, table.part, table.split, *counts, size, file.fingerprint or ""))
            requests[name] = file.attributes["spec"]
            tools.add(tool(file.attributes))
    if split.answers is not None:
        with AnswersFile(split.answers) as answers:
            requests[split.answers.name] = answers.attributes["spec"]
            commands[split.answers.name] = answers.attributes.get("creation_command", "unknown")
    notes = {"Reading": READING, "Splits": _splits(split.count, tallies)}
    if any(table.split == "test" for table in split.tables):
        notes["Test answers"] = HELD if split.answers is None else GIVEN
    names = [table.name for table in split.tables]
    return DataDescription(
        summary=SUMMARY,
        keywords=KEYWORDS,
        files=[
            shared_file(path, JSON if path.name == MANIFEST else HDF5, meaning)
            for path, meaning in split.files
        ],
        columns=QUESTIONS.all_columns,
        key=("file", "part", "row"),
        rows=split.count,
        facts={"Files": facts, "What they hold": counts_table("questions", names, tallies)},
        commands=commands,
        requests=requests,
        layout=_layout(spec),
        responsible={**RESPONSIBLE, "machine_annotation_tools": sorted(tools)},
        notes=notes,
    )


def _splits(count: int, tallies: Sequence[Tally]) -> str:
    """Return how the splits are cut, and whether a question is there twice."""
    again = count - len(set().union(*(tally.digests for tally in tallies)))
    if again:
        return f"**{again} questions have the images of another one.** {SPLITS_TEXT}"
    return f"No two questions have the same images. {SPLITS_TEXT}"


def _layout(spec: SplitSpec) -> str:
    """Return a Markdown table of the data sets; those of the truth lie in the group `truth`."""
    rows = [("dataset", "row", "type", "unit", "meaning")]
    truth = [replace(column, name=f"truth/{column.name}") for column in truth_columns(spec)]
    for column in (*question_columns(spec), answer_column(), *truth):
        shape = "(" + ", ".join(map(str, column.shape)) + ")"
        rows.append((f"`{column.name}`", shape, column.dtype, column.unit, column.meaning))
    return "\n".join(piped(rows))
