"""Write the tables of question files: images, answers, and what is known of the questions."""

import hashlib
from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np

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
from scenegen.common.hdf5.content import SHA256, joint_digest
from scenegen.common.hdf5.row_file import Table
from scenegen.layout import TRUTH_DIGEST

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
    ) -> None:
        """Create the datasets of a table with `count` questions.

        Args:
            part: "labeled" or "unlabeled" of a training file, else "".
        """
        self._spec, self._part = spec, part
        self._files = (images_file, truth_file)
        answers = [] if part == "unlabeled" else [answer_column()]
        truth = truth_file.require_group(f"truth/{part}")
        truth.attrs.update(truth_attributes(spec))
        images = images_file.require_group(part or "/")
        self._images = Table(images, question_columns(spec), count, compression)
        self._truth = Table(truth, truth_columns(spec), count, compression)
        self._answers = Table(truth_file.require_group(part or "/"), answers, count, compression)
        self._digest = hashlib.sha256(f"{spec.public().to_json()} {split} {part}".encode())

    def append(self, questions: Sequence[Rendered]) -> int:
        """Write the next questions; return their number."""
        for one, row in zip(questions, _truth_rows(self._spec, questions), strict=True):
            answer = one.question.shapes.answer
            for name in FINGERPRINTED:
                self._digest.update(np.ascontiguousarray(row[name]).tobytes())
            self._digest.update(bytes([answer]))
            self._images.append({"questions": one.images})
            self._truth.append(row)
            self._answers.append({"answers": answer})
        return len(questions)

    def close(self) -> None:
        """Write the fingerprint, and beside answers the digest of what scores depend on."""
        images_file, truth_file = self._files
        for file in {images_file, truth_file}:
            file.attrs[named("fingerprint", self._part)] = self._digest.hexdigest()
        if self._part != "unlabeled":
            places = (truth_file[self._part or "/"], truth_file[f"truth/{self._part}"])
            scored = {n: place[n].attrs[SHA256] for place in places for n in SCORED if n in place}
            truth_file.attrs[named(TRUTH_DIGEST, self._part)] = joint_digest(scored)


def _truth_rows(spec: SplitSpec, rendered: Sequence[Rendered]) -> list[dict[str, Any]]:
    """Return the values of `truth_columns` for each question."""
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
    return [
        {
            "cube_count": counts[i],
            "cubes": cubes[i],
            "shape_id": shape_ids[i],
            "class_id": class_ids[i],
            "world_from_shape": one.question.world_from_shape,
            "light_count": one.question.light_count,
            "light_position": one.question.light_position,
            "light_color": one.question.light_color,
            "distractor_kind": one.question.shapes.kinds,
            "angle_degrees": one.question.angle_degrees,
            "visible_pixels": one.visible_pixels,
            "camera_distance": one.question.camera_distance,
            "depth": one.depth,
        }
        for i, one in enumerate(rendered)
    ]
