"""Floors of questions: how many a method without any idea of 3D answers rightly, by their kind.

The methods are probes that look at outlines (`bench baseline outline`, which learns nothing, and
`bench baseline outline-trees --labels N`), and chance. docs/results.md has the commands that
measured them. Skill says how much of the way from the floor to perfect a method has gone.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Floor:
    """What one probe reached on one kind of questions.

    Attributes:
        kind: as `iqtt.questions.specs.question_kind` names it, such as "mirror" or "near-2".
        probe: name of the baseline.
        labels: how many labelled questions it learned from; 0 for a probe that does not learn.
        accuracy: fraction of right answers.
        low, high: ends of its 95% interval.
    """

    kind: str
    probe: str
    labels: int
    accuracy: float
    low: float
    high: float

    @property
    def name(self) -> str:
        """The probe and what it learned from, such as "outline-trees, 1,000 labels"."""
        return f"{self.probe}, {self.labels:,} labels" if self.labels else self.probe


FLOORS: tuple[Floor, ...] = ()
CHANCE_BEST = "chance, which no probe beats"
CHANCE_ONLY = "chance, as no probe was measured"


def floor_of_kind(kind: str, answers: int) -> tuple[float, str]:
    """Return the floor of a kind of questions with so many answers, and its name.

    That is the best of the probes whose interval lies above chance, whatever it learned from; else
    chance, 1 / answers.
    """
    chance = 1.0 / answers
    measured = [floor for floor in FLOORS if floor.kind == kind]
    best = max((f for f in measured if f.low > chance), key=lambda f: f.accuracy, default=None)
    if best is not None:
        return best.accuracy, best.name
    return chance, CHANCE_BEST if measured else CHANCE_ONLY


def floor_of_questions(counts: Mapping[str, int], answers: int) -> tuple[float, str]:
    """Return the floor of a set of questions, and its name: the mean over its questions.

    Args:
        counts: how many questions there are of each kind; empty where the kinds are not known, as
            in the released files.
        answers: how many answers each question offers.
    """
    if not counts:
        return 1.0 / answers, CHANCE_ONLY
    found = {kind: floor_of_kind(kind, answers) for kind in sorted(counts)}
    if len(set(found.values())) == 1:
        return next(iter(found.values()))
    mean = math.fsum(counts[kind] * floor for kind, (floor, _) in found.items())
    names = (
        f"{name} ({', '.join(kind for kind, (_, theirs) in found.items() if theirs == name)})"
        for name in dict.fromkeys(name for _, name in found.values())
    )
    return mean / sum(counts.values()), "; ".join(names)
