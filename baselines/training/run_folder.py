"""The folder of a run, which holds its checkpoint and weights; one run has it at a time."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import torch

from baselines.training.checkpoint import (
    CHECKPOINT,
    WEIGHTS,
    CardT,
    Method,
    NetworkT,
    State,
    load_checkpoint,
    new_state,
)
from scenegen.common.errors import SpecError
from scenegen.files.sets.workspace import run_lock


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Make the folder of a run, and keep other runs out of it for the block.

    New folders in which nothing was written are removed. Raises SceneGenError where another run
    trains there, whose checkpoints this one would replace; OSError.
    """
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with run_lock(folder / ".lock", folder, "wait for it, or name another folder"):
            yield
    finally:
        for path in new:
            with suppress(OSError):  # it is not empty
                path.rmdir()


def check_new(folder: Path) -> None:
    """Raise FileExistsError where a new run would replace a checkpoint or weights."""
    if (folder / CHECKPOINT).exists():
        message = "holds a checkpoint; say --resume, or name another folder"
        raise FileExistsError(errno.EEXIST, message, str(folder))
    if (folder / WEIGHTS).exists():
        message = "is there, and a new run would replace it; name another folder"
        raise FileExistsError(errno.EEXIST, message, str(folder / WEIGHTS))


def earlier_state(
    folder: Path, method: Method[CardT, NetworkT], resume: bool
) -> State[CardT, NetworkT] | None:
    """Return the state of the folder's checkpoint, with `resume`; None for a new run.

    Raises FileExistsError where a new run finds files of another; OSError, FileFormatError.
    """
    if resume:
        return load_checkpoint(folder, method)
    check_new(folder)
    return None


def begun(
    method: Method[CardT, NetworkT],
    card: CardT,
    earlier: State[CardT, NetworkT] | None,
    where: object,
    device: torch.device | None = None,
) -> State[CardT, NetworkT]:
    """Return the state from which a run goes on: that of its checkpoint, or a new one.

    Args:
        card: of a new run on these data.
        where: the data, for messages.
        device: to which the state is moved; by default it stays on the CPU.

    Raises SpecError where the earlier state saw other data.
    """
    state = new_state(method, card) if earlier is None else earlier
    trained_on, mark = state.card.fingerprint, card.fingerprint
    if mark != trained_on:
        expected = f"{trained_on[:12]}, on which the run was trained"
        raise SpecError(where, f"fingerprint {mark[:12]}", expected, "resume with the same data")
    if device is not None:
        state.to(device)
    return state
