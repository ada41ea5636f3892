"""How the numbers of one prediction move with the protocol: one table, and one figure."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from metrics.measured.protocols import BY_NAME, PROTOCOLS, Crop
from metrics.scoring.metric_names import HEADLINE
from metrics.scoring.records import ScoreFile
from metrics.views.figures import COLUMN, draw_scores
from metrics.views.score_tables import INTERVAL, baseline_cell, score_cell, size_of
from metrics.views.table import Cell, Table, make_table, to_markdown, to_text
from scenegen.common.text_table import plain


def protocols_report(
    scores: Sequence[ScoreFile], as_markdown: bool = False, width: int | None = None
) -> str:
    """Return a row for each protocol under which a method was scored, with what it takes."""
    left_out = [p.name for p in PROTOCOLS if p.name not in {file.protocol for file in scores}]
    notes = [
        f"[low, high]: {INTERVAL} over {scores[0].unit}; 1 unit is 1 m",
        "values of two protocols are not comparable; bench score --protocol NAME --json stores one",
    ]
    if left_out:
        notes.append(f"protocols that do not apply to these images: {', '.join(left_out)}")
    form = to_markdown if as_markdown else to_text
    first = scores[0]
    title = f"{plain(first.method)} on {plain(first.meta.truth_path)}: {size_of(first)}"
    return form(title, [protocols_table(scores)], notes, width)


def protocols_table(scores: Sequence[ScoreFile]) -> Table:
    """Return the headline under each protocol."""
    names = [n for n in HEADLINE["measured"] if all(n in file.metrics for file in scores)]
    rows: list[Sequence[Cell | str]] = []
    for file in scores:
        protocol = BY_NAME[file.protocol]
        share = f"{file.columns['pixels'].sum() / scores[0].columns['pixels'].sum():.0%}"
        limits = range_text(protocol.least, protocol.largest)
        scored = [score_cell(file.metrics[name]) for name in names]
        # Its baseline beside the first score; that of the others is in the tables of one protocol.
        scored.insert(1, baseline_cell(file, names[0]))
        rows.append([protocol.name, file.alignment, limits, share, *scored])
    head = ("protocol", "alignment", "metres", "pixels", names[0], "baseline", *names[1:])
    return make_table("", head, rows)


def draw_protocols(path: str | Path, scores: Sequence[ScoreFile], overwrite: bool = False) -> None:
    """Draw the first score of the headline under each protocol. Raises as `draw_scores`."""
    labels = [file.protocol for file in scores]
    draw_scores(path, scores, "abs_rel", COLUMN, overwrite, labels)


def range_text(low: float, high: float) -> str:
    """Return a range of depths in words."""
    if np.isfinite(high):
        return f"{low:g} to {high:g}"
    return f"from {low:g}" if low else "all"


def csv_table() -> str:
    """Return docs/data/protocols.csv."""
    head = ("protocol", "pixels", "metres", "alignment", "clipped to", "mean over", "source")
    rows = [
        (
            p.name,
            ", then ".join(_crop_text(crop) for crop in p.crops) or "all",
            range_text(p.least, p.largest),
            p.alignment or "as declared",
            "-" if p.clip is None else range_text(*p.clip),
            p.mean,
            p.source,
        )
        for p in PROTOCOLS
    ]
    table = io.StringIO()
    csv.writer(table, lineterminator="\n").writerows([head, *rows])
    return table.getvalue()


def _crop_text(crop: Crop) -> str:
    if crop.unit == "bottom":
        return f"{crop.size[0]}x{crop.size[1]} at the lower edge"
    ends = f"rows {crop.top:g} to {crop.bottom:g}, columns {crop.left:g} to {crop.right:g}"
    return f"{ends} of {crop.size[0]}x{crop.size[1]}" if crop.unit == "pixels" else ends
