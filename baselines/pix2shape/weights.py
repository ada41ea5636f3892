"""The card of weights, and the weights that come with the package, by name or by data they suit."""

from dataclasses import dataclass
from pathlib import Path

from torch import nn
from torch.optim import Adam

from baselines.pix2shape.network.config import TAUGHT_DEPTH, ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from baselines.training.checkpoint import Card as BaseCard
from baselines.training.checkpoint import Method, check_numbers, load_weights
from baselines.training.machine import PRECISIONS
from baselines.training.questions import is_question_file
from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice, did_you_mean
from scenegen.common.records import LARGEST, check

FOLDER = Path(__file__).with_name("files")


@dataclass(frozen=True)
class Card(BaseCard):
    """The card of a model: what its weights learned from.

    Attributes:
        earlier_labels: as many as the runs were given whose weights this one began from, added up.
        earlier_depth: whether any of those runs learned from true depth maps.
        precision: of the networks in training, one of PRECISIONS.
        classes: names of the object classes, in order, of a conditional model.
    """

    settings: ModelConfig
    earlier_labels: int = 0
    earlier_depth: bool = False
    precision: str = "32"
    classes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        check_numbers(self, {"earlier_labels": (0, LARGEST)})
        check_choice("precision", self.precision, PRECISIONS)
        count, classes = len(self.classes), self.settings.networks.classes
        check(count == classes, "classes", count, f"{classes}, as the networks have")

    @property
    def submission(self) -> str:
        """The name of its submissions: that of the settings, unless depth taught it before."""
        return TAUGHT_DEPTH if self.earlier_depth else self.settings.method


def _optimisers(card: Card, model: Pix2Shape) -> dict[str, Adam]:
    groups = {
        "generator": (model.encoder, model.decoder),
        "critic": (model.critic, model.statistics),
    }
    betas = card.settings.betas
    return {
        name: Adam(nn.ModuleList(networks).parameters(), betas=betas)
        for name, networks in groups.items()
    }


def _network(card: Card) -> Pix2Shape:
    return Pix2Shape(card.settings)


METHOD = Method(
    "pix2shape",
    Card,
    _network,
    _optimisers,
    kept=("encoder.", "decoder.", "prior."),
    gone=('"bounded":false,', '"compared_information":false,', '"consistency":0.0,', '"swap":0.0,'),
)


def names() -> list[str]:
    """Return the names of the bundled weights."""
    return sorted(path.stem for path in FOLDER.glob("*.safetensors"))


def suited(data: str | Path, method: str | None = None) -> str:
    """Return the name of the bundled weights that were trained on the most similar data.

    Args:
        method: the name that their submissions shall have; None for the method that scores best.

    Raises as `open_rooms`, and SpecError where this installation has no such weights, or the method
    is not for such data.
    """
    if is_question_file(data):
        suiting = {"pix2shape-views": "iqtt"}
        task, other, unfit = "questions", "rooms", "pix2shape-rays"
    else:
        with open_rooms(data) as rooms:
            shapes = rooms.spec.source == "shapes"
        suiting = {"pix2shape-rays": "shapes-rays" if shapes else "shapenet-rays"}
        if shapes:
            suiting["pix2shape"] = "shapes-paper"
        task, other, unfit = "rooms", "questions", "pix2shape-views"
    if method == unfit:
        raise SpecError(data, task, f"{other}, which {method} is for")
    bundled = {kind: name for kind, name in suiting.items() if name in names()}
    if method is None and bundled:
        return next(iter(bundled.values()))
    if method not in bundled:
        expected = f"some{f' of {method}' if method else ''} for {data}"
        others = f"; weights of {' and '.join(sorted(bundled))} are bundled" if bundled else ""
        hint = f"train some with `pix2shape train` and name them with --weights{others}"
        raise SpecError("weights", "none bundled", expected, hint)
    return bundled[method]


def open_weights(weights: str | Path) -> tuple[Pix2Shape, Card]:
    """Load weights by path, or bundled ones by name. Raises as `load_weights`, and SpecError."""
    text = str(weights)
    if text in names():
        return load_weights(FOLDER / f"{text}.safetensors", METHOD)
    if Path(text).suffix != ".safetensors":
        bundled = f"or one of {', '.join(names())}" if names() else "as no weights are bundled"
        expected = f"a .safetensors file, {bundled}"
        raise SpecError("weights", f"{text!r:.60}", expected, did_you_mean(text, names()))
    return load_weights(text, METHOD)
