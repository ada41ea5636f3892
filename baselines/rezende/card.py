"""Settings of model and training, and the card of weights."""

from dataclasses import dataclass

from torch.optim import Adam

from baselines.rezende.network import Model
from baselines.training.checkpoint import Card as BaseCard
from baselines.training.checkpoint import Method, check_numbers
from scenegen.common.records import LARGEST, check


@dataclass(frozen=True)
class Settings:
    """Settings of model and training.

    Attributes:
        size: height and width that images are reduced to, pixels.
        code: length of a code.
        iterations, batch: length of training, and images in each batch.
        pairs: antithetic pairs of meshes that are rendered for each image of a batch.
        width: standard deviation of the meshes' offsets about the decoder's, before smoothing,
            where the sphere has radius 1.
        noise: standard deviation of pixels about the rendered ones, in radiance.
        spread: standard deviation of offsets before anything is seen, about the sphere.
        learning_rate: of Adam; it falls linearly to 0 over the second half of training.
        seed: of the first weights and of every random choice.
    """

    size: int = 32
    code: int = 64
    iterations: int = 2_000
    batch: int = 32
    pairs: int = 4
    width: float = 0.2
    noise: float = 0.1
    spread: float = 1.0
    learning_rate: float = 0.001
    seed: int = 0

    def __post_init__(self) -> None:
        ranges = {
            "size": (16, 128), "code": (2, 1024), "iterations": (1, LARGEST), "batch": (1, 1024),
            "pairs": (1, 256), "width": (1e-4, 1.0), "noise": (1e-3, 10.0), "spread": (1e-3, 1e6),
            "learning_rate": (1e-8, 1.0), "seed": (0, LARGEST),
        }  # fmt: skip
        check_numbers(self, ranges)
        check(self.size % 8 == 0, "size", self.size, "a multiple of 8")


@dataclass(frozen=True)
class Card(BaseCard):
    """The card of a model; `labels` is 0 where the head was not trained."""

    settings: Settings


def _optimisers(_card: Card, model: Model) -> dict[str, Adam]:
    return {"adam": Adam([*model.encoder.parameters(), *model.decoder.parameters()])}


def _network(card: Card) -> Model:
    return Model(card.settings.size, card.settings.code)


METHOD = Method("rezende", Card, _network, _optimisers)
