"""Audit question files: prove that the answers are right, and try to guess them without shapes.

`audit` reads the files, runs the proofs and the probes, and returns an `Audit`; `report` makes text
of it.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit import proofs, shape_proofs, view_proofs
from iqtt.audit.probes import Evidence, Probe, run_probes
from iqtt.audit.proofs import Proof
from iqtt.audit.shape_proofs import Shapes
from iqtt.audit.statistics import SHAPE_STATISTICS, Statistics, shape_statistics
from iqtt.audit.table import AuditTable, find_tables, read_table
from scenegen.common.row_file import writer_name

Array = NDArray[Any]
FORMAT = {"format": "pix2shape-bench/iqtt-audit", "format_version": "1.0"}
PROBED = 20_000  # questions that probes look at, by default
CAST = 48  # questions whose images are ray-cast again
_BY_CUBES = (
    *("shapes", "one right answer", "answers differ", "stored ids", "splits apart"),
    *("rotations", "angles", "visibility", "cast again"),
)


@dataclass(frozen=True)
class AuditedTable:
    """A table of questions that was audited; split and fingerprint are None for a released file.

    Attributes:
        questions: number of questions.
        answers: where the right answers come from: "stored", "from the cubes", or "unknown".
        probed: number of questions that probes looked at.
    """

    name: str
    path: str
    split: str | None
    fingerprint: str | None
    questions: int
    answers: str
    probed: int


@dataclass(frozen=True)
class Audit:
    """The result of an audit."""

    tables: tuple[AuditedTable, ...]
    proofs: tuple[Proof, ...]
    probes: tuple[Probe, ...]

    @property
    def passed(self) -> bool:
        """Whether there are questions, and no proof failed."""
        return self.questions > 0 and all(proof.status != "FAIL" for proof in self.proofs)

    @property
    def questions(self) -> int:
        """Number of questions in all tables."""
        return sum(table.questions for table in self.tables)

    @property
    def shortcuts(self) -> tuple[Probe, ...]:
        """The probes that beat chance though they must not."""
        return tuple(probe for probe in self.probes if probe.is_shortcut)

    def to_json(self) -> str:
        """Return all numbers as indented JSON."""
        probes = [
            {**asdict(p), "accuracy": p.accuracy, "is_shortcut": p.is_shortcut} for p in self.probes
        ]
        record = {
            **FORMAT,
            "writer": writer_name(),
            "passed": self.passed,
            "tables": [asdict(table) for table in self.tables],
            "proofs": [asdict(proof) for proof in self.proofs],
            "probes": probes,
        }
        return json.dumps(record, indent=2) + "\n"


def question_count(paths: Sequence[str | Path]) -> int:
    """Return how many questions `audit` will read. Raises as `audit`."""
    return sum(source.count for source in find_tables(paths))


def audit(
    paths: Sequence[str | Path],
    *,
    probed: int = PROBED,
    progress: Callable[[int], Any] = lambda done: None,
) -> Audit:
    """Prove what can be proved of question files, and try to answer them without their shapes.

    Files of answers are found beside the files of questions. Images are read once, in chunks.

    Args:
        paths: question files, or folders with files iqtt-*.h5.
        probed: largest number of questions that probes look at, spread evenly.
        progress: is called with the number of questions that were read since the last call.

    Raises:
        OSError: no such file or folder, or a folder without question files.
        FileFormatError: a file that is no question file, or damaged.
        SpecError: no paths.
    """
    sources = find_tables(paths)
    measured = _spread([source.count if source.answered else 0 for source in sources], probed)
    tables = [
        read_table(source, rows, progress) for source, rows in zip(sources, measured, strict=True)
    ]
    told = [table for table in tables if table.truth]
    shapes = dict(zip((t.name for t in told), shape_proofs.compare_shapes(told), strict=True))
    right = [_right(table, shapes.get(table.name)) for table in tables]
    found = _prove(tables, told, list(shapes.values()), right)
    probes = run_probes(_evidence(tables, shapes, right))
    return Audit(tuple(map(_audited, tables, right)), tuple(found), probes)


def _spread(counts: Sequence[int], most: int) -> list[Array]:
    """Choose rows of each table, evenly: `most` rows in all, or all there are.

    Args:
        counts: number of rows of each table.
    """
    total = sum(counts)
    rows = np.unique(np.linspace(0, max(total - 1, 0), min(most, total)).astype(np.int64))
    starts = np.cumsum([0, *counts])
    return [
        rows[(rows >= start) & (rows < start + count)] - start
        for start, count in zip(starts, counts, strict=False)
    ]


def _right(table: AuditTable, shapes: Shapes | None) -> Array:
    """Return the positions of the right answers, as stored or as found, (Q,); -1 if unknown."""
    if table.answers is not None:
        return table.answers.astype(np.int64)
    return np.full(len(table), -1) if shapes is None else shapes.place


def _prove(
    tables: Sequence[AuditTable],
    told: Sequence[AuditTable],
    shapes: Sequence[Shapes],
    right: Sequence[Array],
) -> list[Proof]:
    found = [
        proofs.balance(tables, right),
        proofs.values(tables),
        proofs.framing(tables),
        proofs.distinct_images(tables),
        proofs.distinct_questions(tables),
    ]
    if not told:
        return [Proof(name, "skipped", "no shape descriptions") for name in _BY_CUBES] + found
    sample = _spread([len(table) for table in told], CAST)
    by_cubes = [
        shape_proofs.whole_shapes(told, shapes),
        shape_proofs.one_right_answer(told, shapes),
        shape_proofs.distractors_differ(told, shapes),
        shape_proofs.stored_ids(told, shapes),
        shape_proofs.splits_share_nothing(told, shapes),
        view_proofs.rotations(told),
        view_proofs.angles(told, shapes),
        proofs.visibility(told),
        view_proofs.cast_again(told, shapes, sample),
    ]
    untold = [table.name for table in tables if not table.truth]
    note = f"; not told of {', '.join(untold)}" if untold else ""
    return [replace(proof, detail=proof.detail + note) for proof in by_cubes] + found


def _evidence(
    tables: Sequence[AuditTable], shapes: Mapping[str, Shapes], right: Sequence[Array]
) -> Evidence:
    """Gather the questions that were measured and whose right answer is known."""
    told = [table.truth["cubes"] for table in tables if table.name in shapes]
    classes = [one.class_name for one in shapes.values()]
    whole = [one.whole for one in shapes.values()]
    numbers = shape_statistics(told, classes, whole) if told else []
    described = dict(zip(shapes, numbers, strict=True))
    cubes, mirrored, places, kept = [], [], [], []
    for table, place in zip(tables, right, strict=True):
        rows = table.measured[place[table.measured] >= 0]
        kept.append(np.isin(table.measured, rows))
        places.append(place[rows])
        unknown = np.full((len(table), 3, len(SHAPE_STATISTICS)), np.nan)
        cubes.append(described.get(table.name, unknown)[rows])
        mirrored.append(_mirror_images(shapes.get(table.name), place, rows))
    joined = np.concatenate(cubes)
    return Evidence(
        statistics=Statistics.join([t.statistics for t in tables]).take(np.concatenate(kept)),
        right=np.concatenate(places),
        mirrored=np.concatenate(mirrored),
        cubes={name: joined[:, :, i] for i, name in enumerate(SHAPE_STATISTICS)},
        places=[place[place >= 0] for place in right],
    )


def _mirror_images(shapes: Shapes | None, place: Array, rows: Array) -> Array:
    """Return for some rows which answer is the right one's mirror image; -1 for none."""
    if shapes is None:
        return np.full(len(rows), -1)
    right = 1 + place[rows, None]
    same_class = shapes.class_name[rows] == np.take_along_axis(
        shapes.class_name[rows], right, axis=1
    )
    mirror = same_class & (
        shapes.shape_name[rows] != np.take_along_axis(shapes.shape_name[rows], right, 1)
    )
    mirror &= shapes.whole[rows, None]
    return np.where(mirror[:, 1:].any(axis=1), mirror[:, 1:].argmax(axis=1), -1)


def _audited(table: AuditTable, right: Array) -> AuditedTable:
    answers = (
        "stored" if table.answers is not None else "from the cubes" if table.truth else "unknown"
    )
    known = int(np.count_nonzero(right[table.measured] >= 0))
    source = table.source
    return AuditedTable(
        table.name, str(source.path), table.split, table.fingerprint, len(table), answers, known
    )
