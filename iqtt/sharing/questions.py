"""Files of questions, handed on: what exports and data cards tell of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from iqtt.files.layout import answer_column, question_columns, truth_columns
from iqtt.files.reader import QuestionsFile
from iqtt.questions.kinds import DISTRACTOR_KINDS
from iqtt.sharing.published import handed_out
from scenegen.common.text_table import piped
from scenegen.files.schema import Column
from scenegen.sharing.card import write_card
from scenegen.sharing.publication import Publication
from scenegen.sharing.task import Line, Tally, Task

KEYWORDS = (
    "synthetic", "3d", "mental-rotation", "visual-reasoning", "multiple-choice",
    "single-image-3d", "3d-iqtt", "pix2shape-bench",
)  # fmt: skip
SUMMARY = (
    "Mental-rotation questions (3D-IQTT), rendered by a program: a reference image of a shape made"
    " of cubes, and two or three answers, of which one shows the same shape from another side."
    " Every cube of a shape shows in every picture."
)
READING = """The HDF5 files are read by any HDF5 library. In Python:

    import h5py

    with h5py.File(name) as f:
        reference, *answers = f["questions"][row]  # (H, W, 3) each
        radiance = reference * f["questions"].attrs["scale"]  # linear RGB, 0 to 1

In the training file the data sets lie in the groups `labeled` and `unlabeled`, and the truth in
`truth/labeled` and `truth/unlabeled`. A file of test questions has `questions` alone.
`datasets.load_dataset(folder, "index")` reads the index, and so does `mlcroissant` by
`croissant.json`. Lengths are in cube edges. World and camera: right-handed, y up; the camera lies
on +z and looks along -z. Images are linear: no gamma is applied."""
SPLITS_TEXT = """The shapes are what the splits are cut by: the program gives each class of shapes,
mirror images included, to one of training, validation and test, for ever and whatever the seed.
`iqtt audit` of pix2shape-bench proves it of files that tell their shapes. Questions of `unlabeled`
have no answers beside them, but `truth/unlabeled` tells them: a learner must not look there."""
HELD = """**The answers to the test questions are not part of this data.** Those who made it hold
them and score predictions. Neither the files nor the index tell shapes, views, kinds or angles of
test questions. Whoever knows the seed can make the answers again, so no file tells it."""
GIVEN = """**The answers to the test questions are part of this data**, in `iqtt-test-answers.h5`
and in the index. Nothing keeps a method from having been chosen by them."""
RESPONSIBLE: dict[str, str | list[str]] = {
    "data_collection": "Nothing was collected. Shapes are drawn by a program from settings and a"
    " seed, turned and lit at random, and rendered by ray casting. The page README.md has all"
    " settings.",
    "data_collection_missing_data": "Questions of `unlabeled` and of the test have no answers"
    " beside them. Where depth is stored it is NaN on the background. Nothing is filled in.",
    "data_preprocessing_protocol": [
        "None: values are stored as they were rendered. Images of 8 bits are linear radiance from"
        " 0 to 1, rounded to 255 steps."
    ],
    "data_annotation_protocol": [
        "No person labelled anything. The right answer shows the reference's own shape, and the"
        " wrong ones shapes that no rotation takes to it. `iqtt audit` recomputes both from the"
        " stored cubes, with code that shares nothing with the program that made them."
    ],
    "data_use_cases": [
        "Training and testing methods that tell whether two pictures show the same shape, with few"
        " labels or none.",
        "Comparing such methods under one protocol, with bench score of pix2shape-bench.",
        "Not for measuring mental rotation in people, and not for deciding how well a method does"
        " on photographs.",
    ],
    "data_limitations": [
        "One kind of shape, unit cubes face to face, before an empty background: no texture, no"
        " shadows, no noise of a sensor, no clutter.",
        "Views that hide a cube are refused, so that most views of a shape never occur.",
        "Three answers at most: a guess is right in a third or half of the questions.",
    ],
    "data_biases": [
        "Questions of the kind `other`, and some of `near`, can be answered from outlines alone."
        " Report `matched` and `mirror-pair`, where outlines tell little or nothing.",
        "In `mirror-pair` with three answers the right one is the odd one out, and can be found"
        " without the reference, by the same mental rotation between answers.",
        "Each number of cubes is asked for equally often, though there are far more shapes of many"
        " cubes; shapes of few cubes recur, seen from other sides.",
    ],
    "personal_sensitive_information": [
        "None: no people, no places, no text in the images. The recorded command, where the page"
        " has it, holds names of files of those who made the data."
    ],
}


def make_questions_card(
    tables: Sequence[QuestionsFile], card: str | Path, publication: Publication, **how: Any
) -> list[Path]:
    """Write the data card of a split, whole or in shards, as `write_card`.

    The answers of the test questions are handed out too where they were opened with these.

    Args:
        tables: as from `published.open_split`.
        card: folder to make.
        how: `overwrite` and `progress` of `write_card`.

    Raises as `write_card`.
    """
    count = sum(map(len, tables))
    answers = [table.beside for table in tables if table.beside is not None]

    def notes(tallies: Sequence[Tally]) -> dict[str, str]:
        again = count - len(set().union(*(tally.digests for tally in tallies)))
        twice = f"**{again} questions have the images of another one.**"
        once = "No two questions have the same images."
        told = {"Splits": f"{twice if again else once} {SPLITS_TEXT}"}
        if any(table.split == "test" for table in tables):
            told["Test answers"] = GIVEN if answers else HELD
        return told

    files = handed_out(tables)
    return write_card(card, publication, QUESTIONS, tables, files, notes, answers=answers, **how)


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


def _layout(tables: Sequence[QuestionsFile]) -> str:
    """Return a Markdown table of the data sets; those of the truth lie in the group `truth`."""
    spec = tables[-1].spec
    assert spec is not None  # `open_split` refuses released files
    rows = [("dataset", "row", "type", "unit", "meaning")]
    truth = [replace(column, name=f"truth/{column.name}") for column in truth_columns(spec)]
    for column in (*question_columns(spec), answer_column(), *truth):
        shape = "(" + ", ".join(map(str, column.shape)) + ")"
        rows.append((f"`{column.name}`", shape, column.dtype, column.unit, column.meaning))
    return "\n".join(piped(rows))


def _facts(table: QuestionsFile, tally: Tally) -> dict[str, str]:
    return {
        "file": table.path.name,
        "part": table.part,
        "split": str(table.split),
        "questions": str(tally.rows),
        "answers told": str(tally.counters["right answers by place"].total()),
        "image": f"{table.height}x{table.width}, {table.image_dtype}",
        "fingerprint": table.fingerprint or "",
    }


# fmt: off
QUESTIONS = Task(
    unit="questions",
    what="a file of 3D-IQTT questions",
    verify="iqtt verify",
    summary=SUMMARY,
    keywords=KEYWORDS,
    responsible=RESPONSIBLE,
    reading=READING,
    exported=exported_columns,
    values=_exported_values,
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
    key=("file", "part", "row"),
    line=_line,
    digested=("questions",),
    same="questions",
    counts={
        "right answers by place": _told("answer"),
        "questions by number of cubes": _told("cube_count"),
        "wrong answers by kind": lambda line: line["distractor_kinds"] or [],
        "questions by angle, in steps of 30 degrees": lambda line: [
            int(angle // 30) * 30 for angle in _told("angle_degrees")(line)
        ],
    },
    facts=_facts,
    layout=_layout,
)
# fmt: on
