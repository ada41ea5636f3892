"""Submissions that are compared as they are: scored first, under their common alignment."""

from contextlib import contextmanager

import numpy as np
import pytest
from made_scores import rooms_scores

from metrics.prediction_writer import RoomPredictionWriter
from metrics.score_file import write_scores
from metrics.scoring.aligned import AlignmentError
from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from metrics.views.compare.methods import read_or_score
from scenegen.rooms.reader import RoomsFile


@pytest.fixture(scope="module")
def methods(truths, tmp_path_factory):
    """Depth in metres with an error of its own, and the same depth up to scale and shift."""
    folder, rng = tmp_path_factory.mktemp("methods"), np.random.default_rng(0)
    paths = [folder / "metric.h5", folder / "affine.h5"]
    alignments = ("none", "scale_shift")
    for path, alignment in zip(paths, alignments, strict=True):
        with (
            RoomsFile(truths.rooms) as rooms,
            RoomPredictionWriter(path, truths.rooms, method=path.stem, alignment=alignment) as out,
        ):
            for row in range(len(rooms)):
                depth = rooms.read("depth", row)
                noise = rng.normal(0, 0.02, depth.shape)
                out.add(row, (1.1 * depth + noise).astype(np.float32))
    return paths


def compared(paths, truth, **settings):
    steps = []

    @contextmanager
    def progress_of(rows):
        yield steps.append
        assert sum(steps) == rows

    return read_or_score(paths, truth, Settings(processes=1, **settings), progress_of)


def test_submissions_are_scored_under_the_common_alignment(methods, truths, tmp_path):
    metric, affine = compared(methods, truths.rooms)
    again = score(methods[:1], truths.rooms, Settings(processes=1, align="scale_shift"))
    assert (metric.alignment, metric.declared, affine.declared) == ("scale_shift", "none", None)
    assert {name: s.value for name, s in metric.metrics.items()} == {
        name: s.value for name, s in again.metrics.items()
    }
    write_scores(score(methods[:1], truths.rooms, Settings(processes=1)), tmp_path / "metric.json")
    kept, other = compared([tmp_path / "metric.json", methods[1]], truths.rooms)
    assert (kept.alignment, kept.path) == ("none", tmp_path / "metric.json")
    assert other.metrics["abs_rel"] == affine.metrics["abs_rel"]


def test_no_alignment_is_tighter_than_a_declared_one(methods, truths):
    with pytest.raises(AlignmentError):
        compared(methods, truths.rooms, align="scale")


def test_other_test_sets_have_alignments_of_their_own(methods, truths, tmp_path):
    """Disparity on another test set is in no table with depth up to scale and shift."""
    other = rooms_scores("other", {"abs_rel": np.full(8, 0.1)}, np.arange(8),
                         alignment="disparity_scale_shift")  # fmt: skip
    write_scores(other, tmp_path / "other.json")
    affine, kept = compared([methods[1], tmp_path / "other.json"], truths.rooms)
    assert (affine.alignment, kept.alignment) == ("scale_shift", "disparity_scale_shift")
