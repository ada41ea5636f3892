"""Audit question files: prove that the answers are right, and try to guess them without shapes.

`audit` reads the files, runs the proofs and the probes, and returns an `Audit`; `report` makes text
of it.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.features.frames import stored_frames
from iqtt.audit.features.statistics import SHAPE_STATISTICS, shape_statistics
from iqtt.audit.probes.masks import costs_of_masks
from iqtt.audit.probes.rules import Evidence, Probe, run_probes
from iqtt.audit.proofs import explanations, images, kinds, rooms, splits, views
from iqtt.audit.proofs import shapes as shape_proofs
from iqtt.audit.proofs.shapes import Shapes
from iqtt.audit.proofs.verdict import Proof
from iqtt.audit.table import AuditTable, read_table
from iqtt.files.reader import QuestionsFile
from iqtt.perspective.specs import PerspectiveSpec
from scenegen.common.threads import one_thread
from scenegen.files.row_file import writer_name
from scenegen.files.sets.cluster import Cluster

Array = NDArray[Any]
FORMAT = {"format": "pix2shape-bench/iqtt-audit", "format_version": "2.0"}
PROBED = 20_000  # questions that probes look at, by default
CAST = 48  # questions whose images are ray-cast again
EXPLAINED = 2_000  # questions whose wrong answers are laid on the reference
_BY_CUBES = (
    *("shapes", "one correct option", "options differ", "labels", "mirror images", "matched"),
    *("stored ids", "disjoint splits", "split by hash", "rotations", "angles", "lines of sight"),
    *("visibility", "ray-cast images", "unique solution"),
)


@dataclass(frozen=True)
class AuditedTable:
    """A table of questions that was audited; split and fingerprint are None for a released file.

    Attributes:
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
    """The result of an audit.

    Attributes:
        lacking: for each folder without some of a split's four files, a line that says which.
    """

    tables: tuple[AuditedTable, ...]
    proofs: tuple[Proof, ...]
    probes: tuple[Probe, ...]
    lacking: tuple[str, ...] = ()

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

    def record(self) -> dict[str, Any]:
        """Return all numbers, ready for JSON."""
        probes = [
            {**asdict(p), "accuracy": p.accuracy, "is_shortcut": p.is_shortcut} for p in self.probes
        ]
        return {
            "passed": self.passed,
            "lacking": list(self.lacking),
            "tables": [asdict(table) for table in self.tables],
            "proofs": [asdict(proof) for proof in self.proofs],
            "probes": probes,
        }


def to_json(audits: Sequence[Audit]) -> str:
    """Return the numbers of one or more audits as indented JSON."""
    passed, records = (
        all(audited.passed for audited in audits),
        [audited.record() for audited in audits],
    )
    record = {**FORMAT, "writer": writer_name(), "passed": passed, "audits": records}
    return json.dumps(record, indent=2) + "\n"


@one_thread()
def audit(
    opened: Mapping[str, QuestionsFile],
    *,
    lacking: Sequence[str] = (),
    probed: int = PROBED,
    progress: Callable[[int], Any] = lambda done: None,
    cluster: Cluster | None = None,
) -> Audit:
    """Prove what can be proved of questions, and try to answer them without their shapes.

    Images are read once, in chunks.

    Args:
        opened: tables by name, as `table.open_paths` gives them.
        lacking: what the result tells of files that are not there, as from `table.lacking`.
        probed: largest number of questions that probes look at, spread evenly.
        progress: is called with the number of questions that were read since the last call.
        cluster: whose workers read the images, which takes most of the time of large splits.

    Raises FileFormatError where a file is damaged.
    """
    files = opened.values()
    measured = _spread([len(t) if t.has_answers or t.has_truth else 0 for t in files], probed)
    tables = [
        read_table(name, table, rows, progress, cluster)
        for (name, table), rows in zip(opened.items(), measured, strict=True)
    ]
    shapes = shape_proofs.compare_shapes(tables)
    right = [
        its_shapes.place if table.answers is None else table.answers.astype(np.int64)
        for table, its_shapes in zip(tables, shapes, strict=True)
    ]
    proofs = _prove(tables, shapes, right)
    probes = run_probes(_evidence(tables, shapes, right))
    return Audit(tuple(map(_audited, tables, right)), tuple(proofs), probes, tuple(lacking))


def _spread(counts: Sequence[int], most: int) -> list[Array]:
    """Choose rows of tables with `counts` rows, evenly: `most` rows in all, or all there are."""
    total = sum(counts)
    rows = np.unique(np.linspace(0, max(total - 1, 0), min(most, total)).astype(np.int64))
    starts = np.cumsum([0, *counts])
    return [
        rows[(rows >= start) & (rows < start + count)] - start
        for start, count in zip(starts, counts, strict=False)
    ]


