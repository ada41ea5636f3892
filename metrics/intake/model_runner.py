"""The process in which a model lives: it imports the model's file and calls it.

`model_file` runs this file by its path, in any Python from 3.9 on that has NumPy from 1.24 on. It
imports nothing of this project, so that a model's own `metrics` or `cli.py` is what the model gets.
Requests come by standard input and answers go by standard output; what the model prints goes to
standard error. After an error it does nothing more.
"""

from __future__ import annotations

import importlib.util
import inspect
import io
import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from queue import SimpleQueue
from types import ModuleType, SimpleNamespace
from typing import IO, Any

SIZE = 8  # bytes of a message's length, before it
END = b""  # the message after the last request
EXPECTED = "infer(image, intrinsics=None), or load() or one class whose object has infer"
EXAMPLE = "see docs/evaluate.md"


class UnusableError(Exception):
    """A file without a model; its arguments are those of `ModelError`."""


def main() -> None:
    """Load the model of the first request, and call it for each of the others."""
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    messages: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(requests, messages), daemon=True).start()
    path, settings, arguments = loads(messages.get())
    sys.argv = [path]
    folder = Path(path).resolve().parent
    if folder != Path(__file__).resolve().parent:
        sys.path.insert(0, str(folder))
    model: Any = None

    def load() -> dict[str, Any]:
        nonlocal model
        model = _loaded(path, settings, arguments)
        batch = getattr(model, "infer_batch", None)
        called = batch if callable(batch) else model.infer
        return {
            "batch": callable(batch),
            "intrinsics": _accepts(called, "intrinsics"),
            "metres": bool(getattr(model, "metres", False)),
            "provenance": plain(model.provenance()) if hasattr(model, "provenance") else {},
        }

    answer = _answer(path, load)
    write(answers, answer)
    while answer[:1] == b"+" and (message := messages.get()):
        name, arguments = loads(message)
        answer = _answer(path, lambda: plain(getattr(model, name)(*arguments)))  # noqa: B023
        write(answers, answer)


def _listen(requests: IO[bytes], messages: SimpleQueue[bytes]) -> None:
    """Pass messages on. Ends this process, whatever it does, when the one that started it ends.

    What the model has started ends, too, as this process leads a group of its own.
    """
    while True:
        try:
            messages.put(read(requests))
        except (OSError, EOFError):
            if hasattr(os, "killpg") and os.getpgid(0) == os.getpid():
                os.killpg(0, signal.SIGKILL)
            os._exit(1)


def write(stream: IO[bytes], message: bytes) -> None:
    """Write a message that `read` can read."""
    stream.write(len(message).to_bytes(SIZE, "little"))
    stream.write(message)
    stream.flush()


def read(stream: IO[bytes]) -> bytes:
    """Return the next message. Raises EOFError where the other side is gone."""
    size = stream.read(SIZE)
    message = stream.read(int.from_bytes(size, "little"))
    if len(size) < SIZE or len(message) < int.from_bytes(size, "little"):
        raise EOFError
    return message


class _Pickler(pickle.Pickler):
    """Sends arrays as bytes: what NumPy pickles cannot be read by one that is much older."""

    def persistent_id(self, obj: Any) -> Any:
        np = sys.modules.get("numpy")
        if np is None or not isinstance(obj, np.ndarray):
            return None
        mask = np.ma.getmaskarray(obj) if isinstance(obj, np.ma.MaskedArray) else None
        return obj.dtype.str, obj.shape, bytearray(obj.tobytes()), mask


class _Unpickler(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Any:
        import numpy as np

        dtype, shape, content, mask = pid
        array = np.frombuffer(content, dtype).reshape(shape)  # of a bytearray, so it is writable
        return array if mask is None else np.ma.MaskedArray(array, mask)


def dumps(value: Any) -> bytes:
    """Return a value of Python's own types and arrays as bytes."""
    stream = io.BytesIO()
    _Pickler(stream, 5).dump(value)
    return stream.getvalue()


def loads(message: bytes) -> Any:
    """Return the value of `dumps`, of any version of Python and NumPy."""
    return _Unpickler(io.BytesIO(message)).load()


def _answer(path: str, function: Callable[[], Any]) -> bytes:
    """Return what a function of the model returns, after `+`; or what it raised, after `-`."""
    try:
        return b"+" + dumps(function())
    except BaseException as error:
        if isinstance(error, UnusableError):
            told: dict[str, Any] = {"unusable": error.args}
        else:
            text = f"{type(error).__name__}: {error}".strip().removesuffix(":")
            told = {"found": " ".join(text.split())[:400], "line": _line(error, path)}
            told |= {"interrupt": isinstance(error, KeyboardInterrupt)}
            lines = traceback.format_exception(type(error), error, error.__traceback__)
            told |= {"traceback": "".join(lines)}
        return b"-" + dumps(told)


def _line(error: BaseException, path: str) -> int | None:
    """Return the last line of the file that an error went through; None for none."""
    if isinstance(error, SyntaxError) and error.filename == path:
        return error.lineno
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == path]
    return lines[-1] if lines else None


# ---- the model ----


