"""Settings of a run, the card of its weights, and what tells the two methods apart."""

from collections.abc import Callable
from dataclasses import dataclass

from torch import Tensor, nn

from baselines.resnets.architecture import DEPTHS
from baselines.training.checkpoint import Card as BaseCard
from baselines.training.checkpoint import Method, check_numbers
from scenegen.common.records import LARGEST, check


@dataclass(frozen=True)
class Settings:
    """Settings of networks and training.

    Attributes:
        seed: of the initial weights and of the order of the questions.
        depth: 18 or 50 layers of the ResNet; 50 in the paper.
        width: channels of its first stage; 64 in the paper.
        size: side of the images that it takes, pixels; 128 in the paper's released files.
        batch: questions in an iteration.
        iterations: number of steps of Adam.
        learning_rate: of the first step; it falls linearly to 0.
    """

    seed: int = 0
    depth: int = 18
    width: int = 16
    size: int = 64
    batch: int = 16
    iterations: int = 400
    learning_rate: float = 0.001

    def __post_init__(self) -> None:
        check(self.depth in DEPTHS, "depth", self.depth, " or ".join(map(str, DEPTHS)))
        ranges = {
            "seed": (0, 2**63), "width": (4, 256), "size": (16, 1024), "batch": (1, 4096),
            "iterations": (1, LARGEST), "learning_rate": (1e-12, 1),
        }  # fmt: skip
        check_numbers(self, ranges)


@dataclass(frozen=True)
class Card(BaseCard):
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


@dataclass(frozen=True)
class Answerer:
    """A way to answer questions with a ResNet.

    Attributes:
        method: its network takes images of questions, (Q, 1 + K, 3, S, S), the reference first, and
            gives the scores of the K answers, (Q, K), the highest of which is its answer.
        loss: of scores, (Q, K), and right answers, (Q,).
        any_number: whether a network answers questions of another number of answers than it was
            trained on.
    """

    method: Method[Card, nn.Module]
    loss: Callable[[Tensor, Tensor], Tensor]
    any_number: bool