@np.errstate(all="ignore")  # files may hold any numbers; NaN fails every proof
def _prove(
    tables: Sequence[AuditTable], shapes: Sequence[Shapes], right: Sequence[Array]
) -> list[Proof]:
    """Run all proofs; right: positions of the right answers, (Q,) each, -1 where unknown."""
    proofs = [
        images.content(tables),
        images.balance(tables, right),
        images.values(tables),
        images.distinct_images(tables),
        images.distinct_questions(tables),
    ]
    if any(isinstance(table.spec, PerspectiveSpec) for table in tables):
        told = [table for table in tables if "scene" in table.truth]
        return [*rooms.prove_rooms(told, _spread([len(t) for t in told], CAST)), *proofs]
    proofs.insert(3, images.framing(tables))
    with_cubes = [table for table in tables if table.truth]
    shapes = [its_shapes for table, its_shapes in zip(tables, shapes, strict=True) if table.truth]
    if not with_cubes:
        return [Proof(name, "skipped", "no shape descriptions") for name in _BY_CUBES] + proofs
    counts = [len(table) for table in with_cubes]
    sample = _spread(counts, CAST)
    by_cubes = [
        shape_proofs.whole_shapes(with_cubes, shapes),
        shape_proofs.one_right_answer(with_cubes, shapes),
        kinds.answers_differ(with_cubes, shapes),
        kinds.labels(with_cubes, shapes),
        kinds.mirror_images(with_cubes, shapes),
        kinds.matched(with_cubes, shapes),
        shape_proofs.stored_ids(with_cubes, shapes),
        splits.splits_share_nothing(with_cubes, shapes),
        splits.splits_for_ever(with_cubes, shapes),
        views.rotations(with_cubes),
        views.angles(with_cubes, shapes),
        views.lines_of_sight(with_cubes, shapes),
        images.visibility(with_cubes),
        views.cast_again(with_cubes, shapes, sample),
        explanations.no_other_explanation(with_cubes, shapes, _spread(counts, EXPLAINED)),
    ]
    untold = [table.name for table in tables if not table.truth]
    note = f"; not stored in {', '.join(untold)}" if untold else ""
    return [replace(proof, detail=proof.detail + note) for proof in by_cubes] + proofs


def _evidence(
    tables: Sequence[AuditTable], shapes: Sequence[Shapes], right: Sequence[Array]
) -> Evidence:
    """Gather the questions that were measured and whose right answer is known."""
    numbers = shape_statistics(
        [table.cubes for table in tables],
        [its_shapes.class_name for its_shapes in shapes],
        [its_shapes.whole for its_shapes in shapes],
    )
    parts, angles, masks = [], [], []
    for table, its_shapes, place, described in zip(tables, shapes, right, numbers, strict=True):
        answered = place[table.measured] >= 0
        rows = table.measured[answered]
        mirrored = _mirror_images(its_shapes, place, rows)
        stored = _frames(table, its_shapes, rows)
        angles.append(table.truth.get("angle_degrees", np.zeros(len(table)))[rows])
        if isinstance(table.spec, PerspectiveSpec):
            masks.append(costs_of_masks(table, rows))
        parts.append((table.statistics[answered], place[rows], mirrored, described[rows], stored))
    statistics, places, mirrored, cubes, frames = map(np.concatenate, zip(*parts, strict=True))
    return Evidence(
        statistics=statistics,
        right=places,
        mirrored=mirrored,
        cubes={name: cubes[:, :, i] for i, name in enumerate(SHAPE_STATISTICS)},
        frames=frames,
        places=[place[place >= 0] for place in right],
        masks=np.concatenate(masks) if masks else None,
        angles=np.concatenate(angles),
    )


def _frames(table: AuditTable, shapes: Shapes, rows: Array) -> Array:
    """Return `frames.stored_frames` of some rows; NaN where the file does not tell the shapes."""
    if "world_from_shape" not in table.truth:
        return np.full((len(rows), table.images - 1, 19), np.nan)
    views = table.truth["world_from_shape"][rows]
    return stored_frames(table.cubes[rows], views, shapes.whole[rows])


def _mirror_images(shapes: Shapes, place: Array, rows: Array) -> Array:
    """Return for some rows which answer is the right one's mirror image; -1 for none."""
    classes, names = shapes.class_name[rows], shapes.shape_name[rows]
    right = 1 + place[rows, None]
    mirror = classes == np.take_along_axis(classes, right, axis=1)
    mirror &= names != np.take_along_axis(names, right, axis=1)
    mirror &= shapes.whole[rows, None]
    return np.where(mirror[:, 1:].any(axis=1), mirror[:, 1:].argmax(axis=1), -1)


def _audited(table: AuditTable, right: Array) -> AuditedTable:
    answers = "from the cubes" if "cubes" in table.truth else "unknown"
    if table.answers is not None:
        answers = "stored"
    answered = int(np.count_nonzero(right[table.measured] >= 0))
    file = table.questions
    return AuditedTable(
        table.name, str(file.path), file.split, file.fingerprint, len(table), answers, answered
    )
