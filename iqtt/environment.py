"""Mental-rotation questions one at a time, for reinforcement learning and curricula.

    question(seed=0, index=7, kind="matched").image      # (H, W, 3) sRGB uint8
    question(seed=0, index=7, kind="matched").verify("The answer is B.")

Shapes are those of training alone: no question here shows a shape of validation or test, or its
mirror image, whatever the seed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.distractors import Pools, make_pools
from iqtt.questions.packing import Question
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import Tally, sample_questions
from iqtt.render import shows_every_cube
from iqtt.vlm.pictures import composed, draw_pictures
from iqtt.vlm.prompt import question_text
from iqtt.vlm.reading import LETTERS, read_answer
from scenegen.common.errors import PlacementError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check

Array = NDArray[Any]
SPLIT = "train"  # whose shapes no validation and no test shows
ROUNDS = (1, 7, 24, 96)  # candidates for one question; few first, as the first is often taken


@dataclass(frozen=True, eq=False)
class EnvironmentQuestion:
    """A question, its pictures and its answer.

    Attributes:
        pictures: the reference, then K answers, (1 + K, H, W, 3) sRGB uint8.
        prompt: the text, for `image`, which shows all pictures with letters.
        answer: the right letter.
        kind, cubes, angle_degrees: what the question is like, as in files.
        seed, index: what it follows from, beside the settings.
    """

    pictures: Array
    prompt: str
    answer: str
    kind: str
    cubes: int
    angle_degrees: float
    seed: int
    index: int
    question: Question = field(repr=False)

    @property
    def image(self) -> Array:
        """All pictures as one, (H', W', 3) sRGB uint8: the reference above, the answers below."""
        return np.asarray(composed(self.pictures))

    @property
    def difficulty(self) -> float:
        """How hard the question is, 0 to 1; see `difficulty_of`."""
        return difficulty_of(self.kind, self.cubes, self.angle_degrees)

    def verify(self, text: str) -> int:
        """Return 1 where a model's text gives the right letter, else 0."""
        answer = read_answer(text, len(self.pictures) - 1).answer
        return int(answer is not None and LETTERS[answer] == self.answer)


def question(
    seed: int,
    index: int,
    *,
    kind: str = "matched",
    cubes: int | tuple[int, int] = (8, 11),
    angle: tuple[float, float] = (30.0, 180.0),
    answers: int = 3,
    size: int = 256,
    device: str = "auto",
) -> EnvironmentQuestion:
    """Return question `index`; the same arguments always give the same question.

    Args:
        seed, index: 0 or more.
        kind: of QUESTION_KINDS, such as "mirror-pair".
        cubes: of each shape: a number, or fewest and most.
        angle: smallest and largest rotation from the reference's view to the right answer's,
            degrees.
        answers: 3 or 2.
        size: of a picture, pixels.

    Raises SpecError for a setting out of range, PlacementError where no question meets them.
    """
    numbers = (cubes, cubes) if isinstance(cubes, int) else cubes
    low, high = angle
    check(0 <= index < 1 << 40, "index", index, "from 0 to 2**40 - 1")
    check(0 <= low < high <= 180, "angle", angle, "two angles within 0 to 180 degrees, ascending")
    spec = SplitSpec(
        seed=0,
        cubes=numbers,
        distractors=kind,
        answers=answers,
        min_angle_degrees=min(float(low), 90.0),
    )
    pools = _pools(spec)
    rng = item_rng(seed, index, Purpose.ENVIRONMENT)
    place, own_seed = int(rng.integers(answers)), int(rng.integers(1 << 62))
    drawn = _first_within(replace(pools, spec=replace(spec, seed=own_seed)), place, angle, device)
    (pictures,) = draw_pictures(spec, [drawn], size, device)
    return EnvironmentQuestion(
        pictures=pictures,
        prompt=question_text(answers),
        answer=LETTERS[place],
        kind=kind,
        cubes=int(drawn.shapes.cubes.shape[1]),
        angle_degrees=drawn.angle_degrees,
        seed=seed,
        index=index,
        question=drawn,
    )


def difficulty_of(kind: str, cubes: int, angle_degrees: float) -> float:
    """Return how hard a question is, 0 to 1: the mean of three parts, each 0 to 1.

    Kinds count as what outlines alone reach: 1 where that is chance, as for `matched` and
    `mirror-pair`, and 0 for `other`. Cubes count from 3 to 11, and angles from 0 to 180 degrees, as
    people need time in proportion to the angle (Shepard and Metzler, Science 171, 1971).
    """
    hardness = {"other": 0.0, "near": 0.5, "mirror": 0.75}.get(kind, 1.0)
    parts = (hardness, (min(cubes, 11) - 3) / 8, angle_degrees / 180)
    return sum(parts) / len(parts)


class Questions(Sequence[dict[str, Any]]):
    """Questions as entries for training loops, of the shape that reasoning-gym gives them.

    An entry has `question`, `answer` and `metadata`; its pictures are `images`. `score_answer`
    gives 1.0 for the right letter, else 0.0.
    """

    def __init__(self, length: int, seed: int = 0, **settings: Any) -> None:
        """Take the number of questions, the seed, and the settings of `question`."""
        self.length, self.seed, self.settings = length, seed, settings

    def __len__(self) -> int:
        return self.length

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(self.length))]
        row = int(index) + (self.length if index < 0 else 0)
        if not 0 <= row < self.length:
            raise IndexError(f"question {index} of {self.length}")
        made = question(self.seed, row, **self.settings)
        facts = ("kind", "cubes", "angle_degrees", "difficulty", "seed", "index")
        return {
            "question": made.prompt,
            "answer": made.answer,
            "images": [made.image],
            "metadata": {name: getattr(made, name) for name in facts},
        }

    def score_answer(self, answer: str | None, entry: dict[str, Any]) -> float:
        """Return 1.0 where a model's text gives the entry's letter, else 0.0; None is no answer."""
        reading = read_answer(answer, 3).answer if isinstance(answer, str) else None
        return float(reading is not None and LETTERS[reading] == entry["answer"])


def _first_within(pools: Pools, place: int, angle: tuple[float, float], device: str) -> Question:
    """Return the first candidate whose angle is within bounds and which shows every cube."""
    first = 0
    for count in ROUNDS:
        requests = [(candidate, place, 0) for candidate in range(first, first + count)]
        for drawn in sample_questions(pools, SPLIT, requests, Tally()):
            within = angle[0] <= drawn.angle_degrees <= angle[1]
            if within and shows_every_cube(pools.spec, drawn, device):
                return drawn
        first += count
    range_ = f"{angle[0]:g} to {angle[1]:g} degrees"
    why = f"none of {first} candidates has a rotation of {range_}"
    raise PlacementError("question", why, hint="use a wider range of angles")


@lru_cache(maxsize=16)
def _pools(spec: SplitSpec) -> Pools:
    return make_pools(spec)
