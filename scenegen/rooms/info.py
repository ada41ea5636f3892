"""Describe a file of rooms as text: what it was asked for, what it holds, how it is stored."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.records import changed_settings
from scenegen.common.text_table import printable
from scenegen.files.content import CONTENT_DIGEST
from scenegen.layout import FIELDS, TRUTH_DIGEST
from scenegen.rendering.backend import UNKNOWN, VERSION_ATTRIBUTES
from scenegen.rooms.reader import RoomsFile

SAMPLED = 64  # rows that are read to tell the ranges of values
MOST = 1000  # letters of an attribute that are shown


def describe(path: str | Path) -> str:
    """Return a file's spec, counts, ranges, units, sizes, versions and fingerprint, as one text.

    Raises FileNotFoundError, FileFormatError as `RoomsFile`.
    """
    with RoomsFile(path) as rooms:
        rows = np.unique(np.linspace(0, len(rooms) - 1, min(SAMPLED, len(rooms))).astype(int))
        ranges, shapes = _ranges(rooms, rows)
        attributes = rooms.attributes
        lines = [
            f"{path}: {len(rooms)} images of {rooms.spec.height}x{rooms.spec.width},"
            f" {sum(stored for stored, _ in rooms.stored_bytes().values()) / 1e6:.1f} MB",
            "",
            f"  format          {attributes['format']} {shown(attributes, 'format_version')}",
            f"  written by      {shown(attributes, 'writer')}, {shown(attributes, 'variant')}",
            f"  rendered by     {renderer_text(attributes)}",
            *(f"  {name:15} {shown(attributes, key)}" for name, key in _SHOWN.items()),
            "",
            "  spec (* differs from the default)",
        ]
        lines += setting_lines(rooms.spec)
        lines += ["", f"  ranges over {len(rows)} rows; shapes: {shapes}"]
        lines += [f"    {name:10} {low:.4g} to {high:.4g}" for name, (low, high) in ranges.items()]
        lines += ["", f"  {'dataset':27} {'row':14} {'unit':24} {'stored':>9} {'ratio':>6}"]
        for field, (stored, raw) in zip(FIELDS, rooms.stored_bytes().values(), strict=True):
            row = "(" + ", ".join(field.shape) + ")"
            unit = field.unit if len(field.unit) <= 24 else field.unit[:21] + "..."
            ratio = f"{raw / stored:.1f}" if stored else "-"
            lines.append(f"  {field.name:27} {row:14} {unit:24} {size_text(stored):>9} {ratio:>6}")
    return "\n".join(map(printable, lines))


_SHOWN = {
    "command": "creation_command",
    "fingerprint": "fingerprint",
    "truth digest": TRUTH_DIGEST,
    "content digest": CONTENT_DIGEST,
    "conventions": "conventions",
}


def shown(attributes: Mapping[str, Any], name: str, missing: str = "-") -> str:
    """Return a root attribute of a file, which may hold anything, as text for one line."""
    value = attributes.get(name, "")
    text = value if isinstance(value, str) else f"not a text: {value!r}"
    return (text if len(text) <= MOST else text[: MOST - 3] + "...") or missing


def renderer_text(attributes: Mapping[str, Any]) -> str:
    """Return the versions that rendered a file of rooms or questions; old files do not say."""
    named = zip(("Mitsuba", "Dr.Jit", "LLVM"), VERSION_ATTRIBUTES, strict=True)
    return ", ".join(f"{name} {shown(attributes, key, UNKNOWN)}" for name, key in named)


def setting_lines(spec: Any) -> list[str]:
    """Return a line for each setting, a star before those that differ from the default."""
    changed = changed_settings(spec)
    lines = []
    for name, value in vars(spec).items():
        shown = ", ".join(map(str, value)) if isinstance(value, tuple) else value
        star = "*" if name in changed and value is not None else " "
        lines.append(f"  {star} {name:24} {'not told' if value is None else shown}")
    return lines


def _ranges(rooms: RoomsFile, rows: NDArray[np.int_]) -> tuple[dict[str, tuple[float, float]], str]:
    ends: dict[str, list[float]] = {}
    counts: Counter[str] = Counter()
    for i in rows.tolist():
        room = rooms[i]
        counts.update(item.name for item in room.scene.objects)
        values = {
            "radiance": room.radiance,
            "depth": room.depth[np.isfinite(room.depth)],
            "n_z": room.normal[..., 2],
            "object_id": room.object_id,
        }
        for name, array in values.items():
            if array.size:
                ends.setdefault(name, []).extend((float(array.min()), float(array.max())))
    shapes = ", ".join(f"{name} {count}" for name, count in sorted(counts.items()))
    return {name: (min(some), max(some)) for name, some in ends.items()}, shapes or "none"


def size_text(count: int) -> str:
    """Return a number of bytes in kB or MB."""
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"
