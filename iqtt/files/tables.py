"""One table of questions in an HDF5 file, ours or a released one: open it, check it, read rows.

A training file holds two tables, its parts "labeled" and "unlabeled"; other files one, at the root.
`reader` has what users open: files of questions, and files of answers.
"""

from pathlib import Path
from typing import Any, ClassVar, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from iqtt.files.attributes import read_root, version_of
from iqtt.files.layout import (
    CAMERAS_SINCE,
    DIGESTS_SINCE,
    SCORED,
    named,
    old_camera_distance,
    truth_columns,
)
from iqtt.files.truth import QuestionTruth, question_truth
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import LARGEST, check
from scenegen.files import content
from scenegen.files.attributes import read_digest, read_names, read_text
from scenegen.files.input_file import StoredArray, checking, reading
from scenegen.files.row_file import and_more, column_problems
from scenegen.files.shards import JoinedArray, open_with_shards, stored_array
from scenegen.layout import TRUTH_DIGEST

Array = NDArray[Any]
PARTS = ("labeled", "unlabeled")
RELEASED = ("questions", "answers")


class TableFile:
    """An open file and one of its tables. Use it as a context manager, or close it.

    Attributes:
        part: which of its tables: "labeled" or "unlabeled", or "" for the only one.
        attributes: the root attributes `layout.ROOT_TEXTS` that are there; none are read of a
            released file.
        spec: the settings it was made with, without the seed unless it is a file of answers; None
            for a released file.
        split: "train", "val" or "test"; None for a released file.
        answers: how many answers a question has, 2 or 3.
        kind_names: names of the kinds that `distractor_kind` counts; empty where it is not told.
        fingerprint: SHA-256 of settings, shapes, views and answers of this table; None for a
            released file.
        stored_content_digest: what the file says of all it holds; None before format 1.2.
        stored_truth_digest: what the file says of the datasets that scores depend on; None before
            format 1.2 and without answers.
    """

    CONTENT: ClassVar[str]  # the dataset that every table has

    def __init__(self, path: str | Path, part: str | None = None) -> None:
        """Open a file and check the layout of one of its tables.

        Raises:
            OSError: no such file, or a folder.
            FileFormatError: not HDF5, without such a table, of a newer format, or damaged.
            SpecError: `part` is not given where there are two, or names none of them.
        """
        self.path = Path(path)
        self._file, self._shards = open_with_shards(self.path, "question file")
        with checking(self._file):
            self.attributes, self.spec, self.split = read_root(self._file, self.path)
            self.part = self._chosen(part)
            self._datasets: dict[str, Any] = {}  # the answers are in memory
            self._stored: dict[str, h5py.Dataset] = {}
            self._ranges: dict[str, tuple[float, float]] = {}
            self.answers = self.spec.answers if self.spec else 3
            self.kind_names: list[str] = []
            self._count = self._open_content()
            self._open_truth()
            self._read_identity()

    @property
    def fields(self) -> tuple[str, ...]:
        """The names that `read` takes."""
        return tuple(self._datasets)

    @property
    def has_answers(self) -> bool:
        """Whether the file tells which answers are right."""
        return "answers" in self._datasets

    @property
    def has_truth(self) -> bool:
        """Whether the file tells shapes, views and lights."""
        return "cubes" in self._datasets

    def __len__(self) -> int:
        return self._count

    def check_field(self, name: str) -> None:
        """Raise SpecError unless `read` takes this name."""
        check(name in self._datasets, "field", repr(name), f"one of {', '.join(self.fields)}")

    def read(self, name: str, rows: int | slice) -> Any:
        """Read rows of one dataset, such as "questions", "answers" or "cubes", as stored.

        Answers come as uint8, whatever integers the file has. Counts, kinds and angles are within
        their ranges.

        Raises:
            IndexError: a row beyond the file.
            FileFormatError: the rows are damaged, or a value is out of its range.
            SpecError: there is no such dataset.
        """
        self.check_field(name)
        with reading(self.place(name, rows)):
            values = self._datasets[name][rows]
        if name in self._ranges:
            self._check_values(name, rows, values)
        return values

    def truth(self, row: int) -> QuestionTruth | None:
        """Return what the file tells of one question beside images and answer; None if nothing.

        Raises as `read`.
        """
        if not self.has_truth:
            return None
        values = {name: self.read(name, row) for name in self.fields if name not in RELEASED}
        assert self.spec is not None  # truth is read only where there is one
        return question_truth(values, self.kind_names, self.spec)

    def stored_bytes(self) -> dict[str, tuple[int, int]]:
        """Return for each dataset of this table its bytes on disk and in memory."""
        with reading(self.path):
            return {n: (self._bytes_on_disk(d), d.nbytes) for n, d in self._stored.items()}

    def _bytes_on_disk(self, dataset: h5py.Dataset) -> int:
        if self._shards is not None and dataset.is_virtual:
            return self._shards.stored_bytes(dataset)
        return int(dataset.id.get_storage_size())

    def compression(self) -> str:
        """Return how large data sets are compressed: "gzip", "lzf" or "none"."""
        with reading(self.path):
            for data in self._stored.values():
                real = data
                if self._shards is not None and data.is_virtual:
                    real = self._shards.file(self._shards.numbers(data)[0])[data.name]
                if real.compression:
                    return str(real.compression)
            return "none"

    def stored_at(self, name: str) -> tuple[Path, str]:
        """Return the file that holds one dataset, and the name of the dataset there."""
        stored = self._stored[name]
        return Path(stored.file.filename), stored.name.lstrip("/")

    def stored_digest(self, name: str) -> str | None:
        """Return what the file says of one dataset; None before format 1.2. Raises as `read`.

        A field that is no dataset, as `camera_distance` before format 2.0, has none either.
        """
        place = f"{self.path}: {name}"
        if name not in self._stored:
            return None
        with reading(place):
            return read_digest(self._stored[name], content.SHA256, place)

    def truth_digest(self) -> str:
        """Return the joint digest of what scores depend on, made from what is read now.

        That are the datasets `layout.SCORED` that are there. Raises as `read`.
        """
        scored = [name for name in SCORED if name in self._datasets]
        values = {name: self.read(name, slice(None)) for name in scored}
        return content.joint_digest({n: content.dataset_digest(v) for n, v in values.items()})

    def close(self) -> None:
        """Close the file; idempotent."""
        self._file.close()
        if self._shards is not None:
            self._shards.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _chosen(self, part: str | None) -> str:
        parts = table_parts(self._file, self.path, self.CONTENT)
        if part is None and len(parts) == 1:
            return parts[0]
        if part is None or part not in parts:
            named = " or ".join(parts) or "none, as there is one table only"
            raise SpecError(f"{self.path}: part", part or "none", named)
        return part

    def _open_content(self) -> int:
        """Check and open questions and answers; return the number of questions."""
        raise NotImplementedError

    def _dataset(self, name: str) -> StoredArray | JoinedArray:
        """Return a dataset of this part, and note its size."""
        dataset = self._file[f"{self.part}/{name}"]
        if not isinstance(dataset, h5py.Dataset):
            raise FileFormatError(f"{self.path}: {name}", "a group", "a dataset")
        self._stored[name] = dataset
        return stored_array(dataset, self._shards)

    def _take_answers(self, count: int | None = None) -> int:
        """Read all answers; return their number, which must be `count` where that is given."""
        dataset = self._dataset("answers")
        found: tuple[int, ...] = dataset.shape or ()
        count = found[0] if count is None and found else count
        if found not in ((count,), (count, 1)) or dataset.dtype.kind not in "iu":
            raise FileFormatError(
                f"{self.path}: answers",
                f"shape {found}, type {dataset.dtype}",
                f"shape ({'Q' if count is None else count},), whole numbers",
            )
        answers = dataset[()].reshape(-1)
        wrong = np.flatnonzero((answers < 0) | (answers >= self.answers))
        if len(wrong):
            expected = f"0 to {self.answers - 1}"
            raise FileFormatError(self.place("answers", int(wrong[0])), answers[wrong[0]], expected)
        self._datasets["answers"] = answers.astype(np.uint8)
        return len(answers)

    def _open_truth(self) -> None:
        name = f"truth/{self.part}".rstrip("/")
        group = self._file.get(name)
        if self.spec is None or group is None:
            return
        version = version_of(self.attributes)
        columns = truth_columns(self.spec, version)
        problems = ["expected a group"]
        if isinstance(group, h5py.Group):
            problems = column_problems(group, columns, self._count)
        if problems:
            raise FileFormatError(f"{self.path}: {name}: {and_more(problems)}")
        for column in columns:
            dataset = self._stored[column.name] = group[column.name]
            self._datasets[column.name] = stored_array(dataset, self._shards)
        if version < CAMERAS_SINCE:
            self._datasets["camera_distance"] = np.full(self._count, old_camera_distance(self.spec))
        place = f"{self.path}: {name}/distractor_kind"
        self.kind_names = read_names(group["distractor_kind"], "names", place)
        self._ranges = {
            "cube_count": (1, self.spec.cubes[1]),
            "light_count": (0, self.spec.lights[1]),
            "distractor_kind": (-1, len(self.kind_names) - 1),
            "angle_degrees": (0, 180),
            "camera_distance": (1e-3, LARGEST),
        }

    def _read_identity(self) -> None:
        """Read fingerprint and digests, which a file of ours must have."""
        ours, needed = self.spec is not None, version_of(self.attributes) >= DIGESTS_SINCE
        self.fingerprint, self.stored_truth_digest, self.stored_content_digest = None, None, None
        if ours:
            mark, digest = named("fingerprint", self.part), named(TRUTH_DIGEST, self.part)
            self.fingerprint = read_text(self._file, mark, self.path, True)
            self.stored_truth_digest = read_digest(
                self._file, digest, self.path, needed and self.has_answers
            )
            self.stored_content_digest = read_digest(
                self._file, content.CONTENT_DIGEST, self.path, needed
            )

    def _check_values(self, name: str, rows: int | slice, values: Array) -> None:
        """Raise FileFormatError where one of these rows leaves the range of its dataset."""
        low, high = self._ranges[name]
        good = (values >= low) & (values <= high)  # NaN is not
        if np.all(good):
            return
        if isinstance(rows, slice):
            first = int(np.argmin(good.reshape(len(values), -1).all(axis=1)))
            rows, values = range(len(self))[rows][first], values[first]
        raise FileFormatError(self.place(name, rows), values.tolist(), f"{low} to {high}")

    def place(self, name: str, rows: int | slice) -> str:
        """Return file, dataset and rows as text, for an error's `where`."""
        where = f"row {rows}"
        if isinstance(rows, slice):
            first, end, _ = rows.indices(len(self))
            where = f"rows {first} to {end - 1}"
        return f"{self.path}: {name}, {where}"


class NoImagesError(FileFormatError):
    """The file holds answers but no images; these are in another file."""


class NoAnswersError(FileFormatError):
    """The file holds questions but no answers; these are in another file."""


def table_parts(file: h5py.File, path: Path, content: str) -> tuple[str, ...]:
    """Return the parts of a file that hold a dataset; ("",) if it is at the root.

    Raises FileFormatError where there is none; its hint says what to open instead.
    """
    parts = tuple(part for part in PARTS if f"{part}/{content}" in file)
    if parts or content in file:
        return parts or ("",)
    if content == "questions" and any(name in file for name in ("answers", "labeled/answers")):
        images = path.name.replace("-answers", "")
        what = images if images != path.name else "the file of questions"
        hint = f"open {what} instead, with this file for answers"
        raise NoImagesError(path, "answers but no images", "questions", hint)
    if content == "answers" and "questions" in file:
        hint = "ask those who made the questions for the file of answers"
        raise NoAnswersError(path, "questions but no answers", "answers", hint)
    expected = f"a dataset {content!r}, 'labeled/{content}' or 'unlabeled/{content}'"
    raise FileFormatError(path, "no question file", expected)
