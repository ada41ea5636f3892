"""Run a model on every row of a file of rooms or questions, and write its submission."""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from metrics.intake.kept_rows import KeptRows, kept_rows
from metrics.intake.model_file import Model, ModelError
from metrics.intake.outputs import Frame, Geometry, Missing, OutputError, in_row, read_output
from metrics.measured.reader import Images, MeasuredFile, matrix_of, size_of
from metrics.submissions.truths import open_data
from metrics.submissions.writer import RoomPredictionWriter, as_array, write_answers
from scenegen.common.errors import SpecError
from scenegen.files.new_file import check_writable
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import radiance_of

if TYPE_CHECKING:
    from iqtt.files.reader import QuestionsFile

Array = NDArray[Any]
Arrays = dict[str, Any]  # what is kept of a row
Ask = Callable[[Sequence[int]], Callable[[], dict[int, Any]]]
Progress = Callable[[int], Any]
DEFAULT_BATCH = 8  # images, of a model that has infer_batch
TOLD = "the true intrinsics were given to the model"


@dataclass(frozen=True)
class Call:
    """How a model is called, and what is made of what it returns.

    Attributes:
        encoding: of images: "srgb" for networks, or "linear" radiance.
        exposure: factor of radiance; 1 is the brightest value.
        intrinsics: whether the model is told the true camera.
        batch: images for each call of `infer_batch`.
        frame, key, missing: as in `outputs.read_output`.
    """

    encoding: str = "srgb"
    exposure: float = 1.0
    intrinsics: bool = False
    batch: int = DEFAULT_BATCH
    frame: Frame = "opencv"
    key: str | None = None
    missing: Missing = "refuse"

    def picture(self, radiance: Array, where: str) -> Array:
        """Return linear radiance (..., H, W, 3) as bytes for a network. Raises SpecError."""
        radiance = radiance * np.float32(self.exposure)
        brightest = float(radiance.max())
        if not brightest <= 1.0 + 1e-6:
            hint = f"use --exposure {0.9 * self.exposure / brightest:.2g}"
            raise SpecError(where, f"radiance up to {brightest:.4g}", "at most 1", hint)
        if self.encoding == "srgb":
            return srgb_bytes(radiance)
        return np.asarray(np.rint(np.clip(radiance, 0.0, 1.0) * 255.0).astype(np.uint8))

    @property
    def settings(self) -> dict[str, Any]:
        """What the rows depend on."""
        names = ("encoding", "exposure", "intrinsics", "frame", "key", "missing")
        return {name: getattr(self, name) for name in names}


def run_model(
    model: Model,
    data: "str | Path | Images | QuestionsFile",
    out: str | Path,
    *,
    call: Call,
    method: str,
    run: str = "",
    notes: str = "",
    overwrite: bool = False,
    keep: str | None = None,
    options: dict[str, Any] | None = None,
    progress: Progress = lambda done: None,
) -> str:
    """Write the submission of a model, and return in words what it holds.

    Every row is kept on the disk when it is done, so that a killed run loses none; the same call
    goes on with the others.

    Args:
        data: a file of rooms, or of questions, which may be open.
        keep: "resume", "restart" or None, as in `kept_rows`.
        options: that the model was loaded with; kept rows of others are refused.
        progress: called with the number of rows that were done since it was last called.

    Raises ModelError, OutputError and PredictionError, naming the row; and as `kept_rows` and the
    readers and writers of files.
    """
    check_writable(out, overwrite)
    texts: dict[str, Any] = {"method": method, "run": run, "notes": notes, "overwrite": overwrite}
    with open_data(data) as rows:
        _check_suits(model, rows, call)
        kept_options = {name: value for name, value in (options or {}).items() if name != "batch"}
        settings = {"model": model.sha256, **call.settings, "options": kept_options}
        settings |= {"weights": model.provenance["weights_sha256"]} if model.named else {}
        with kept_rows(out, settings | {"data": rows.fingerprint or ""}, keep) as kept:
            done = kept.count
            write = _write_rooms if isinstance(rows, Images) else _write_answers
            said = write(model, rows, out, call, texts, kept, progress)  # type: ignore[arg-type]
    return said + (f", {done} of them from an earlier run" if done else "")


