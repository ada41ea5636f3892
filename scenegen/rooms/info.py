"""Describe a file of rooms as text: what it was asked for, what it holds, how it is stored."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenegen.common.text_table import printable
from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.info import column_lines, fact_lines, setting_lines, size_text
from scenegen.files.verify import spread_rows
from scenegen.layout import TRUTH_DIGEST
from scenegen.rendering.backend import renderer_text
from scenegen.rooms.exposure import clipped_shares, exposure_text, exposure_warnings
from scenegen.rooms.reader import RoomsFile

SAMPLED = 64  # rows that are read to tell the ranges of values


def describe(path: str | Path) -> str:
    """Return settings, counts, ranges, units, sizes, versions and hashes of a file, as one text.

    Raises FileNotFoundError, FileFormatError as `RoomsFile`.
    """
    with RoomsFile(path) as rooms:
        spec, texts = rooms.spec, rooms.attributes
        size = size_text(sum(path.stat().st_size for path, _ in rooms.parts))
        facts = {
            "format": f"{texts['format']} {texts['format_version']}",
            "written by": f"{texts['writer']}, {texts['variant']}",
            "rendered by": renderer_text(texts),
            "command": texts["creation_command"] or "-",
            "recipe hash": rooms.fingerprint,
            "truth hash": texts[TRUTH_DIGEST],
            "content hash": texts[CONTENT_DIGEST],
            "conventions": texts["conventions"],
        }
        sampled = spread_rows(len(rooms), SAMPLED)
        ranges, shapes = _ranges(rooms, sampled)
        shares = clipped_shares(rooms, sampled)
        ranges |= {} if shares is None else {"exposure": exposure_text(shares)}
        parts = (
            fact_lines(facts),
            setting_lines(spec),
            [f"ranges over {len(sampled)} images; objects: {shapes}", *fact_lines(ranges)],
            column_lines(rooms),
        )
        lines = [f"{path}: {len(rooms)} images of {spec.height}x{spec.width}, {size}"]
        for part in parts:
            lines += ["", *(f"  {line}" for line in part)]
        warnings = exposure_warnings(shares or (0.0, 0.0), spec.interior)
        lines += ["", *(f"warning: {text}" for text in warnings)] if warnings else []
    return "\n".join(map(printable, lines))


def _ranges(rooms: RoomsFile, rows: Sequence[int]) -> tuple[dict[str, str], str]:
    """Return the least and the largest values of some rows, and how often each shape comes."""
    ends: dict[str, list[float]] = {}
    counts: Counter[str] = Counter()
    for row in rows:
        room = rooms[row]
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
    ranges = {name: f"{min(some):.4g} to {max(some):.4g}" for name, some in ends.items()}
    return ranges, shapes or "none"
