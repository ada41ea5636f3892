"""Read submissions: the one file through which any model meets the benchmark.

`layout` has the format, and `describe_format` prints it. Opening checks everything that needs no
truth, except for the pixels, which are read one row at a time.
"""

import hashlib
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self, cast

import h5py
import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment
from metrics.submissions import layout
from metrics.submissions.inspection import Inspection, inspect
from metrics.submissions.problems import Problem, first_error
from metrics.submissions.rules import as_doubles
from scenegen.common.errors import FileFormatError
from scenegen.files import trial
from scenegen.files.input_file import checking, open_unchecked, reading

Array = NDArray[np.float64]
BLOCK_BYTES = 1 << 20
Identity = tuple[int, int, int, int]  # device, inode, size, and time of the last change


def _identity(place: Path | int) -> Identity:
    status = os.stat(place)
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def on_any_machine(identity: Identity) -> Identity:
    """Return the identity by which other machines know a file of a shared folder."""
    return 0, 0, *identity[2:]


class Predictions:
    """An open submission. Use it as a context manager, or close it.

    Attributes:
        method, run, notes: what it says of itself; run and notes may be empty.
        truth_fingerprint: of the truth that it answers; None where it names none.
        truth_path: where the truth lay when the submission was written; empty where not recorded.
        rows: (M,) int64: which row of the truth, or which question, each entry answers; every one
            at least 0 and there once.
        alignment: what the method says it cannot know: "none", "median_scale", "scale" or
            "scale_shift" (`layout.KINDS`); "none" for questions.
        shown: which image of a scene the method was shown, as `layout.Shown`.
        identity: which file it was when it was opened, whatever has its path now.
    """

    task = ""

    def __init__(
        self,
        path: Path,
        content: Inspection,
        file: h5py.File | None,
        identity: Identity | None = None,
    ) -> None:
        """Take over an open file whose ids are usable, or none after JSON was read.

        `identity` is that of content that lies in no file.
        """
        assert content.ids is not None, "only usable files are opened"
        self.task = content.task or self.task
        texts = content.texts
        self.path, self.rows = path, content.ids
        self.method, self.run = texts.get("method", ""), texts.get("run", "")
        self.notes, self.truth_path = texts.get("notes", ""), texts.get("truth_path", "")
        self.truth_fingerprint = texts.get("truth_fingerprint") or None
        self.shown = cast(layout.Shown, texts.get("shown", "scored_view"))
        self._arrays, self._file = content.arrays, file
        allowed = layout.KINDS.get(self.kind, ("none",))
        self.alignment = cast(Alignment, texts.get("alignment", allowed[0]))
        if identity is None:
            identity = _identity(path if file is None else file.id.get_vfd_handle())
        self.identity = identity

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def kind(self) -> str:
        """What is predicted: "depth", "disparity", "points" or "layers"; "answers" to questions."""
        return next((kind for kind in layout.KINDS if kind in self._arrays), "answers")

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the file, as hex. Raises FileFormatError as `require_unchanged`."""
        with self.path.open("rb") as file:
            self.require(_identity(file.fileno()))
            return hashlib.file_digest(file, "sha256").hexdigest()

    def require_unchanged(self) -> None:
        """Raise FileFormatError where the path has another file than the one that was opened."""
        self.require(_identity(self.path))

    def require(self, identity: Identity) -> None:
        """Raise FileFormatError unless this is the identity of the file that was opened.

        Numbers that are 0 are not compared.
        """
        if any(
            theirs not in (0, ours) for theirs, ours in zip(identity, self.identity, strict=True)
        ):
            found = "another file than the one that was opened"
            raise FileFormatError(self.path, found, "a file that does not change during scoring")

    def close(self) -> None:
        """Close the file; idempotent."""
        if self._file is not None:
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


@dataclass(frozen=True, eq=False)
class PredictedView:
    """What is predicted for one image.

    Attributes:
        kind: which of `layout.KINDS` the geometry is.
        alignment: what the method cannot know, one of those that the kind allows.
        geometry: planar depth or disparity (H, W), points (H, W, 3), or layers (H, W, L), camera
            frame, as stored.
        normal: (H, W, 3), camera frame, as stored; None where there are none.
        fov_y_degrees: vertical field of view; None where the method does not estimate it.
        confidence: of each pixel's depth, (H, W), larger is surer; None where there is none.
        surface_points: of whole objects, (P, 3), camera frame, as stored; None where there are
            none.
    """

    kind: str
    alignment: Alignment
    geometry: Array
    normal: Array | None = None
    fov_y_degrees: float | None = None
    confidence: Array | None = None
    surface_points: Array | None = None

    @property
    def columns(self) -> tuple[tuple[str, Array | None], ...]:
        """What is predicted of each pixel, by the name of the column."""
        columns = (self.geometry, self.normal, self.confidence)
        return tuple(zip((self.kind, "normal", "confidence"), columns, strict=True))


class RoomPredictions(Predictions):
    """Predicted depth, disparity, points or layers, and optionally normals and field of view.

    They are of rooms, or of images whose truth was measured (`task`).
    """

    task = "rooms"
    scored_as: Alignment | None = None  # an alignment that takes the place of the declared one

    @property
    def fitted(self) -> Alignment:
        """The alignment under which it is scored."""
        return self.scored_as or self.alignment

    @property
    def height(self) -> int:
        """Of an image, pixels."""
        return int(self._arrays[self.kind].shape[1])

    @property
    def width(self) -> int:
        """Of an image, pixels."""
        return int(self._arrays[self.kind].shape[2])

    @property
    def has_normals(self) -> bool:
        """Whether there are normals."""
        return "normal" in self._arrays

    @property
    def has_confidence(self) -> bool:
        """Whether there is a confidence of each pixel."""
        return "confidence" in self._arrays

    @property
    def has_surface_points(self) -> bool:
        """Whether there are points of whole objects."""
        return "surface_points" in self._arrays

    def view(self, index: int) -> PredictedView:
        """Everything that is predicted in entry `index`. Raises FileFormatError."""
        normal = self.normal(index) if self.has_normals else None
        fov = float(self._arrays["fov_y_degrees"][index]) if self.has_fov else None
        sure = self.confidence(index) if self.has_confidence else None
        points = self.surface_points(index) if self.has_surface_points else None
        geometry = self.geometry(index)
        return PredictedView(self.kind, self.fitted, geometry, normal, fov, sure, points)

    @property
    def has_fov(self) -> bool:
        """Whether fields of view are predicted."""
        return "fov_y_degrees" in self._arrays

    def geometry(self, index: int) -> Array:
        """Depth or disparity (H, W), points (H, W, 3) or layers (H, W, L) of entry `index`.

        Values need not be finite. Raises FileFormatError where they are damaged.
        """
        return self._read(self.kind, index)

    def depth(self, index: int) -> Array:
        """Planar depth (H, W) of entry `index`, scene units, camera frame; of the first layer.

        Values need not be finite. Raises FileFormatError where they are damaged, or disparity.
        """
        if self.kind == "points":
            return -self.geometry(index)[..., 2]
        if self.kind == "layers":
            return self.geometry(index)[..., 0]
        return self._read("depth", index)

    def normal(self, index: int) -> Array:
        """Predicted normals (H, W, 3) of entry `index`, camera frame, as stored.

        Raises FileFormatError where there are none, or they are damaged.
        """
        return self._read("normal", index)

    def confidence(self, index: int) -> Array:
        """How sure the method is of each pixel of entry `index`, (H, W): larger is surer.

        Raises FileFormatError where there is none, or it is damaged.
        """
        return self._read("confidence", index)

    def surface_points(self, index: int) -> Array:
        """Points of whole objects (P, 3) of entry `index`. Raises as `normal`."""
        return self._read("surface_points", index)

    def _read(self, name: str, index: int) -> Array:
        if name not in self._arrays:
            raise FileFormatError(f"{self.path}: {name}", "the submission has none")
        with reading(f"{self.path}: {name}, row {self.rows[index]}"):
            return as_doubles(self._arrays[name][index])


class QuestionPredictions(Predictions):
    """Answers to questions.

    Attributes, besides those of `Predictions`:
        answers: (M,) int64: from 0, or -1 (abstained); those of the highest scores where only
            scores are given (`metrics.measures.answers.answers_from_scores`).
    """

    task = "iqtt"

    def __init__(self, path: Path, content: Inspection, file: h5py.File | None) -> None:
        """Take over an open file whose answers are usable, or none after JSON was read."""
        assert content.answers is not None, "only usable files are opened"
        super().__init__(path, content, file)
        self.answers = content.answers

    @property
    def candidates(self) -> int | None:
        """How many answers have scores, 2 or 3; None where only answers are given."""
        return int(self._arrays["scores"].shape[1]) if "scores" in self._arrays else None

    def told(self, name: str) -> Array | None:
        """Return `outcome`, (M,), or `rotated`, (M, A), as int64; None where it is not there."""
        if name not in self._arrays:
            return None
        with reading(f"{self.path}: {name}"):
            return np.asarray(self._arrays[name][()], np.int64)

    @cached_property
    def scores(self) -> Array | None:
        """Scores (M, A), finite; None where only answers are given. Raises FileFormatError."""
        if "scores" not in self._arrays:
            return None
        with reading(f"{self.path}: scores"):
            return as_doubles(self._arrays["scores"][()])


def open_predictions(
    path: str | Path, *, tried: Identity | None = None
) -> RoomPredictions | QuestionPredictions:
    """Open a submission of either task, HDF5 or JSON, and check what can be checked without truth.

    `tried` is the identity of a file that was opened in another process, and which this must be.

    Raises:
        OSError: no such file, or a folder.
        FileFormatError: not a submission, of another format, or broken; with the first problem and
            how many follow. `metrics.submissions.validation.validate` returns all.
    """
    opened, problems = inspect_predictions(path, tried=tried is not None)
    try:
        if opened is None or problems:
            raise first_error(FileFormatError, path, problems)
        if tried is not None:
            opened.require(tried)
    except FileFormatError:
        if opened is not None:
            opened.close()
        raise
    return opened


def inspect_predictions(
    path: str | Path, *, tried: bool = False
) -> tuple[RoomPredictions | QuestionPredictions | None, list[Problem]]:
    """Open what can be opened of a submission, and return everything that is wrong with it.

    Raises:
        OSError: no such file, or a folder.
        FileFormatError: neither HDF5 nor JSON.
    """
    path, file = Path(path), None
    if _looks_like_json(path):
        from metrics.submissions.answers_json import read_answers

        content = read_answers(path)
    else:
        if not tried:
            trial.try_file(path)
        file = open_unchecked(path, "submission; `bench import` converts other files")
        with checking(file):
            content = inspect(file)
    opened: RoomPredictions | QuestionPredictions | None = None
    if content.ids is not None and layout.KINDS.keys() & content.arrays.keys():
        opened = RoomPredictions(path, content, file)
    elif content.ids is not None and content.answers is not None:
        opened = QuestionPredictions(path, content, file)
    elif file is not None:
        file.close()
    return opened, content.problems


def _looks_like_json(path: Path) -> bool:
    """Return whether a file is to be read as JSON: by its first character, or else its name."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        start = file.read(64)
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip()
    return text[:1] in (b"[", b"{") or (path.suffix == ".json" and start[1:4] != b"HDF")
