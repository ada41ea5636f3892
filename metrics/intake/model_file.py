"""A model in a Python file of the user's, in a process of its own: `model_runner`.

The file holds `infer(image, intrinsics=None)`; or `load()`, which returns an object with `infer`;
or one class with `infer`; or a `Baseline` of MoGe's evaluation. For models of public libraries it
is `doors`. What the file prints goes to standard error. What it raises becomes one line that names
the file's line. Where it crashes or hangs, the row is named.
"""

import hashlib
import os
import re
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from metrics.intake import model_runner
from scenegen.common.errors import SceneGenError
from scenegen.files.pool import ended

LIBRARIES = ("hf:", "moge:")  # what begins the names of models that `doors` loads
DOORS = Path(__file__).with_name("doors.py")
PACKAGES = {  # what to install, by the module that is missing
    "transformers": "transformers torch torchvision",
    "moge": "dlr-moge torch",
}
READY, NEEDED = "ready", "a Python of 3.9 or newer with NumPy"
# For `python -c`, of any version: says whether it can run the runner, and runs it without its
# folder among those of imports; -P is of Python 3.11.
BOOT = """
import os, sys
said = "ready"
if sys.version_info < (3, 9):
    said = "Python " + sys.version.split()[0]
else:
    try:
        import numpy
    except Exception as error:
        said = "no NumPy (%s)" % " ".join(str(error).split())
os.write(1, (said + "\\n").encode("ascii", "replace"))
if said == "ready":
    import runpy
    sys.path = [p for p in sys.path if p]
    runpy.run_path(sys.argv[1], run_name="__main__")
"""
WEIGHTS = (".pt", ".pth", ".ckpt", ".safetensors", ".onnx", ".bin")
PIPE_BYTES = 1 << 20
PATIENCE = 10.0  # seconds that a model has to end by itself, after the last row
MOMENT = 1.0  # seconds between two looks whether its process lives
SILENCE = 60.0  # seconds of one call after which the row is told; then twice, four times as many
Note = Callable[[str], Any]


class ModelError(SceneGenError):
    """A model that cannot be loaded, or that raised, crashed or took too long.

    Attributes:
        traceback: of what it raised; empty where it raised nothing.
    """

    traceback = ""


class Model:
    """A loaded model; `opened_model` makes it.

    Attributes:
        name: its file, or its name with that of its library before it.
        named: whether it is a public model by its name.
        path: the file that makes it.
        sha256: of that file and of the name; of a user's file, also of names, sizes and dates of
            the weights beside it.
        metres: whether what it calls metric is in metres, not in scene units.
        provenance: what it tells of itself, such as its revision and a digest of its weights.
        takes_batches: whether it has infer_batch.
        takes_intrinsics: whether infer_batch, or infer where it has none, does.
        calls: that have begun and whose results were not waited for, in words, the oldest first.
    """

    def __init__(
        self, name: str, timeout: float | None, note: Note, python: str | Path | None = None
    ) -> None:
        self.named = name.startswith(LIBRARIES)
        self.name, self.path = name, DOORS if self.named else Path(name)
        self.sha256, self.calls = _digest(self.path, name if self.named else None), deque[str]()
        self._timeout, self._note, self._said = timeout, note, ""
        self._program = str(python or sys.executable)
        command = [self._program, "-c", BOOT, model_runner.__file__]
        # Of its own session, so that Ctrl-C is not told to it, and what it starts ends with it.
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
        except OSError as error:
            found = f"{self._program}: {error.strerror}"
            raise ModelError("--python", found, "a Python that starts") from error
        for pipe in (self._process.stdin, self._process.stdout):
            _widen(pipe)
        self._asking = ThreadPoolExecutor(1, thread_name_prefix="model")
        self.takes_batches = self.takes_intrinsics = self.metres = False
        self.provenance: dict[str, Any] = {}

    def load(self, settings: Mapping[str, Any], arguments: Sequence[str] = ()) -> None:
        """Let the process import the file and make the model. Raises ModelError."""
        where = "import and load()"
        named = {"name": self.name} if self.named else {}
        request = str(self.path), {**named, **settings}, list(arguments)
        about = self._wait(self._ask(request, where), where, None)
        self.takes_batches, self.takes_intrinsics = about["batch"], about["intrinsics"]
        self.metres, self.provenance = about["metres"], about["provenance"]

    @property
    def title(self) -> str:
        """The name for tables: of a public model with its revision, of a file without its ending.

        So two revisions are two methods.
        """
        if not self.named:
            return self.path.stem
        name, revision = self.name.partition(":")[2], self.provenance.get("revision", "")
        name = Path(name).resolve().name if Path(name).exists() else name
        return f"{name}@{revision[:7]}" if revision else name

    def ask_provenance(self) -> None:
        """Ask once more, after the first row, what the model tells of itself."""
        if self.provenance:
            self.provenance = self.begin("provenance", "its provenance")()

    def begin(self, function: str, where: str, *arguments: Any) -> Callable[[], Any]:
        """Begin to call `infer` or `infer_batch`; the function returned waits for the result.

        The result has Python's own values and arrays of NumPy. Raises ModelError, with `where`.
        """
        asked = self._ask((function, arguments), where)
        return lambda: self._wait(asked, where, self._timeout)

    def close(self) -> None:
        """Let it end by itself, and end it and all that it has started where it does not."""
        self._asking.submit(self._tell, model_runner.END)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE)
        self.kill()

    def kill(self) -> None:
        """End it and all that it has started."""
        with suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._asking.shutdown(cancel_futures=True)
        with suppress(OSError), self._process:
            pass

    def _ask(self, request: Any, where: str) -> Future[bytes]:
        self.calls.append(where)
        return self._asking.submit(self._answer, model_runner.dumps(request))

    def _answer(self, message: bytes) -> bytes:
        assert self._process.stdout is not None
        if self._said != READY:  # before anything that a process might not take
            self._said = self._process.stdout.readline(300).decode("ascii", "replace").strip()
            if self._said != READY:
                raise EOFError
        self._tell(message)
        return model_runner.read(self._process.stdout)

    def _tell(self, message: bytes) -> None:
        assert self._process.stdin is not None
        model_runner.write(self._process.stdin, message)

    def _wait(self, asked: Future[bytes], where: str, timeout: float | None) -> Any:
        """Return the result of a call; tells where it is meanwhile."""
        begun, told = time.monotonic(), SILENCE
        place = f"{self.name}: {where}"
        while True:
            try:
                answer = asked.result(MOMENT)
                break
            except TimeoutError:
                seconds = time.monotonic() - begun
            except (OSError, EOFError):
                with suppress(subprocess.TimeoutExpired):
                    self._process.wait(MOMENT)
                raise self._lost(place) from None
            if self._process.poll() is not None and not asked.done():
                self.kill()  # what it started may hold the pipe
                raise self._lost(place)
            if timeout is not None and seconds > timeout:
                self.kill()
                found, hint = f"no result after {timeout:g} s", "pass a longer --timeout"
                raise ModelError(place, found, "", hint)
            if seconds > told:
                self._note(
                    f"{place}: the model has been running for {seconds:.0f} s; Ctrl-C ends it"
                )
                told *= 2
        self.calls.popleft()
        succeeded, content = answer[:1] == b"+", model_runner.loads(answer[1:])
        if succeeded:
            return _with_types(content)
        if content.get("interrupt"):
            raise KeyboardInterrupt
        if "unusable" in content:
            raise ModelError(*content["unusable"])
        found = str(content["found"])
        line = f", line {content['line']}" if content["line"] and not self.named else ""
        error = ModelError(f"{self.name}{line}: {where}", found, "", _advice(found))
        error.traceback = content["traceback"]
        raise error

    def _lost(self, place: str) -> ModelError:
        code = self._process.poll()
        how = "closed its pipes" if code is None else f"exited with {ended(code)}"
        if self._said != READY:
            tells = self._said.startswith(("no NumPy", "Python "))
            found = f"{self._program}: {self._said if tells else how}"
            return ModelError("--python", found, NEEDED)
        hint = "possibly out of memory" if code == -getattr(signal, "SIGKILL", 9) else ""
        return ModelError(place, f"a model whose process {how}", "", hint)


