"""Processes that do tasks and need nothing of the program that started them.

They are started by `subprocess`, as those of `multiprocessing` import the main module of the
caller: a script without `if __name__ == "__main__":` would run once more in each. They end with the
process that started them, however it ends, and their libraries use one thread.

A task whose process a signal ended is done again once, alone: a crash may depend on where memory
lies, and memory may be short while other tasks are done.
"""

import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from queue import SimpleQueue
from typing import IO, Any

from scenegen.common.cgroup import oom_kills
from scenegen.common.errors import SceneGenError
from scenegen.common.signals import without_interrupts
from scenegen.common.threads import ONE_THREAD

SIZE = 8  # bytes of a message's length, before it
PATIENCE = 5.0  # seconds, until a process that closed its pipes has ended
END = b""  # the message after the last task
SIGNAL = "signal"  # how `ended` begins


class LostWorkerError(SceneGenError):
    """A process ended by itself while it did a task."""

    @property
    def by_signal(self) -> bool:
        """Whether a signal ended it."""
        return self.found.startswith(SIGNAL)

    def of(self, what: str) -> "LostWorkerError":
        """Return the error of a second process that ended while it made the same rows."""
        where = f"{what}: the worker process was terminated twice"
        return LostWorkerError(where, self.found, "", self.hint)