def _check_suits(model: Model, rows: "Images | QuestionsFile", call: Call) -> None:
    """Raise ModelError for a model that cannot predict such rows, or is not told the camera."""
    if not isinstance(rows, Images):
        if model.named:
            found = f"questions in {rows.path}"
            raise ModelError(model.name, found, "rooms, because it predicts depth")
    elif call.intrinsics and not model.takes_intrinsics:
        found = f"infer of {model.name}, which takes none"
        raise ModelError("--intrinsics", found, "infer(image, intrinsics=None)")


def _results(
    ask: Ask, count: int, size: int, kept: KeptRows
) -> Iterator[tuple[int, Arrays | None, Any]]:
    """Yield each row with what is kept of it, or None and what the model returns.

    The model is asked for `size` rows at a time, one block ahead: it works while rows are written.
    """

    def begin(start: int) -> tuple[dict[int, Arrays | None], Callable[[], dict[int, Any]]]:
        stored = {row: kept.read(row) for row in range(start, min(start + size, count))}
        lacking = [row for row, arrays in stored.items() if arrays is None]
        return stored, ask(lacking) if lacking else dict

    begun = map(begin, range(0, count, size))
    block = next(begun, None)
    while block is not None:
        stored, wait = block
        block = next(begun, None)
        outputs = wait()
        for row, arrays in stored.items():
            yield row, arrays, outputs.get(row)


# ---- rooms ----


def _write_rooms(
    model: Model, rooms: Images, out: str | Path, call: Call, texts: dict[str, Any],
    kept: KeptRows, progress: Progress,
) -> str:  # fmt: skip
    size = call.batch if model.takes_batches else 1
    results = _results(partial(_ask, model, rooms, call), len(rooms), size, kept)
    rows = (
        (row, _predicted(model, rooms, call, row, output) if arrays is None else _geometry(arrays))
        for row, arrays, output in results
    )
    start = next(rows)
    first = start[1]
    model.ask_provenance()
    told = [f"{name}: {text}" for name, text in model.provenance.items() if text]
    notes = (texts["notes"], TOLD if call.intrinsics else "", *told)
    texts["notes"] = "\n".join(filter(None, notes))
    with RoomPredictionWriter(out, rooms, alignment=first.alignment, **texts) as writer:
        for row, geometry in itertools.chain([start], rows):
            with in_row(out, row, f"{model.name}: row {row}"):
                if geometry.key != first.key:
                    expected = f"{first.key!r}, as in row 0"
                    raise OutputError("returned", repr(geometry.key), expected)
                writer.add(row, **geometry.values)
            kept.write(row, _arrays(geometry))
            progress(1)
    return f"{first.key} of {len(rooms)} images"


def _predicted(model: Model, rooms: Images, call: Call, row: int, output: Any) -> Geometry:
    """Return what a model returned for a row, in the size of the row. Raises OutputError."""
    try:
        geometry = read_output(
            output, *size_of(rooms, row), frame=call.frame, key=call.key, missing=call.missing
        )
    except OutputError as error:
        raise error.inside(f"{model.name}: row {row}") from error
    in_metres = isinstance(rooms, MeasuredFile) or rooms.spec.interior
    if model.metres and geometry.alignment == "none" and not in_metres:
        return replace(geometry, alignment="scale")
    return geometry


