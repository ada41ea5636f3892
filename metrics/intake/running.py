"""Run a model on every row of a file of rooms or questions, and write its submission."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from metrics.intake.importing import told_of_missing
from metrics.intake.kept_rows import KeptRows, kept_rows
from metrics.intake.model_file import Model, ModelError
from metrics.intake.outputs import Frame, Geometry, Missing, OutputError, read_output
from metrics.measured.reader import Images, MeasuredFile, matrix_of, open_images, size_of
from metrics.submissions.problems import PredictionError
from metrics.submissions.writer import RoomPredictionWriter, as_array, write_answers
from scenegen.common.errors import SpecError
from scenegen.files.new_file import check_writable
from scenegen.files.sets.shards import OpenFile
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import radiance_of

Array = NDArray[Any]
Begun = TypeVar("Begun")
Progress = Callable[[int], Any]
DEFAULT_BATCH = 8  # images, of a model that has infer_batch
KIND = "file of rooms or questions"
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
            hint = f"say --exposure {0.9 * self.exposure / brightest:.2g}"
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
    data: str | Path,
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
        data: a file of rooms, or of questions.
        keep: "resume", "restart" or None, as in `kept_rows`.
        options: that the model was loaded with; kept rows of others are refused.
        progress: called with the number of rows that were done since it was last called.

    Raises ModelError, OutputError and PredictionError, naming the row; and as `kept_rows` and the
    readers and writers of files.
    """
    from iqtt.files.reader import holds_questions

    check_writable(out, overwrite)
    with OpenFile(data, KIND) as opened:
        questions = holds_questions(opened)
    texts: dict[str, Any] = {"method": method, "run": run, "notes": notes, "overwrite": overwrite}
    kept = {name: value for name, value in (options or {}).items() if name != "batch"}
    settings = {"model": model.sha256, **call.settings, "options": kept}
    settings |= {"weights": model.provenance["weights_sha256"]} if model.named else {}
    runner = _run_questions if questions else _run_rooms
    return runner(model, data, out, call, texts, settings, keep, progress)


def count_rows(data: str | Path) -> int:
    """Return how many rows a file of rooms or questions has. Raises as their readers."""
    from iqtt.files.reader import QuestionsFile, holds_questions

    with OpenFile(data, KIND) as opened:
        if holds_questions(opened):
            return len(QuestionsFile(opened))
    with open_images(data) as images:
        return len(images)


# ---- rooms ----


def _run_rooms(
    model: Model, data: str | Path, out: str | Path, call: Call, texts: dict[str, Any],
    settings: dict[str, Any], keep: str | None, progress: Progress,
) -> str:  # fmt: skip
    if call.intrinsics:
        if not model.takes_intrinsics:
            found = f"infer of {model.name}, which takes none"
            raise ModelError("--intrinsics", found, "infer(image, intrinsics=None)")
        texts["notes"] = "\n".join(filter(None, (texts["notes"], TOLD)))
    with open_images(data) as rooms:
        settings |= {"data": rooms.fingerprint}
        with kept_rows(out, settings, keep) as kept:
            done = kept.count
            rows = _geometries(model, rooms, call, kept)
            start = next(rows)
            first = start[1]
            model.ask_provenance()
            told = [f"{name}: {text}" for name, text in model.provenance.items() if text]
            texts["notes"] = "\n".join(filter(None, (texts["notes"], *told)))
            with RoomPredictionWriter(out, data, alignment=first.alignment, **texts) as writer:
                for row, geometry in itertools.chain([start], rows):
                    where = f"{model.name}: row {row}"
                    try:
                        if geometry.key != first.key:
                            expected = f"{first.key!r}, as in row 0"
                            raise OutputError("returned", repr(geometry.key), expected)
                        writer.add(row, **geometry.values)
                    except (OutputError, PredictionError) as error:
                        error.where = error.where.removeprefix(f"{out}: row {row}: ")
                        raise told_of_missing(error, where) from error
                    kept.write(row, _arrays(geometry))
                    progress(1)
    again = f", {done} of them from an earlier run" if done else ""
    return f"{first.key} of {len(rooms)} rows{again}"


def _geometries(
    model: Model, rooms: Images, call: Call, kept: KeptRows
) -> Iterator[tuple[int, Geometry]]:
    """Yield what is predicted for each row, in order: kept, or from the model."""
    size = call.batch if model.takes_batches else 1

    def begin(start: int) -> tuple[dict[int, Any], Callable[[], dict[int, Any]]]:
        stored = {row: kept.read(row) for row in range(start, min(start + size, len(rooms)))}
        todo = [row for row in stored if stored[row] is None]
        return stored, _begun(model, rooms, call, todo) if todo else dict

    for stored, wait in _one_ahead(begin, range(0, len(rooms), size)):
        outputs = wait()
        for row, arrays in stored.items():
            if arrays is not None:
                yield row, _geometry(arrays)
                continue
            try:
                geometry = read_output(
                    outputs[row], *size_of(rooms, row),
                    frame=call.frame, key=call.key, missing=call.missing,
                )  # fmt: skip
            except OutputError as error:
                raise error.inside(f"{model.name}: row {row}") from error
            in_metres = isinstance(rooms, MeasuredFile) or rooms.spec.interior
            if model.metres and geometry.alignment == "none" and not in_metres:
                geometry = replace(geometry, alignment="scale")
            yield row, geometry


