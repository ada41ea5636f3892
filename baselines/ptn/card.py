"""The card of stored weights: where they come from; and how networks are made of it."""

from dataclasses import dataclass

from torch.optim import Adam

from baselines import checkpoints
from baselines.ptn.network import Ptn, PtnConfig
from scenegen.common.records import check, normalise

FORMAT_VERSION = 1


@dataclass(frozen=True)
class Card:
    """What is stored with weights: where they come from.

    Attributes:
        iteration: number of training iterations done.
        data, fingerprint: request and fingerprint of the training file.
        labels: number of answers that training was told.
        head: how the features of an answer are weighted, for questions (`answers.features`).
        seconds: duration of training.
    """

    config: PtnConfig
    iteration: int = 0
    data: str = ""
    fingerprint: str = ""
    labels: int = 0
    head: tuple[float, ...] = ()
    seconds: float = 0.0
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        normalise(self)
        version = self.format_version
        check(version == FORMAT_VERSION, "format version", version, str(FORMAT_VERSION))
        check(
            0 <= self.iteration <= self.config.iterations, "iteration", self.iteration, "in reach"
        )

    @property
    def seed(self) -> int:
        """Seed of the first weights and of every random choice of training."""
        return self.config.seed


def _optimiser(card: Card, model: Ptn) -> Adam:
    config = card.config
    return Adam(model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)


State = checkpoints.State[Card, Ptn]
RECIPE = checkpoints.Recipe("ptn", Card, lambda card: Ptn(card.config), _optimiser)
