"""Questions written for the programs that ask models: Parquet, VLMEvalKit, lmms-eval.

`questions.parquet` and `control.parquet` have the columns of `COLUMNS`; the control leaves out the
reference. `NAME.tsv` and `NAME_circular.tsv` follow VLMEvalKit's layout of own multiple-choice
data, and the YAML files are tasks of lmms-eval.
"""

import base64
import csv
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from iqtt.vlm.prompt import CANARY
from iqtt.vlm.rows import Asked, Row, count_rows, vlm_rows
from scenegen.common.records import check
from scenegen.files.new_file import folder_written_beside

COLUMNS = {
    "id": "name of the row: question and rotation of the options",
    "question_index": "index of the question in its file, from 0",
    "rotation": "letter k shows option (k + rotation) mod K of the file",
    "image": "sRGB PNG: the reference on top, the options below with their letters",
    "images": "sRGB PNGs: the reference, then the options in the order of their letters",
    "question": "text of the prompt",
    "choices": "names of the options",
    "answer": "letter of the correct option; not in held-out tests, nor are kind to floor",
    "kind": "distractor type, such as matched",
    "angle": "smallest rotation from the reference to the correct option, degrees",
    "cubes": "number of cubes of each shape; null for rooms",
    "shape": "cluster for confidence intervals: shared by questions about one shape or its mirror"
    " image",
    "floor": "accuracy of the best 2D-only baseline on this distractor type; null if unknown",
    "canary": "marker of test data; do not train on text or images with this marker",
    "digest": "recipe hash of the questions; responses are accepted only for the same hash",
}
FACTS = ("answer", "kind", "angle", "cubes", "shape", "floor")
CIRCULAR = 1_000_000  # VLMEvalKit: index + k * CIRCULAR is rotation k of a question
AT_ONCE = 32  # rows of a row group
TEMPLATES = Path(__file__).with_name("lmms_eval")
QUESTIONS, CONTROL, CARD = "questions.parquet", "control.parquet", "README.md"