def _one_ahead(begin: Callable[[int], Begun], items: Iterable[int]) -> Iterator[Begun]:
    """Begin each item before the one before it is yielded: the model works meanwhile."""
    before: list[Begun] = []
    for item in items:
        before.append(begin(item))
        if len(before) > 1:
            yield before.pop(0)
    yield from before


def _begun(
    model: Model, rooms: Images, call: Call, rows: Sequence[int]
) -> Callable[[], dict[int, Any]]:
    """Let the model begin some rows; the function returned waits for what it returns for each.

    Raises ModelError, and OutputError for a list of another length.
    """
    images, cameras = [], []
    for row in rows:
        if isinstance(rooms, MeasuredFile):
            images.append(rooms.picture(row))
        else:
            images.append(call.picture(radiance_of(rooms, row), rooms.place("image", row)))
        cameras += [matrix_of(rooms, row)] if call.intrinsics else []
    if not model.takes_batches:
        (row,), told = rows, cameras if call.intrinsics else []
        one = model.begin("infer", f"row {row}", *images, *told)
        return lambda: {row: one()}
    where = f"rows {rows[0]} to {rows[-1]}"
    if len({image.shape for image in images}) > 1:
        found = f"images of {len({image.shape for image in images})} sizes"
        raise OutputError(f"{model.name}: {where}", found, "one", "say --batch 1")
    batch = (np.stack(images), *([np.stack(cameras)] if call.intrinsics else []))
    several = model.begin("infer_batch", where, *batch)

    def wait() -> dict[int, Any]:
        outputs = several()
        if not isinstance(outputs, list) or len(outputs) != len(rows):
            count = f" of {len(outputs)}" if isinstance(outputs, list) else ""
            place, found = f"{model.name}: {where}: infer_batch", type(outputs).__name__ + count
            raise OutputError(place, found, f"a list of {len(rows)} dicts")
        return dict(zip(rows, outputs, strict=True))

    return wait


def _arrays(geometry: Geometry) -> dict[str, Any]:
    arrays = {"geometry": geometry.geometry.astype(np.float32), "key": geometry.key}
    arrays |= {"kind": geometry.kind, "alignment": geometry.alignment}
    arrays |= {} if geometry.normal is None else {"normal": geometry.normal.astype(np.float32)}
    return arrays | ({} if geometry.fov_y_degrees is None else {"fov": geometry.fov_y_degrees})


def _geometry(arrays: dict[str, Any]) -> Geometry:
    """Return what `_arrays` kept."""
    alignment: Any = str(arrays["alignment"])
    fov = float(arrays["fov"]) if "fov" in arrays else None
    kind, key = str(arrays["kind"]), str(arrays["key"])
    return Geometry(kind, alignment, arrays["geometry"], arrays.get("normal"), fov, key)


# ---- questions ----


def _run_questions(
    model: Model, data: str | Path, out: str | Path, call: Call, texts: dict[str, Any],
    settings: dict[str, Any], keep: str | None, progress: Progress,
) -> str:  # fmt: skip
    from iqtt.files.reader import QuestionsFile

    if model.named:
        raise ModelError(model.name, f"questions in {data}", "rooms, whose depth it predicts")
    values = []
    with QuestionsFile(data) as questions:
        settings |= {"data": questions.fingerprint or ""}
        with kept_rows(out, settings, keep) as kept:
            done = kept.count

            def begin(row: int) -> tuple[int, Any, Callable[[], Any]]:
                arrays = kept.read(row)
                if arrays is not None:
                    return row, arrays, lambda: None
                images = call.picture(
                    decode_image(questions.read("questions", row)), f"{data}: row {row}"
                )
                return row, None, model.begin("infer", f"row {row}", images[0], images[1:])

            for row, arrays, wait in _one_ahead(begin, range(len(questions))):
                where = f"{model.name}: row {row}: returned"
                value = arrays["value"] if arrays else _answer(wait(), questions.answers, where)
                if arrays is None:
                    kept.write(row, {"value": value})
                values.append(value)
                if values[-1].shape != values[0].shape:
                    where = f"{model.name}: row {row}: returned"
                    raise OutputError(where, "an index after scores, or scores after an index",
                                      "the same for all questions")  # fmt: skip
                progress(1)
            form = "scores" if values and values[0].ndim else "answer"
            given: dict[str, Any] = {form: np.array(values)}
            write_answers(out, data, **texts, **given)
    again = f", {done} of them from an earlier run" if done else ""
    return f"{form} to {len(values)} questions{again}"


def _answer(value: Any, offered: int, where: str) -> Array:
    """Return an index as int64, or scores (A,) as float64. Raises OutputError."""
    expected = f"the index of an answer, 0 to {offered - 1}, or {offered} scores"
    array = as_array(value, where)
    if array.shape == () and array.dtype.kind in "iu" and -1 <= int(array) < offered:
        return array.astype(np.int64)
    if array.shape == (offered,) and array.dtype.kind in "fiu" and np.isfinite(array).all():
        return array.astype(np.float64)
    found = "None" if value is None else f"{value!r:.60}"
    raise OutputError(where, " ".join(found.split()), expected)
