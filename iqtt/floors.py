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


# Each measured on 2,000 questions of the preset `suite`, trees trained on others of the kind.
FLOORS = (
    Floor("matched", "outline", 0, 0.3240, 0.3038, 0.3448),
    Floor("matched", "outline-trees", 200, 0.3465, 0.3260, 0.3676),
    Floor("matched", "outline-trees", 1_000, 0.3515, 0.3309, 0.3727),
    Floor("matched", "outline-trees", 5_000, 0.3630, 0.3422, 0.3843),
    Floor("mirror-pair", "outline", 0, 0.3345, 0.3142, 0.3555),
    Floor("mirror-pair", "outline-trees", 200, 0.3335, 0.3132, 0.3545),
    Floor("mirror-pair", "outline-trees", 1_000, 0.3225, 0.3024, 0.3433),
    Floor("mirror-pair", "outline-trees", 5_000, 0.3175, 0.2975, 0.3382),
    Floor("mirror-pair-2", "outline", 0, 0.4955, 0.4736, 0.5174),
    Floor("mirror-pair-2", "outline-trees", 200, 0.4930, 0.4711, 0.5149),
    Floor("mirror-pair-2", "outline-trees", 1_000, 0.4865, 0.4646, 0.5084),
    Floor("mirror-pair-2", "outline-trees", 5_000, 0.4920, 0.4701, 0.5139),
    Floor("other", "outline", 0, 0.5565, 0.5346, 0.5781),
    Floor("other", "outline-trees", 200, 0.5720, 0.5502, 0.5935),
    Floor("other", "outline-trees", 1_000, 0.5835, 0.5618, 0.6049),
    Floor("other", "outline-trees", 5_000, 0.5910, 0.5693, 0.6124),
    Floor("near", "outline", 0, 0.4315, 0.4099, 0.4533),
    Floor("near", "outline-trees", 200, 0.4135, 0.3921, 0.4352),
    Floor("near", "outline-trees", 1_000, 0.4290, 0.4075, 0.4508),
    Floor("near", "outline-trees", 5_000, 0.4525, 0.4308, 0.4744),
    Floor("mirror", "outline", 0, 0.3610, 0.3402, 0.3823),
    Floor("mirror", "outline-trees", 200, 0.3410, 0.3205, 0.3621),
    Floor("mirror", "outline-trees", 1_000, 0.3565, 0.3358, 0.3777),
    Floor("mirror", "outline-trees", 5_000, 0.3860, 0.3649, 0.4075),
)
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
    floor_of = {kind: floor_of_kind(kind, answers) for kind in sorted(counts)}
    kinds_of: dict[str, list[str]] = {}
    for kind, (_, name) in floor_of.items():
        kinds_of.setdefault(name, []).append(kind)
    names = [f"{name} ({', '.join(kinds)})" for name, kinds in kinds_of.items()]
    # Exact where all floors are the same, so that chance has a skill of 0.
    floors = {floor for floor, _ in floor_of.values()}
    mean = math.fsum(counts[kind] * floor for kind, (floor, _) in floor_of.items())
    floor = floors.pop() if len(floors) == 1 else mean / sum(counts.values())
    return floor, "; ".join(names) if len(names) > 1 else next(iter(kinds_of))
