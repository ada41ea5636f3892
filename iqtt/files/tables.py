"""Question tables in HDF5 files: opened, checked and read by row, whoever wrote them.

A training file holds two tables, its parts "labeled" and "unlabeled"; other files one, at the root.
"""

from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, Self

import h5py
import numpy as np

from iqtt.files.layout import FORMAT_NAME, FORMAT_VERSION, truth_columns
from iqtt.files.truth import QuestionTruth, question_truth
from iqtt.questions.specs import SPLITS, SplitSpec
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.row_file import (
    and_more,
    check_version,
    checking,
    column_problems,
    open_file,
    reading,
)

PARTS = ("labeled", "unlabeled")
RELEASED = ("questions", "answers")


class TableFile:
    """An open file and one of its tables. Use it as a context manager, or close it.

    Attributes:
        path: where it lies.
        part: which of its tables: "labeled" or "unlabeled", or "" for the only one.
        attributes: all root attributes.
        spec: the request that it answers, without the seed where readers shall not know it; None
            for a released file.
        split: "train", "val" or "test"; None for a released file.
        kind_names: what `distractor_kind` counts through, where it is told.
        fingerprint: SHA-256 of request, shapes, views and answers of this part; None for a
            released file.
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
        self._file = open_file(path, "question file")
        with checking(self._file):
            self.attributes: dict[str, Any] = dict(self._file.attrs)
            self.spec, self.split = read_root(self.path, self.attributes)
            self.part = self._chosen(part)
            self.fingerprint = self._own_fingerprint()
            self._datasets: dict[str, Any] = {}
            self._stored: dict[str, tuple[int, int]] = {}
            self.kind_names: list[str] = []
            self._count = self._open_content()
            self._open_truth()

    @property
    def fields(self) -> tuple[str, ...]:
        """What `read` gives."""
        return tuple(self._datasets)

    @property
    def has_answers(self) -> bool:
        """Whether it is told which answers are right."""
        return "answers" in self._datasets

    @property
    def has_truth(self) -> bool:
        """Whether shapes, views and lights are told."""
        return "cubes" in self._datasets

    def __len__(self) -> int:
        return self._count

    def check_field(self, name: str) -> None:
        """Raise SpecError unless `read` knows that name."""
        if name not in self._datasets:
            raise SpecError(f"field: found {name!r}, expected some of {', '.join(self.fields)}")

    def read(self, name: str, rows: int | slice) -> Any:
        """Read rows of one dataset, such as "questions", "answers" or "cubes", as stored.

        Answers come as uint8, whatever the file has.

        Raises:
            IndexError: a row beyond the file.
            FileFormatError: the rows are damaged.
            SpecError: there is no such dataset.
        """
        self.check_field(name)
        with reading(self.place(name, rows)):
            return self._datasets[name][rows]

    def truth(self, row: int) -> QuestionTruth | None:
        """Return what is known of one question; None where nothing is. Raises as `read`."""
        if not self.has_truth:
            return None
        values = {name: self.read(name, row) for name in self.fields if name not in RELEASED}
        try:
            return question_truth(values, self.kind_names)
        except FileFormatError as error:
            raise FileFormatError(f"{self.path}: row {row}: {error}") from error

    def stored_bytes(self) -> dict[str, tuple[int, int]]:
        """Return for each dataset of this table its bytes on disk and in memory."""
        return dict(self._stored)

    def close(self) -> None:
        """Close the file; idempotent."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _chosen(self, part: str | None) -> str:
        parts = table_parts(self._file, self.path, self.CONTENT)
        if part is None and len(parts) == 1:
            return parts[0]
        if part is None or part not in parts:
            named = " or ".join(parts) or "none, as there is one table only"
            raise SpecError(f"{self.path}: part: found {part or 'none'}, expected {named}")
        return part

    def _open_content(self) -> int:
        """Check and take in the datasets beside the truth; return the number of questions."""
        raise NotImplementedError

    def _dataset(self, name: str) -> h5py.Dataset:
        """Return a dataset of this part, its size noted."""
        dataset = self._file[f"{self.part}/{name}"]
        if not isinstance(dataset, h5py.Dataset):
            raise FileFormatError(f"{self.path}: {name}: a group, expected a dataset")
        self._stored[name] = (dataset.id.get_storage_size(), dataset.nbytes)
        return dataset

    def _take_answers(self, count: int | None = None) -> int:
        """Read all answers; return their number, which must be `count` where that is given."""
        dataset = self._dataset("answers")
        found: tuple[int, ...] = dataset.shape or ()
        count = found[0] if count is None and found else count
        if found not in ((count,), (count, 1)) or dataset.dtype.kind not in "iu":
            raise FileFormatError(
                f"{self.path}: answers: shape {found}, type {dataset.dtype}, expected"
                f" ({'Q' if count is None else count},) whole numbers"
            )
        answers = dataset[()].reshape(-1)
        wrong = np.flatnonzero((answers < 0) | (answers > 2))
        if len(wrong):
            raise FileFormatError(
                self.place("answers", int(wrong[0])), answers[wrong[0]], "0, 1 or 2"
            )
        self._datasets["answers"] = answers.astype(np.uint8)
        return len(answers)

    def _open_truth(self) -> None:
        name = f"truth/{self.part}".rstrip("/")
        group = self._file.get(name)
        if self.spec is None or group is None:
            return
        columns = truth_columns(self.spec)
        problems = [f"{name}: expected a group"]
        if isinstance(group, h5py.Group):
            problems = column_problems(group, columns, self._count)
        if problems:
            raise FileFormatError(f"{self.path}: {name}: {and_more(problems)}")
        for column in columns:
            dataset = self._datasets[column.name] = group[column.name]
            self._stored[column.name] = (dataset.id.get_storage_size(), dataset.nbytes)
        self.kind_names = [str(kind) for kind in group["distractor_kind"].attrs["names"]]

    def _own_fingerprint(self) -> str | None:
        if self.spec is None:
            return None
        name = f"fingerprint_{self.part}".rstrip("_")
        found = self.attributes.get(name)
        if not isinstance(found, str):
            raise FileFormatError(f"{self.path}: attribute {name!r}: found {found!r:.40}")
        return found

    def place(self, name: str, rows: int | slice) -> str:
        """Return the file, the data set and the rows, to begin an error with."""
        where = f"row {rows}"
        if isinstance(rows, slice):
            first, end, _ = rows.indices(len(self))
            where = f"rows {first} to {end - 1}"
        return f"{self.path}: {name}, {where}"


