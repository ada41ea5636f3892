"""The weights that come with the package, found by name or by the data they suit."""

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


def suited(data: str | Path, rays: bool | None = None) -> str:
    """Return the name of the bundled weights that were trained on the most similar data.

    Args:
        rays: whether they shall be of the configuration "rays", which there is for rooms alone;
            None for whichever is better.

    Raises as `RoomsFile`, and SpecError where this installation has no such weights.
    """
    if is_question_file(data):
        if rays:
            raise SpecError(data, "questions", "rooms, which the configuration rays is for")
        name = "iqtt"
    else:
        with RoomsFile(data) as rooms:
            rays = rays is not False
            single = "-single" if rooms.spec.objects[1] == 1 and not rays else ""
            name = f"shapes{single}" if rooms.spec.source == "shapes" else "shapenet"
            name += "-rays" * rays
    if name not in names():
        hint = "train some with `pix2shape train`"
        raise SpecError("weights", "none bundled", f"some that suit {data}", hint)
    return name


def open_weights(weights: str | Path) -> tuple[Pix2Shape, Card]:
    """Load weights by path, or bundled ones by name. Raises as `load_model`, and SpecError."""
    text = str(weights)
    if text in names():
        return load_model(FOLDER / f"{text}.safetensors")
    if Path(text).suffix != ".safetensors":
        known = f"or one of {', '.join(names())}" if names() else "as no weights are bundled"
        raise SpecError("weights", repr(text), f"a .safetensors file, {known}")
    return load_model(text)