def export_for_models(
    asked: Asked,
    folder: str | Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write a file of questions for models to a folder, which appears when it is complete.

    Args:
        progress: is told the number of rows that were written since the last call.

    Returns the files. Raises as `vlm_rows`, and OSError as `folder_written_beside`.
    """
    name = Path(asked.path).stem
    sheets = [f"{name}.tsv", *([f"{name}_circular.tsv"] if asked.rotations > 1 else [])]
    tasks = sorted(path.name for path in TEMPLATES.iterdir() if path.is_file())
    names = [QUESTIONS, CONTROL, *sheets, CARD, *tasks]
    check(count_rows(asked) > 0, str(asked.path), "no questions", "at least one")
    with folder_written_beside(folder, names, overwrite) as made:
        last = _write_rows(asked, made, sheets, progress)
        (made / CARD).write_text(_card(name, last), encoding="utf-8")
        for task in tasks:
            text = (TEMPLATES / task).read_text(encoding="utf-8")
            target = str(Path(folder).absolute() / QUESTIONS)
            (made / task).write_text(text.replace("QUESTIONS_PARQUET", target), encoding="utf-8")
    return [Path(folder) / name for name in names]


def _write_rows(
    asked: Asked, made: Path, sheets: Sequence[str], progress: Callable[[int], Any]
) -> Row:
    """Write all files that hold rows, each row drawn once; return the last row."""
    with ExitStack() as stack:
        questions, control = (stack.enter_context(_parquet(made / n)) for n in (QUESTIONS, CONTROL))
        lines = [stack.enter_context(_sheet(made / name)) for name in sheets]
        for block in _batches(vlm_rows(asked), AT_ONCE):
            first = [row for row in block if row.rotation == 0]
            questions(block)
            control([row.control() for row in first])
            for write, rows in zip(lines, (first, block), strict=False):
                write(rows)
            progress(len(block))
    return block[-1]


def row_facts(row: Row) -> dict[str, Any]:
    """Return what is told of a row beside its pictures; without FACTS if the answer is withheld."""
    values = {
        "id": row.id,
        "question_index": row.question_index,
        "rotation": row.rotation,
        "question": row.question,
        "choices": [f"picture {letter}" for letter in row.letters],
        "answer": row.answer,
        **row.facts,
        "canary": CANARY,
        "digest": row.digest,
    }
    hidden = FACTS if row.answer is None else ()
    return {name: value for name, value in values.items() if name not in hidden}


def row_values(row: Row) -> dict[str, Any]:
    """Return the values of a row by COLUMNS; without FACTS where the answer is withheld."""
    values = {
        **row_facts(row),
        "image": {"bytes": row.image, "path": None},
        "images": [{"bytes": image, "path": None} for image in row.images],
    }
    return {name: values[name] for name in COLUMNS if name in values}


@contextmanager
def _parquet(path: Path) -> Iterator[Callable[[Sequence[Row]], None]]:
    """Give a function that appends rows to a file as a row group."""
    import pyarrow.parquet as pq
    from datasets import Dataset, Features, Image, List, Value

    types: dict[str, Any] = {name: Value("string") for name in COLUMNS}
    types |= dict.fromkeys(("question_index", "rotation", "cubes"), Value("int32"))
    types |= dict.fromkeys(("angle", "floor"), Value("float64"))
    types |= {"image": Image(), "images": List(Image()), "choices": List(Value("string"))}
    with ExitStack() as stack:
        writer = None

        def write(rows: Sequence[Row]) -> None:
            nonlocal writer
            values = [row_values(row) for row in rows]
            if not values:
                return
            features = Features({name: types[name] for name in values[0]})
            if writer is None:
                made = pq.ParquetWriter(path, features.arrow_schema, compression="zstd")
                writer = stack.enter_context(made)
            columns = {name: [row[name] for row in values] for name in values[0]}
            writer.write_table(Dataset.from_dict(columns, features).data.table)

        yield write


@contextmanager
def _sheet(path: Path) -> Iterator[Callable[[Sequence[Row]], None]]:
    """Give a function that appends rows to a sheet of VLMEvalKit; a heading comes first.

    `digest` is ours: VLMEvalKit keeps it, so that its results tell which questions were asked.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        lines = csv.writer(file, delimiter="\t", lineterminator="\n")

        def write(rows: Sequence[Row]) -> None:
            for row in rows:
                values = _sheet_values(row)
                if file.tell() == 0:
                    lines.writerow(values)
                lines.writerow(values.values())

        yield write


def _sheet_values(row: Row) -> dict[str, Any]:
    texts = [base64.b64encode(picture).decode() for picture in row.sent]
    told = {"answer": row.answer, "category": row.facts["kind"], "split": "test"}
    return {
        "index": row.question_index + row.rotation * CIRCULAR,
        "image": texts[0] if len(texts) == 1 else json.dumps(texts),
        "question": row.question,
        **{letter: f"picture {letter}" for letter in row.letters},
        **({} if row.answer is None else told),
        "g_index": row.question_index,
        "digest": row.digest,
    }


def _card(name: str, row: Row) -> str:
    """Return the page of a folder, given one of its rows."""
    columns = "\n".join(
        f"| `{column}` | {text} |"
        for column, text in COLUMNS.items()
        if not (row.answer is None and column in FACTS)
    )
    shows = "One option shows the same shape,\nrotated. All images are rendered from cubes."
    report = (
        "on `matched` and on `mirror-pair` with two options, next to their 2D-only\nbaselines, with"
        " confidence intervals clustered by `shape`"
    )
    if row.of_rooms:
        shows = "One option shows the same room,\nseen from elsewhere."
        report = "on each type, from 60 degrees on"
    return f"""---
license: cc-by-4.0
task_categories: [visual-question-answering]
tags: [mental-rotation, 3d, synthetic, pix2shape-bench]
configs:
- config_name: default
  data_files: {QUESTIONS}
- config_name: control
  data_files: {CONTROL}
---

# {name}: mental-rotation questions for models

Each question shows a reference and {len(row.letters)} options. {shows} `iqtt audit` of
pix2shape-bench checks that each question has exactly one correct option.

`{CONTROL}` is the blind control: the same questions without the reference. A model that scores
above chance on the control uses a shortcut.

| column | content |
| --- | --- |
{columns}

Report the accuracy {report}. CircularEval accuracy counts a question as correct if the response
is correct in every rotation of the options.

{CANARY}
"""


def _batches(rows: Iterator[Row], size: int) -> Iterator[list[Row]]:
    block: list[Row] = []
    for row in rows:
        block.append(row)
        if len(block) == size:
            yield block
            block = []
    if block:
        yield block
