"""Write the questions of a file to a folder of Parquet or WebDataset files, as they are stored."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from iqtt.files.layout import answer_column, truth_columns
from iqtt.files.reader import QuestionsFile
from scenegen.files.schema import Column
from scenegen.sharing.columns import row_column
from scenegen.sharing.folder import ROWS_PER_FILE, ExportedTable, write_folder

ROW = row_column("row of the table of questions")


def export_questions(
    path: str | Path,
    form: str,
    folder: str | Path,
    part: str | None = None,
    *,
    rows_per_file: int = ROWS_PER_FILE,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write a table of questions, ours or a released one, as `write_folder`; return its files.

    Files are called `iqtt-train-labeled-00000-of-00003.parquet` after `iqtt-train.h5` and its part
    "labeled". Only what the file itself tells is written: a file of test questions has no answers.

    Raises as `write_folder` and `QuestionsFile`.
    """
    with QuestionsFile(path, part) as questions:
        which = f", {questions.part}" if questions.part else ""
        table = ExportedTable(
            stem="-".join(filter(None, (Path(path).stem, questions.part))),
            what=f"rows of {questions.path.name}{which}, a file of 3D-IQTT questions",
            columns=exported_columns(questions),
            count=len(questions),
            read=partial(read_rows, questions),
            attributes=questions.attributes,
        )
        return write_folder(
            table,
            form,
            folder,
            rows_per_file=rows_per_file,
            overwrite=overwrite,
            progress=progress,
        )


def image_names(answers: int) -> list[str]:
    """Return the columns of a question's images: the reference, and its answers."""
    return ["reference", *(f"answer_{i}" for i in range(answers))]


def exported_columns(questions: QuestionsFile) -> list[Column]:
    """Return the columns: `row`, each image, the right answer and the truth, as far as told."""
    kind = questions.image_dtype
    shape = (questions.height, questions.width, 3)
    unit, frame = "linear radiance, times `scale`", "pixels: row 0 on top"
    scale = {"scale": 1 / 255 if kind == "uint8" else 1.0}
    columns = [
        ROW,
        *(
            Column(
                name,
                shape,
                kind,
                unit,
                frame,
                f"{name.replace('_', ' ')}; RGB",
                own_chunk=True,
                more=scale,
            )
            for name in image_names(questions.answers)
        ),
    ]
    if questions.has_answers:
        columns.append(replace(answer_column(), name="answer"))
    if questions.has_truth:
        assert questions.spec is not None  # truth is read only where there is one
        columns += truth_columns(questions.spec)
    return columns


def read_rows(questions: QuestionsFile, rows: Sequence[int]) -> dict[str, Any]:
    """Read some rows; return their values by name of the column, in the order of `rows`.

    Raises IndexError, and FileFormatError where a row is damaged.
    """

    def values(name: str) -> Any:
        if list(rows) == list(range(rows[0], rows[0] + len(rows))):
            return questions.read(name, slice(rows[0], rows[0] + len(rows)))
        return np.stack([questions.read(name, row) for row in rows])

    images = values("questions")
    found = {name: images[:, i] for i, name in enumerate(image_names(questions.answers))}
    found |= {ROW.name: np.array(rows, np.int64)}
    for name in questions.fields:
        if name != "questions":
            found["answer" if name == "answers" else name] = values(name)
    return found
