"""Which scenes a report shows, the best, the median and the worst ones, and their pictures."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.report.pictures import view_pictures
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.scoring.records import ScoreFile
from metrics.submissions.reader import RoomPredictions, open_predictions
from scenegen.common.errors import FileFormatError
from scenegen.common.text_table import number
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
SHOWN = 6  # scenes in each of the three lists, where there are enough


@dataclass(frozen=True)
class Pictured:
    """An image or a question, and pictures of it.

    Attributes:
        name: which one it is: scene, view and row, or the question.
        told: its scores in words.
        pictures: caption and data URL of each.
        marks: for each picture, what is said of it in an extra line; or empty.
    """

    name: str
    told: str
    pictures: Sequence[tuple[str, str]]
    marks: Sequence[str] = ()


def shown_score(scores: ScoreFile) -> str:
    """Return the first score of the headline that any image has a number for; else ""."""
    for name in (*HEADLINE[scores.task], *scores.metrics):
        if name in scores.items and np.isfinite(np.asarray(scores.items[name], float)).any():
            return name
    return ""


def chosen_scenes(
    scenes: Array, values: Array, higher_is_better: bool, most: int = SHOWN
) -> dict[str, list[int]]:
    """Return entries to show by "best", "median" and "worst", one of each scene, none twice.

    Scenes stand in the order of their mean value, equal ones by their number. Of each scene it is
    the view whose value is nearest to that mean, of equal ones the first. Where there are fewer
    than three times `most` scenes, each list gets a third; a single scene is the best one.

    Args:
        scenes, values: of each entry, (N,); entries whose value is not finite are left out.
        most: scenes in each list.
    """
    kept = np.flatnonzero(np.isfinite(values))
    if not len(kept):
        return {}
    labels, place = np.unique(scenes[kept], return_inverse=True)
    means = np.bincount(place, values[kept]) / np.bincount(place)
    off = np.abs(values[kept] - means[place])
    first = np.lexsort((kept, off, place))  # by scene, the nearest view first
    entry = kept[first[np.searchsorted(place[first], np.arange(len(labels)))]]
    order = entry[np.argsort(-means if higher_is_better else means, kind="stable")]
    shown = min(most, max(1, len(order) // 3))
    rest = order[shown : max(shown, len(order) - shown)]
    middle = (len(rest) - shown) // 2
    found = {
        "best": order[:shown],
        "median": rest[max(middle, 0) :][:shown],
        "worst": order[::-1][: min(shown, len(order) - shown)],
    }
    return {title: entries.tolist() for title, entries in found.items() if len(entries)}


def pictured_scenes(
    scores: ScoreFile, truth: Path, submission: Path, name: str
) -> list[tuple[str, list[Pictured]]]:
    """Return the lists of scenes by a score, each with its title and pictures.

    Raises OSError and FileFormatError where truth or submission cannot be read.
    """
    higher = metric(name).higher_is_better
    values = np.asarray(scores.items[name], float)
    chosen = chosen_scenes(scores.clusters, values, higher)
    entries = [entry for found in chosen.values() for entry in found]
    shown = dict(zip(entries, pictured(scores, truth, submission, entries), strict=True))
    scenes = len(np.unique(scores.clusters[np.isfinite(values)]))
    return [
        (_title(title, len(found), scenes, metric(name).title), [shown[entry] for entry in found])
        for title, found in chosen.items()
    ]


def _title(which: str, count: int, scenes: int, score: str) -> str:
    if scenes == 1:
        return "The only scene"
    return f"{which.capitalize()} {count} of {scenes} scenes by {score}"


def pictured(
    scores: ScoreFile, truth: Path, submission: Path, entries: Sequence[int]
) -> Iterator[Pictured]:
    """Yield entries of a score file with the pictures of `pictures.view_pictures`.

    Raises OSError and FileFormatError where a file cannot be read or lacks an entry's row.
    """
    with RoomsFile(truth) as rooms, open_predictions(submission) as predictions:
        assert isinstance(predictions, RoomPredictions)
        place = dict(zip(predictions.rows.tolist(), range(len(predictions)), strict=True))
        for entry in entries:
            row = int(scores.items["row"][entry])
            if row not in place or row >= len(rooms):
                expected = f"rows of {submission} and {truth}"
                raise FileFormatError(scores.place, f"items.row: {row}", expected)
            found = room_pictures(rooms, predictions, row, place[row])
            yield Pictured(entry_name(scores, entry), entry_scores(scores, entry), found)


def room_pictures(
    rooms: RoomsFile, predictions: RoomPredictions, row: int, place: int
) -> Sequence[tuple[str, str]]:
    """Return caption and data URL of each picture of a row; `place` is that of its prediction."""
    urls: Mapping[str, str] = view_pictures(
        decode_image(rooms.read("image", row)),
        rooms.read("depth", row),
        predictions.depth(place),
        rooms.read("normal", row),
        float(rooms.read("camera/fov_y_degrees", row)),
        predictions.normal(place) if predictions.has_normals else None,
    )
    return list(urls.items())


def entry_name(scores: ScoreFile, entry: int) -> str:
    """Return scene, view and row of an entry, in words."""
    row, scene, view = (int(scores.items[n][entry]) for n in ("row", "scene_index", "view_index"))
    degrees = int(scores.items["view_angle_degrees"][entry]) if _has_angle(scores) else -1
    angle = f" ({degrees}°)" if degrees >= 0 else ""
    return f"scene {scene}, view {view}{angle}, row {row}"


def entry_scores(scores: ScoreFile, entry: int) -> str:
    """Return the headline scores of an entry, in words."""
    return ", ".join(
        f"{metric(name).title} {number(float(scores.items[name][entry]))}"
        for name in HEADLINE["rooms"]
        if name in scores.items and np.isfinite(scores.items[name][entry])
    )


def _has_angle(scores: ScoreFile) -> bool:
    return "view_angle_degrees" in scores.items
