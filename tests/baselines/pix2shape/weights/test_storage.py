"""Weights and cards: what is saved comes back, and any other file is refused in one line."""

import copy
import json
import os
import resource
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pix2shape_models import tiny

from scenegen.common.errors import FileFormatError

torch = pytest.importorskip("torch")
from safetensors.torch import load_file, save_file  # noqa: E402

from baselines.pix2shape.network.model import Pix2Shape  # noqa: E402
from baselines.pix2shape.weights.storage import Card, load_model, save_card, save_weights  # noqa: E402

CARD = Card(tiny(classes=2), 70, data='{"seed":3}', classes=("mug", "bowl"), seconds=1.5)
BIAS, VARIANCE = "encoder.last.bias", "decoder.norms.0.norm.running_var"


@pytest.fixture(scope="session")
def model() -> Pix2Shape:
    """Return a model whose statistics are those of some images."""
    torch.manual_seed(0)
    model = Pix2Shape(CARD.config)
    model.decoder(torch.randn(4, 128), torch.rand(4, 5))
    model.prior.fit(
        model.encoder(torch.rand(4, 3, 32, 32), torch.rand(4, 5)).detach(), torch.eye(5)[:4]
    )
    return model


@pytest.fixture
def path(tmp_path: Path, model: Pix2Shape) -> Path:
    save_weights(tmp_path / "w.safetensors", model, CARD)
    return tmp_path / "w.safetensors"


def refused(path: Path, found: str = "", named: Path | None = None) -> None:
    """Check that loading raises one line that names a file."""
    with pytest.raises((FileFormatError, OSError)) as error:
        load_model(path)
    line = str(error.value)
    assert str(named or path) in line
    assert "\n" not in line
    assert not found or error.value.found == found


@pytest.mark.parametrize("dtype", [torch.float32, torch.float16])
def test_the_same_model_comes_back(tmp_path, model, dtype):
    path = tmp_path / "w.safetensors"
    save_weights(path, model, CARD, dtype)
    again, card = load_model(path)
    assert (card, again.training) == (CARD, False)
    own = model.state_dict()
    kept = {name for name in own if name.split(".")[0] in ("encoder", "decoder", "prior")}
    stored = load_file(path)
    assert stored.keys() == kept, "critic and statistics are not needed"
    for name in kept:
        expected = own[name].to(dtype).float() if own[name].is_floating_point() else own[name]
        assert torch.equal(again.state_dict()[name], expected), name
        assert stored[name].dtype == (dtype if own[name].is_floating_point() else torch.int64)
    assert any((own[name] != 0).any() for name in kept if "running_mean" in name)


def test_saving_again_replaces_both(path, model):
    card, other = replace(CARD, iteration=80), copy.deepcopy(model)
    other.encoder.last.bias.data += 1
    save_weights(path, other, card)
    again, found = load_model(path)
    assert found == card
    moved = again.encoder.last.bias - model.encoder.last.bias
    assert moved.mean().item() == pytest.approx(1, rel=1e-2)
    assert len(os.listdir(path.parent)) == 2


def test_files_that_are_not_there(tmp_path, path):
    refused(tmp_path / "none.safetensors", named=tmp_path / "none.json")
    path.unlink()
    refused(path)
    path.mkdir()
    refused(path)
    path.with_suffix(".json").unlink()
    path.with_suffix(".json").mkdir()
    refused(path, named=path.with_suffix(".json"))


@pytest.mark.parametrize(
    "text",
    [b"", b"\xff\xfe\x00", b"{" * 100_000, b"[" * 100_000, b"[]", b"{}", b" " * 1_000_001],
    ids=lambda text: str(text[:4]),
)
def test_cards_that_are_none(path, text):
    path.with_suffix(".json").write_bytes(text)
    refused(path, named=path.with_suffix(".json"))


