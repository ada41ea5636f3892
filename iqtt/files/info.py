"""A description of a question file, as text: counts, settings, shapes, sizes and versions."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.files.layout import truth_columns
from iqtt.files.reader import AnswersFile, QuestionsFile, answers_beside, parts
from iqtt.files.tables import NoImagesError, TableFile
from scenegen.common.text_table import printable
from scenegen.files.shards import set_name
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.info import renderer_text, setting_lines, size_text

Array = NDArray[Any]
SAMPLED = 64  # rows that are read for the range of the images


def describe(path: str | Path) -> str:
    """Describe a question file, ours or a released one, or a file of answers, in lines of text.

    Raises OSError and FileFormatError as `QuestionsFile`.
    """
    with ExitStack() as stack:
        tables = [stack.enter_context(table) for table in _tables(path)]
        lines = _header(Path(path), tables)
        for table in tables:
            lines += ["", *_table_lines(table)]
    return "\n".join(map(printable, lines))


def _tables(path: str | Path) -> Iterator[TableFile]:
    try:
        names = parts(path)
    except NoImagesError:
        yield AnswersFile(path)
        return
    for part in names:
        yield QuestionsFile(path, part)


def _header(path: Path, tables: Sequence[TableFile]) -> list[str]:
    total = sum(map(len, tables))
    lines = [
        f"{path}: {total} questions, {size_text(_size(path))}",
        "",
        f"  answers       {_answers_told(path, tables, total)}",
    ]
    spec, attributes = tables[0].spec, tables[0].attributes
    if spec is None:
        return [*lines, "  format        none, as in the released 3D-IQTT"]
    return [
        *lines,
        f"  format        {attributes['format']} {attributes['format_version']}",
        f"  written by    {attributes['writer']}, {attributes.get('variant')}",
        f"  rendered by   {renderer_text(attributes)}",
        f"  command       {attributes.get('creation_command') or '-'}",
        f"  split         {tables[0].split}",
        f"  task          {attributes.get('task') or '-'}",
        f"  conventions   {attributes.get('conventions')}",
        f"  content       {tables[0].stored_content_digest or 'no digest'}",
        "",
        "  spec (* differs from the default)",
        *setting_lines(spec),
    ]


def _size(path: Path) -> int:
    """Return the size of a file and of its shards, if it has any."""
    shards = [one for one in path.parent.iterdir() if set_name(one.name) == path.name]
    return sum(file.stat().st_size for file in (path, *shards))


def _answers_told(path: Path, tables: Sequence[TableFile], total: int) -> str:
    labelled = sum(len(table) for table in tables if table.has_answers)
    if isinstance(tables[0], AnswersFile):
        return "to all of them; the images lie in another file"
    if labelled:
        return f"to {labelled} of them ({labelled / total:.1%})"
    beside = answers_beside(path)
    return f"in {beside.name}" if beside else "none"


def _table_lines(table: TableFile) -> list[str]:
    heading = f"{table.part}: " if table.part else ""
    heading += f"{len(table)} questions"
    if isinstance(table, QuestionsFile):
        heading += (
            f" of {1 + table.answers} images of {table.height}x{table.width}, {table.image_dtype}"
        )
    lines = [f"  {heading}"]
    lines += [f"    {name:14} {text}" for name, text in _facts(table).items()]
    units = {c.name: c.attributes["unit"] for c in truth_columns(table.spec)} if table.spec else {}
    lines += [
        "",
        f"    {'dataset':18} {'row':20} {'type':8} {'unit':10} {'stored':>9} {'ratio':>6}",
    ]
    for name, (stored, raw) in table.stored_bytes().items():
        values = table.read(name, slice(0, 0))
        row = "(" + ", ".join(map(str, values.shape[1:])) + ")"
        ratio = f"{raw / stored:.1f}" if stored else "-"
        lines.append(
            f"    {name:18} {row:20} {values.dtype!s:8} {units.get(name, '-'):10}"
            f" {size_text(stored):>9} {ratio:>6}"
        )
    return lines


def _facts(table: TableFile) -> dict[str, str]:
    """Return counts and ranges of the values of a table, by name."""
    told = {"fingerprint": table.fingerprint, "truth digest": table.stored_truth_digest}
    facts = {name: text for name, text in told.items() if text}
    if len(table) == 0:
        return facts
    everything = slice(0, len(table))
    if isinstance(table, QuestionsFile):
        rows = np.unique(np.linspace(0, len(table) - 1, SAMPLED).astype(int)).tolist()
        images = [decode_image(table.read("questions", row)) for row in rows]
        low, high = min(i.min() for i in images), max(i.max() for i in images)
        facts["radiance"] = f"{low:.4g} to {high:.4g} over {len(rows)} questions"
    if table.has_answers:
        facts["answers"] = _counts(table.read("answers", everything))
    if table.has_truth:
        kinds = table.read("distractor_kind", everything)
        names = dict(enumerate(table.kind_names))
        facts["distractors"] = _counts(kinds[kinds != -1], names)
        quantiles = np.quantile(table.read("angle_degrees", everything), np.linspace(0, 1, 5))
        shown = ", ".join(f"{q:.0f}" for q in quantiles)
        facts["angle"] = f"{shown} degrees: least, quartiles, most"
        facts["cubes a shape"] = _counts(table.read("cube_count", everything))
    return facts


def _counts(values: Array, names: dict[int, str] | None = None) -> str:
    """Return how often each value occurs."""
    pairs = zip(*np.unique(values, return_counts=True), strict=True)
    return ", ".join(f"{(names or {}).get(v, v)}: {count}" for v, count in pairs)
