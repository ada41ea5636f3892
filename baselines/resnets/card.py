"""Settings of a ResNet that answers questions, and the card of its weights."""

from dataclasses import dataclass
from typing import ClassVar

from baselines.resnets.architecture import DEPTHS
from baselines.training import checkpoint
from baselines.training.checkpoint import Ranges, check_numbers
from scenegen.common.records import LARGEST, check


@dataclass(frozen=True)
class Settings(checkpoint.Settings):
    """Settings of networks and training; `size` is 128 in the paper's released files.

    Attributes:
        depth: 18 or 50 layers of the ResNet; 50 in the paper.
        width: channels of its first stage; 64 in the paper.
        learning_rate: of the first step; it falls linearly to 0.
    """

    RANGES: ClassVar[Ranges] = {"width": (4, 256), "size": (16, 1024), "batch": (1, 4096)}
    depth: int = 18
    width: int = 16
    iterations: int = 400

    def __post_init__(self) -> None:
        check(self.depth in DEPTHS, "depth", self.depth, " or ".join(map(str, DEPTHS)))
        super().__post_init__()


@dataclass(frozen=True)
class Card(checkpoint.Card):
    """The card of a ResNet.

    Attributes:
        answers: number of answers of each question.
        validation: accuracy on iqtt-val.h5 beside the training file; None where there is none.
    """

    settings: Settings
    answers: int = 3
    validation: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_numbers(self, {"answers": (2, 16), "labels": (1, LARGEST)})
