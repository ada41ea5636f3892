"""What a file of rows holds, as lines of text: facts, settings, and a table of its columns."""

from collections.abc import Mapping
from typing import Any

from scenegen.common.records import changed_settings
from scenegen.common.text_table import aligned
from scenegen.files.rows import RowFile

LONGEST = 24  # characters of a unit
LONGEST_FACT = 1000  # and of a fact, such as the command that made a file


def fact_lines(facts: Mapping[str, str], width: int = 15) -> list[str]:
    """Return a line for each fact, the names in a column of so many characters."""
    return [f"{name:{width}} {_shortened(text, LONGEST_FACT)}" for name, text in facts.items()]


def setting_lines(spec: Any) -> list[str]:
    """Return a line for each setting, a star before those that differ from the default."""
    changed = changed_settings(spec)
    lines = ["settings (* differs from the default)"]
    for name, value in vars(spec).items():
        shown = ", ".join(map(str, value)) if isinstance(value, tuple) else value
        star = "*" if name in changed and value is not None else " "
        lines.append(f"{star} {name:24} {'not stored' if value is None else shown}")
    return lines


def column_lines(file: RowFile) -> list[str]:
    """Return a table of the columns: row, type and unit, size on disk, and how much is saved."""
    rows = [("dataset", "shape", "type", "unit", f"{'stored':>9}", f"{'ratio':>6}")]
    for name, (stored, raw) in file.stored_bytes().items():
        values = file.read(name, slice(0, 0))
        rows.append(
            (
                name,
                f"({', '.join(map(str, values.shape[1:]))})",
                "text" if values.dtype.kind in "OS" else str(values.dtype),
                _shortened(file.unit(name), LONGEST),
                f"{size_text(stored):>9}",
                f"{raw / stored:6.1f}" if stored else f"{'-':>6}",
            )
        )
    return aligned(rows)


def _shortened(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."


def size_text(count: int) -> str:
    """Return a number of bytes in kB or MB."""
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"
