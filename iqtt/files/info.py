"""A description of a question file, as text: counts, settings, shapes, sizes and versions."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.files.reader import QuestionsFile, answers_beside, open_tables
from iqtt.questions.kinds import DISTRACTOR_KINDS
from scenegen.common.text_table import printable
from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.info import column_lines, fact_lines, setting_lines, size_text
from scenegen.files.sets.shards import name_of_set
from scenegen.files.verify import spread_rows
from scenegen.rendering.backend import renderer_text

Array = NDArray[Any]
SAMPLED = 64  # rows that are read for the range of the images


def describe(path: str | Path) -> str:
    """Describe a question file, ours or a released one, or a file of answers, in lines of text.

    Raises OSError and FileFormatError as `QuestionsFile`.
    """
    tables = open_tables(path)
    with tables[0] as first:
        parts = [fact_lines(_facts_of_file(Path(path), tables))]
        parts += [setting_lines(first.spec)] if first.spec else []
        for table in tables:
            parts.append([_heading(table), *("  " + x for x in fact_lines(_facts(table), 14))])
            parts.append(["  " + line for line in column_lines(table)])
    lines = [f"{path}: {sum(map(len, tables))} questions, {size_text(_size(Path(path)))}"]
    for part in parts:
        lines += ["", *(f"  {line}" for line in part)]
    return "\n".join(map(printable, lines))


def _facts_of_file(path: Path, tables: Sequence[QuestionsFile]) -> dict[str, str]:
    first, texts = tables[0], tables[0].attributes
    facts = {"answer key": _answer_key(path, tables)}
    if first.spec is None:
        return {**facts, "format": "none, as in the released 3D-IQTT"}
    return {
        **facts,
        "format": f"{texts['format']} {texts['format_version']}",
        "written by": f"{texts['writer']}, {texts['variant']}",
        "rendered by": renderer_text(texts),
        "command": texts.get("creation_command") or "-",
        "split": texts["split"],
        "task": texts["task"],
        "conventions": texts["conventions"],
        "content hash": texts[CONTENT_DIGEST],
    }


def _size(path: Path) -> int:
    """Return the size of a file and of its shards, if it has any."""
    shards = [file for file in path.parent.iterdir() if name_of_set(file.name) == path.name]
    return sum(file.stat().st_size for file in (path, *shards))


def _answer_key(path: Path, tables: Sequence[QuestionsFile]) -> str:
    total = sum(map(len, tables))
    labelled = sum(len(table) for table in tables if table.has_answers)
    if not tables[0].has_images:
        return "for all questions; the images are in another file"
    if labelled:
        return f"for {labelled} of {total} questions ({labelled / total:.1%})"
    beside = answers_beside(path)
    return f"in {beside.name}" if beside else "none"


def _heading(table: QuestionsFile) -> str:
    heading = f"{table.part}: " if table.part else ""
    heading += f"{len(table)} questions"
    if table.has_images:
        size = f"{table.height}x{table.width}, {table.image_dtype}"
        heading += f" of {1 + table.answers} images of {size}"
    return heading


def _facts(table: QuestionsFile) -> dict[str, str]:
    """Return counts and ranges of the values of a table, by name."""
    identity = {"recipe hash": table.fingerprint, "truth hash": table.stored_truth_digest}
    facts = {name: text for name, text in identity.items() if text}
    if len(table) == 0:
        return facts
    everything = slice(0, len(table))
    if table.has_images:
        rows = spread_rows(len(table), SAMPLED)
        images = [table[row].radiance for row in rows]
        low, high = min(i.min() for i in images), max(i.max() for i in images)
        facts["radiance"] = f"{low:.4g} to {high:.4g} over {len(rows)} questions"
    if table.has_answers:
        facts["correct option"] = _counts(table.read("answers", everything))
    if table.has_truth:
        kinds = table.read("distractor_kind", everything)
        facts["distractors"] = _counts(kinds[kinds != -1], dict(enumerate(DISTRACTOR_KINDS)))
        quantiles = np.quantile(table.read("angle_degrees", everything), np.linspace(0, 1, 5))
        shown = ", ".join(f"{q:.0f}" for q in quantiles)
        facts["rotation"] = f"{shown} degrees (minimum, quartiles, maximum)"
    if "cube_count" in table.fields:
        facts["cubes"] = _counts(table.read("cube_count", everything))
    return facts


def _counts(values: Array, names: dict[int, str] | None = None) -> str:
    """Return how often each value occurs."""
    pairs = zip(*np.unique(values, return_counts=True), strict=True)
    return ", ".join(f"{(names or {}).get(v, v)}: {count}" for v, count in pairs)
