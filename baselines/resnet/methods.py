"""The settings of a run, which are the card of its weights, and what tells methods apart."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor, nn
from torch.optim import Adam

from baselines import checkpoints
from baselines.resnet.architecture import DEPTHS
from scenegen.common.records import check, normalise


@dataclass(frozen=True)
class Card:
    """Settings of a run and what came of it.

    Attributes:
        method: "cnn" or "siamese".
        answers: number of answers of each question.
        labels: number of labelled questions, the first ones of the file.
        seed: of the initial weights and of the order of the questions.
        depth: 18 or 50 layers of the ResNet; 50 in the paper.
        width: channels of its first stage; 64 in the paper.
        size: side of the images that it takes, pixels; 128 in the paper's released files.
        batch: questions in an iteration.
        iterations: number of steps of Adam.
        learning_rate: of the first step; it falls linearly to 0.
        fingerprint: of the labelled part of the training file.
        iteration: how many steps are done.
        validation: accuracy on iqtt-val.h5 beside the training file; None where there is none.
    """

    method: str
    answers: int
    labels: int
    seed: int = 0
    depth: int = 18
    width: int = 16
    size: int = 64
    batch: int = 16
    iterations: int = 400
    learning_rate: float = 0.001
    fingerprint: str = ""
    iteration: int = 0
    validation: float | None = None

    def __post_init__(self) -> None:
        normalise(self)
        check(self.depth in DEPTHS, "depth", self.depth, " or ".join(map(str, DEPTHS)))
        for name, low, high in (
            ("answers", 2, 16),
            ("labels", 1, 10**8),
            ("seed", 0, 2**63),
            ("width", 4, 256),
            ("size", 16, 1024),
            ("batch", 1, 4096),
            ("iterations", 1, 10**8),
            ("iteration", 0, self.iterations),
        ):
            value = getattr(self, name)
            check(low <= value <= high, name, value, f"{low} to {high}")
        check(0 < self.learning_rate <= 1, "learning rate", self.learning_rate, "above 0, up to 1")


@dataclass(frozen=True)
class Method:
    """A way to answer questions with a ResNet.

    Attributes:
        name: as in `bench baseline NAME`.
        network: makes the network of a card; it takes images of questions, (Q, 1 + K, 3, S, S), the
            reference first, and gives the scores of the K answers, (Q, K), the highest of which
            is its answer.
        loss: of scores, (Q, K), and right answers, (Q,).
        files: folder of the weights that come with the package.
        any_number: whether a network answers questions of another number of answers than it
            was trained on.
    """

    name: str
    network: Callable[[Card], nn.Module]
    loss: Callable[[Tensor, Tensor], Tensor]
    files: Path
    any_number: bool

    @property
    def recipe(self) -> checkpoints.Recipe[Card, nn.Module]:
        """How the networks of the method are made of its cards."""
        return checkpoints.Recipe(self.name, Card, self.network, _optimiser, self._check)

    def _check(self, card: Card) -> None:
        check(card.method == self.name, "method", f"{card.method:.40}", self.name)


def _optimiser(card: Card, network: nn.Module) -> Adam:
    return Adam(network.parameters(), lr=card.learning_rate)


State = checkpoints.State[Card, nn.Module]
