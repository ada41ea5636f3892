"""Rows that a run has done, kept beside the file that it makes until that is complete."""

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import SceneGenError, SpecError
from scenegen.files.places import is_remote
from scenegen.files.sets.workspace import run_lock

SETTINGS = "settings.json"


class KeptRows:
    """A folder with one file for each row that is done.

    Attributes:
        folder: beside the output.
        count: rows that were there at the beginning.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.count = len(list(folder.glob("*.npz")))

    def read(self, row: int) -> dict[str, NDArray[Any]] | None:
        """Return the arrays of a row; None where it is not done."""
        try:
            with np.load(self._path(row), allow_pickle=False) as arrays:
                return dict(arrays)
        except Exception:  # not there, or cut off when the machine went down
            return None

    def write(self, row: int, arrays: Mapping[str, Any]) -> None:
        """Keep a row; it is there when it is complete."""
        path = self._path(row)
        temporary = path.with_suffix(".part")
        with temporary.open("wb") as file:
            np.savez(file, **arrays)
        os.replace(temporary, path)

    def _path(self, row: int) -> Path:
        return self.folder / f"{row:08d}.npz"


@contextmanager
def kept_rows(out: str | Path, settings: Mapping[str, Any], keep: str | None) -> Iterator[KeptRows]:
    """Open the rows that are kept beside `out`; they are removed when the block ends well.

    Args:
        settings: what rows depend on.
        keep: what to do with rows of other settings: "resume" takes them, "restart" removes all
            rows; None refuses.

    Raises SpecError for rows of other settings; SceneGenError where another run is at work. An
    error of the block says how many rows are kept.
    """
    if is_remote(out):
        raise SpecError("out", str(out), "a path of this machine, where finished images are kept")
    folder = Path(f"{out}.rows")
    text = json.dumps(dict(settings), indent=1, sort_keys=True)
    with run_lock(Path(f"{out}.rows.lock"), Path(out)):
        if keep == "restart" and folder.is_dir():
            shutil.rmtree(folder)
        stored = folder / SETTINGS
        if stored.exists() and stored.read_text(encoding="utf-8") != text and keep != "resume":
            count = len(list(folder.glob("*.npz")))
            found = f"{count} images of another model, other weights or other options"
            hint = "use --resume to keep them, or --restart to start again"
            raise SpecError(folder, found, "rows of this model", hint)
        folder.mkdir(exist_ok=True)
        stored.write_text(text, encoding="utf-8")
        rows = KeptRows(folder)
        try:
            yield rows
        except BaseException as error:
            done = len(list(folder.glob("*.npz")))
            if not done:
                shutil.rmtree(folder)
            elif isinstance(error, SceneGenError):
                kept = f"{done} images are kept in {folder}; re-run the same command to resume"
                error.hint = "; ".join(filter(None, (error.hint, kept)))
            raise
        shutil.rmtree(folder)
