"""Write the tables of question files: images, answers, and what is known of the questions."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from iqtt.files.layout import (
    ID_BYTES,
    NO_CUBE,
    SCORED,
    answer_column,
    named,
    question_columns,
    truth_attributes,
    truth_columns,
)
from iqtt.questions.specs import SplitSpec
from iqtt.render import Rendered
from iqtt.shapes.polycube import canonical, canonical_class, set_ids
from scenegen.files.content import SHA256, joint_digest
from scenegen.files.schema import Column
from scenegen.files.shards import write_row_digests
from scenegen.files.table import PackedRows, Rows, Table, extend_together, pack_rows
from scenegen.layout import TRUTH_DIGEST

OF_QUESTION = (
    *("world_from_shape", "light_count", "light_position", "light_color"),
    *("angle_degrees", "camera_distance"),
)
FINGERPRINTED = ("cubes", "world_from_shape", "light_position", "light_color")


class QuestionsWriter:
    """Writes the questions of one table in order; `close` completes the table.

    When all tables of a file are complete, `content.seal` completes the file.

    Images go to one file and everything else to another, so that a test file can be handed out; for
    training and validation both are the same file.
    """

    def __init__(
        self,
        images_file: h5py.File,
        truth_file: h5py.File,
        spec: SplitSpec,
        split: str,
        part: str,
        count: int,
        compression: str,
        *,
        is_shard: bool = False,
    ) -> None:
        """Create the datasets of a table with `count` questions.

        Args:
            part: "labeled" or "unlabeled" of a training file, else "".
            is_shard: whether the digests of all rows are written too.
        """
        self._part, self._is_shard = part, is_shard
        self._files = (images_file, truth_file)
        truth = truth_file.require_group(f"truth/{part}")
        truth.attrs.update(truth_attributes(spec))
        groups = (
            images_file.require_group(part or "/"),
            truth,
            truth_file.require_group(part or "/"),
        )
        self._tables = [
            Table(group, columns, count, compression, is_shard)
            for group, columns in zip(groups, _columns(spec, part), strict=True)
        ]
        self._mark = Fingerprint(spec, split, part)

    @property
    def rows(self) -> int:
        """The number of questions that are written."""
        return self._tables[0].rows

    def extend(self, questions: "PackedQuestions") -> None:
        """Write the next questions."""
        self._mark.add(questions.fingerprinted)
        extend_together(self._tables, questions.rows)

    def close(self) -> None:
        """Write the fingerprint, and beside answers the digest of what scores depend on."""
        images_file, truth_file = self._files
        for file in {images_file, truth_file}:
            write_identity(file, self._part, self._mark, file == truth_file)
            if self._is_shard:
                tables = [table for table in self._tables if table.file == file]
                write_row_digests(file, {k: v for t in tables for k, v in t.row_digests().items()})


class Fingerprint:
    """SHA-256 of the settings of a part of a split, and of shapes, views and answers in order."""

    def __init__(self, spec: SplitSpec, split: str, part: str) -> None:
        self._hash = hashlib.sha256(f"{spec.public().to_json()} {split} {part}".encode())

    def add(self, questions: bytes) -> None:
        """Add the next questions: the bytes of FINGERPRINTED, and of the answer, of each."""
        self._hash.update(questions)

    @property
    def hex(self) -> str:
        """The fingerprint of the questions so far."""
        return self._hash.hexdigest()


def write_identity(file: h5py.File, part: str, mark: Fingerprint, has_truth: bool) -> None:
    """Write the fingerprint of a table, and beside answers the digest of what scores depend on."""
    file.attrs[named("fingerprint", part)] = mark.hex
    if has_truth and part != "unlabeled":
        places = (file[part or "/"], file[f"truth/{part}"])
        scored = {n: place[n].attrs[SHA256] for place in places for n in SCORED if n in place}
        file.attrs[named(TRUTH_DIGEST, part)] = joint_digest(scored)


@dataclass(frozen=True, eq=False)
class PackedQuestions:
    """Questions ready to be written; other processes may have made them.

    Attributes:
        count: number of questions.
        rows: of the images, of the truth and of the answers.
        fingerprinted: what goes into the fingerprint.
    """

    count: int
    rows: tuple[PackedRows, ...]
    fingerprinted: bytes


def pack_questions(
    spec: SplitSpec, part: str, questions: Sequence[Rendered], compression: str
) -> PackedQuestions:
    """Pack questions, at least one, of the part of a split that `QuestionsWriter` tells of."""
    truth = _truth(spec, questions)
    answers = np.array([one.question.shapes.answer for one in questions], np.uint8)
    images: Rows = {"questions": [one.images for one in questions]}
    rows: tuple[Rows, ...] = (images, truth, {"answers": answers})
    packed = tuple(
        pack_rows(values, columns, compression)
        for values, columns in zip(rows, _columns(spec, part), strict=True)
    )
    marks = zip(*(truth[name] for name in FINGERPRINTED), answers, strict=True)
    fingerprinted = b"".join(value.tobytes() for row in marks for value in row)
    return PackedQuestions(len(questions), packed, fingerprinted)


def _columns(spec: SplitSpec, part: str) -> tuple[list[Column], list[Column], list[Column]]:
    answers = [] if part == "unlabeled" else [answer_column()]
    return question_columns(spec), truth_columns(spec), answers


def _truth(spec: SplitSpec, rendered: Sequence[Rendered]) -> dict[str, Any]:
    """Return the values of `truth_columns`, for each question."""
    most, images = spec.cubes[1], 1 + spec.answers
    cubes = np.full((len(rendered), images, most, 3), NO_CUBE, np.int8)
    shape_ids, class_ids = np.zeros((2, len(rendered), images, ID_BYTES), np.uint8)
    counts = np.array([one.question.shapes.cubes.shape[1] for one in rendered])
    for count in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == count)
        cubes[rows, :, :count] = [rendered[i].question.shapes.cubes for i in rows.tolist()]
        flat = cubes[rows, :, :count].reshape(-1, count, 3)
        for ids, form in ((shape_ids, canonical), (class_ids, canonical_class)):
            ids[rows] = set_ids(form(flat)).view(np.uint8).reshape(-1, images, ID_BYTES)
    questions = [one.question for one in rendered]

    def each(name: str) -> NDArray[Any]:
        return np.array([getattr(question, name) for question in questions])

    return {
        "cube_count": counts,
        "cubes": cubes,
        "shape_id": shape_ids,
        "class_id": class_ids,
        **{name: each(name) for name in OF_QUESTION},
        "distractor_kind": np.array([question.shapes.kinds for question in questions]),
        "visible_pixels": np.array([one.visible_pixels for one in rendered]),
        "depth": [one.depth for one in rendered],
    }
