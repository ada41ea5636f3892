"""Scores as one self-contained page: the table, distributions, and pictures of items."""

from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.report.charts import histogram, intervals
from metrics.report.pictures import view_pictures
from metrics.report.text import CHANCE, GROUP_TITLES, SHORT, interval_cells
from metrics.scoring.metric_names import HEADLINE, in_order, metric
from metrics.scoring.records import GROUPINGS, ScoreFile
from metrics.submissions.reader import RoomPredictions, open_predictions
from scenegen.common.text_table import number
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
SHOWN = 3  # best, median and worst items, so many of each
COLUMNS = ("image", "true depth", "predicted depth", "error")
STYLE = """
:root { color-scheme: light dark; --ink: #1a1a1a; --faint: #666; --line: #ddd; --bar: #3b76a8;
  --page: #fff; }
@media (prefers-color-scheme: dark) { :root { --ink: #eee; --faint: #aaa; --line: #444;
  --bar: #6aa5d8; --page: #161616; } }
body { font: 15px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--page);
  max-width: 1080px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .25rem .8rem .25rem 0; border-bottom: 1px solid var(--line); }
th { color: var(--faint); font-weight: 500; } td.definition { color: var(--faint); }
.charts { display: flex; flex-wrap: wrap; gap: 1rem; }
svg { max-width: 100%; } svg text { font-size: 11px; fill: var(--faint); }
svg .title { font-size: 12px; fill: var(--ink); } svg .bar, svg .dot { fill: var(--bar); }
svg .axis { stroke: var(--faint); } svg .range { stroke: var(--bar); stroke-width: 2; }
svg .mean { stroke: #d55e00; stroke-width: 1.5; }
svg .median { stroke: #009e73; stroke-width: 1.5; stroke-dasharray: 4 3; }
.item { display: grid; grid-template-columns: repeat(4, minmax(0, 160px)); gap: .4rem;
  margin: .6rem 0 1.1rem; }
.item p { grid-column: 1 / -1; margin: 0; } .item figure { margin: 0; }
.item img { width: 100%; image-rendering: pixelated; outline: 1px solid var(--line); }
figcaption { font-size: 12px; color: var(--faint); }
.note { color: var(--faint); } .warning { color: #b00020; font-weight: 600; }
"""


def html_report(scores: ScoreFile, truth_path: Path, submissions: Sequence[Path]) -> str:
    """Return the page as text; pictures come from the truth and the first run.

    Raises FileFormatError where a picture's row cannot be read.
    """
    parts = [_head(scores), _score_table(scores), *_groups(scores), _distributions(scores)]
    if scores.task == "rooms":
        parts += _pictures(scores, truth_path, submissions[0])
    parts.append(_definitions(scores))
    title = escape(f"{scores.method}: scores")
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>'
        f'\n<meta name="viewport" content="width=device-width">\n<style>{STYLE}</style>\n</head>\n'
        f"<body>\n{''.join(parts)}</body>\n</html>\n"
    )


def _head(scores: ScoreFile) -> str:
    meta = scores.meta
    counts = ", ".join(f"{name} {value}" for name, value in meta.counts.items())
    warnings = "".join(f'<p class="warning">{escape(text)}</p>' for text in meta.warnings)
    runs = "".join(
        f"<li>{escape(one.path)} {escape(one.run)} <code>{one.sha256[:16]}</code></li>"
        for one in meta.submissions
    )
    return (
        f"<h1>{escape(scores.method)}</h1>{warnings}<p>{escape(counts.replace('_', ' '))};"
        f" truth {escape(meta.truth_path)} <code>{escape(meta.truth_fingerprint[:16])}</code>;"
        f" {escape(meta.writer)}; intervals at {meta.confidence:.0%}, seed {meta.seed},"
        f" {meta.resamples} resamples.</p><ul>{runs}</ul>\n"
    )


