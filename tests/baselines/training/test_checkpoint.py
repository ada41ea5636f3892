"""Weights and checkpoints come back as they were; damaged, hostile and other files are refused."""

import copy
import json
import os
import struct
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
import torch
from refusals import refused
from torch.optim import Adam

from baselines.training import checkpoint
from baselines.training.checkpoint import (
    CHECKPOINT,
    WEIGHTS,
    Method,
    load_checkpoint,
    load_tensors,
    load_weights,
    moments_of,
    new_state,
    save_checkpoint,
    save_tensors,
    save_weights,
)
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check

BIAS, VARIANCE = "layers.0.bias", "layers.1.running_var"


@dataclass(frozen=True)
class Settings:
    width: int = 4
    seed: int = 3
    iterations: int = 9
    learning_rate: float = 0.1

    def __post_init__(self) -> None:
        check(0 < self.width < 10**6, "width", self.width, "a width")


@dataclass(frozen=True)
class Card(checkpoint.Card):
    settings: Settings = field(default_factory=Settings)


class Network(torch.nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = torch.nn.Sequential(torch.nn.Linear(2, width), torch.nn.BatchNorm1d(width))
        self.unused = torch.nn.Linear(width, width)


def optimisers(card: Card, network: Network) -> dict[str, Adam]:
    return {"adam": Adam(network.parameters()), "idle": Adam(network.unused.parameters())}


METHOD = Method("mine", Card, lambda card: Network(card.settings.width), optimisers)
CARD = Card("mine", labels=2, iteration=7, seconds=1.5)


@pytest.fixture
def saved(tmp_path: Path) -> Any:
    """Return a state after one step, of which the folder holds weights and checkpoint."""
    state = new_state(METHOD, CARD)
    state.network.layers(torch.rand(8, 2)).square().sum().backward()
    state.optimisers["adam"].step()
    save_weights(tmp_path / WEIGHTS, METHOD, state.network, state.card)
    save_checkpoint(tmp_path, state)
    return state


def test_a_checkpoint_holds_all_of_a_state(saved, tmp_path):
    again = load_checkpoint(tmp_path, METHOD)
    assert again.card == saved.card
    assert again.network.training
    for name, value in saved.network.state_dict().items():
        assert torch.equal(again.network.state_dict()[name], value), name
    moments, found = (moments_of(state.optimisers) for state in (saved, again))
    assert found.keys() == moments.keys()
    assert all(torch.equal(found[name], value) for name, value in moments.items())
    trained = {name for name, value in moments.items() if name.endswith("step") and value}
    assert trained == {f"adam.{number}.step" for number in range(4)}, "not the unused layer"


def test_weights_come_back_and_those_beyond_float16_are_kept_in_full(saved, tmp_path):
    method, network = replace(METHOD, kept=("layers.",)), copy.deepcopy(saved.network)
    network.layers[0].weight.data[0, 0] = 1e5
    save_weights(tmp_path / WEIGHTS, method, network, CARD)
    again, card = load_weights(tmp_path / WEIGHTS, method)
    assert (card, again.training) == (CARD, False)
    stored = load_tensors(tmp_path / WEIGHTS)[0]
    expected = {k: v for k, v in network.state_dict().items() if k.startswith("layers.")}
    assert stored.keys() == expected.keys(), "only what is kept"
    for name, value in expected.items():
        full = name == "layers.0.weight" or not value.is_floating_point()
        assert stored[name].dtype == (value.dtype if full else torch.float16), name
        assert torch.equal(again.state_dict()[name], stored[name].to(value.dtype)), name
    assert len(os.listdir(tmp_path)) == 2


Edit = Callable[[dict[str, Any], dict[str, Any]], Any]


def spoil(path: Path, edit: Edit) -> None:
    """Edit tensors, and notes, of which the card is a dict."""
    tensors, notes = load_tensors(path)
    ((content, text),) = notes.items()
    record: dict[str, Any] = {"content": content, "card": json.loads(text)}
    edit(tensors, record)
    card = record.get("card", "")
    text = card if isinstance(card, str) else json.dumps(card)
    save_tensors(path, tensors, {record["content"]: text} if record else {})


def named(tensors: dict[str, Any], end: str) -> str:
    """Return the name of a weight, which in a checkpoint begins with more."""
    return next(name for name in tensors if name.endswith(end) and "exp" not in name)


def changed(end: str, value: Any) -> Edit:
    return lambda t, n: t.update({named(t, end): value})


def of_settings(**values: Any) -> Edit:
    return lambda t, n: n["card"]["settings"].update(values)


FULL = torch.full((4,), 1e300, dtype=torch.float64)  # finite, but not in the network's float32
SPOILT: dict[str, tuple[Edit, str, str]] = {  # what is edited, and the error's place and finding
    "another content": (lambda t, n: n.update(content="labels"), "", "labels"),
    "no notes": (lambda t, n: n.clear(), "", "no card"),
    "another version": (lambda t, n: n.update(content="weights 9"), "", "weights 9"),
    "no JSON": (lambda t, n: n.update(card="{" * 100_000), "card", ""),
    "a list": (lambda t, n: n.update(card="[]"), "card", ""),
    "too long": (lambda t, n: n.update(card=" " * 4_000_001), "card", ""),
    "another method": (lambda t, n: n["card"].update(method="yours"), "method", "yours"),
    "a field too many": (lambda t, n: n["card"].update(colour="red"), "card", "colour"),
    "a text for a number": (lambda t, n: n["card"].update(iteration="7"), "iteration", "7"),
    "labels below 0": (lambda t, n: n["card"].update(labels=-1), "labels", "-1"),
    "beyond its last iteration": (lambda t, n: n["card"].update(iteration=10), "iteration", "10"),
    "no settings": (lambda t, n: n["card"].update(settings=None), "settings", "None"),
    "a wrong setting": (of_settings(width=0), "width", "0"),
    "a hostile width": (of_settings(width=10**9), "width", ""),
    "a huge width": (of_settings(width=999_999), "", "shape"),
    "wider than its weights": (of_settings(width=5), "layers.0.weight", "shape (4, 2)"),
    "a tensor missing": (lambda t, n: t.pop(named(t, BIAS)), BIAS, "nothing"),
    "one dimension": (changed(BIAS, torch.zeros(1, 4)), BIAS, "shape (1, 4)"),
    "NaN": (changed(BIAS, torch.full((4,), torch.nan)), BIAS, "NaN"),
    "infinity": (changed(BIAS, FULL), BIAS, "infinity"),
    "a negative variance": (changed(VARIANCE, -torch.ones(4)), VARIANCE, "negative"),
    **{
        str(dtype): (changed(BIAS, torch.zeros(4).to(dtype)), BIAS, str(dtype))
        for dtype in (torch.int32, torch.bool, torch.complex64, torch.float8_e4m3fn)
    },
}  # fmt: skip


@pytest.mark.parametrize("name", SPOILT)
def test_spoilt_files_are_refused(name, saved, tmp_path):
    edit, where, found = SPOILT[name]
    for path, load in (
        (tmp_path / WEIGHTS, lambda path: load_weights(path, METHOD)),
        (tmp_path / CHECKPOINT, lambda path: load_checkpoint(path.parent, METHOD)),
    ):
        spoil(path, edit)
        with pytest.raises(FileFormatError) as error:
            load(path)
        assert error.value.where.startswith(str(path))
        assert where in error.value.where
        assert found in error.value.found
        assert "\n" not in str(error.value)


SPOILT_MOMENTS: dict[str, Edit] = {
    "another tensor": lambda t, n: t.update(extra=torch.zeros(3)),
    "none at all": lambda t, n: [t.pop(name) for name in list(t) if name.startswith("adam.")],
    "one less": lambda t, n: t.pop("adam.0.exp_avg"),
    "one more": lambda t, n: t.update({"adam.0.more": torch.tensor(1.0)}),
    "infinite": lambda t, n: t["adam.1.exp_avg_sq"].fill_(torch.inf),
    "squares below 0": lambda t, n: t["adam.1.exp_avg_sq"].fill_(-1),
    "steps below 0": lambda t, n: t["adam.1.step"].fill_(-1),
    "shape": lambda t, n: t.update({"adam.0.exp_avg": torch.zeros(2)}),
    "of no parameter": lambda t, n: t.update({"adam.999.exp_avg": t.pop("adam.1.exp_avg")}),
    "before the first": lambda t, n: t.update({"adam.-1.exp_avg": t.pop("adam.1.exp_avg")}),
    "named": lambda t, n: t.update({"adam.first.exp_avg": t.pop("adam.1.exp_avg")}),
    "another beginning": lambda t, n: t.update({"colour.1.exp_avg": t.pop("adam.1.exp_avg")}),
}


@pytest.mark.parametrize("edit", SPOILT_MOMENTS.values(), ids=SPOILT_MOMENTS)
def test_spoilt_moments_are_refused(edit, saved, tmp_path):
    spoil(tmp_path / CHECKPOINT, edit)
    with pytest.raises(FileFormatError) as error:
        load_checkpoint(tmp_path, METHOD)
    assert error.value.where.startswith(str(tmp_path / CHECKPOINT))


def test_weights_and_checkpoints_are_told_apart(saved, tmp_path):
    with refused(FileFormatError, CHECKPOINT, "checkpoint 1", "weights 1 of mine", WEIGHTS):
        load_weights(tmp_path / CHECKPOINT, METHOD)
    (tmp_path / WEIGHTS).rename(tmp_path / CHECKPOINT)
    with refused(FileFormatError, CHECKPOINT, "weights 1", "checkpoint 1 of mine"):
        load_checkpoint(tmp_path, METHOD)


def lying_header(raw: bytes) -> bytes:
    """Return a file whose first tensor claims to be huge."""
    end = 8 + struct.unpack("<Q", raw[:8])[0]
    header = json.loads(raw[8:end])
    header[BIAS]["shape"] = [2**40]
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + raw[end:]


@pytest.mark.parametrize(
    "damage",
    [
        *(lambda raw, kept=kept: raw[:kept] for kept in (0, 7, 8, 300, -1)),
        lambda raw: b"weights",
        lambda raw: b"\xff" * 64,
        lambda raw: struct.pack("<Q", 2**62) + raw[8:],
        lying_header,
    ],
)
def test_damaged_files_are_refused(damage, saved, tmp_path):
    path = tmp_path / WEIGHTS
    path.write_bytes(damage(path.read_bytes()))
    with refused(FileFormatError, str(path)):
        load_weights(path, METHOD)


def test_numbers_out_of_range_are_refused():
    with refused(SpecError, "seconds", "-1"):
        replace(CARD, seconds=-1)