class Pool:
    """At most `count` processes; a thread for each waits for its answers.

    A process that ended is replaced when the next task comes.
    """

    def __init__(
        self, count: int, function: Callable[[Any], Any], told: Callable[[Any], str] = str
    ) -> None:
        """Take the function of all tasks, which is pickled once for each process.

        Args:
            told: says what a task makes, for errors.
        """
        self._told = told
        self._function = pickle.dumps(function)
        self._threads = ThreadPoolExecutor(count, thread_name_prefix="worker")
        self._idle: list[Process] = []
        self._started: list[Process] = []
        self._lock, self._killed = threading.Lock(), False
        self._turns = threading.Condition()
        self._busy = self._alone = 0  # tasks that are done; those that wait to be done alone, too

    def submit(self, task: Any) -> Future[Any]:
        """Return the future of the function's result; its error may be a LostWorkerError."""
        return self._threads.submit(self.do, task)

    def close(self) -> None:
        """Wait for all tasks, and for the end of the processes."""
        self._threads.shutdown()
        for process in self._started:
            process.end()

    def kill(self) -> None:
        """End the processes now."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        with self._lock:
            self._killed = True
            for process in self._started:
                process.kill()
        self.close()

    def do(self, task: Any) -> Any:
        """Return what the future of `submit` would, in this thread."""
        message = pickle.dumps(task)
        try:
            with self._turn(alone=False):
                succeeded, result = self._answer(message)
        except LostWorkerError as error:
            if not error.by_signal:
                raise
            with self._turn(alone=True):
                while self._idle:  # they hold memory
                    self._idle.pop().end()
                try:
                    succeeded, result = self._answer(message)
                except LostWorkerError as again:
                    raise again.of(self._told(task)) from error
        if not succeeded:
            raise result
        return result

    @contextmanager
    def _turn(self, alone: bool) -> Iterator[None]:
        """Wait until a task may be done: beside others, or alone, which comes first."""
        with self._turns:
            self._alone += alone
            self._turns.wait_for(lambda: not self._busy if alone else not self._alone)
            self._busy += 1
        try:
            yield
        finally:
            with self._turns:
                self._busy -= 1
                self._alone -= alone
                self._turns.notify_all()

    def _answer(self, message: bytes) -> tuple[bool, Any]:
        try:
            process = self._idle.pop()
        except IndexError:
            process = self._start()
        answer = process.answer(message)
        self._idle.append(process)
        return answer

    def _start(self) -> "Process":
        with self._lock:
            if self._killed:
                raise LostWorkerError("the worker processes were terminated")
            process = Process()
            self._started.append(process)
        process.begin(self._function)
        return process


class Process:
    """One process, and the pipes to it and from it."""

    def __init__(self, files: Sequence[int] = ()) -> None:
        """Start it; it never sees Ctrl-C, which a terminal sends to all processes.

        Args:
            files: descriptors that it gets, too, under the same numbers.

        Raises SceneGenError where no process can be started.
        """
        command = python_command(f"from {__name__} import serve; serve()")
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        environment = {**os.environ, **ONE_THREAD}
        self._oom_kills = oom_kills()
        try:
            with without_interrupts():
                self._popen = subprocess.Popen(command, **pipes, pass_fds=files, env=environment)
        except OSError as error:
            raise _not_to_be_had(error) from error

    def begin(self, function: bytes) -> None:
        """Hand over the function of all tasks. Raises SceneGenError where it cannot begin."""
        try:
            succeeded, result = self.answer(function)
        except LostWorkerError as error:
            raise _not_to_be_had(f"the first one exited at start, {error.found}") from error
        if not succeeded:
            raise result

    def answer(self, message: bytes) -> tuple[bool, Any]:
        """Return whether a task succeeded, and its result or error. Raises LostWorkerError."""
        self.ask(message)
        return self.heard()

    def ask(self, message: bytes) -> None:
        """Hand over a task, which is done after those before it. Raises LostWorkerError."""
        assert self._popen.stdin is not None
        try:
            _write(self._popen.stdin, message)
        except (OSError, ValueError):  # it has closed the pipe, as it ends, or `_lost` has
            raise self._lost() from None

    def heard(self) -> tuple[bool, Any]:
        """Wait for the oldest answer that is due; return and raise as `answer`."""
        assert self._popen.stdout is not None
        try:
            answer = _read(self._popen.stdout)
        except (OSError, ValueError, EOFError):
            raise self._lost() from None
        succeeded, result = pickle.loads(answer)
        return succeeded, result

    def _lost(self) -> LostWorkerError:
        with suppress(subprocess.TimeoutExpired):
            self._popen.wait(PATIENCE)
        self.kill()
        code = self._popen.wait()
        self.end()
        hint = ""
        if oom_kills() > self._oom_kills:
            hint = "out of memory (reported by the kernel): use fewer --workers"
        elif code == -getattr(signal, "SIGKILL", 0):
            hint = "possibly out of memory: use fewer --workers"
        return LostWorkerError("A worker process ended", ended(code), "", hint)

    def end(self) -> None:
        """Let it end by itself where it lives, wait for that, and close the pipes."""
        assert self._popen.stdin is not None
        with suppress(OSError, ValueError):  # it is gone, or its pipes are closed
            _write(self._popen.stdin, END)
        with suppress(OSError), self._popen:
            pass

    def kill(self) -> None:
        """End it now."""
        self._popen.kill()


def _not_to_be_had(why: object) -> SceneGenError:
    what = f"Worker processes cannot be started here ({why})"
    return SceneGenError(what, hint="use --workers 1")


def ended(code: int) -> str:
    """Return how a process ended, in words, by the return code of `subprocess`."""
    if code >= 0:
        return f"exit code {code}"
    try:
        return f"{SIGNAL} {-code}, {signal.Signals(-code).name}"
    except ValueError:  # of real time
        return f"{SIGNAL} {-code}"


@contextmanager
def worker_pool(
    count: int, function: Callable[[Any], Any], told: Callable[[Any], str] = str
) -> Iterator[Pool]:
    """Open a pool. The block waits for all tasks at its end; where it raises, they are killed."""
    pool = Pool(count, function, told)
    try:
        yield pool
    except BaseException:
        pool.kill()
        raise
    pool.close()


def python_command(code: str) -> list[str]:
    """Return a command that runs code in another Python, which imports from where this one does.

    The code needs no main module of this process, and gets none.
    """
    flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
    path = f"import sys; sys.path[:] = {list(map(str, sys.path))!r}"
    return [sys.executable, "-P", *flags, "-c", f"{path}; {code}"]


# ---- in the process ----


def serve() -> None:
    """Do the tasks that come by standard input, and answer each by standard output."""
    requests, answers = (os.fdopen(os.dup(number), mode) for number, mode in ((0, "rb"), (1, "wb")))
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)  # what libraries print must not come between the answers
    messages: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(requests, messages), daemon=True).start()
    function: Callable[[Any], Any] | None = None
    while message := messages.get():
        try:
            task = pickle.loads(message)
            if function is None:
                function, result = task, None
            else:
                result = function(task)
            answer = pickle.dumps((True, result))
        except Exception as error:
            answer = _told(error)
        _write(answers, answer)


def _listen(requests: IO[bytes], messages: "SimpleQueue[bytes]") -> None:
    """Pass messages on. Ends this process, whatever it does, when the one that started it ends."""
    while True:
        try:
            messages.put(_read(requests))
        except (OSError, EOFError):
            os._exit(1)


def _told(error: Exception) -> bytes:
    """Return an error as an answer, with its traceback where nobody is meant to read it."""
    if not isinstance(error, (SceneGenError, OSError)):
        error.add_note(traceback.format_exc())
    try:
        return pickle.dumps((False, error))
    except Exception:
        return pickle.dumps((False, RuntimeError(traceback.format_exc())))


# ---- messages ----


def _write(stream: IO[bytes], message: bytes) -> None:
    stream.write(len(message).to_bytes(SIZE, "little"))
    stream.write(message)
    stream.flush()


def _read(stream: IO[bytes]) -> bytes:
    """Return the next message. Raises EOFError where the other side is gone."""
    size = stream.read(SIZE)
    message = stream.read(int.from_bytes(size, "little"))
    if len(size) < SIZE or len(message) < int.from_bytes(size, "little"):
        raise EOFError
    return message
