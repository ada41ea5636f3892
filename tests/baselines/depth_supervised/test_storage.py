"""Damaged or foreign weights and checkpoints are refused with one line, before memory is taken."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from scenegen.common.errors import FileFormatError

torch = pytest.importorskip("torch")
from baselines.depth_supervised.network import ReliefSpec  # noqa: E402
from baselines.depth_supervised.storage import (  # noqa: E402
    CHECKPOINT,
    METHODS,
    Card,
    load_state,
    load_weights,
    new_state,
    save_state,
    save_weights,
)
from baselines.tensor_files import load_tensors, save_tensors  # noqa: E402

SPEC = ReliefSpec("unet", 32, 0.1)
OURS, OTHERS = METHODS
Edit = Callable[[dict[str, Any], dict[str, Any]], Any]


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    state = new_state(Card(OURS, SPEC, iterations=3))
    sum(p.square().sum() for p in state.network.parameters()).backward()
    state.optimiser.step()
    save_weights(tmp_path / "w.safetensors", state)
    save_state(tmp_path, state)
    return tmp_path


def test_weights_and_checkpoint_come_back(saved):
    state = load_state(saved, OURS)
    network, card = load_weights(saved / "w.safetensors", OURS)
    assert card == state.card == Card(OURS, SPEC, iterations=3)
    assert not network.training
    for name, value in state.network.state_dict().items():
        found = network.state_dict()[name]
        torch.testing.assert_close(found, value, atol=1e-3, rtol=1e-3, msg=name)
    assert len(state.optimiser.state_dict()["state"]) == len(list(state.network.parameters()))


def spoil(path: Path, edit: Edit) -> None:
    """Edit tensors, and notes, of which the card is a dict."""
    tensors, notes = load_tensors(path)
    told: dict[str, Any] = {**notes, "card": json.loads(notes["card"])}
    edit(tensors, told)
    card = {"card": json.dumps(told["card"])} if "card" in told else {}
    save_tensors(path, tensors, {**{k: str(v) for k, v in told.items() if k != "card"}, **card})


SPOILT: list[tuple[str, Edit]] = [
    ("no card", lambda t, n: n.pop("card")),
    ("weights of view-pairs", lambda t, n: n["card"].update(method=OTHERS)),
    ("another method", lambda t, n: n["card"].update(method="mine")),
    ("another version", lambda t, n: n["card"].update(format_version=9)),
    ("a field too many", lambda t, n: n["card"].update(more=1)),
    ("a size that is not built", lambda t, n: n["card"]["network"].update(size=10**9)),
    ("wider than its weights", lambda t, n: n["card"]["network"].update(width=4.0)),
    ("a tensor missing", lambda t, n: t.pop(next(name for name in t if "last.weight" in name))),
    ("a tensor too many", lambda t, n: t.update(extra=torch.zeros(3))),
    ("NaN", lambda t, n: next(v for k, v in t.items() if "last.weight" in k).fill_(torch.nan)),
]


@pytest.mark.parametrize("edit", [e for _, e in SPOILT], ids=[name for name, _ in SPOILT])
def test_spoilt_files_are_refused(edit, saved):
    spoil(saved / "w.safetensors", edit)
    with pytest.raises(FileFormatError) as error:
        load_weights(saved / "w.safetensors", OURS)
    assert str(saved) in error.value.where
    spoil(saved / CHECKPOINT, edit)
    with pytest.raises(FileFormatError) as error:
        load_state(saved, OURS)
    assert str(saved) in error.value.where


@pytest.mark.parametrize(
    "edit",
    [
        lambda t, n: n.update(moments="many"),
        lambda t, n: n.pop("moments"),
        lambda t, n: t.pop("adam.0.exp_avg"),
        lambda t, n: t["adam.1.exp_avg_sq"].fill_(torch.inf),
        lambda t, n: t.update({"adam.999.step": torch.tensor(1.0)}),
    ],
    ids=["count", "no count", "one less", "infinite", "one more"],
)
def test_spoilt_moments_are_refused(edit, saved):
    spoil(saved / CHECKPOINT, edit)
    with pytest.raises(FileFormatError):
        load_state(saved, OURS)


def test_other_files_are_refused(saved, tmp_path):
    with pytest.raises(FileFormatError, match="a checkpoint"):
        load_weights(saved / CHECKPOINT, OURS)
    whole = (saved / "w.safetensors").read_bytes()
    for name, content in (("cut", whole[:1000]), ("text", b"weights"), ("none", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FileFormatError, match="safetensors"):
            load_weights(tmp_path / name, OURS)
    for path in (tmp_path / "missing", tmp_path):
        with pytest.raises(OSError, match=r"missing|directory"):
            load_weights(path, OURS)
