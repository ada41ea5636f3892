"""Measure floors: what probes without 3D reach on questions with the settings of a file.

The questions are drawn anew, about shapes of the training split, so no test shape is used and the
seed of the file makes no difference. Probes are those of the audit that may beat chance. Learned
ones are cross-validated. The floor is the best of those that beat chance at the level of the audit,
Holm's correction included; else it is chance. So the luckiest of many that only guess is no floor.
"""

import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from iqtt.audit.probes.masks import costs_of_masks
from iqtt.audit.probes.rules import Probe, run_floor_probes
from iqtt.audit.table import open_paths, read_table
from iqtt.files.make import make_split
from iqtt.files.split import FILES
from iqtt.floors import CHANCE, Floor, Measured, Settings, settings_of
from iqtt.perspective.specs import PerspectiveSpec
from iqtt.shapes.splits import TooFewShapesError

QUESTIONS = 6_000  # of each kind
SEED = int.from_bytes(b"floors")


def measure_floors(
    specs: Sequence[Settings],
    count: int = QUESTIONS,
    *,
    workers: int = 1,
    device: str = "auto",
    progress: Callable[[int], Any] = lambda done: None,
) -> list[tuple[Measured, list[tuple[Probe, ...]]]]:
    """Return the floor of each kind of question that files with these settings ask.

    Args:
        count: questions of each kind.
        workers: processes that render, as in `make_split`.
        progress: is called with the number of questions done since the last call; each is made,
            and then read.

    Also returns, for each floor, all probes. Raises as `make_split`.
    """
    floors: dict[Settings, list[Floor]] = {}
    probes: dict[Settings, list[tuple[Probe, ...]]] = {}
    for (settings, kind), spec in floor_specs(specs, count).items():
        with tempfile.TemporaryDirectory(prefix="iqtt-floors-") as folder:
            try:
                make_split(folder, spec, workers=workers, device=device, progress=progress)
            except TooFewShapesError:
                if any(asked.distractors == kind for asked in specs):
                    raise
                continue  # a mixed file then has no questions of this kind
            found = probe_file(Path(folder) / FILES["train"][0], progress)
        floors.setdefault(settings, []).append(floor_of(kind, spec.answers, found))
        probes.setdefault(settings, []).append(found)
    return [(Measured(s, tuple(floors[s])), probes[s]) for s in floors]


def floor_specs(specs: Iterable[Settings], count: int) -> dict[tuple[Settings, str], Settings]:
    """Return what each floor is measured on, by `settings_of` and the kind of question."""
    drawn = {}
    for spec in specs:
        settings = settings_of(spec)
        for kind in spec.kinds:
            name = kind if spec.answers == 3 else f"{kind}-{spec.answers}"
            drawn[settings, name] = replace(
                settings, seed=SEED, train=count, labeled=count, distractors=kind,
                answers=spec.answers,
            )  # fmt: skip
    return drawn


def probe_file(path: Path, progress: Callable[[int], Any] = lambda done: None) -> tuple[Probe, ...]:
    """Run the probes without 3D that may beat chance on a file of labelled questions."""
    with open_paths([path]) as opened:
        name, questions = next(one for one in opened.items() if one[1].has_answers and len(one[1]))
        rows = np.arange(len(questions))
        table = read_table(name, questions, rows, progress)
        of_rooms = isinstance(questions.spec, PerspectiveSpec)
        masks = costs_of_masks(table, rows) if of_rooms else None
    assert table.answers is not None
    return run_floor_probes(table.statistics, table.answers.astype(np.int64), masks)


def floor_of(kind: str, answers: int, probes: tuple[Probe, ...]) -> Floor:
    """Return the best of the probes that beat chance, else chance."""
    beating = [probe for probe in probes if probe.beats_chance]
    if not beating:
        return Floor(kind, CHANCE, 1 / answers, max(probe.n for probe in probes))
    best = max(beating, key=lambda probe: probe.accuracy)
    return Floor(kind, f"{best.statistic}, {best.rule}", best.accuracy, best.n)
