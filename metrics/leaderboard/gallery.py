"""The same scenes as several methods see them, for the gallery of a leaderboard's site."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from metrics.report.at_hand import submission_at_hand, truth_at_hand
from metrics.report.pictures import DEPTH, IMAGE, TRUE_DEPTH
from metrics.report.scenes import Pictured, entry_name, room_pictures
from metrics.scoring.records import ScoreFile
from metrics.submissions.reader import RoomPredictions, open_predictions
from scenegen.rooms.reader import RoomsFile

SCENES = 6
MOST_METHODS = 10


def gallery(files: Sequence[ScoreFile], labels: Sequence[str]) -> list[Pictured]:
    """Return scenes of one test set, each as image, true depth and depth of each method.

    The scenes are spread evenly over those that all shown methods predict, by number, and shown in
    their first view. Methods are those, in the given order, whose submission still lies where the
    score file says; nothing is returned without any, or without the truth.
    """
    truth = next(filter(None, map(truth_at_hand, files)), None) if files else None
    if truth is None or files[0].task != "rooms":
        return []
    found = [(f, name, submission_at_hand(f)) for f, name in zip(files, labels, strict=True)]
    at_hand = [(f, name, path) for f, name, path in found if path is not None][:MOST_METHODS]
    return _pictures(truth, at_hand) if at_hand else []


def _pictures(truth: Path, at_hand: Sequence[tuple[ScoreFile, str, Path]]) -> list[Pictured]:
    with ExitStack() as stack:
        rooms = stack.enter_context(RoomsFile(truth))
        opened = [stack.enter_context(open_predictions(path)) for *_, path in at_hand]
        shared = set(range(len(rooms))).intersection(*(p.rows.tolist() for p in opened))
        first = at_hand[0][0]
        return [
            Pictured(entry_name(first, entry), "", _side_by_side(rooms, opened, at_hand, row))
            for entry in spread_entries(first, shared)
            for row in [int(first.ids[entry])]
        ]


def spread_entries(file: ScoreFile, rows: set[int]) -> list[int]:
    """Return an entry of each of up to six scenes, evenly spread, with a row among `rows`."""
    kept = [i for i, row in enumerate(file.ids.tolist()) if row in rows]
    kept.sort(key=lambda i: (int(file.clusters[i]), int(file.items["view_index"][i])))
    scenes = {int(file.clusters[i]): i for i in reversed(kept)}
    firsts = [scenes[scene] for scene in sorted(scenes)]
    places = np.linspace(0, len(firsts) - 1, min(SCENES, len(firsts)))
    return [firsts[int(place)] for place in np.rint(places)]


def _side_by_side(
    rooms: RoomsFile,
    opened: Sequence[object],
    at_hand: Sequence[tuple[ScoreFile, str, Path]],
    row: int,
) -> list[tuple[str, str]]:
    shown: list[tuple[str, str]] = []
    for predictions, (_, label, _) in zip(opened, at_hand, strict=True):
        assert isinstance(predictions, RoomPredictions)
        place = int(np.flatnonzero(predictions.rows == row)[0])
        urls = dict(room_pictures(rooms, predictions, row, place))
        shown = shown or [(name, urls[name]) for name in (IMAGE, TRUE_DEPTH)]
        shown.append((f"depth of {label}", urls[DEPTH]))
    return shown
