"""Floors beside scores: the empty room, guesses, chance, and probes that know nothing of 3D."""

import math
from collections.abc import Sequence

from metrics.score_file import SCORE_AGAIN
from metrics.scoring.metric_names import BASELINES, EMPTY_ROOM, OTHER_SCENE, SKILLED
from metrics.scoring.records import ScoreFile
from metrics.views.leaderboard.rows import Cells
from metrics.views.score_tables import floor_text
from metrics.views.table import Cell
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import number

SKILL_OF = "skill of "  # begins the keys of columns of skills
FLOOR, CHANCE = "floor: ", "floor: chance"
AGREEMENT = 1e-9  # of floors, relative: other releases of libraries add differently


class FloorError(SceneGenError):
    """Score files of one test set that state different floors."""


def floor_cells(file: ScoreFile, names: Sequence[str]) -> Cells:
    """Return what the floors of a file's test set score.

    The floor of a relief differs from file to file: its skill has one, 0, the score itself none.
    """
    rows: dict[str, dict[str, float]] = {}
    for name in names:
        if name in file.skills:
            text = floor_text(file, name) if is_shared(name) else BASELINES[EMPTY_ROOM].name
            row = rows.setdefault(FLOOR + " ".join(text.split()), {})
            row[SKILL_OF + name] = 0.0
            if is_shared(name):
                row[name] = file.skills[name].floor
    if file.task == "iqtt" and not any(label.startswith(CHANCE) for label in rows):
        rows[CHANCE] = {"iqtt_accuracy": 1.0 / file.meta.counts["answers"]}
    return {
        label: {key: Cell(number(value)) for key, value in row.items()}
        for label, row in rows.items()
    }


def own_floors(file: ScoreFile) -> dict[str, float]:
    """Return the floors that belong to this file's predictions alone, by name of the score."""
    return {name: skill.floor for name, skill in file.skills.items() if not is_shared(name)}


def is_shared(name: str) -> bool:
    """Return whether all files of one test set have the same floor of this score."""
    return SKILLED.get(name) != (OTHER_SCENE,)


def require_same_floors(files: Sequence[ScoreFile]) -> None:
    """Raise FloorError where comparable files of one test set state different floors.

    Floors follow from the test set alone, so that one of the files must be wrong.
    """
    whole = [file for file in files if file.comparable]
    for file in whole[1:]:
        ours, theirs = _stated(whole[0]), _stated(file)
        for name in ours.keys() & theirs.keys():
            if not math.isclose(theirs[name], ours[name], rel_tol=AGREEMENT):
                expected = f"{ours[name]!r}, as in {whole[0].place}"
                raise FloorError(f"{file.place}: {name}", theirs[name], expected, SCORE_AGAIN)


def _stated(file: ScoreFile) -> dict[str, float]:
    return {
        f"skills.{name}.floor ({skill.floor_name})": skill.floor
        for name, skill in file.skills.items()
        if is_shared(name)
    }
