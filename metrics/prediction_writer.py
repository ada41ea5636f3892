"""Write submissions that cannot be invalid: every row is checked as it comes.

    with RoomPredictionWriter("predictions.h5", "rooms.h5", method="mine", run="seed 0") as out:
        for row in range(len(rooms)):
            out.add(row, depth, normal)

`describe_format` says in words what is written.
"""

from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.depth import Alignment
from metrics.submissions.answer_writer import write_answers
from metrics.submissions.layout import datasets, describe_format
from metrics.submissions.parts import check_elsewhere, checked_floats, checked_texts, write_columns
from metrics.submissions.problems import PredictionError, first_ids
from metrics.submissions.row_rules import EXPECTED, GOT, depth_faults, faces_away, normal_faults
from scenegen.common.row_file import Table, new_file
from scenegen.rooms.reader import RoomsFile

__all__ = ["PredictionError", "RoomPredictionWriter", "describe_format", "write_answers"]

Array = NDArray[Any]


class RoomPredictionWriter:
    """Writes predicted depth, and normals perhaps, of the rooms of a file; a context manager.

    The file appears under its name when the block ends well and holds every row. Memory stays
    flat. Not to be shared between threads.
    """

    def __init__(
        self,
        path: str | Path,
        truth: str | Path,
        *,
        method: str,
        run: str = "",
        alignment: Alignment = "none",
        notes: str = "",
        overwrite: bool = False,
        allow_partial: bool = False,
    ) -> None:
        """Check the texts; the files are opened when the block begins.

        Args:
            path: to write.
            truth: the rooms file that is predicted, recorded as given.
            method, run: who predicts; runs of one method are averaged.
            alignment: what the method cannot know, as in `metrics.measures.depth.align`.
            notes: anything else.
            overwrite: whether an existing file may be replaced.
            allow_partial: whether rows may be missing; scores of such a file are not comparable.

        Raises:
            PredictionError: a text does not suit.
        When the block begins also OSError for either path, FileFormatError for the truth.
        """
        given = {"method": method, "run": run, "alignment": alignment, "notes": notes}
        self._texts = checked_texts("rooms", {**given, "truth_path": str(truth)})
        check_elsewhere(path, truth)
        self._path, self._truth_path = Path(path), Path(truth)
        self._overwrite, self._allow_partial = overwrite, allow_partial
        self._context: AbstractContextManager[None] | None = None
        self._table: Table | None = None
        self._written = 0

    def __enter__(self) -> Self:
        self._context = self._opened()
        self._context.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        context, self._context = self._context, None
        assert context is not None, "a block ends after it began"
        context.__exit__(kind, error, trace)

    def add(self, row: int, depth: ArrayLike, normal: ArrayLike | None = None) -> None:
        """Write the prediction for one row of the truth; rows may come in any order.

        Args:
            row: of the truth file.
            depth: (H, W) floats: planar depth, scene units, camera frame.
            normal: (H, W, 3) floats: camera frame, facing the viewer, of any length but 0. For
                all rows or for none.

        Raises PredictionError, naming the row, what was found and what was expected.
        """
        if self._context is None:
            raise PredictionError(f"{self._path}: not open: add rows inside the with block")
        row = self._checked_row(row)
        where = f"{self._path}: row {row}"
        mask = np.isfinite(self._truth.read("depth", row))
        values = {"depth": checked_floats(depth, mask.shape, f"{where}: depth")}
        _refuse(depth_faults(values["depth"], mask), f"{where}: depth")
        if self._texts["alignment"] != "scale_shift" and faces_away(values["depth"], mask):
            raise PredictionError(
                f"{where}: depth: found most of it at or below 0, expected planar depth, which is"
                " positive in front of the camera"
            )
        if normal is not None:
            values["normal"] = checked_floats(normal, (*mask.shape, 3), f"{where}: normal")
            _refuse(normal_faults(values["normal"], mask), f"{where}: normal")
        if self._table is None:
            self._table = self._new_table(values)
        with_normal = "normal" in self._columns
        if with_normal != ("normal" in values):
            found, expected = ("none", "one") if with_normal else ("one", "none")
            raise PredictionError(
                f"{where}: normal: found {found}, expected {expected}, as in the first row"
            )
        self._table.append(values)
        self._order[self._written] = row
        self._given[row] = True
        self._written += 1

    @contextmanager
    def _opened(self) -> Iterator[None]:
        with (
            RoomsFile(self._truth_path) as self._truth,
            new_file(self._path, self._overwrite) as self._file,
        ):
            count = len(self._truth)
            self._given, self._order = np.zeros(count, np.bool_), np.zeros(count, np.int64)
            self._written, self._table = 0, None
            yield
            self._finish(self._file)

    def _new_table(self, values: Mapping[str, Array]) -> Table:
        height, width = values["depth"].shape
        columns = [d.column(height, width) for d in datasets("rooms") if d.name in values]
        self._columns = [column.name for column in columns]
        return Table(self._file, columns, len(self._given))

    def _checked_row(self, row: Any) -> int:
        count = len(self._given)
        whole = isinstance(row, int | np.integer) and not isinstance(row, bool)
        if not whole or not 0 <= row < count:
            raise PredictionError(
                f"{self._path}: row: found {row!r:.40}, expected a row of {self._truth_path}, from"
                f" 0 to {count - 1}"
            )
        if self._given[row]:
            raise PredictionError(f"{self._path}: row {row}: given twice, expected once")
        return int(row)

    def _finish(self, file: h5py.File) -> None:
        missing = np.flatnonzero(~self._given)
        if self._written == 0 or (len(missing) and not self._allow_partial):
            shown = ", ".join(map(str, first_ids(missing)))
            raise PredictionError(
                f"{self._path}: {len(missing)} of {len(self._given)} rows were not given, such as"
                f" {shown}; nothing was written"
            )
        for name in self._columns if len(missing) else ():
            file[name].resize(self._written, axis=0)
        file.attrs.update({**self._texts, "truth_fingerprint": self._truth.fingerprint})
        write_columns(file, "rooms", {"row": self._order[: self._written]})


def _refuse(faults: Mapping[str, Array], where: str) -> None:
    for rule, at in faults.items():
        first = tuple(int(i) for i in np.argwhere(at)[0])
        raise PredictionError(
            f"{where}: found {GOT[rule]} at {np.count_nonzero(at)} pixels, the first at"
            f" {first}, expected {EXPECTED[rule]}"
        )
