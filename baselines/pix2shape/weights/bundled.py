"""The weights that come with the package, by name."""

from pathlib import Path

from baselines.pix2shape.data.rooms import is_question_file
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.weights.storage import Card, load_model
from scenegen.common.errors import SpecError
from scenegen.rooms.reader import RoomsFile

FOLDER = Path(__file__).with_name("files")


def names() -> list[str]:
    """Return the names of the bundled weights."""
    return sorted(path.stem for path in FOLDER.glob("*.safetensors"))


def suited(data: str | Path) -> str:
    """Return the name of the bundled weights that were trained on the most similar data.

    Raises as `RoomsFile`, and SpecError where none are.
    """
    if is_question_file(data):
        name = "iqtt"
    else:
        with RoomsFile(data) as rooms:
            single = "-single" if rooms.spec.objects[1] == 1 else ""
            name = f"shapes{single}" if rooms.spec.source == "shapes" else "shapenet"
    if name not in names():
        raise SpecError(f"weights: none are bundled for {data}; train some with pix2shape train")
    return name


def open_weights(weights: str | Path) -> tuple[Pix2Shape, Card]:
    """Load bundled weights by name, or any by path. Raises as `load_model`, and SpecError."""
    text = str(weights)
    if text in names():
        return load_model(FOLDER / f"{text}.safetensors")
    if Path(text).suffix != ".safetensors":
        known = ", ".join(names()) or "the bundled ones, of which this installation has none"
        raise SpecError(f"weights: found {text!r}, expected a .safetensors file or one of {known}")
    return load_model(text)
