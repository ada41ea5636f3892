"""TensorBoard logs of a run: losses and pictures, and one clear error where the disk is full.

TensorBoard writes in a thread of its own. An error there would be printed as a traceback; it comes
to this thread, too, with what is logged next.
"""

import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL.Image import Image
from torch.utils.tensorboard import SummaryWriter


class Logs:
    """A folder of logs. All methods raise OSError, which names it, where it cannot be written."""

    def __init__(self, folder: Path, first: int) -> None:
        """Go on with the logs in a folder; what they have from iteration `first` on is hidden."""
        self._folder = folder
        with self._named():
            self._writer = SummaryWriter(str(folder), purge_step=first)

    def numbers(self, values: Mapping[str, float], iteration: int) -> None:
        """Log losses by name."""
        with self._named():
            for name, value in values.items():
                self._writer.add_scalar(name, value, iteration)

    def picture(self, image: Image, iteration: int) -> None:
        """Log a picture."""
        with self._named():
            self._writer.add_image("pictures", np.asarray(image), iteration, dataformats="HWC")

    def close(self) -> None:
        """Write what is not written yet."""
        with self._named():
            self._writer.close()

    @contextmanager
    def _named(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            why = os.strerror(error.errno) if error.errno else str(error)
            raise OSError(error.errno, f"cannot be written: {why}", str(self._folder)) from error


@contextmanager
def opened_logs(folder: Path, first: int) -> Iterator[Logs]:
    """Open a folder of logs for the block, as `Logs`."""
    before = threading.excepthook

    def quiet(error: threading.ExceptHookArgs) -> None:
        if not isinstance(error.exc_value, OSError):
            before(error)

    threading.excepthook = quiet
    try:
        logs = Logs(folder, first)
        try:
            yield logs
        finally:
            logs.close()
    finally:
        threading.excepthook = before
