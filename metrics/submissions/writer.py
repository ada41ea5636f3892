"""Writers of valid submissions; `metrics.prediction_writer` is the public entry point.

Rooms are written row by row, responses to questions all at once. The rules of the reader are
checked before anything is written.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike

from metrics.measured.reader import Images, MeasuredFile, is_flat, open_images, padded_size, size_of
from metrics.measures.alignment import Alignment
from metrics.submissions import layout, rules
from metrics.submissions.inspection import Inspection, take_values
from metrics.submissions.problems import PredictionError, first_error, first_ids
from scenegen.files.row_file import new_hdf5_file, writer_name
from scenegen.files.rows import RowFile
from scenegen.files.schema import Column
from scenegen.files.table import Table

if TYPE_CHECKING:
    from iqtt.files.reader import QuestionsFile


class RoomPredictionWriter:
    """Context manager that writes predicted geometry, and optionally normals, of images.

    The file appears under its name when the block ends without an error and every row is written.
    Memory use is constant. An instance must not be shared between threads.
    """

    def __init__(
        self,
        path: str | Path,
        truth: str | Path | Images,
        *,
        method: str,
        run: str = "",
        alignment: Alignment | None = None,
        shown: layout.Shown = "scored_view",
        notes: str = "",
        overwrite: bool = False,
        allow_partial: bool = False,
    ) -> None:
        """Check the texts; the files are opened when the block begins.

        Args:
            truth: file of rooms, or of measured ground truth, to predict; its path is recorded as
                given. An open file stays open.
            method, run: names of method and training run; runs of one method are averaged.
            alignment: alignment that the predictions need: "none", "median_scale", "scale" or
                "scale_shift"; None for "none", or "scale_shift" for disparity.
            shown: input view of each prediction: the scored view ("scored_view"), the first view of
                the scene ("first_view"), or none ("no_view"). Leaderboards rank each separately.
            allow_partial: whether rows may be missing; scores of such a file are not comparable.

        Raises PredictionError for an invalid text; when the block begins also OSError for
        either path, and FileFormatError for the ground truth.
        """
        texts: dict[str, Any] = {"method": method, "run": run, "shown": shown, "notes": notes}
        texts |= {} if alignment is None else {"alignment": alignment}
        self._given = _checked_texts("rooms", {**texts, "truth_path": str(_place_of(truth))})
        _check_elsewhere(path, _place_of(truth))
        self._path, self._source = Path(path), truth
        self._overwrite, self._allow_partial = overwrite, allow_partial
        self._context: AbstractContextManager[None] | None = None
        self._table: Table | None = None
        self._names: list[str] = []  # of what is written, as in the first row

    def __enter__(self) -> Self:
        self._context = self._opened()
        self._context.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        context, self._context = self._context, None
        assert context is not None, "a block ends after it began"
        context.__exit__(*error)

    @property
    def truth(self) -> Images:
        """The open file that is predicted, while the block lasts."""
        return self._truth

    def add(
        self,
        row: int,
        depth: ArrayLike | None = None,
        normal: ArrayLike | None = None,
        *,
        disparity: ArrayLike | None = None,
        points: ArrayLike | None = None,
        layers: ArrayLike | None = None,
        surface_points: ArrayLike | None = None,
        fov_y_degrees: float | None = None,
        confidence: ArrayLike | None = None,
    ) -> None:
        """Write the prediction for one row of the ground truth; rows may come in any order.

        Give one of depth, disparity, points and layers, the same for all rows. Torch tensors are
        accepted.

        Args:
            row: row of the ground truth file.
            depth: (H, W) floats: planar depth, scene units, camera frame.
            normal: (H, W, 3) floats: camera frame, facing the viewer, of any length but 0. For
                all rows or none.
            disparity: (H, W) floats: 1 / planar depth, up to a scale above 0 and a shift.
            points: (H, W, 3) floats: camera frame (x right, y up, z towards the viewer), scene
                units.
            layers: (H, W, L) floats: planar depth of all surfaces along each ray, in order; NaN
                behind the last one.
            surface_points: (P, 3) floats: points evenly by area on the whole surfaces of objects,
                camera frame, scene units; with layers alone. For all rows or none, as many in each.
            fov_y_degrees: vertical field of view that the method estimates. For all rows or none.
            confidence: (H, W) floats: larger for more certain depth; only the order within the
                image counts. For all rows or none.

        Raises PredictionError, naming the row, what was found and what was expected.
        """
        if self._context is None:
            raise PredictionError(self._path, "not open", "rows to be added inside the with block")
        row = self._checked_row(row)
        where = f"{self._path}: row {row}"
        height, width = size_of(self._truth, row)
        surface = np.ones((height, width), np.bool_)
        if self._truth.has_truth:
            surface = np.isfinite(self._truth.read("depth", row)[:height, :width])
        sizes = dict(zip(("y", "x"), ((size,) for size in surface.shape), strict=True))
        for column in self._table.columns if self._table else ():
            if column.name == "layers":
                sizes["layer"] = (column.shape[-1],)  # as in the first row
            elif column.name == "surface_points":
                sizes["point"] = (column.shape[0],)
        images = {"depth": depth, "disparity": disparity, "points": points}
        images |= {"layers": layers, "surface_points": surface_points}
        images |= {"normal": normal, "confidence": confidence}
        values = {}
        for column in layout.COLUMNS["rooms"]:
            image = images.get(column.name)
            if image is not None:
                place = f"{where}: {column.name}"
                array = _checked(column, [as_array(image, place)], where, 1, sizes)[0]
                rules.refuse_pixels(PredictionError, place, column.name, array, surface)
                values[column.name] = array
        self._check_kind(values, where, surface)
        if fov_y_degrees is not None:
            values["fov_y_degrees"] = _checked_fov(fov_y_degrees, where)
        if self._table is None:
            self._table = self._new_table(values)
            self._names = list(values)
        for name in sorted(set(self._names) ^ set(values)):
            found, expected = ("one", "none") if name in values else ("none", "one")
            raise PredictionError(f"{where}: {name}", found, f"{expected}, as in the first row")
        self._fov.append(values.pop("fov_y_degrees", np.array(np.nan)))
        self._table.append({name: self._padded(image) for name, image in values.items()})
        self._rows.append(row)
        self._written[row] = True

    def _padded(self, image: rules.Array) -> rules.Array:
        """Return an image (h, w, ...) in the size to which those of the truth are padded."""
        height, width = padded_size(self._truth)
        if not isinstance(self._truth, MeasuredFile) or image.shape[:2] == (height, width):
            return image
        padded = np.zeros((height, width, *image.shape[2:]), image.dtype)
        padded[: len(image), : image.shape[1]] = image
        return padded

    def _check_kind(self, values: Mapping[str, rules.Array], where: str, surface: Any) -> None:
        """Raise PredictionError unless there is one geometry, as the alignment allows."""
        kinds = [kind for kind in layout.KINDS if kind in values]
        if len(kinds) != 1:
            expected = f"one of {', '.join(layout.KINDS)}"
            raise PredictionError(f"{where}: geometry", " and ".join(kinds) or "none", expected)
        if "surface_points" in values and (
            kinds[0] != "layers" or isinstance(self._truth, MeasuredFile)
        ):
            raise PredictionError(
                f"{where}: surface_points", f"it with {kinds[0]}", "layers of rooms"
            )
        kind, allowed = kinds[0], layout.KINDS[kinds[0]]
        alignment = self._texts.setdefault("alignment", allowed[0])
        if alignment not in allowed:
            expected = f"{' or '.join(allowed)}, for {kind}"
            raise PredictionError(f"{where}: alignment", repr(alignment), expected)
        if is_flat(self._truth) or kind != "points":
            rules.refuse_behind_camera(where, kind, alignment, values[kind], surface)

    @contextmanager
    def _opened(self) -> Iterator[None]:
        source = self._source
        opening = nullcontext(source) if isinstance(source, Images) else open_images(source)
        with (
            opening as self._truth,
            new_hdf5_file(self._path, self._overwrite) as self._file,
        ):
            self._written = np.zeros(len(self._truth), np.bool_)
            self._rows: list[int] = []
            self._fov: list[rules.Array] = []
            self._names = []
            self._table = None
            self._texts = dict(self._given)
            yield
            self._finish(self._file)

    def _new_table(self, values: Mapping[str, rules.Array]) -> Table:
        columns = [
            # Without axes, which would be data sets of their own: readers go by the shape.
            replace(
                column,
                shape=self._padded(values[column.name]).shape,
                axes=None,
                more=_shape(column),
            )
            for column in layout.COLUMNS["rooms"]
            if column.name in values and column.own_chunk
        ]
        return Table(self._file, columns, len(self._written))

    def _checked_row(self, row: Any) -> int:
        count = len(self._written)
        whole = isinstance(row, int | np.integer) and not isinstance(row, bool)
        if not whole or not 0 <= row < count:
            expected = f"a row of {self._truth.path}, from 0 to {count - 1}"
            raise PredictionError(f"{self._path}: row", f"{row!r:.40}", expected)
        if self._written[row]:
            raise PredictionError(f"{self._path}: row {row}", "the row twice", "each row once")
        return int(row)

    def _finish(self, file: h5py.File) -> None:
        missing = np.flatnonzero(~self._written)
        if not self._rows or (len(missing) and not self._allow_partial):
            shown = ", ".join(map(str, first_ids(missing)))
            raise PredictionError(
                f"{self._path}: row",
                f"{len(missing)} of {len(self._written)} missing, such as {shown}",
                "all rows" if self._rows else "at least one row",
                "nothing was written",
            )
        assert self._table is not None, "a row was written"
        self._table.write_packed()
        for column in self._table.columns if len(missing) else ():
            file[column.name].resize(len(self._rows), axis=0)
        texts = {**self._texts, "truth_fingerprint": self._truth.fingerprint}
        if isinstance(self._truth, MeasuredFile):
            texts["task"] = "measured"
            del texts["shown"]  # there are no scenes of several views
        file.attrs.update(texts)
        fov = {"fov_y_degrees": np.array(self._fov)} if "fov_y_degrees" in self._names else {}
        _write_columns(file, "rooms", {"row": np.array(self._rows), **fov})


def write_answers(
    path: str | Path,
    questions_file: "str | Path | QuestionsFile",
    *,
    method: str,
    answer: ArrayLike | None = None,
    scores: ArrayLike | None = None,
    outcome: ArrayLike | None = None,
    rotated: ArrayLike | None = None,
    rows: Sequence[int] | None = None,
    run: str = "",
    notes: str = "",
    overwrite: bool = False,
) -> None:
    """Write responses to all questions of a file in its order, or to those of `rows`.

    Args:
        questions_file: such as iqtt-test.h5, or an open one; its path is recorded as given.
        method, run: as for `RoomPredictionWriter`.
        answer: (Q,) indices of options from 0, or -1 to abstain, which counts as wrong.
        scores: (Q, A) floats for A options, 2 or 3 as in the file: the highest score selects, and a
            tie abstains. Give `answer`, `scores`, or both in agreement.
        outcome: (Q,) outcome of reading a reply, an index into `rules.OUTCOMES`.
        rotated: (Q, A) the selected option if option r is shown first, for r from 0; -1 abstains,
            -2 not asked.
        rows: (Q,) indices of the questions, each once; the scores are comparable only if these are
            all questions.

    Raises:
        PredictionError: naming the questions, what was found and what was expected.
        OSError, FileFormatError, SpecError: either file, as `iqtt.QuestionsFile`.
    """
    place = _place_of(questions_file)
    texts = {"method": method, "run": run, "notes": notes, "truth_path": str(place)}
    texts = _checked_texts("iqtt", texts)
    _check_elsewhere(path, place)
    count, offered, fingerprint = _questions(questions_file)
    if count == 0:
        raise PredictionError(place, "no questions", "at least one")
    if answer is None and scores is None:
        raise PredictionError(path, "neither a response nor scores", "either")
    ids = np.arange(count) if rows is None else as_array(rows, f"{path}: rows")
    arrays = {"question": ids, "answer": answer, "scores": scores}
    arrays |= {"outcome": outcome, "rotated": rotated}
    values: dict[str, rules.Array] = {}
    for column in layout.COLUMNS["iqtt"]:
        array = arrays[column.name]
        if array is not None:
            many = None if column.name == "question" else len(ids)
            values[column.name] = _checked(column, array, str(path), many, {"answer": (offered,)})
    inspected = Inspection(task="iqtt", arrays=values)
    take_values(inspected, rules.Against(count, offered))
    problems = inspected.problems
    if problems:
        raise first_error(PredictionError, path, problems)
    with new_hdf5_file(path, overwrite) as file:
        file.attrs.update({**texts, "truth_fingerprint": fingerprint})
        _write_columns(file, "iqtt", values)


def _questions(source: "str | Path | QuestionsFile") -> tuple[int, int, str]:
    """Return how many questions a file holds, how many answers each offers, and its fingerprint."""
    from iqtt.files.reader import AnswersFile, NoImagesError, QuestionsFile

    if isinstance(source, QuestionsFile):
        return len(source), source.answers, source.fingerprint or ""
    try:
        with QuestionsFile(source) as questions:
            return _questions(questions)
    except NoImagesError:
        with AnswersFile(source) as answers:
            return _questions(answers)


def _place_of(truth: str | Path | RowFile) -> str | Path:
    """Return the path of a file that may be open."""
    return truth.path if isinstance(truth, RowFile) else truth


def _check_elsewhere(path: str | Path, truth: str | Path) -> None:
    """Raise PredictionError where a submission would replace the file that it predicts."""
    if os.path.exists(path) and os.path.exists(truth) and os.path.samefile(path, truth):
        raise PredictionError(path, "the file that is predicted", "another one to write to")


def _checked_texts(task: str, texts: Mapping[str, str]) -> dict[str, str]:
    """Return the root attributes, except for the fingerprint. Raises PredictionError."""
    ours = {"format": layout.FORMAT_NAME, "format_version": layout.FORMAT_VERSION, "task": task}
    texts = {**ours, "writer": writer_name(), **texts}
    for attribute in layout.attributes(task):
        if attribute.name in texts:
            fault = layout.text_fault(attribute, texts[attribute.name])
            if fault is not None:
                raise PredictionError(attribute.name, *fault)
    return texts


def _checked_fov(degrees: Any, where: str) -> rules.Array:
    """Return a vertical field of view, (). Raises PredictionError."""
    value = as_array(degrees, f"{where}: fov_y_degrees")
    if value.shape != () or value.dtype.kind not in "fiu" or not 0.0 < float(value) < 180.0:
        expected = "a number of degrees between 0 and 180"
        raise PredictionError(f"{where}: fov_y_degrees", f"{degrees!r:.60}", expected)
    return value.astype(np.float64)


def as_array(values: Any, where: str) -> rules.Array:
    """Return values as an array; masked floats become NaN, which counts as missing.

    Tensors of torch, on any device and with gradients, are taken without importing torch; the
    bfloat16 that NumPy lacks becomes float32. Raises PredictionError for what is no array, and for
    masked integers.
    """
    if isinstance(values, np.ma.MaskedArray):
        masked = int(np.ma.getmaskarray(values).sum())
        if masked and values.dtype.kind != "f":
            expected = "a value for each, or rows without them"
            raise PredictionError(where, f"{masked} masked values", expected)
        return np.asarray(values.filled(np.nan) if masked else values)
    try:
        if hasattr(values, "detach"):
            values = values.detach().cpu()
            values = values.float() if str(values.dtype).endswith("bfloat16") else values
        return np.asarray(values)
    except Exception as error:
        found = f"{type(values).__name__}, which is no array ({error!s:.80})"
        raise PredictionError(where, found, "an array of numbers") from error


def _checked(
    column: Column,
    values: Any,
    where: str,
    count: int | None,
    sizes: Mapping[str, tuple[int, ...]],
) -> rules.Array:
    """Return the values of a column as they are stored. Raises PredictionError."""
    array = as_array(values, f"{where}: {column.name}")
    problem = rules.array_problem(column, array, count, {**layout.SIZES, **sizes})
    if problem is not None:
        raise first_error(PredictionError, where, [problem])
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as infinite
        return array.astype(column.dtype)


def _write_columns(file: h5py.File, task: str, values: Mapping[str, rules.Array]) -> None:
    """Write data sets that are small enough to be kept in memory."""
    for column in layout.COLUMNS[task]:
        if column.name in values:
            data = values[column.name].astype(column.dtype)
            stored = file.create_dataset(
                column.name, data=data, compression="gzip", shuffle=data.itemsize > 1
            )
            stored.attrs.update(column.attributes | _shape(column))


def _shape(column: Column) -> dict[str, str]:
    """Return the HDF5 attribute that tells the shape of a column."""
    return {"shape": rules.shape_text(column, None, layout.SIZES)}
