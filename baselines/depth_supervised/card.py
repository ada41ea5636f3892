"""The card of stored weights: how they were made; and how relief networks are made of it."""

from dataclasses import dataclass, field

from torch import nn
from torch.optim import Adam

from baselines import checkpoints
from baselines.depth_supervised.network import ReliefSpec, relief_network
from scenegen.common.records import check, normalise

FORMAT_VERSION = 1
METHODS = ("depth-supervised", "view-pairs")


@dataclass(frozen=True)
class Card:
    """What is stored with weights: how they were made.

    Attributes:
        method: one of METHODS, which says what the network learned from.
        network: which network, and how large.
        seed: of the first weights and of every random choice of training.
        iterations, batch: length of training, and images in each batch.
        learning_rate: of Adam; it rises over WARM_UP iterations and falls to 0 along a cosine.
        iteration: number of iterations done.
        data, fingerprint: request and fingerprint of the training file.
        seconds: duration of training.
    """

    method: str
    network: ReliefSpec = field(default_factory=ReliefSpec)
    seed: int = 0
    iterations: int = 1200
    batch: int = 16
    learning_rate: float = 0.003
    iteration: int = 0
    data: str = ""
    fingerprint: str = ""
    seconds: float = 0.0
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        normalise(self)
        check(self.method in METHODS, "method", self.method, " or ".join(METHODS))
        check(self.seed >= 0, "seed", self.seed, "0 or more")
        check(self.iterations >= 1, "iterations", self.iterations, "1 or more")
        check(self.batch >= 2, "batch", self.batch, "2 or more")
        check(self.learning_rate > 0, "learning rate", self.learning_rate, "a positive number")
        done = 0 <= self.iteration <= self.iterations
        check(done, "iteration", self.iteration, f"0 to {self.iterations}")
        check(self.seconds >= 0, "seconds", self.seconds, "0 or more")
        version = self.format_version
        check(version == FORMAT_VERSION, "format version", version, str(FORMAT_VERSION))


def _optimiser(card: Card, network: nn.Module) -> Adam:
    return Adam(network.parameters(), lr=card.learning_rate)


def recipe(method: str) -> checkpoints.Recipe[Card, nn.Module]:
    """Return how the networks of one of METHODS are made of its cards."""

    def own(card: Card) -> None:
        check(card.method == method, "method", card.method, method)

    return checkpoints.Recipe(
        method, Card, lambda card: relief_network(card.network), _optimiser, own
    )


State = checkpoints.State[Card, nn.Module]