def _ask(
    model: Model, rooms: Images, call: Call, rows: Sequence[int]
) -> Callable[[], dict[int, Any]]:
    """Let the model begin some rows; the function returned waits for what it returns for each.

    Raises ModelError, and OutputError for a list of another length.
    """
    images = [_picture(rooms, row, call) for row in rows]
    cameras = [matrix_of(rooms, row) for row in rows] if call.intrinsics else []
    if not model.takes_batches:
        wait_for_it = model.begin("infer", f"row {rows[0]}", *images, *cameras)
        return lambda: {rows[0]: wait_for_it()}
    runs = [list(run) for _, run in itertools.groupby(range(len(rows)), lambda i: images[i].shape)]
    waits = []
    for run in runs:  # of pictures of one size
        numbers = [rows[i] for i in run]
        some = [np.stack([of[i] for i in run]) for of in (images, cameras) if of]
        where = f"rows {numbers[0]} to {numbers[-1]}"
        waits.append((numbers, where, model.begin("infer_batch", where, *some)))

    def wait() -> dict[int, Any]:
        returned = dict[int, Any]()
        for numbers, where, wait_for_all in waits:
            outputs = wait_for_all()
            if not isinstance(outputs, list) or len(outputs) != len(numbers):
                count = f" of {len(outputs)}" if isinstance(outputs, list) else ""
                place, found = f"{model.name}: {where}: infer_batch", type(outputs).__name__ + count
                raise OutputError(place, found, f"a list of {len(numbers)} dicts")
            returned |= zip(numbers, outputs, strict=True)
        return returned

    return wait


def _picture(rooms: Images, row: int, call: Call) -> Array:
    if isinstance(rooms, MeasuredFile):
        return rooms.picture(row)
    return call.picture(radiance_of(rooms, row), rooms.place("image", row))


def _arrays(geometry: Geometry) -> Arrays:
    arrays = {"geometry": geometry.geometry.astype(np.float32), "key": geometry.key}
    arrays |= {"kind": geometry.kind, "alignment": geometry.alignment}
    for name in ("normal", "confidence"):
        values = getattr(geometry, name)
        arrays |= {} if values is None else {name: values.astype(np.float32)}
    return arrays | ({} if geometry.fov_y_degrees is None else {"fov": geometry.fov_y_degrees})


def _geometry(arrays: Mapping[str, Any]) -> Geometry:
    """Return what `_arrays` kept."""
    alignment: Any = str(arrays["alignment"])
    fov = float(arrays["fov"]) if "fov" in arrays else None
    kind, key = str(arrays["kind"]), str(arrays["key"])
    normal, sure = arrays.get("normal"), arrays.get("confidence")
    return Geometry(kind, alignment, arrays["geometry"], normal, fov, sure, key=key)


# ---- questions ----


def _write_answers(
    model: Model, questions: "QuestionsFile", out: str | Path, call: Call, texts: dict[str, Any],
    kept: KeptRows, progress: Progress,
) -> str:  # fmt: skip
    def ask(rows: Sequence[int]) -> Callable[[], dict[int, Any]]:
        (row,) = rows
        radiance = decode_image(questions.read("questions", row))
        images = call.picture(radiance, f"{questions.path}: row {row}")
        wait = model.begin("infer", f"row {row}", images[0], images[1:])
        return lambda: {row: wait()}

    values = list[Array]()
    for row, arrays, output in _results(ask, len(questions), 1, kept):
        where = f"{model.name}: row {row}: returned"
        value = _answer(output, questions.answers, where) if arrays is None else arrays["value"]
        if arrays is None:
            kept.write(row, {"value": value})
        values.append(value)
        if value.shape != values[0].shape:
            found = "an index after scores, or scores after an index"
            raise OutputError(where, found, "the same for all questions")
        progress(1)
    form = "scores" if values and values[0].ndim else "answer"
    predicted: dict[str, Any] = {form: np.array(values)}
    write_answers(out, questions, **texts, **predicted)
    what = "scores" if form == "scores" else "responses"
    return f"{what} for {len(values)} questions"


def _answer(value: Any, offered: int, where: str) -> Array:
    """Return an index as int64, or scores (A,) as float64. Raises OutputError."""
    expected = f"the index of an option, 0 to {offered - 1}, or {offered} scores"
    array = as_array(value, where)
    if array.shape == () and array.dtype.kind in "iu" and -1 <= int(array) < offered:
        return array.astype(np.int64)
    if array.shape == (offered,) and array.dtype.kind in "fiu" and np.isfinite(array).all():
        return array.astype(np.float64)
    found = "None" if value is None else f"{value!r:.60}"
    raise OutputError(where, " ".join(found.split()), expected)
