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


def suited(data: str | Path, method: str | None = None) -> str:
    """Return the name of the bundled weights that were trained on the most similar data.

    Args:
        method: the name that their submissions shall have; None for the method that scores best.

    Raises as `RoomsFile`, and SpecError where this installation has no such weights, or the method
    is not for such data.
    """
    if is_question_file(data):
        suiting = {"pix2shape-views": "iqtt"}
        found, other, unfit = "questions", "rooms", "pix2shape-rays"
    else:
        with RoomsFile(data) as rooms:
            shapes, single = rooms.spec.source == "shapes", rooms.spec.objects[1] == 1
        kind = "shapes" if shapes else "shapenet"
        suiting = {
            "pix2shape-rays": f"{kind}-rays",
            "pix2shape-compact": f"{kind}-single" if shapes and single else kind,
        }
        if shapes:
            suiting["pix2shape"] = "shapes-paper"
        found, other, unfit = "rooms", "questions", "pix2shape-views"
    if method == unfit:
        raise SpecError(data, found, f"{other}, which {method} is for")
    there = {one: name for one, name in suiting.items() if name in names()}
    if method is None and there:
        return next(iter(there.values()))
    if method not in there:
        expected = f"some{f' of {method}' if method else ''} that suit {data}"
        others = f"; weights of {' and '.join(sorted(there))} are bundled" if there else ""
        hint = f"train some with `pix2shape train` and name them with --weights{others}"
        raise SpecError("weights", "none bundled", expected, hint)
    return there[method]


def open_weights(weights: str | Path) -> tuple[Pix2Shape, Card]:
    """Load weights by path, or bundled ones by name. Raises as `load_model`, and SpecError."""
    text = str(weights)
    if text in names():
        return load_model(FOLDER / f"{text}.safetensors")
    if Path(text).suffix != ".safetensors":
        known = f"or one of {', '.join(names())}" if names() else "as no weights are bundled"
        raise SpecError("weights", repr(text), f"a .safetensors file, {known}")
    return load_model(text)
