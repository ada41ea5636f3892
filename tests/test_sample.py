"""The shipped sample: its submission has the documented scores, to the last digits that matter."""

import shutil
from pathlib import Path

import pytest

from metrics.score_file import read_scores
from metrics.scoring.evaluate import score

SAMPLE = Path(__file__).parents[1] / "examples" / "sample"


def test_the_sample_has_its_documented_scores(tmp_path, monkeypatch):
    """Moved elsewhere, so that the truth is found beside the submission."""
    for name in ("rooms.h5", "empty-room.h5"):
        shutil.copy(SAMPLE / name, tmp_path)
    found, told = score([tmp_path / "empty-room.h5"]), read_scores(SAMPLE / "empty-room.json")
    assert set(found.metrics) == set(told.metrics)
    for name, expected in told.metrics.items():
        got = found.metrics[name]
        assert got.value == pytest.approx(expected.value, rel=1e-9, abs=1e-12), name
        assert got.low == pytest.approx(expected.low, rel=1e-9, abs=1e-12), name
        assert got.high == pytest.approx(expected.high, rel=1e-9, abs=1e-12), name
    assert found.meta.truth_fingerprint == told.meta.truth_fingerprint
    assert found.meta.submissions[0].sha256 == told.meta.submissions[0].sha256


def test_the_documents_tell_those_scores():
    told = read_scores(SAMPLE / "empty-room.json").metrics
    text = (SAMPLE.parents[1] / "docs" / "scores.md").read_text()
    for name in ("chamfer", "hausdorff", "mse_depth"):
        assert f"| `{name}` | {told[name].value:.6g} |" in text, name