class NoImagesError(FileFormatError):
    """The file holds the answers to questions that lie in another one."""


def table_parts(file: h5py.File, path: Path, content: str) -> tuple[str, ...]:
    """Return the parts of a file that hold a dataset; ("",) for one at the root.

    Raises FileFormatError where there is none, and says what to open instead.
    """
    parts = tuple(part for part in PARTS if f"{part}/{content}" in file)
    if parts or content in file:
        return parts or ("",)
    if content == "questions" and any(name in file for name in ("answers", "labeled/answers")):
        images = path.name.replace("-answers", "")
        what = images if images != path.name else "the file of questions"
        raise NoImagesError(
            f"{path}: holds answers but no images; open {what} instead, with this file for answers"
        )
    if content == "answers" and "questions" in file:
        raise FileFormatError(f"{path}: holds questions but no answers")
    raise FileFormatError(
        f"{path}: not a question file: found no dataset {content!r}, 'labeled/{content}' or"
        f" 'unlabeled/{content}'"
    )


def read_root(path: Path, attributes: dict[str, Any]) -> tuple[SplitSpec | None, str | None]:
    """Return spec and split of a file of ours; None of a file without format, as released."""
    found = attributes.get("format")
    if found is None:
        return None, None
    if not isinstance(found, str) or found != FORMAT_NAME:
        raise FileFormatError(
            f"{path}: not a question file: found format {found!r:.60}, expected {FORMAT_NAME!r},"
            " or none, as in the released 3D-IQTT"
        )
    check_version(path, attributes, FORMAT_VERSION)
    for name in ("spec", "writer"):
        if name not in attributes:
            raise FileFormatError(f"{path}: root attribute {name!r} is missing")
    split = attributes.get("split")
    if not isinstance(split, str) or split not in SPLITS:
        raise FileFormatError(
            f"{path}: attribute 'split': found {split!r:.40}, expected one of {', '.join(SPLITS)}"
        )
    try:
        return SplitSpec.from_json(str(attributes["spec"])), split
    except SpecError as error:
        raise FileFormatError(f"{path}: attribute 'spec': {error}") from error
