"""Floors beside scores: the empty room, noise, chance, and probes that know nothing of 3D."""

import math
from collections.abc import Sequence

from metrics.leaderboard.table import Cell, Row, Table
from metrics.report.text import FLOORS_OF_ROOMS, floor_text
from metrics.score_file import SCORE_AGAIN
from metrics.scoring import floors
from metrics.scoring.floors import floor_of_kind
from metrics.scoring.metric_names import EMPTY_ROOM, OTHER_SCENE, SKILLED
from metrics.scoring.records import ScoreFile
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import number, printable

FloorRows = dict[str, dict[str, float]]
AGREEMENT = 1e-9  # of floors, relative: other releases of libraries add differently
SKILL_OF = "skill of "  # how the keys of columns of skills begin
FLOOR, NOISE, CHANCE = "floor: ", "noise floor", "floor: chance"  # how their labels begin


class FloorError(SceneGenError):
    """Score files of one test set that state different floors."""


def skill_key(name: str) -> str:
    """Return the key of the column that shows the skill of a score."""
    return SKILL_OF + name


def floor_rows(file: ScoreFile, names: Sequence[str]) -> FloorRows:
    """Return what the floors of a file's test set score: by label, then by key of the column.

    The floor of a relief is not that of other files: its skill has one, 0, the score itself none.
    """
    rows: FloorRows = {}
    for name in names:
        skill = file.skills.get(name)
        if skill is None:
            continue
        told = floor_text(file, name) if is_shared(name) else FLOORS_OF_ROOMS[EMPTY_ROOM]
        label = FLOOR + printable(" ".join(told.split()))
        row = rows.setdefault(label, {})
        row[skill_key(name)] = 0.0
        if is_shared(name):
            row[name] = skill.floor
    noise = {name: file.meta.noise_floors[name] for name in names if name in file.meta.noise_floors}
    if noise:
        rows[NOISE] = noise
    if "answers" in file.meta.counts and not any(label.startswith(CHANCE) for label in rows):
        rows[CHANCE] = {"iqtt_accuracy": 1.0 / file.meta.counts["answers"]}
    return rows


def own_floors(file: ScoreFile) -> dict[str, float]:
    """Return the floors that belong to this file's predictions alone, by name of the score."""
    return {name: one.floor for name, one in file.skills.items() if not is_shared(name)}


def is_shared(name: str) -> bool:
    """Return whether all files of one test set have the same floor of this score."""
    return SKILLED.get(name) != OTHER_SCENE


def kind_floor_rows(file: ScoreFile, kinds: Sequence[str]) -> FloorRows:
    """Return the best floor of each kind of question, and chance, by label, then by kind."""
    if "answers" not in file.meta.counts:
        return {}
    answers = file.meta.counts["answers"]
    best = {kind: floor_of_kind(kind, answers)[0] for kind in kinds}
    chance = dict.fromkeys(kinds, 1.0 / answers)
    return {CHANCE: chance} if best == chance else {f"{FLOOR}best": best, CHANCE: chance}


def require_same_floors(files: Sequence[ScoreFile]) -> None:
    """Raise FloorError where comparable files of one test set state different floors.

    Floors follow from the test set alone, so that one of the files must be wrong.
    """
    whole = [file for file in files if file.comparable]
    for file in whole[1:]:
        ours, theirs = _stated(whole[0]), _stated(file)
        for what in ours.keys() & theirs.keys():
            if not math.isclose(theirs[what], ours[what], rel_tol=AGREEMENT):
                expected = f"{ours[what]!r}, as in {whole[0].place}"
                raise FloorError(f"{file.place}: {what}", theirs[what], expected, SCORE_AGAIN)


def _stated(file: ScoreFile) -> dict[str, float]:
    skills = {
        f"skills.{name}.floor": one.floor for name, one in file.skills.items() if is_shared(name)
    }
    noise = {f"meta.noise_floors.{name}": value for name, value in file.meta.noise_floors.items()}
    return skills | noise


def floors_table(files: Sequence[ScoreFile]) -> Table | None:
    """Return what each probe reached on the kinds of question in these files; None if unknown."""
    asked = {kind for file in files for kind in file.by_distractor}
    measured = [floor for floor in floors.FLOORS if floor.kind in asked]
    kinds = tuple(dict.fromkeys(floor.kind for floor in measured))
    if not kinds:
        return None
    cells: dict[str, dict[str, Cell]] = {}
    for floor in measured:
        ends = f" [{number(floor.low, floor.accuracy)}, {number(floor.high, floor.accuracy)}]"
        cells.setdefault(floor.name, {})[floor.kind] = Cell(number(floor.accuracy), ends)
    rows = tuple(
        Row("", name, "floor", tuple(found.get(kind, Cell()) for kind in kinds))
        for name, found in cells.items()
    )
    note = (
        "Fraction of right answers of methods that know nothing of 3D, with 95% intervals, by kind"
        " of question and number of labelled questions; measured once, as docs/results.md says. The"
        " best that lies above chance is the floor of skill."
    )
    return Table("3D-IQTT: floors by kind of question", kinds, rows, (note,))