@contextmanager
def opened_model(
    name: str | Path,
    settings: Mapping[str, Any] | None = None,
    timeout: float | None = None,
    note: Note = lambda text: None,
    *,
    arguments: Sequence[str] = (),
    python: str | Path | None = None,
) -> Iterator[Model]:
    """Import the file and make its model, in a process that lives as long as the block.

    Args:
        name: of a file, or of a model of a library: `hf:NAME` or `moge:NAME`.
        settings: such as device and batch, without those that are not set; handed to `load` or to
            the class where it takes an argument of that name.
        timeout: seconds that a call may take; None for any.
        note: is called with a line where a call takes long.
        arguments: words for the command `load` of a `Baseline`.
        python: the program that runs it, of 3.9 or newer and with NumPy; by default ours.

    Raises ModelError for a file that cannot be imported, holds no model, or takes no such setting
    ("batch" only where there is no `infer_batch` either); OSError for the path.
    """
    model = Model(str(name), timeout, note, python)
    try:
        model.load(settings or {}, arguments)
        yield model
    except BaseException:
        model.kill()
        raise
    model.close()


def _digest(path: Path, named: str | None) -> str:
    digest = hashlib.sha256(path.read_bytes())
    if named is not None:
        digest.update(named.encode())
        return digest.hexdigest()
    for file in sorted(path.resolve().parent.iterdir()):
        if file.suffix in WEIGHTS:
            state = file.stat()
            digest.update(f"{file.name} {state.st_size} {state.st_mtime_ns}".encode())
    return digest.hexdigest()


def _advice(found: str) -> str:
    """Return what helps against an error that many models raise; nothing for others."""
    lacks = re.match(r"ModuleNotFoundError: No module named '(\w+)", found)
    if lacks:
        package = PACKAGES.get(lacks[1], lacks[1])
        return f"pip install {package}, or name a Python that has it with --python"
    return "take fewer images at a time with --batch" if "out of memory" in found else ""


def _widen(pipe: Any) -> None:
    """Let a pipe hold an image, where the system can: else each one is sent in 13 pieces."""
    with suppress(ImportError, AttributeError, OSError):
        import fcntl

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)


def _with_types(value: Any) -> Any:
    """Return a value in which what was no plain one has its type's name, its shape and its text."""
    if isinstance(value, SimpleNamespace):
        shown = {"shape": value.shape, "__repr__": lambda self: str(value.text)}
        return type(value.type, (), shown)()
    if isinstance(value, dict):
        return {name: _with_types(one) for name, one in value.items()}
    return [_with_types(one) for one in value] if isinstance(value, list) else value
