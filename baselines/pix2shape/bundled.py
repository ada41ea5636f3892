"""The weights that come with the package, by name."""

from pathlib import Path

from baselines.pix2shape.model import Pix2Shape
from baselines.pix2shape.weights import Card, load_model
from scenegen.errors import SpecError

FOLDER = Path(__file__).with_name("bundled_weights")


def names() -> list[str]:
    """Return the names of the bundled weights."""
    return sorted(path.stem for path in FOLDER.glob("*.safetensors"))


def open_weights(weights: str | Path) -> tuple[Pix2Shape, Card]:
    """Load bundled weights by name, or any by path. Raises as `load_model`, and SpecError."""
    text = str(weights)
    if text in names():
        return load_model(FOLDER / f"{text}.safetensors")
    if Path(text).suffix != ".safetensors":
        raise SpecError(
            f"weights: found {text!r}, expected a .safetensors file or one of {', '.join(names())}"
        )
    return load_model(text)
