"""Two processes learn what one learns, also where a run goes on with another number of them."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
import shared_training
from pix2shape_models import tiny

from baselines.pix2shape.weights import METHOD
from baselines.training.checkpoint import load_checkpoint, moments_of, new_state
from baselines.training.machine import torchrun_counts
from scenegen.common.errors import SpecError

ALL = {
    "seed": 2, "critic_steps": 2, "questions": 0.01, "contrast": 1.0, "question_batch": 8,
    "labelled_batch": 2,
}  # fmt: skip
MORE = {
    "turned": True, "hard_negatives": 0.5, "encoder": "polar", "spherical": True, "camera": False,
    "adversarial": 0.0, "code_reconstruction": 0.0,
}  # fmt: skip
VIEWS = {
    "question_batch": 8, "encoder": "polar", "spherical": True, "camera": False, "turned": True,
    "seed": 2, "adversarial": 0.0, "code_reconstruction": 0.0, "reconstruction": 0.0,
    "mutual_information": 0.0, "questions": 0.0, "contrast": 1.0, "labelled_batch": 2,
}  # fmt: skip
CONFIGS = {
    "rooms": tiny(**ALL, depth=1.0),
    "questions": tiny(**ALL, batch=8),
    "compared": tiny(**ALL, **MORE, batch=8),
    "images unused": tiny(**VIEWS, batch=4),  # one question, which two cannot share
}
PAPERS = {"distance", "penalty", "adversarial", "reconstruction", "code_reconstruction"}
LOSSES = {
    "rooms": PAPERS | {"depth"},
    "questions": PAPERS | {"mutual_information", "questions", "contrast"},
    "compared": {"reconstruction", "mutual_information", "questions", "contrast"},
    "images unused": {"contrast"},
}
Folder = Callable[[str, str], Path]


@pytest.fixture(scope="module")
def folder(
    rooms_path: Path, train_questions: Path, tmp_path_factory: pytest.TempPathFactory
) -> Folder:
    """Return the folder of a run of four iterations, by its data and by its processes.

    These are "1" or "2", or "1 then 2", where two made the last two iterations, or "2 then 1".
    """
    top = tmp_path_factory.mktemp("shared")

    @cache
    def trained(kind: str, name: str) -> Path:
        resumed, to = "then" in name, top / f"{kind} {name}"
        if resumed:
            shutil.copytree(f"{trained(kind, name[0])}-half", to)
        run = {
            "folder": str(to),
            "data": str(rooms_path if kind == "rooms" else train_questions),
            "config": None if resumed else CONFIGS[kind].to_json(),
            "labels": int(kind != "rooms" and not resumed),  # in one of 2 places
            "processes": int(name[-1]),
        }
        if name[-1] == "1":
            shared_training.train_all([run])
            return to
        (top / "runs").write_text(json.dumps([run]))
        command = [sys.executable, "-W", "ignore", shared_training.__file__, top / "runs"]
        more = {"PYTHONPATH": str(Path(__file__).parents[3])}
        subprocess.run(command, timeout=300, check=True, env={**os.environ, **more})
        return to

    return trained


@pytest.mark.parametrize(("here", "world"), [("-1", "2"), ("two", "2"), ("0", "2"), ("2", "")])
def test_an_environment_that_torchrun_does_not_make_is_refused(here, world, monkeypatch):
    monkeypatch.setenv("LOCAL_WORLD_SIZE", here)
    monkeypatch.setenv("WORLD_SIZE", world)
    with pytest.raises(SpecError) as error:
        torchrun_counts()
    assert error.value.where in ("LOCAL_WORLD_SIZE", "WORLD_SIZE")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "name"),
    [*((kind, "2") for kind in CONFIGS), ("rooms", "2 then 1"), ("rooms", "1 then 2")],
)
def test_several_processes_learn_what_one_learns(kind, name, folder):
    """The losses of every iteration, the weights, batch statistics and moments at the end."""
    one, several = (json.loads((folder(kind, n) / "losses.json").read_text()) for n in ("1", name))
    assert all(losses.keys() == LOSSES[kind] for losses in one)
    assert len(several) == (2 if "then" in name else 4)
    first = len(one) - len(several)
    for number, (expected, found) in enumerate(zip(one[first:], several, strict=True), first):
        off = 1e-3 * 4**number  # rounding, which Adam's first steps enlarge, on some CPUs more
        assert found == pytest.approx(expected, rel=off, abs=off / 10)
    expected, found = (load_checkpoint(folder(kind, n), METHOD) for n in ("1", name))
    start, compared = new_state(METHOD, expected.card).network.state_dict(), 0
    for part, value in expected.network.state_dict().items():
        if not part.endswith("bias") and not part.startswith("prior."):
            # before a normalisation the slopes of biases are but rounding
            off = (found.network.state_dict()[part] - value).float().norm()
            assert off <= 0.05 * (value - start[part]).float().norm(), part
            compared += 1
    assert compared > 30
    moments, others = (moments_of(state.optimisers) for state in (expected, found))
    for part, value in moments.items():
        if part.endswith("exp_avg"):
            assert (others[part] - value).norm() <= 0.05 * value.norm() + 5e-5, part
