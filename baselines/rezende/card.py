"""The card of stored weights: settings, and what was done; and how networks are made of it."""

from dataclasses import dataclass

from torch.optim import Adam

from baselines import checkpoints
from baselines.rezende.network import Model
from scenegen.common.records import LARGEST, check, normalise

FORMAT_VERSION = 1


@dataclass(frozen=True)
class Card:
    """Settings of model and training, and where the weights come from.

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
        labels: answers that the head was trained on; 0 where it was not.
        fingerprint: of the data.
        iteration, seconds: what has been done.
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
    labels: int = 0
    fingerprint: str = ""
    iteration: int = 0
    seconds: float = 0.0
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        normalise(self)
        for name, low, high in (
            ("size", 16, 128), ("code", 2, 1024), ("iterations", 1, LARGEST), ("batch", 1, 1024),
            ("pairs", 1, 256), ("width", 1e-4, 1.0), ("noise", 1e-3, 10.0), ("spread", 1e-3, 1e6),
            ("learning_rate", 1e-8, 1.0), ("seed", 0, LARGEST), ("labels", 0, LARGEST),
            ("iteration", 0, self.iterations), ("format_version", FORMAT_VERSION, FORMAT_VERSION),
        ):  # fmt: skip
            value = getattr(self, name)
            check(low <= value <= high, name.replace("_", " "), value, f"{low:g} to {high:g}")
        check(self.size % 8 == 0, "size", self.size, "a multiple of 8")


def _optimiser(card: Card, model: Model) -> Adam:
    learned = [*model.encoder.parameters(), *model.decoder.parameters()]
    return Adam(learned, lr=card.learning_rate)


State = checkpoints.State[Card, Model]
RECIPE = checkpoints.Recipe("rezende", Card, lambda card: Model(card.size, card.code), _optimiser)
