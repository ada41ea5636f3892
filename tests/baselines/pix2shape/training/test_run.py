"""A run's folder: what is written, going on after a kill, and what does not go together."""

import multiprocessing
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import pytest
import torch
from h5_edits import attribute
from PIL import Image
from pix2shape_models import edited, room_source, tiny
from refusals import refused
from safetensors.torch import load_file
from torch.utils.data import default_collate

from baselines.pix2shape.network.config import LOSSES
from baselines.pix2shape.network.model import Prior
from baselines.pix2shape.training import run as module
from baselines.pix2shape.weights import METHOD
from baselines.training.checkpoint import load_checkpoint, load_weights
from baselines.training.data import TrainingFiles
from baselines.training.fit import TrainingError
from baselines.training.machine import Machine
from scenegen.common.errors import SceneGenError, SpecError

HERE = Machine("cpu", workers=0, every=2)
CONFIG = tiny(seed=3)
WEIGHTS, CHECKPOINT = "weights.safetensors", "checkpoint.safetensors"
FILES = {"logs", "pictures.png", WEIGHTS, CHECKPOINT}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "deep" / "run"


@pytest.fixture(scope="session")
def unbroken(rooms_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run of 4 iterations that no test changes."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    assert train_run(folder, rooms_path, CONFIG, HERE) == folder / "weights.safetensors"
    return folder


def train_run(folder: Path, path: Path, *given: Any, **how: Any) -> Any:
    with TrainingFiles(path) as data:
        return module.train_run(folder, data, *given, **how)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def same(one: Path, other: Path) -> bool:
    """Tell whether two files of tensors hold the same bits."""
    found, expected = load_file(one), load_file(other)
    assert found.keys() == expected.keys()
    return all(torch.equal(found[name], expected[name]) for name in found)


def test_a_killed_reader_ends_the_run(rooms_path, folder):
    def kill(*_: Any) -> None:
        for child in multiprocessing.active_children():
            child.kill()
            child.join()

    with pytest.raises(TrainingError):
        train_run(folder, rooms_path, CONFIG, replace(HERE, workers=1), progress=kill)


class Killed(Exception):
    pass


def killed_at(iteration: int) -> Callable[[int, int, Any], None]:
    def progress(done: int, total: int, losses: Any) -> None:
        if done == iteration:
            raise Killed

    return progress


def weights_of(folder: Path) -> Any:
    return load_weights(folder / WEIGHTS, METHOD)


def test_what_a_run_leaves(rooms_path, unbroken):
    assert names(unbroken) == FILES
    model, card = weights_of(unbroken)
    with h5py.File(rooms_path) as file:
        origin = (str(file.attrs["fingerprint"]), str(file.attrs["spec"]))
    assert (card.fingerprint, card.data) == origin
    assert (card.iteration, card.labels, card.classes, card.seconds > 0) == (4, 0, (), True)
    off = {"mutual_information": 0.0, "questions": 0.0}
    assert card.settings == model.config == replace(CONFIG, **off)
    state = load_checkpoint(unbroken, METHOD)
    assert state.card == card
    found, expected = model.encoder.state_dict(), state.network.encoder.state_dict()
    torch.testing.assert_close(dict(found), dict(expected), atol=1e-3, rtol=1e-3)
    stored = {name.partition(".")[0] for name in load_file(unbroken / WEIGHTS)}
    assert stored == {"encoder", "decoder", "prior"}, "critic and statistics are not needed"
    with Image.open(unbroken / "pictures.png") as picture:
        assert picture.size == (4 * 134 + 6, 6 * 134 + 6)


CASES: dict[str, dict[str, Any]] = {
    "rooms": {},
    "critic steps": {"critic_steps": 2, "decay": True, "mutual_information": 0.0},
    "questions": {
        "questions": 0.1, "contrast": 1.0, "mutual_information": 0.1, "labelled_batch": 2,
        "batch": 12, "question_batch": 6,
    },
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("case", CASES)
def test_a_killed_run_goes_on_as_if_it_had_not_been(
    case, rooms_path, train_questions, folder, unbroken
):
    """To the bit; nor do processes that read change anything."""
    config, whole = replace(CONFIG, **CASES[case]), unbroken
    path, how = rooms_path, {}
    if case == "questions":
        path, how = train_questions, {"labels": 2}
    if case != "rooms":
        whole = train_run(folder.with_name("whole"), path, config, HERE, **how).parent
    there = replace(HERE, workers=2)
    with pytest.raises(Killed):
        train_run(folder, path, config, there, progress=killed_at(3), **how)
    assert names(folder) == FILES
    assert load_checkpoint(folder, METHOD).card.iteration == 2
    steps: list[int] = []
    train_run(folder, path, None, there, progress=lambda done, *_: steps.append(done))
    assert steps == [3, 4]
    for name in (CHECKPOINT, WEIGHTS):
        assert same(folder / name, whole / name), name
    (_, again), (_, card) = weights_of(folder), weights_of(whole)
    assert again == replace(card, seconds=again.seconds)


def test_a_run_goes_on_in_the_precision_that_it_began_with(rooms_path, folder, unbroken):
    whole = train_run(folder.with_name("whole"), rooms_path, CONFIG, HERE, precision="bf16")
    assert not same(whole, unbroken / "weights.safetensors")
    how: dict[str, Any] = {"precision": "bf16", "progress": killed_at(3)}
    with pytest.raises(Killed):
        train_run(folder, rooms_path, CONFIG, HERE, **how)
    with refused(SpecError, "precision", "32"):
        train_run(folder, rooms_path, None, HERE, precision="32")
    assert same(train_run(folder, rooms_path, None, HERE), whole)
    assert load_weights(whole, METHOD)[1].precision == "bf16"


def test_a_finished_run_is_neither_trained_on_nor_replaced(rooms_path, folder, unbroken):
    shutil.copytree(unbroken, folder)
    (folder / "weights.safetensors").unlink()
    train_run(folder, rooms_path, None, HERE, progress=lambda *_: pytest.fail("trained on"))
    assert same(folder / "weights.safetensors", unbroken / "weights.safetensors")
    with pytest.raises(FileExistsError, match="--resume"):
        train_run(folder, rooms_path, CONFIG, HERE)
    assert same(folder / "checkpoint.safetensors", unbroken / "checkpoint.safetensors")
    path = edited(rooms_path, folder.parent / "other.h5", attribute("fingerprint", "0" * 64))
    with refused(SceneGenError, str(path), "recipe hash 000000000000"):
        train_run(folder, path, None, HERE)


def test_classes_are_told(single_path, folder):
    weights = train_run(folder, single_path, CONFIG, HERE, conditional=True)
    model, card = load_weights(weights, METHOD)
    assert card.classes == ("box", "sphere")
    assert (model.config.networks.classes, model.config.networks.condition) == (2, 5)
    again, how = folder.with_name("again"), {"conditional": True, "progress": killed_at(3)}
    with pytest.raises(Killed):
        train_run(again, single_path, CONFIG, HERE, **how)
    assert same(train_run(again, single_path, None, HERE), weights)


@pytest.mark.parametrize("adversarial", [0.0, 1.0])
def test_the_prior_is_that_of_codes_where_no_critic_ties_them(rooms_path, folder, adversarial):
    config = replace(CONFIG, adversarial=adversarial)
    model, card = load_weights(train_run(folder, rooms_path, config, HERE), METHOD)
    prior, source = model.prior, room_source(rooms_path, card.settings)
    if adversarial:
        assert torch.equal(prior.mean, torch.zeros(128))
        assert torch.equal(prior.factor, torch.eye(128))
        return
    batch = source.as_batch(default_collate([source[row] for row in range(len(source))]))
    with torch.no_grad():
        codes = model.encode(batch.image, batch.views)
    spread, covariance = float(codes.std()), prior.factor @ prior.factor.T
    torch.testing.assert_close(prior.mean, codes.mean(dim=0), atol=0.02 * spread, rtol=0)
    torch.testing.assert_close(covariance, codes.T.cov(), atol=0.05 * spread**2, rtol=0)


def test_each_class_has_the_mean_of_its_codes():
    """Classes with other means, one covariance; a class that is not seen has the mean of all."""
    number = torch.Generator().manual_seed(0)
    codes, told = torch.randn(3000, 4, generator=number), torch.eye(3)[torch.arange(3000) % 2]
    codes[::2] += 5
    prior, condition = Prior(4, 3), torch.cat([torch.rand(3000, 3), told], dim=1)
    prior.fit(codes, condition)
    found = prior(torch.randn(3000, 4, generator=number), condition)
    for one in (codes, found):
        torch.testing.assert_close(one[::2].mean(dim=0), torch.full((4,), 5.0), atol=0.1, rtol=0)
        torch.testing.assert_close(one[1::2].T.cov(), torch.eye(4), atol=0.15, rtol=0)
    torch.testing.assert_close(prior.mean[2], codes.mean(dim=0))


OFF = dict.fromkeys(LOSSES, 0.0)
RAYS = tiny(64, rays=True, **{"iterations": 3, **OFF, "matching": 1.0})


def test_a_run_of_rays_learns_from_matching_alone(near_path, folder, tmp_path):
    """It reads no depth, no lights and no ids, and its matching is not done twice."""
    blind = tmp_path / "blind.h5"
    shutil.copy(near_path, blind)
    with h5py.File(blind, "r+") as file:
        file["depth"][...] = 7.0
        file["normal"][...] = 0.0
        file["object_id"][...] = 0
    done: list[dict[str, float]] = []
    train_run(
        folder, near_path, RAYS, HERE, progress=lambda now, total, losses: done.append(losses)
    )
    assert [set(losses) for losses in done[-3:]] == [{"matching"}] * 3
    assert done[0].keys() == {"share of images matched"}
    other = tmp_path / "other"
    train_run(other, blind, RAYS, HERE)
    assert same(folder / "weights.safetensors", other / "weights.safetensors")


def test_rays_refuse_uneven_views_before_the_search(near_path, folder, tmp_path):
    uneven = tmp_path / "uneven.h5"
    shutil.copy(near_path, uneven)
    with h5py.File(uneven, "r+") as file:
        file["view_angle_degrees"][5] = 60
    with refused(SpecError, str(uneven)):
        train_run(folder, uneven, RAYS, HERE)
    assert not folder.exists()
