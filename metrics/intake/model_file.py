"""Load a model from a Python file of the user's, and call it.

The file holds `infer(image, intrinsics=None)`; or `load()`, which returns an object with `infer`;
or one class with `infer`. What the file prints goes to standard error. What it raises becomes one
line that names the file's line.
"""

import contextlib
import hashlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from scenegen.common.errors import SceneGenError

EXPECTED = "infer(image, intrinsics=None), or load() or one class that gives an object with it"
WEIGHTS = (".pt", ".pth", ".ckpt", ".safetensors", ".onnx", ".bin")
EXAMPLE = "see docs/your-model.md"


class ModelError(SceneGenError):
    """A model that cannot be loaded, or that raised; `__cause__` is what it raised."""


@dataclass(frozen=True)
class Model:
    """A loaded model.

    Attributes:
        path: its file.
        infer: for one image, or one question.
        infer_batch: for several images at once; None where the model has none.
        sha256: of the file, and of names, sizes and dates of the weights beside it.
    """

    path: Path
    infer: Callable[..., Any]
    infer_batch: Callable[..., Any] | None
    sha256: str

    def call(self, function: Callable[..., Any], where: str, *arguments: Any) -> Any:
        """Return what the model returns. Raises ModelError, with `where` in it."""
        with _guarded(self.path, where):
            return function(*arguments)


def load_model(path: str | Path, settings: Mapping[str, Any]) -> Model:
    """Import the file and make its model.

    Args:
        settings: such as device and batch, without those that are not set; handed to `load` or to
            the class where it takes an argument of that name.

    Raises ModelError for a file that cannot be imported, holds no model, or takes no such setting
    ("batch" only where there is no `infer_batch` either); OSError for the path.
    """
    path = Path(path)
    digest = _digest(path)
    module = _imported(path)
    make = getattr(module, "load", None)
    if not callable(make):
        make = None if callable(getattr(module, "infer", None)) else _only_class(module, path)
    taken = {name: settings[name] for name in settings if make and accepts(make, name)}
    model: Any = module
    if make is not None:
        with _guarded(path, f"{make.__name__}()"):
            model = make(**taken)
        model = module if model is None else model
    infer, batch = getattr(model, "infer", None), getattr(model, "infer_batch", None)
    if not callable(infer):
        raise ModelError(path, f"no infer in {type(model).__name__}", EXPECTED, EXAMPLE)
    for name in settings:
        if name not in taken and not (name == "batch" and callable(batch)):
            expected = f"a load() or a class that takes {name}"
            if name == "batch":
                expected += ", or infer_batch(images, intrinsics=None)"
            raise ModelError(f"--{name}", f"{path}, which does not take it", expected)
    return Model(path, infer, batch if callable(batch) else None, digest)


def accepts(function: Callable[..., Any], name: str) -> bool:
    """Return whether a function takes an argument of this name."""
    try:
        parameters = inspect.signature(function).parameters
    except (TypeError, ValueError):  # of some built-in functions
        return False
    kinds = (p.kind for p in parameters.values())
    return name in parameters or inspect.Parameter.VAR_KEYWORD in kinds


def _digest(path: Path) -> str:
    digest = hashlib.sha256(path.read_bytes())
    for file in sorted(path.resolve().parent.iterdir()):
        if file.suffix in WEIGHTS:
            state = file.stat()
            digest.update(f"{file.name} {state.st_size} {state.st_mtime_ns}".encode())
    return digest.hexdigest()


def _imported(path: Path) -> ModuleType:
    """Import a file as `python FILE` would: with its folder first among those of imports."""
    name = path.stem if path.stem.isidentifier() and path.stem not in sys.modules else "user_model"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ModelError(path, f"the ending {path.suffix!r:.20}", "a Python file, .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look a class up by its module
    sys.path.insert(0, str(path.resolve().parent))
    with _guarded(path, "import"):
        spec.loader.exec_module(module)
    return module


def _only_class(module: ModuleType, path: Path) -> Any:
    """Return the class of the file that has `infer`. Raises ModelError unless there is just one."""
    classes = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and value.__module__ == module.__name__
        if hasattr(value, "infer")
    ]
    if len(classes) != 1:
        names = ", ".join(value.__name__ for value in classes)
        found = f"{len(classes)} classes with infer: {names}" if classes else "no infer"
        raise ModelError(path, found, EXPECTED, EXAMPLE)
    return classes[0]


@contextlib.contextmanager
def _guarded(path: Path, where: str) -> Iterator[None]:
    """Let the block print to standard error, and turn what it raises into a ModelError."""
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    except (Exception, SystemExit) as error:
        found = f"{type(error).__name__}: {error}".strip().removesuffix(":")
        place = f"{path}{_line(error, path)}: {where}"
        raise ModelError(place, " ".join(found.split())[:400], "", "") from error


def _line(error: BaseException, path: Path) -> str:
    """Return the last line of the file that an error went through, in words; "" for none."""
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return f", line {error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    return f", line {lines[-1]}" if lines else ""
