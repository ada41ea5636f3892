"""Weights and checkpoints come back as they were; damaged, hostile and other files are refused."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from refusals import refused

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check

torch = pytest.importorskip("torch")
from baselines.checkpoints import (  # noqa: E402
    CHECKPOINT,
    WEIGHTS,
    Recipe,
    check_data,
    check_new,
    load_checkpoint,
    load_weights,
    new_state,
    save_checkpoint,
    save_weights,
)
from baselines.tensor_files import load_tensors, save_tensors  # noqa: E402


@dataclass(frozen=True)
class Card:
    method: str = "mine"
    width: int = 4
    seed: int = 3


class Network(torch.nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = torch.nn.Sequential(torch.nn.Linear(2, width), torch.nn.BatchNorm1d(width))
        self.unused = torch.nn.Linear(width, width)


def of_this_method(card: Card) -> None:
    check(card.method == "mine", "method", card.method, "mine")


def adam(card: Card, network: Network) -> torch.optim.Adam:
    return torch.optim.Adam(network.parameters(), lr=0.1)


RECIPE = Recipe("mine", Card, lambda card: Network(card.width), adam, of_this_method)


@pytest.fixture
def saved(tmp_path: Path) -> Any:
    """Return a state after one step, of which the folder holds weights and checkpoint."""
    state = new_state(RECIPE, Card())
    state.network.layers(torch.rand(8, 2)).square().sum().backward()
    state.optimiser.step()
    save_weights(tmp_path / WEIGHTS, state)
    save_checkpoint(tmp_path, state)
    return state


def test_a_checkpoint_holds_all_of_a_state(saved, tmp_path):
    again = load_checkpoint(tmp_path, RECIPE)
    assert again.card == saved.card
    assert again.network.training
    for name, value in saved.network.state_dict().items():
        assert torch.equal(again.network.state_dict()[name], value), name
    moments, found = (one.optimiser.state_dict()["state"] for one in (saved, again))
    assert found.keys() == moments.keys() == {0, 1, 2, 3}, "the unused layer has none"
    for index, own in moments.items():
        assert all(torch.equal(found[index][name], value) for name, value in own.items())


def test_weights_come_back_in_half_precision(saved, tmp_path):
    again = load_weights(tmp_path / WEIGHTS, RECIPE)
    assert again.card == saved.card
    assert not again.network.training
    for name, value in saved.network.state_dict().items():
        found = again.network.state_dict()[name]
        assert found.dtype == value.dtype
        torch.testing.assert_close(found, value, rtol=1e-3, atol=1e-5, msg=name)
    stored = load_tensors(tmp_path / WEIGHTS)[0]
    assert stored["unused.weight"].dtype == torch.float16


def test_the_seed_decides_the_weights():
    cards = Card(), Card(), Card(seed=4)
    one, same, other = (new_state(RECIPE, card).network.unused.weight for card in cards)
    assert torch.equal(one, same)
    assert not torch.equal(one, other)


Edit = Callable[[dict[str, Any], dict[str, Any]], Any]


def spoil(path: Path, edit: Edit) -> None:
    """Edit tensors, and notes, of which the card is a dict."""
    tensors, notes = load_tensors(path)
    told: dict[str, Any] = {**notes, "card": json.loads(notes["card"])}
    edit(tensors, told)
    texts = {k: v if isinstance(v, str) else json.dumps(v) for k, v in told.items()}
    save_tensors(path, tensors, texts)


def named(tensors: dict[str, Any], end: str) -> str:
    """Return the name of a weight, which in a checkpoint begins with more."""
    return next(name for name in tensors if name.endswith(end))


SPOILT: dict[str, Edit] = {
    "no card": lambda t, n: n.pop("card"),
    "another method": lambda t, n: n["card"].update(method="yours"),
    "a field too many": lambda t, n: n["card"].update(colour="red"),
    "wider than its weights": lambda t, n: n["card"].update(width=5),
    "a hostile width": lambda t, n: n["card"].update(width=10**9),
    "a tensor missing": lambda t, n: t.pop(named(t, "unused.weight")),
    "a tensor too many": lambda t, n: t.update(extra=torch.zeros(3)),
    "NaN": lambda t, n: t[named(t, "unused.weight")].fill_(torch.nan),
    "a negative variance": lambda t, n: t[named(t, "running_var")].fill_(-1),
}


@pytest.mark.parametrize("edit", SPOILT.values(), ids=SPOILT)
def test_spoilt_files_are_refused(edit, saved, tmp_path):
    spoil(tmp_path / WEIGHTS, edit)
    with pytest.raises(FileFormatError) as error:
        load_weights(tmp_path / WEIGHTS, RECIPE)
    assert str(tmp_path / WEIGHTS) in error.value.where
    spoil(tmp_path / CHECKPOINT, edit)
    with pytest.raises(FileFormatError) as error:
        load_checkpoint(tmp_path, RECIPE)
    assert str(tmp_path / CHECKPOINT) in error.value.where


def moved(new: str) -> Edit:
    return lambda t, n: t.update({new: t.pop("moments.1.exp_avg")})


SPOILT_MOMENTS: dict[str, Edit] = {
    "count": lambda t, n: n.update(moments="many"),
    "another count": lambda t, n: n.update(moments="3"),
    "no count": lambda t, n: n.pop("moments"),
    "one less": lambda t, n: t.pop("moments.0.exp_avg"),
    "one more": lambda t, n: t.update({"moments.0.more": torch.tensor(1.0)}),
    "infinite": lambda t, n: t["moments.1.exp_avg_sq"].fill_(torch.inf),
    "shape": lambda t, n: t.update({"moments.0.exp_avg": torch.zeros(2)}),
    "of no parameter": moved("moments.999.exp_avg"),
    "before the first": moved("moments.-1.exp_avg"),
    "no number": moved("moments.first.exp_avg"),
    "another beginning": moved("colour.1.exp_avg"),
}


@pytest.mark.parametrize("edit", SPOILT_MOMENTS.values(), ids=SPOILT_MOMENTS)
def test_spoilt_moments_are_refused(edit, saved, tmp_path):
    spoil(tmp_path / CHECKPOINT, edit)
    with refused(FileFormatError, CHECKPOINT, expected="checkpoint"):
        load_checkpoint(tmp_path, RECIPE)


def test_other_files_are_refused(saved, tmp_path):
    with refused(FileFormatError, CHECKPOINT, "a checkpoint", "weights", WEIGHTS):
        load_weights(tmp_path / CHECKPOINT, RECIPE)
    whole = (tmp_path / WEIGHTS).read_bytes()
    contents = {
        "cut": whole[: len(whole) // 2],
        "text": b"weights",
        "none": b"",
        "ff": b"\xff" * 64,
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FileFormatError) as error:
            load_weights(tmp_path / name, RECIPE)
        assert str(tmp_path / name) in error.value.where
    for path in (tmp_path / "missing", tmp_path):
        with pytest.raises(OSError, match=r"missing|directory"):
            load_weights(path, RECIPE)


def test_a_new_run_leaves_an_old_one_alone_and_an_old_one_needs_its_checkpoint(saved, tmp_path):
    with pytest.raises(FileExistsError) as there:
        check_new(tmp_path)
    assert there.value.filename == str(tmp_path)
    check_new(tmp_path / "new")
    (tmp_path / CHECKPOINT).rename(tmp_path / WEIGHTS)
    with pytest.raises(FileExistsError) as error:
        check_new(tmp_path)
    assert error.value.filename == str(tmp_path / WEIGHTS)
    with pytest.raises(FileNotFoundError) as none:
        load_checkpoint(tmp_path / "new", RECIPE)
    assert none.value.filename == str(tmp_path / "new")


def test_a_run_goes_on_with_its_own_data_alone():
    check_data("rooms.h5", "a" * 64, "a" * 64)
    with refused(SpecError, "rooms.h5", "b" * 12, "a" * 12):
        check_data("rooms.h5", "b" * 64, "a" * 64)
