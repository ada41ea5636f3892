"""The examples that users copy run, and refuse bad input; the shipped sample has its scores."""

import runpy
import shutil
import sys
from pathlib import Path

import pytest

from metrics.intake.model_file import opened_model
from metrics.intake.running import Call, run_model
from metrics.score_file import read_scores
from metrics.scoring.evaluate import score
from metrics.scoring.known_tests import known_test
from metrics.submissions.reader import open_predictions

ROOT = Path(__file__).parents[1]
EXAMPLES, SAMPLE = ROOT / "examples", ROOT / "examples" / "sample"


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run an example inside this process; return its exit code, and what it printed."""
    monkeypatch.chdir(tmp_path)

    def call(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        code = 0
        try:
            runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
        except SystemExit as end:
            code = end.code
        return code, *capsys.readouterr()

    return call


@pytest.mark.parametrize("name", ["submit", "submit_iqtt"])
def test_an_example_writes_what_can_be_scored(name, run, truths, tmp_path):
    truth = truths.rooms if name == "submit" else truths.iqtt
    assert run(name, truth, "out.h5")[:2] == (0, f"now: bench score out.h5 --truth {truth}\n")
    assert score([tmp_path / "out.h5"], truth).comparable


@pytest.mark.parametrize(
    ("name", "kind"),
    [("numpy", "disparity"), pytest.param("torch", "points", marks=pytest.mark.slow)],
)
def test_a_model_runs_and_can_be_scored(name, kind, truths, tmp_path):
    options = {"batch": 3} if name == "torch" else {}
    with opened_model(EXAMPLES / f"run_{name}.py", options) as model:
        run_model(model, truths.rooms, tmp_path / "out.h5", call=Call(batch=3), method=name)
    with open_predictions(tmp_path / "out.h5") as predictions:
        assert predictions.kind == kind
    assert score([tmp_path / "out.h5"], truths.rooms).comparable


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("submit none.h5 out.h5", "none.h5"),
        ("submit ROOMS text.h5", "text.h5"),
        ("submit text.h5 out.h5", "text.h5"),
        ("submit_iqtt ROOMS out.h5", "iqtt"),
    ],
)
def test_a_mistake_ends_in_one_line_and_exit_code_2(line, word, run, truths, tmp_path):
    (tmp_path / "text.h5").write_text("mine")
    code, out, err = run(*line.replace("ROOMS", str(truths.rooms)).split())
    assert (code, out, len(err.splitlines()), word in err) == (2, "", 1, True)
    assert [path.name for path in tmp_path.iterdir()] == ["text.h5"]
    assert (tmp_path / "text.h5").read_text() == "mine"


def test_the_sample_has_its_documented_scores(tmp_path):
    """Moved elsewhere; the truth is found beside the submission, and known by its digest."""
    for name in ("rooms.h5", "empty-room.h5"):
        shutil.copy(SAMPLE / name, tmp_path)
    found, told = score([tmp_path / "empty-room.h5"]), read_scores(SAMPLE / "empty-room.json")
    assert set(found.metrics) == set(told.metrics)
    for name, expected in told.metrics.items():
        for part in ("value", "low", "high"):
            wanted = pytest.approx(getattr(expected, part), rel=1e-9, abs=1e-12)
            assert getattr(found.metrics[name], part) == wanted, (name, part)
    assert (found.comparable, found.meta.truth_source) == (True, "known")
    assert known_test(found.meta.truth_digest).name == "sample-1"
    assert found.meta.truth_digest == told.meta.truth_digest
    assert found.meta.truth_fingerprint == told.meta.truth_fingerprint
    assert found.meta.submissions[0].sha256 == told.meta.submissions[0].sha256


@pytest.mark.slow
def test_a_public_network_learns(run, make_rooms, tmp_path):
    pytest.importorskip("transformers")
    from tiny_depth_models import save

    save("depth-anything", tmp_path / "network")
    size = {"height": 64, "width": 64}
    train, validation = make_rooms(tmp_path / "t.h5", 96, **size), tmp_path / "v.h5"
    make_rooms(validation, 16, **size, seed=1)
    code, printed, _ = run("finetune", "network", train, validation, "--epochs", 3, "--rate", 1e-3)
    skills = [float(line.split("mse_depth")[1].split()[0]) for line in printed.splitlines()]
    assert (code, len(skills)) == (0, 4)
    assert skills[-1] > skills[0] + 0.1