def _loaded(path: str, settings: Mapping[str, Any], arguments: Sequence[str]) -> Any:
    """Import the file and return its model, as `model_file.opened_model` says."""
    module = _imported(path)
    make = getattr(module, "load", None)
    if not callable(make):
        make = None if callable(getattr(module, "infer", None)) else _only_class(module, path)
    if hasattr(getattr(make, "load", None), "main"):  # a command of click
        return _Baseline(make, settings, arguments)
    if arguments:
        found = f"{path}, which has no Baseline with a command load"
        raise UnusableError("arguments after --", found, "a file of MoGe's evaluation", EXAMPLE)
    taken = {name: settings[name] for name in settings if make and _accepts(make, name)}
    model: Any = module
    if make is not None:
        model = make(**taken)
        model = module if model is None else model
    if not callable(getattr(model, "infer", None)):
        raise UnusableError(path, f"no infer in {type(model).__name__}", EXPECTED, EXAMPLE)
    for name in settings:
        batches = name == "batch" and callable(getattr(model, "infer_batch", None))
        if name not in taken and not batches:
            raise UnusableError(*_untaken(name, path))
    return model


def _untaken(name: str, path: str) -> tuple[str, str, str]:
    expected = f"a load() or a class that takes {name}"
    if name == "batch":
        expected += ", or infer_batch(images, intrinsics=None)"
    return f"--{name}", f"{path}, which does not take it", expected


class _Baseline:
    """A wrapper of MoGe's evaluation: `load` is a command of click, images are tensors.

    `infer` takes an image (3, H, W) in [0, 1] and normalised intrinsics, and returns metres. Where
    there is an `infer_for_evaluation`, that is called.
    """

    metres = True

    def __init__(self, made: Any, settings: Mapping[str, Any], arguments: Sequence[str]) -> None:
        options = {word for parameter in made.load.params for word in parameter.opts}
        words = list(arguments)
        for name, value in settings.items():
            if f"--{name}" not in options:
                raise UnusableError(*_untaken(name, f"the command load of {made.__name__}"))
            words += [f"--{name}", str(value)]
        import click

        try:
            self.wrapped = made.load.main(words, standalone_mode=False)
        except click.ClickException as error:
            where, known = "arguments after --", ", ".join(sorted(options))
            raise UnusableError(
                where, error.format_message(), f"options of its load: {known}"
            ) from None
        self.called = getattr(self.wrapped, "infer_for_evaluation", None) or self.wrapped.infer

    def infer(self, image: Any, intrinsics: Any = None) -> Any:
        """Image (H, W, 3), sRGB bytes, and a matrix in pixels, to what the wrapper returns."""
        import torch

        device = getattr(self.wrapped, "device", "cpu")
        tensor = torch.from_numpy(image).to(device).permute(2, 0, 1).float() / 255.0
        with torch.inference_mode():
            if intrinsics is None:
                return self.called(tensor)
            height, width = image.shape[:2]
            matrix = torch.from_numpy(intrinsics).float() / torch.tensor([[width], [height], [1]])
            return self.called(tensor, matrix.to(device))


def _imported(path: str) -> ModuleType:
    """Import a file as `python FILE` would: with its folder first among those of imports."""
    stem = Path(path).stem
    name = stem if stem.isidentifier() and stem not in sys.modules else "user_model"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise UnusableError(path, f"the ending {Path(path).suffix!r:.20}", "a Python file, .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look a class up by its module
    spec.loader.exec_module(module)
    return module


def _only_class(module: ModuleType, path: str) -> Any:
    """Return the class of the file that has `infer`. Raises UnusableError unless there is one."""
    classes = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and value.__module__ == module.__name__
        if hasattr(value, "infer")
    ]
    if len(classes) != 1:
        names = ", ".join(value.__name__ for value in classes)
        found = f"{len(classes)} classes with infer: {names}" if classes else "no infer"
        raise UnusableError(path, found, EXPECTED, EXAMPLE)
    return classes[0]


def _accepts(function: Callable[..., Any], name: str) -> bool:
    """Return whether a function takes an argument of this name."""
    try:
        parameters = inspect.signature(function).parameters
    except (TypeError, ValueError):  # of some built-in functions
        return False
    kinds = (p.kind for p in parameters.values())
    return name in parameters or inspect.Parameter.VAR_KEYWORD in kinds


def plain(value: Any) -> Any:
    """Return what a model returned as Python's own values and arrays of NumPy, to be pickled.

    Tensors of torch, on any device and with gradients, become arrays; the bfloat16 that NumPy lacks
    becomes float32. Of what is none of these, its type, its shape and a text are told.
    """
    import numpy as np

    if value is None or type(value) in {bool, int, float, str}:
        return value
    if isinstance(value, Mapping):
        return {str(key): plain(value[key]) for key in value}
    if isinstance(value, (list, tuple)):
        first = value[0] if value else None
        if type(first) in {bool, int, float, list, tuple}:
            try:
                return plain(np.asarray(value))
            except ValueError:  # lists of several lengths
                pass
        return [plain(one) for one in value]
    try:
        found = value
        if hasattr(value, "detach"):
            found = value.detach().cpu()
            found = found.float() if str(found.dtype).endswith("bfloat16") else found
        found = found if isinstance(found, np.ma.MaskedArray) else np.asarray(found)
        if found.dtype.kind in "biufcSU":
            return found
    except Exception:
        pass
    shape = getattr(value, "shape", None)
    told = {"type": type(value).__name__, "shape": shape and tuple(shape), "text": f"{value!r:.60}"}
    return SimpleNamespace(**told)


if __name__ == "__main__":
    main()
