"""Floors of questions: how many a method without any idea of 3D answers rightly.

A floor belongs to the settings of a file of questions and to a kind of question. It is the best of
the audit's probes that see pictures alone (`floor_probes` measures it). Skill says how much of the
way from the floor to perfect a method has gone. The package holds the floors of its presets.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, TypeAlias

from iqtt.perspective.specs import PerspectiveSpec
from iqtt.questions.specs import QuestionSpec, SplitSpec
from scenegen.common.records import check, from_json

SHIPPED = "floors.json"
CHANCE = "chance, which no classifier beats"
SIDE = 96  # pixels of images of rooms that floors are measured on
Settings: TypeAlias = SplitSpec | PerspectiveSpec


@dataclass(frozen=True)
class Floor:
    """What the best probe reached on one kind of questions.

    Attributes:
        kind: as `specs.question_kind` names it, such as "mirror" or "near-2".
        probe: what it looked at and how it chose, or CHANCE.
        accuracy: fraction of right answers.
        questions: how many questions it was measured on.
    """

    kind: str
    probe: str
    accuracy: float
    questions: int

    def __post_init__(self) -> None:
        check(0 < self.accuracy < 1, f"accuracy of {self.kind!r}", self.accuracy, "between 0 and 1")

    @property
    def error(self) -> float:
        """Standard error of the accuracy."""
        return math.sqrt(self.accuracy * (1 - self.accuracy) / max(self.questions, 1))


@dataclass(frozen=True)
class Measured:
    """The floors of questions with these settings (`settings_of`), one for each kind."""

    settings: Settings
    floors: tuple[Floor, ...]


@dataclass(frozen=True)
class FloorFile:
    """What a file of floors holds."""

    format: Literal["pix2shape-bench/floors"]
    format_version: Literal["1.0"]
    measured: tuple[Measured, ...]


def settings_of(spec: Settings) -> Settings:
    """Return the settings that floors depend on: the others are the same for all.

    Left out are the seed, the numbers of questions, how pictures are stored, and the kind and the
    number of answers, which the kind of a floor tells. Floors of rooms are those of small images of
    the objects for training, as masks of objects decide them.
    """
    spec = replace(
        spec, seed=None, train=1, labeled=0, val=0, test=0, distractors="mixed", answers=3,
        image_dtype="uint8", with_depth=False,
    )  # fmt: skip
    if isinstance(spec, PerspectiveSpec):
        less = SIDE / min(spec.height, spec.width)
        return replace(
            spec, height=round(less * spec.height), width=round(less * spec.width),
            object_split="train", spp=1, denoise=False,
        )  # fmt: skip
    return spec


def read_floors(text: str | bytes) -> tuple[Measured, ...]:
    """Return what a file of floors holds. Raises SpecError where it is none."""
    return from_json(FloorFile, text, "floors").measured


@cache
def shipped_floors() -> tuple[Measured, ...]:
    """Return the floors that the package holds."""
    return read_floors(files("iqtt").joinpath(SHIPPED).read_bytes())


def to_json(measured: Sequence[Measured]) -> str:
    """Return the text of a file of floors: a line for the settings, and one for each floor."""
    record: dict[str, Any] = {"format": "pix2shape-bench/floors", "format_version": "1.0"}
    lines = []
    for group in measured:
        floors = ",\n".join(f"      {json.dumps(asdict(floor))}" for floor in group.floors)
        settings = group.settings.to_json()
        lines.append(f'    {{"settings": {settings},\n     "floors": [\n{floors}]}}')
    return json.dumps(record)[:-1] + ',\n  "measured": [\n' + ",\n".join(lines) + "]}\n"


def floors_of(spec: QuestionSpec | None, path: str | Path | None = None) -> dict[str, Floor]:
    """Return the floors of questions of these settings by kind; none where they are not known.

    Args:
        spec: None for files that do not tell their settings, as the released ones.
        path: a file of floors that goes before those of the package.

    Raises OSError, and SpecError where the file is none of floors.
    """
    ours = () if path is None else read_floors(Path(path).read_bytes())
    if not isinstance(spec, SplitSpec | PerspectiveSpec):  # released
        return {}
    groups = [group for group in (*shipped_floors(), *ours) if group.settings == settings_of(spec)]
    return {floor.kind: floor for group in groups for floor in group.floors}


def floor_of_questions(
    counts: Mapping[str, int], floors: Mapping[str, Floor]
) -> tuple[float, str] | None:
    """Return the floor of a set of questions, and its name: the mean over its questions.

    Args:
        counts: how many questions there are of each kind; empty where the kinds are not known.
        floors: as `floors_of` returns them.

    Returns None where the floor of some kind is not known.
    """
    if not counts or not counts.keys() <= floors.keys():
        return None
    kinds_of: dict[str, list[str]] = {}
    for kind in sorted(counts):
        kinds_of.setdefault(floors[kind].probe, []).append(kind)
    names = [f"{name} ({', '.join(kinds)})" for name, kinds in kinds_of.items()]
    # Exact where all floors are the same, so that chance has a skill of 0.
    values = {floors[kind].accuracy for kind in counts}
    mean = math.fsum(counts[kind] * floors[kind].accuracy for kind in counts)
    floor = values.pop() if len(values) == 1 else mean / sum(counts.values())
    return floor, "; ".join(names) if len(names) > 1 else next(iter(kinds_of))
