"""The process in which a model lives: it imports the model's file and calls it.

`model_file` runs this file by its path. It imports nothing of this project, so that a model's own
`metrics` or `cli.py` is what the model gets. Requests come by standard input and answers go by
standard output; what the model prints goes to standard error. After an error it does nothing more.
"""

import importlib.util
import inspect
import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from queue import SimpleQueue
from types import ModuleType, SimpleNamespace
from typing import IO, Any

SIZE = 8  # bytes of a message's length, before it
END = b""  # the message after the last request
EXPECTED = "infer(image, intrinsics=None), or load() or one class that gives an object with it"
EXAMPLE = "see docs/your-model.md"


class UnusableError(Exception):
    """A file without a model; its arguments are those of `ModelError`."""


def main() -> None:
    """Load the model of the first request, and call it for each of the others."""
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    messages: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(requests, messages), daemon=True).start()
    path, settings = pickle.loads(messages.get())
    sys.argv = [path]
    sys.path.insert(0, str(Path(path).resolve().parent))
    model: Any = None

    def load() -> dict[str, Any]:
        nonlocal model
        model = _loaded(path, settings)
        batch = getattr(model, "infer_batch", None)
        called = batch if callable(batch) else model.infer
        return {"batch": callable(batch), "intrinsics": _accepts(called, "intrinsics")}

    answer = _answer(path, load)
    write(answers, answer)
    while answer[:1] == b"+" and (message := messages.get()):
        name, arguments = pickle.loads(message)
        answer = _answer(path, lambda: plain(getattr(model, name)(*arguments)))  # noqa: B023
        write(answers, answer)


def _listen(requests: IO[bytes], messages: "SimpleQueue[bytes]") -> None:
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


def _answer(path: str, function: Callable[[], Any]) -> bytes:
    """Return what a function of the model returns, after `+`; or what it raised, after `-`."""
    try:
        return b"+" + pickle.dumps(function(), 5)
    except BaseException as error:
        if isinstance(error, UnusableError):
            told: dict[str, Any] = {"unusable": error.args}
        else:
            text = f"{type(error).__name__}: {error}".strip().removesuffix(":")
            told = {"found": " ".join(text.split())[:400], "line": _line(error, path)}
            told |= {"interrupt": isinstance(error, KeyboardInterrupt)}
            told |= {"traceback": "".join(traceback.format_exception(error))}
        return b"-" + pickle.dumps(told)


def _line(error: BaseException, path: str) -> int | None:
    """Return the last line of the file that an error went through; None for none."""
    if isinstance(error, SyntaxError) and error.filename == path:
        return error.lineno
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == path]
    return lines[-1] if lines else None


# ---- the model ----


def _loaded(path: str, settings: Mapping[str, Any]) -> Any:
    """Import the file and return its model, as `model_file.opened_model` says."""
    module = _imported(path)
    make = getattr(module, "load", None)
    if not callable(make):
        make = None if callable(getattr(module, "infer", None)) else _only_class(module, path)
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
            expected = f"a load() or a class that takes {name}"
            if name == "batch":
                expected += ", or infer_batch(images, intrinsics=None)"
            raise UnusableError(f"--{name}", f"{path}, which does not take it", expected)
    return model


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
