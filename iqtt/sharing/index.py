"""The index of files of questions: a Parquet file with a line for each question, and no pixels."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from iqtt.files.reader import QuestionsFile
from iqtt.questions.specs import DISTRACTOR_KINDS
from iqtt.sharing.published import PublishedTable
from scenegen.common.errors import FileFormatError
from scenegen.files.content import ColumnDigest, row_digest
from scenegen.files.shards import cut
from scenegen.sharing.description import IndexColumn
from scenegen.sharing.index_file import write_lines

BLOCK_BYTES = 2**24  # of images that are in memory at once
MOST_ROWS = 1000  # that are read at once
KEY = ("file", "part", "row")

# fmt: off
COLUMNS = (
    IndexColumn("file", "Text", "name of the file of questions to open; of a set, the file that"
                " shows all shards as one"),
    IndexColumn("split", "Text", "what the questions are for: train, val or test"),
    IndexColumn("part", "Text", "table of the file: labeled or unlabeled; empty where it has only"
                " one"),
    IndexColumn("row", "Int64", "row in that table, from 0"),
    IndexColumn("shard", "Text", "name of the file that holds the row: the same, or a shard"),
    IndexColumn("shard_row", "Int64", "row in that file's table, from 0"),
    IndexColumn("answer_count", "Int32", "number of answers that are offered"),
    IndexColumn("answer", "Int32", "which of them shows the reference's shape, from 0; null where"
                " the files do not tell"),
    IndexColumn("cube_count", "Int32", "cubes of each of the shapes; null where the files do not"
                " tell"),
    IndexColumn("camera_distance", "Float64", "from the camera of all images to the world's origin,"
                " cube edges; null where the files do not tell"),
    IndexColumn("angle_degrees", "Float64", "smallest rotation from the reference's view to the"
                " right answer's, degrees; null where the files do not tell"),
    IndexColumn("distractor_kinds", "Text", "kinds of the wrong answers, in their order; null where"
                " the files do not tell", (-1,)),
    IndexColumn("questions_sha256", "Text", "SHA-256 of the images, the reference first, as they"
                " are stored: C order, little-endian"),
)
# fmt: on


@dataclass
class Tally:
    """What the questions of one table hold; of questions without truth, only their number.

    Attributes:
        rows: number of questions.
        answers: how often the right answer comes at a place.
        cubes: how many questions have shapes of so many cubes.
        kinds: how many wrong answers are of a kind.
        angles: the same of angles, in steps of 30 degrees, by the smallest.
        digests: SHA-256 of the images of each question, 32 bytes.
    """

    rows: int = 0
    answers: Counter[int] = field(default_factory=Counter)
    cubes: Counter[int] = field(default_factory=Counter)
    kinds: Counter[str] = field(default_factory=Counter)
    angles: Counter[int] = field(default_factory=Counter)
    digests: set[bytes] = field(default_factory=set)

    def add(self, line: dict[str, Any]) -> None:
        """Count one line of the index."""
        self.rows += 1
        self.digests.add(bytes.fromhex(line["questions_sha256"]))
        if line["answer"] is not None:
            self.answers[line["answer"]] += 1
        if line["cube_count"] is not None:
            self.cubes[line["cube_count"]] += 1
            self.kinds.update(line["distractor_kinds"])
            self.angles[int(line["angle_degrees"] // 30) * 30] += 1


def write_index(
    path: Path,
    tables: Sequence[PublishedTable],
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Tally]:
    """Write the index of some tables; return what each of them holds.

    All values are read once, and compared with the digests of those that were written.

    Raises OSError and FileFormatError as `QuestionsFile`, and FileFormatError where a row is
    damaged or values are not those that were written.
    """
    tallies: list[Tally] = []
    write_lines(path, COLUMNS, _counted(tables, tallies, progress))
    return tallies


def _counted(
    tables: Sequence[PublishedTable], tallies: list[Tally], progress: Callable[[int], Any]
) -> Iterator[dict[str, Any]]:
    """Yield the lines of all tables; append a tally of each table's lines."""
    for table in tables:
        tallies.append(Tally())
        with table.open() as questions:
            for line in _lines(table, questions):
                tallies[-1].add(line)
                progress(1)
                yield line


def _lines(table: PublishedTable, questions: QuestionsFile) -> Iterator[dict[str, Any]]:
    """Yield the lines of one table; check at the end that all values are those written."""
    places = ((name, row) for name, count in table.pieces for row in range(count))
    found = {name: ColumnDigest() for name in questions.fields}
    for some in cut(len(questions), _rows_at_once(questions)):
        rows = slice(some.start, some.stop)
        block = {name: questions.read(name, rows) for name in questions.fields}
        digests = [row_digest(images) for images in block["questions"]]
        for name, values in block.items():
            if name != "questions":
                found[name].update(values)
        for place, row in enumerate(some):
            found["questions"].add(digests[place])
            shard, shard_row = next(places)
            yield {
                "file": table.path.name,
                "split": table.split,
                "part": table.part,
                "row": row,
                "shard": shard,
                "shard_row": shard_row,
                "answer_count": questions.answers,
                **_told(questions, {name: values[place] for name, values in block.items()}),
                "questions_sha256": digests[place].hex(),
            }
    told = questions.stored_digests()
    for name, digest in found.items():
        if told.get(name) not in (None, digest.hex):
            wrong = f"values of {name} that are not those which were written"
            raise FileFormatError(table.path, wrong, "", "iqtt verify tells which")


def _told(questions: QuestionsFile, values: dict[str, Any]) -> dict[str, Any]:
    """Return what the file tells of a question beside its images; None where it does not."""
    told = dict.fromkeys(
        ("answer", "cube_count", "camera_distance", "angle_degrees", "distractor_kinds")
    )
    told |= {"answer": int(values["answers"])} if questions.has_answers else {}
    if questions.has_truth:
        kinds = [DISTRACTOR_KINDS[kind] for kind in values["distractor_kind"] if kind >= 0]
        told |= {
            "cube_count": int(values["cube_count"]),
            "camera_distance": float(values["camera_distance"]),
            "angle_degrees": float(values["angle_degrees"]),
            "distractor_kinds": kinds,
        }
    return told


def _rows_at_once(questions: QuestionsFile) -> int:
    shape = (1 + questions.answers, questions.height, questions.width, 3)
    size = math.prod(shape) * np.dtype(questions.image_dtype).itemsize
    return min(MOST_ROWS, max(1, BLOCK_BYTES // size))
