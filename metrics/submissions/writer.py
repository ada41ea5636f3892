"""Writers of submissions that cannot be invalid; `metrics.prediction_writer` is their public door.

Rooms are written row by row, answers to questions all at once; the same rules as in `validate` are
checked before anything is written.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike

from metrics.measures.answers import ABSTAINED, answers_from_scores
from metrics.measures.depth import Alignment
from metrics.submissions import layout, rules
from metrics.submissions.problems import PredictionError, first_error, first_ids
from scenegen.files.row_file import new_file, writer_name
from scenegen.files.table import Table
from scenegen.rooms.reader import RoomsFile


class RoomPredictionWriter:
    """Writes predicted depth, and optionally normals, of the rooms of a file; a context manager.

    The file appears under its name when the block ends without an error and every row was given.
    Memory stays flat. Not to be shared between threads.
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
            truth: the rooms file that is predicted, recorded as given.
            method, run: who predicts; runs of one method are averaged.
            alignment: what the method cannot know, as in `metrics.measures.depth.align`.
            allow_partial: whether rows may be missing; scores of such a file are not comparable.

        Raises PredictionError where a text does not suit; when the block begins also OSError for
        either path, and FileFormatError for the truth.
        """
        given = {"method": method, "run": run, "alignment": alignment, "notes": notes}
        self._texts = _checked_texts("rooms", {**given, "truth_path": str(truth)})
        _check_elsewhere(path, truth)
        self._path, self._truth_path = Path(path), Path(truth)
        self._overwrite, self._allow_partial = overwrite, allow_partial
        self._context: AbstractContextManager[None] | None = None
        self._table: Table | None = None

    def __enter__(self) -> Self:
        self._context = self._opened()
        self._context.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        context, self._context = self._context, None
        assert context is not None, "a block ends after it began"
        context.__exit__(*error)

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
            raise PredictionError(self._path, "not open", "rows to be added inside the with block")
        row = self._checked_row(row)
        where = f"{self._path}: row {row}"
        mask = np.isfinite(self._truth.read("depth", row))
        values = {"depth": _checked_floats(depth, mask.shape, f"{where}: depth")}
        faults = rules.depth_faults(values["depth"], mask)
        rules.refuse_faults(faults, PredictionError, f"{where}: depth")
        if self._texts["alignment"] != "scale_shift" and rules.faces_away(values["depth"], mask):
            expected = "planar depth, which is positive in front of the camera"
            raise PredictionError(f"{where}: depth", "most of it at or below 0", expected)
        if normal is not None:
            values["normal"] = _checked_floats(normal, (*mask.shape, 3), f"{where}: normal")
            faults = rules.normal_faults(values["normal"], mask)
            rules.refuse_faults(faults, PredictionError, f"{where}: normal")
        if self._table is None:
            self._table = self._new_table(values)
        with_normal = "normal" in self._columns
        if with_normal != ("normal" in values):
            found, expected = ("none", "one") if with_normal else ("one", "none")
            raise PredictionError(f"{where}: normal", found, f"{expected}, as in the first row")
        self._table.append(values)
        self._rows.append(row)
        self._given[row] = True

    @contextmanager
    def _opened(self) -> Iterator[None]:
        with (
            RoomsFile(self._truth_path) as self._truth,
            new_file(self._path, self._overwrite) as self._file,
        ):
            self._given = np.zeros(len(self._truth), np.bool_)
            self._rows: list[int] = []
            self._table = None
            yield
            self._finish(self._file)

    def _new_table(self, values: Mapping[str, rules.Array]) -> Table:
        height, width = values["depth"].shape
        columns = [d.column(height, width) for d in layout.datasets("rooms") if d.name in values]
        self._columns = [column.name for column in columns]
        return Table(self._file, columns, len(self._given))

    def _checked_row(self, row: Any) -> int:
        count = len(self._given)
        whole = isinstance(row, int | np.integer) and not isinstance(row, bool)
        if not whole or not 0 <= row < count:
            expected = f"a row of {self._truth_path}, from 0 to {count - 1}"
            raise PredictionError(f"{self._path}: row", f"{row!r:.40}", expected)
        if self._given[row]:
            raise PredictionError(f"{self._path}: row {row}", "it twice", "each row once")
        return int(row)

    def _finish(self, file: h5py.File) -> None:
        missing = np.flatnonzero(~self._given)
        if not self._rows or (len(missing) and not self._allow_partial):
            shown = ", ".join(map(str, first_ids(missing)))
            raise PredictionError(
                f"{self._path}: row",
                f"{len(missing)} of {len(self._given)} missing, such as {shown}",
                "every one" if self._rows else "at least one",
                "nothing was written",
            )
        if self._table is not None:
            self._table.write_packed()
        for name in self._columns if len(missing) else ():
            file[name].resize(len(self._rows), axis=0)
        file.attrs.update({**self._texts, "truth_fingerprint": self._truth.fingerprint})
        _write_columns(file, "rooms", {layout.ID_NAMES["rooms"]: np.array(self._rows)})


def write_answers(
    path: str | Path,
    questions_file: str | Path,
    *,
    method: str,
    answer: ArrayLike | None = None,
    scores: ArrayLike | None = None,
    rows: Sequence[int] | None = None,
    run: str = "",
    notes: str = "",
    overwrite: bool = False,
) -> None:
    """Write answers to the questions of a file, all of them in its order unless `rows` is given.

    Args:
        questions_file: such as iqtt-test.h5, recorded as given.
        method, run: as for `RoomPredictionWriter`.
        answer: (Q,) integers from 0, or -1 to abstain, which counts as wrong.
        scores: (Q, A) floats for A answers, 2 or 3 as the file offers: the highest wins, a tie for
            it abstains. Either or both; both must say the same.
        rows: (Q,) the questions that are answered, each once; scores of such a file are not
            comparable unless these are all.

    Raises:
        PredictionError: naming the questions, what was found and what was expected.
        OSError, FileFormatError, SpecError: either file, as `iqtt.QuestionsFile`.
    """
    texts = _checked_texts(
        "iqtt", {"method": method, "run": run, "notes": notes, "truth_path": str(questions_file)}
    )
    _check_elsewhere(path, questions_file)
    count, candidates, fingerprint = _questions(questions_file)
    if count == 0:
        raise PredictionError(questions_file, "no questions", "at least one")
    ids = np.arange(count) if rows is None else _checked_rows(rows, count, f"{path}")
    values = _checked_answers(answer, scores, ids, candidates, f"{path}")
    with new_file(path, overwrite) as file:
        file.attrs.update({**texts, "truth_fingerprint": fingerprint})
        _write_columns(file, "iqtt", {layout.ID_NAMES["iqtt"]: ids, **values})


def _checked_rows(rows: Sequence[int], count: int, where: str) -> rules.Array:
    """Return rows of a file of `count` as an array. Raises PredictionError."""
    found = np.asarray(rows)
    good = found.ndim == 1 and len(found) > 0 and found.dtype.kind in "iu"
    if not good or len(np.unique(found)) < len(found) or found.min() < 0 or found.max() >= count:
        expected = f"different rows of the file, from 0 to {count - 1}, at least one"
        raise PredictionError(f"{where}: rows", f"{found.tolist()!r:.60}", expected)
    return found


def _checked_answers(
    answer: ArrayLike | None,
    scores: ArrayLike | None,
    ids: rules.Array,
    candidates: int,
    where: str,
) -> dict[str, rules.Array]:
    """Return the datasets to write, for scores of these questions. Raises PredictionError."""
    count, shape = len(ids), (len(ids), candidates)
    values: dict[str, rules.Array] = {}
    problems = []
    if scores is not None:
        values["scores"] = _checked_floats(scores, shape, f"{where}: scores", np.float64)
        problems += rules.score_problems(values["scores"], ids)
    if answer is not None:
        found = values["answer"] = np.asarray(answer)
        if found.shape != (count,) or found.dtype.kind not in "iu":
            expected = f"integers of shape ({count},), {ABSTAINED} to {candidates - 1}"
            what = f"{found.dtype} of shape {found.shape}"
            raise PredictionError(f"{where}: answer", what, expected)
        problems += rules.answer_problems(found, ids, candidates=candidates)
    if not values:
        raise PredictionError(where, "neither answer nor scores", "either")
    if len(values) == 2 and not problems:
        from_scores = answers_from_scores(values["scores"])
        problems = rules.agreement_problems(values["answer"].astype(np.int64), from_scores, ids)
    if problems:
        raise first_error(PredictionError, where, problems)
    return values


def _questions(path: str | Path) -> tuple[int, int, str]:
    """Return how many questions a file holds, how many answers each offers, and its fingerprint."""
    from iqtt.files.reader import AnswersFile, NoImagesError, QuestionsFile

    try:
        with QuestionsFile(path) as questions:
            return len(questions), questions.answers, questions.fingerprint or ""
    except NoImagesError:
        with AnswersFile(path) as answers:
            return len(answers), answers.answers, answers.fingerprint or ""


def _check_elsewhere(path: str | Path, truth: str | Path) -> None:
    """Raise PredictionError where a submission would replace the file that it predicts."""
    if os.path.exists(path) and os.path.exists(truth) and os.path.samefile(path, truth):
        raise PredictionError(path, "the file that is predicted", "another one to write to")


def _checked_texts(task: str, given: Mapping[str, str]) -> dict[str, str]:
    """Return the root attributes, except for the fingerprint. Raises PredictionError."""
    for attribute in layout.attributes(task):
        if attribute.name not in given:
            continue
        fault = layout.text_fault(attribute, given[attribute.name])
        if fault is not None:
            raise PredictionError(attribute.name, *fault)
    ours = {"format": layout.FORMAT_NAME, "format_version": layout.FORMAT_VERSION, "task": task}
    texts = {**ours, "writer": writer_name(), **given}
    return {a.name: texts[a.name] for a in layout.ATTRIBUTES if a.name in texts}


def _checked_floats(
    values: ArrayLike, shape: tuple[int, ...], where: str, dtype: type[Any] = np.float32
) -> rules.Array:
    """Return the array as it is stored. Raises PredictionError for another shape, or no floats."""
    try:
        array = np.asarray(values)
    except Exception as error:
        what = f"{type(values).__name__}, which is no array ({error!s:.80})"
        raise PredictionError(where, what, f"floats {shape}") from error
    if array.shape != shape:
        raise PredictionError(where, f"shape {array.shape}", str(shape))
    if array.dtype.kind != "f":
        raise PredictionError(where, f"type {array.dtype}", "floats")
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as infinite
        return array.astype(dtype)


def _write_columns(file: h5py.File, task: str, values: Mapping[str, rules.Array]) -> None:
    """Write datasets that are small enough to be kept in memory."""
    for dataset in layout.datasets(task):
        if dataset.name in values:
            data = values[dataset.name].astype(dataset.dtype)
            stored = file.create_dataset(
                dataset.name, data=data, compression="gzip", shuffle=data.itemsize > 1
            )
            stored.attrs.update(dataset.attributes)
