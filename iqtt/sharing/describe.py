"""What a data card tells of a split of questions: facts that were counted, and where they lie."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from iqtt.files.layout import answer_column, question_columns, truth_columns
from iqtt.files.reader import AnswersFile
from iqtt.files.shards import ANSWERS, MANIFEST
from iqtt.questions.specs import SplitSpec
from iqtt.sharing.index import COLUMNS, KEY, Tally
from iqtt.sharing.published import PublishedSplit, PublishedTable
from iqtt.sharing.texts import (
    GIVEN,
    HELD,
    KEYWORDS,
    READING,
    RESPONSIBLE,
    SPLITS_TEXT,
    SUMMARY,
)
from scenegen.common.text_table import piped, printable
from scenegen.rendering.backend import VERSION_ATTRIBUTES
from scenegen.sharing.description import (
    HDF5,
    JSON,
    PARQUET,
    DataDescription,
    Publication,
    shared_file,
)

HEAD = ("file", "part", "split", "questions", "answers told", "image", "fingerprint")


def describe_split(
    split: PublishedSplit, tallies: Sequence[Tally], index: Path, publication: Publication
) -> DataDescription:
    """Return what is to be told of a split, given the tallies and the index that was written.

    Every byte of the files that are handed out is read, for their SHA-256. Raises as
    `QuestionsFile`, and OSError.
    """
    told = {table.path.name: _root_texts(table) for table in split.tables}
    versions: list[tuple[str, ...]] = [
        ("file", "written by", "Mitsuba", "Dr.Jit", "LLVM", "variant")
    ]
    for name, texts in told.items():
        known = [texts.get(key, "unknown") for key in ("writer", *VERSION_ATTRIBUTES, "variant")]
        versions.append((name, *known))
    requests = {name: texts["spec"] for name, texts in told.items()}
    commands = {}
    if split.with_answers:
        answers = next(table.answers for table in split.tables if table.answers is not None)
        with AnswersFile(answers) as file:
            requests[ANSWERS] = file.attributes["spec"]
            commands[ANSWERS] = file.attributes.get("creation_command", "unknown")
    tools = {
        f"{texts['writer']}, Mitsuba {texts.get(VERSION_ATTRIBUTES[0])}" for texts in told.values()
    }
    listed = [
        shared_file(path, JSON if path.name == MANIFEST else HDF5, meaning)
        for path, meaning in split.files
    ]
    notes = {"Reading": READING, "Splits": _splits(split, tallies)}
    if split.with_test:
        notes["Test answers"] = GIVEN if split.with_answers else HELD
    return DataDescription(
        publication=publication,
        summary=SUMMARY,
        keywords=KEYWORDS,
        files=(*listed, shared_file(index, PARQUET, "a line for each question, without pixels")),
        index=COLUMNS,
        index_file=index.name,
        rows=split.count,
        facts={
            "Files": _tables(split, tallies),
            "What they hold": _counts(split, tallies),
            "Versions": versions,
        },
        commands=commands,
        requests=requests,
        layout=_layout(split.spec),
        responsible={**RESPONSIBLE, "machineAnnotationTools": sorted(map(printable, tools))},
        notes=notes,
        key=KEY,
    )


def _root_texts(table: PublishedTable) -> dict[str, str]:
    with table.open() as file:
        return file.attributes


def _tables(split: PublishedSplit, tallies: Sequence[Tally]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [HEAD]
    for table, tally in zip(split.tables, tallies, strict=True):
        with table.open() as file:
            size = f"{file.height}x{file.width}, {file.image_dtype}"
            answered, mark = str(sum(tally.answers.values())), file.fingerprint or ""
        counts = (str(tally.rows), answered)
        rows.append((table.path.name, table.part, table.split, *counts, size, mark))
    return rows


def _counts(split: PublishedSplit, tallies: Sequence[Tally]) -> list[tuple[str, ...]]:
    """Return a column for each table; of questions without truth only their number is known."""

    def shown(counter: Counter[Any]) -> str:
        return ", ".join(f"{key}: {n}" for key, n in sorted(counter.items())) or "not told"

    return [
        ("what", *(table.name for table in split.tables)),
        ("questions", *(str(t.rows) for t in tallies)),
        ("right answers by place", *(shown(t.answers) for t in tallies)),
        ("questions by number of cubes", *(shown(t.cubes) for t in tallies)),
        ("wrong answers by kind", *(shown(t.kinds) for t in tallies)),
        ("questions by angle, in steps of 30 degrees", *(shown(t.angles) for t in tallies)),
    ]


def _splits(split: PublishedSplit, tallies: Sequence[Tally]) -> str:
    """Return how the splits are cut, and whether a question is there twice."""
    every: set[bytes] = set().union(*(tally.digests for tally in tallies))
    again = split.count - len(every)
    if again:
        return f"**{again} questions have the images of another one.** {SPLITS_TEXT}"
    return f"No two questions have the same images. {SPLITS_TEXT}"


def _layout(spec: SplitSpec) -> str:
    """Return a Markdown table of the data sets; those of the truth lie in the group `truth`."""
    rows = [("dataset", "row", "type", "unit", "meaning")]
    truth = [replace(c, name=f"truth/{c.name}") for c in truth_columns(spec)]
    for column in (*question_columns(spec), answer_column(), *truth):
        shape = "(" + ", ".join(map(str, column.shape)) + ")"
        unit, meaning = column.attributes.get("unit", "1"), column.attributes["meaning"]
        rows.append((f"`{column.name}`", shape, column.dtype, unit, meaning))
    return "\n".join(piped(rows))