def _score_table(scores: ScoreFile) -> str:
    rows = []
    for name in in_order(scores.metrics):
        score = scores.metrics[name]
        value, ends = interval_cells(score)
        std = "" if score.std is None else number(score.std, score.value)
        rows.append((name, value, ends, std, score.unit, metric(name).direction))
        if name == "chamfer" and scores.meta.chamfer_floor is not None:
            rows.append(("noise floor", number(scores.meta.chamfer_floor), "", "", score.unit, ""))
        if name == "iqtt_accuracy":
            rows.append(("chance", number(CHANCE), "", "", score.unit, ""))
    head = ("score", "value", "95% interval", "std of runs", "unit", "")
    return f"<h2>Scores</h2>{_table(head, rows)}\n"


def _groups(scores: ScoreFile) -> Iterator[str]:
    for grouping in GROUPINGS[scores.task]:
        groups = getattr(scores, grouping)
        if not groups:
            continue
        names = [name for name in SHORT[scores.task] if name in scores.metrics]
        rows = [
            (key, *(" ".join(interval_cells(found[name])) for name in names))
            for key, found in groups.items()
        ]
        yield f"<h2>{GROUP_TITLES[grouping].capitalize()}</h2>{_table(('', *names), rows)}\n"
        if grouping in ("by_view_angle", "by_rotation_angle"):
            yield f'<div class="charts">{"".join(_over_angle(groups, names))}</div>\n'


def _over_angle(groups: Any, names: Sequence[str]) -> Iterator[str]:
    for name in names:
        points = []
        for key, found in groups.items():
            ends = [float(part) for part in key.split("-")]
            score = found[name]
            low, high = (np.nan if end is None else end for end in (score.low, score.high))
            points.append((sum(ends) / len(ends), score.value, low, high))
        yield intervals(points, metric(name).title, metric(name).unit)


def _distributions(scores: ScoreFile) -> str:
    shown = [
        histogram(np.asarray(scores.items[name], float), metric(name).title, metric(name).unit)
        for name in (*HEADLINE["rooms"], "normal_mean_degrees", "derived_normal_mean_degrees")
        if name in scores.items
    ]
    if not shown:
        return ""
    return (
        f"<h2>Distribution over images</h2><p class='note'>Mean solid, median dashed.</p>"
        f'<div class="charts">{"".join(shown)}</div>\n'
    )


def _pictures(scores: ScoreFile, truth_path: Path, submission: Path) -> Iterator[str]:
    chamfer = np.asarray(scores.items["chamfer"], float)
    order = np.argsort(chamfer, kind="stable")
    number_shown = min(SHOWN, len(order))
    middle = (len(order) - number_shown) // 2
    chosen = {
        "Best": order[:number_shown],
        "Median": order[middle : middle + number_shown],
        "Worst": order[::-1][:number_shown],
    }
    yield (
        "<p class='note'>Below: depth black at the truth's nearest, white at its farthest; error"
        " from white (none) to dark red (a tenth of the range or more); purple is not scored.</p>"
    )
    with RoomsFile(truth_path) as truth, open_predictions(submission) as predictions:
        assert isinstance(predictions, RoomPredictions)
        place = dict(zip(predictions.rows.tolist(), range(len(predictions)), strict=True))
        for title, entries in chosen.items():
            yield f"<h2>{title} by Chamfer distance</h2>\n"
            for entry in entries.tolist():
                row = int(scores.items["row"][entry])
                pictures = view_pictures(
                    decode_image(truth.read("image", row)),
                    truth.read("depth", row),
                    predictions.depth(place[row]),
                )
                images = "".join(
                    f'<figure><img src="{url}" alt="{name} of row {row}">'
                    f"<figcaption>{name}</figcaption></figure>"
                    for name, url in zip(COLUMNS, pictures, strict=True)
                )
                found = ", ".join(
                    f"{name} {number(float(scores.items[name][entry]))}"
                    for name in HEADLINE["rooms"]
                )
                yield f'<div class="item"><p>row {row}: {found}</p>{images}</div>\n'


def _definitions(scores: ScoreFile) -> str:
    rows = [(name, metric(name).definition) for name in in_order(scores.metrics)]
    return f"<h2>How each number is defined</h2>{_table(('score', 'of one item'), rows)}\n"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in row)

    body = "".join(f"<tr>{cells('td', row)}</tr>\n" for row in rows)
    return (
        f'<div class="scroll"><table><thead><tr>{cells("th", head)}</tr></thead>\n'
        f"<tbody>{body}</tbody></table></div>"
    )