def change_card(path: Path, change: dict[str, Any]) -> Path:
    """Change a card, field by field; return its path."""

    def changed(raw: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
        inner = {k: changed(raw[k], v) if isinstance(v, dict) else v for k, v in change.items()}
        return {**raw, **inner}

    beside = path.with_suffix(".json")
    beside.write_text(json.dumps(changed(json.loads(beside.read_text()), change)))
    return beside


@pytest.mark.parametrize(
    "change",
    [
        {"format_version": 2},
        {"iteration": "70"},
        {"earlier_labels": -1},
        {"classes": "mug"},
        {"classes": ["mug", "bowl", "hat", "lamp"]},
        {"config": {"networks": {"size": 48}}},
        {"config": {"decay": 1}},
        {"config": None},
        {"code": "import os"},
        {"config": {"networks": {"z_scene": 10**13}}},
        {"config": {"networks": {"z_scene": 10**30}}},
    ],
    ids=str,
)
def test_cards_that_are_wrong(path, change):
    refused(path, named=change_card(path, change))


@pytest.mark.parametrize(
    "change",
    [
        {"networks": {"z_scene": 64}},
        {"networks": {"size": 64}},
        {"opacity": True},
        # 3.4e9 parameters, each number within its range: refused before anything is allocated
        {"networks": {"size": 256, "width": 4.0, "z_scene": 4096, "z_view": 4096}},
    ],
    ids=str,
)
def test_cards_of_another_configuration(path, change):
    change_card(path, {"config": change})
    with pytest.raises(FileFormatError) as error:
        load_model(path)
    assert error.value.where.startswith(f"{path}: ")
    assert "another configuration" in error.value.hint


@pytest.mark.parametrize("kept", [0, 7, 8, 300, 5000, -1])
def test_truncated_files(path, kept):
    path.write_bytes(path.read_bytes()[:kept])
    refused(path)


def test_a_header_that_lies(path):
    raw = path.read_bytes()
    path.write_bytes(struct.pack("<Q", 2**62) + raw[8:])
    refused(path)
    end = 8 + struct.unpack("<Q", raw[:8])[0]
    header = json.loads(raw[8:end])
    header[BIAS]["shape"] = [2**40]
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + raw[end:])
    refused(path)


class Touch(str):
    """Makes a folder of this name when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return os.mkdir, (str(self),)


def test_a_pickle_is_refused_and_not_run(path, tmp_path):
    torch.save({BIAS: torch.zeros(128), "x": Touch(str(tmp_path / "owned"))}, path)
    refused(path)
    assert not (tmp_path / "owned").exists()
    torch.load(path.rename(tmp_path / "w.pt"), weights_only=False)
    assert (tmp_path / "owned").exists(), "it would have run"


@pytest.mark.parametrize(
    ("edit", "name", "found"),
    [
        (lambda t: t.pop(BIAS), BIAS, "nothing"),
        (lambda t: t.update(more=torch.zeros(1)), "more", "a tensor"),
        (lambda t: t.update({BIAS: torch.zeros(127)}), BIAS, "shape (127,)"),
        (lambda t: t.update({BIAS: torch.zeros(1, 128)}), BIAS, "shape (1, 128)"),
        (lambda t: t[BIAS].__setitem__(3, torch.nan), BIAS, "NaN"),
        (lambda t: t[BIAS].__setitem__(3, -torch.inf), BIAS, "NaN, infinity"),
        (lambda t: t.update({BIAS: torch.zeros(128, dtype=torch.int32)}), BIAS, "int32"),
        (lambda t: t.update({BIAS: torch.zeros(128, dtype=torch.bool)}), BIAS, "bool"),
        (lambda t: t.update({BIAS: torch.zeros(128, dtype=torch.complex64)}), BIAS, "complex64"),
        (lambda t: t.update({BIAS: torch.zeros(128).to(torch.float8_e4m3fn)}), BIAS, "float8"),
        # finite, but not in the model's float32
        (lambda t: t.update({BIAS: torch.full((128,), 1e300, dtype=torch.float64)}), BIAS, "NaN"),
        (lambda t: t[VARIANCE].neg_(), VARIANCE, "variance below 0"),
    ],
)
def test_tensors_that_do_not_fit(path, edit, name, found):
    tensors = load_file(path)
    edit(tensors)
    save_file(tensors, path)
    with pytest.raises(FileFormatError) as error:
        load_model(path)
    assert error.value.where == f"{path}: {name}"
    assert found in error.value.found


@pytest.mark.parametrize("kind", ["card", "weights"])
def test_a_write_that_fails_leaves_what_was_there(path, kind, model):
    before = {p.name: p.read_bytes() for p in path.parent.iterdir()}
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, hard))
    try:
        with pytest.raises(OSError, match="File too large") as error:
            save_card(path, CARD) if kind == "card" else save_weights(path, model, CARD)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert {p.name: p.read_bytes() for p in path.parent.iterdir()} == before
    assert str(path.with_suffix(".json") if kind == "card" else path) in str(error.value)


def test_a_checkpoint_is_told_from_weights(path):
    save_file({f"model.{name}": value for name, value in load_file(path).items()}, path)
    refused(path, "a checkpoint")


def test_what_is_beyond_half_precision_is_kept_in_full(model, tmp_path):
    large, path = copy.deepcopy(model), tmp_path / "w.safetensors"
    large.decoder.last.bias.data.fill_(1e5)
    save_weights(path, large, CARD)
    assert float(load_model(path)[0].decoder.last.bias.detach()[0]) == 1e5
    kept = load_file(path)
    full = {name for name, value in kept.items() if value.dtype == torch.float32}
    assert full == {"decoder.last.bias"}
