"""The same scenes as several methods see them, for the gallery of a leaderboard's site."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from metrics.scoring.records import ScoreFile
from metrics.submissions.reader import RoomPredictions, open_predictions
from metrics.views.at_hand import submission_at_hand, truth_at_hand
from metrics.views.examples import Example, entry_name, room_pictures
from metrics.views.pictures import DEPTH, IMAGE, TRUE_DEPTH, Picture
from scenegen.rooms.reader import RoomsFile

SCENES = 6
MOST_METHODS = 10


def gallery(files: Sequence[ScoreFile], labels: Sequence[str]) -> list[Example]:
    """Return scenes of one test set, each as image, true depth and depth of each method.

    The scenes are spread evenly over those that all shown methods predict, by number, and shown in
    their first view. Methods are those, in the given order, whose submission still lies where the
    score file says; nothing is returned without any, or without the truth.
    """
    if not files or files[0].task != "rooms":
        return []
    truth = next(filter(None, map(truth_at_hand, files)), None)
    paths = [submission_at_hand(file) for file in files]
    there = [i for i, path in enumerate(paths) if path is not None][:MOST_METHODS]
    if truth is None or not there:
        return []
    with ExitStack() as stack:
        rooms = stack.enter_context(RoomsFile(truth))
        opened: dict[str, RoomPredictions] = {}
        for i in there:
            predictions = stack.enter_context(open_predictions(paths[i] or Path()))
            assert isinstance(predictions, RoomPredictions)
            opened[labels[i]] = predictions
        shared = set(range(len(rooms))).intersection(*(p.rows.tolist() for p in opened.values()))
        first = files[there[0]]
        return [
            Example(entry_name(first, entry), "", _depths(rooms, opened, int(first.ids[entry])))
            for entry in spread_entries(first, shared)
        ]


def spread_entries(file: ScoreFile, rows: set[int]) -> list[int]:
    """Return an entry of each of up to six scenes, evenly spread, with a row among `rows`."""
    kept = [i for i, row in enumerate(file.ids.tolist()) if row in rows]
    kept.sort(key=lambda i: (int(file.clusters[i]), int(file.items["view_index"][i])))
    scenes = {int(file.clusters[i]): i for i in reversed(kept)}
    firsts = [scenes[scene] for scene in sorted(scenes)]
    places = np.linspace(0, len(firsts) - 1, min(SCENES, len(firsts)))
    return [firsts[int(place)] for place in np.rint(places)]


def _depths(rooms: RoomsFile, opened: dict[str, RoomPredictions], row: int) -> list[Picture]:
    """Return a row's image and true depth, then its depth by each method."""
    shown: list[Picture] = []
    for label, predictions in opened.items():
        place = int(np.flatnonzero(predictions.rows == row)[0])
        pictures = {p.caption: p for p in room_pictures(rooms, predictions, row, place)}
        shown = shown or [pictures[IMAGE], pictures[TRUE_DEPTH]]
        shown.append(replace(pictures[DEPTH], caption=f"depth of {label}"))
    return shown
