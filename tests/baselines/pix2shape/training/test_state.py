"""Checkpoints refused when damaged; each step's own noise."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pix2shape_models import tiny

from scenegen.common.errors import FileFormatError

torch = pytest.importorskip("torch")
from baselines.pix2shape.data.rooms import RoomImages  # noqa: E402
from baselines.pix2shape.training import loop as training  # noqa: E402
from baselines.pix2shape.training.loop import train  # noqa: E402
from baselines.pix2shape.training.state import CHECKPOINT, load_state, new_state, save_state  # noqa: E402
from baselines.pix2shape.weights.storage import Card  # noqa: E402
from baselines.tensor_files import load_tensors, save_tensors  # noqa: E402

TINY = tiny(iterations=3)


@pytest.fixture(scope="session")
def trained(rooms_path: Path, fabric: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the checkpoint of a tiny model, trained for three iterations."""
    folder = tmp_path_factory.mktemp("trained")
    state = new_state(TINY)
    for _ in train(state, RoomImages(rooms_path, TINY), fabric):
        pass
    save_state(folder, state, Card(TINY, state.iteration))
    return folder


def test_an_untrained_state_is_a_checkpoint_too(tmp_path):
    state = new_state(TINY)
    save_state(tmp_path, state, Card(TINY))
    again, _ = load_state(tmp_path)
    assert again.iteration == 0
    for name, value in state.model.state_dict().items():
        assert torch.equal(again.model.state_dict()[name], value), name
    assert {path.suffix for path in tmp_path.iterdir()} == {".json", ".safetensors"}


def test_a_checkpoint_that_is_not_there(tmp_path):
    with pytest.raises(FileNotFoundError, match="checkpoint"):
        load_state(tmp_path)


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda t, n: n.clear(), "iteration"),
        (lambda t, n: n.update(iteration="three"), "three"),
        (lambda t, n: n.update(iteration="-5"), "-5"),
        (lambda t, n: n.update(iteration="1e1"), "'1e1'"),
        (lambda t, n: t["generator.0.exp_avg_sq"].fill_(-1), "0.exp_avg_sq"),
        (lambda t, n: t["generator.0.step"].fill_(-1), "0.step"),
        (lambda t, n: t.update({"critic.x.step": torch.ones(1)}), "'x'"),
        (lambda t, n: t.pop("model.critic.last.bias"), "critic.last.bias"),
        (lambda t, n: t.update({"model.more": torch.ones(1)}), "more"),
        (lambda t, n: t["model.decoder.last.bias"].fill_(torch.nan), "decoder.last.bias"),
        (lambda t, n: t.pop("generator.0.exp_avg"), "0.exp_avg"),
        (lambda t, n: [t.pop(name) for name in list(t) if name.startswith("critic.")], "moments"),
        (lambda t, n: t.update({"generator.0.exp_avg": torch.zeros(3)}), "0.exp_avg"),
        (lambda t, n: t["generator.0.exp_avg"].fill_(torch.nan), "0.exp_avg"),
        (lambda t, n: t.update({"generator.9999.exp_avg": torch.zeros(3)}), "9999"),
        (lambda t, n: t.update({"more": torch.zeros(3)}), "more"),
    ],
)
def test_damaged_checkpoints_are_refused(trained, tmp_path, edit, words):
    path = shutil.copytree(trained, tmp_path, dirs_exist_ok=True) / CHECKPOINT
    tensors, notes = load_tensors(path)
    edit(tensors, notes)
    save_tensors(path, tensors, notes)
    with pytest.raises(FileFormatError) as error:
        load_state(tmp_path)
    assert error.value.where.startswith(str(path))
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_every_step_has_noise_of_its_own(rooms_path, fabric, monkeypatch):
    """Of each critic's batch, too; but the same wherever training began."""
    seeds: list[int] = []
    draw = training.draw
    monkeypatch.setattr(training, "draw", lambda *a: (seeds.append(a[2]), draw(*a))[1])
    config = replace(TINY, critic_steps=2, iterations=2)
    for first in (0, 0, 1):
        state = new_state(config)
        state.iteration = first
        for _ in train(state, RoomImages(rooms_path, config), fabric):
            pass
    assert len(set(seeds[:4])) == 4
    assert seeds == [*seeds[:4], *seeds[:4], *seeds[2:4]]
