"""Weights and cards: the same again, and whatever else lies there told in one line."""

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

from scenegen.common.errors import FileFormatError

torch = pytest.importorskip("torch")
from safetensors.torch import load_file, save_file  # noqa: E402

from baselines.pix2shape.network.architecture import NetworkSpec  # noqa: E402
from baselines.pix2shape.network.config import ModelConfig  # noqa: E402
from baselines.pix2shape.network.model import Pix2Shape  # noqa: E402
from baselines.pix2shape.weights.storage import (  # noqa: E402
    LARGEST_JSON,
    Card,
    load_model,
    save_card,
    save_weights,
)

CARD = Card(
    ModelConfig(networks=NetworkSpec(size=32, width=0.05, classes=2), learning_rate=3e-4),
    iteration=70, data='{"seed":3}', classes=("mug", "bowl"), seconds=1.5,
)  # fmt: skip
BIAS = "encoder.last.bias"


@pytest.fixture(scope="session")
def model() -> Pix2Shape:
    """Return a model whose statistics are those of some images."""
    torch.manual_seed(0)
    model = Pix2Shape(CARD.config)
    model.decoder(torch.randn(4, 128), torch.rand(4, 5))
    model.prior.fit(model.encoder(torch.rand(4, 3, 32, 32), torch.rand(4, 5)).detach())
    return model


@pytest.fixture
def path(tmp_path: Path, model: Pix2Shape) -> Path:
    save_weights(tmp_path / "w.safetensors", model, CARD)
    return tmp_path / "w.safetensors"


def refused(path: Path, *words: str, named: Path | None = None) -> str:
    """Check that loading raises one line that names the file and has all words; return it."""
    with pytest.raises((FileFormatError, OSError)) as error:
        load_model(path)
    line = str(error.value)
    assert str(named or path) in line
    assert "\n" not in line
    assert [word for word in words if word not in line] == [], line
    return line


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


def test_the_card_is_json_for_people(path):
    told = json.loads(path.with_suffix(".json").read_text())
    assert told["config"]["networks"]["size"] == 32
    assert (told["iteration"], told["seconds"], told["classes"]) == (70, 1.5, ["mug", "bowl"])
    assert told["format_version"] == 1
    assert sorted(p.name for p in path.parent.iterdir()) == ["w.json", "w.safetensors"]


def test_saving_again_replaces_both(path, model):
    card = replace(CARD, iteration=80)
    with torch.no_grad():
        model.encoder.last.bias += 1
        save_weights(path, model, card)
        model.encoder.last.bias -= 1
    again, found = load_model(path)
    assert found == card
    difference = again.encoder.last.bias - model.encoder.last.bias
    assert difference.mean().item() == pytest.approx(1, rel=1e-2)
    assert len(os.listdir(path.parent)) == 2


def test_files_that_are_not_there(tmp_path, path):
    refused(tmp_path / "none.safetensors", "No such file", named=tmp_path / "none.json")
    path.unlink()
    refused(path, "No such file")
    path.mkdir()
    refused(path, "Is a directory")
    path.with_suffix(".json").unlink()
    path.with_suffix(".json").mkdir()
    refused(path, "Is a directory", named=path.with_suffix(".json"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "cannot be read as JSON"),
        (b"\xff\xfe\x00", "cannot be read as JSON"),
        (b"{" * 100_000, "cannot be read as JSON"),
        (b"[" * 100_000, "nested too deeply"),
        (b"[]", "expected a JSON object"),
        (b"{}", "'config' is missing"),
        (b" " * (LARGEST_JSON + 1), "over 1000000 bytes"),
    ],
)
def test_cards_that_are_none(path, text, words):
    path.with_suffix(".json").write_bytes(text)
    refused(path, words, named=path.with_suffix(".json"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format_version": 2}, "format version 2, this release reads 1"),
        ({"iteration": "70"}, "iteration: found '70', expected a whole number"),
        ({"classes": "mug"}, "classes: found 'mug', expected a list"),
        ({"config": {"networks": {"size": 48}}}, "size: found 48"),
        ({"config": {"decay": 1}}, "decay: found 1, expected true or false"),
        ({"config": None}, "expected a JSON object"),
        ({"code": "import os"}, "unknown field 'code'"),
        ({"config": {"networks": {"z_scene": 64}}}, "has shape"),
        ({"config": {"networks": {"size": 64}}}, "weights of another configuration"),
        ({"config": {"opacity": True}}, "has shape"),
    ],
)
def test_cards_that_are_wrong(path, change, words):
    beside = path.with_suffix(".json")

    def changed(raw: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
        inner = {k: changed(raw[k], v) if isinstance(v, dict) else v for k, v in change.items()}
        return {**raw, **inner}

    beside.write_text(json.dumps(changed(json.loads(beside.read_text()), change)))
    weights = "shape" in words or "weights" in words
    refused(path, words, named=path if weights else beside)


@pytest.mark.parametrize("size", [10**13, 10**30])
def test_a_card_of_absurd_size(path, size):
    card = json.loads(path.with_suffix(".json").read_text())
    card["config"]["networks"]["z_scene"] = size
    path.with_suffix(".json").write_text(json.dumps(card))
    refused(path, named=path.with_suffix(".json"))


@pytest.mark.parametrize("kept", [0, 7, 8, 300, 5000, -1])
def test_truncated_files(path, kept):
    path.write_bytes(path.read_bytes()[:kept])
    refused(path, "not a safetensors file, or damaged")


def test_a_header_that_lies(path):
    raw = path.read_bytes()
    path.write_bytes(struct.pack("<Q", 2**62) + raw[8:])
    refused(path, "not a safetensors file, or damaged")
    end = 8 + struct.unpack("<Q", raw[:8])[0]
    header = json.loads(raw[8:end])
    header[BIAS]["shape"] = [2**40]
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + raw[end:])
    refused(path, "not a safetensors file, or damaged")


class Touch:
    """Makes a file when it is unpickled."""

    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return os.mkdir, (self.path,)


def test_a_pickle_is_refused_and_not_run(path, tmp_path):
    torch.save({BIAS: torch.zeros(128), "x": Touch(str(tmp_path / "owned"))}, path)
    refused(path, "not a safetensors file, or damaged")
    assert not (tmp_path / "owned").exists()
    torch.load(path.rename(tmp_path / "w.pt"), weights_only=False)
    assert (tmp_path / "owned").exists(), "it would have run"


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda t: t.pop(BIAS), f"{BIAS} is missing"),
        (lambda t: t.update(more=torch.zeros(1)), "more is not expected"),
        (lambda t: t.update({BIAS: torch.zeros(127)}), "has shape (127,), expected (128,)"),
        (lambda t: t.update({BIAS: torch.zeros(1, 128)}), "has shape (1, 128)"),
        (lambda t: t[BIAS].__setitem__(3, torch.nan), f"{BIAS} is not finite"),
        (lambda t: t[BIAS].__setitem__(3, -torch.inf), f"{BIAS} is not finite"),
    ],
)
def test_tensors_that_do_not_fit(path, edit, words):
    tensors = load_file(path)
    edit(tensors)
    save_file(tensors, path)
    refused(path, words)


@pytest.mark.parametrize(
    "values",
    [
        torch.zeros(128, dtype=torch.int32),
        torch.zeros(128, dtype=torch.bool),
        torch.zeros(128, dtype=torch.complex64),
        torch.zeros(128).to(torch.float8_e4m3fn),
        torch.full((128,), 1e300, dtype=torch.float64),  # finite, but not in the model
    ],
    ids=lambda values: str(values.dtype),
)
def test_tensors_of_another_type(path, values):
    save_file({**load_file(path), BIAS: values}, path)
    refused(path, BIAS)


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


def test_a_card_of_a_huge_model_allocates_nothing(path):
    """3.4e9 parameters, each number within its range: refused by the shapes alone."""
    card = json.loads(path.with_suffix(".json").read_text())
    card["config"]["networks"].update(size=256, width=4.0, z_scene=4096, z_view=4096)
    path.with_suffix(".json").write_text(json.dumps(card))
    refused(path, "weights of another configuration")


def test_a_checkpoint_is_told_from_weights(path):
    save_file({f"model.{name}": value for name, value in load_file(path).items()}, path)
    refused(path, "a checkpoint; name the weights beside it")


def test_classes_of_card_and_networks_must_agree(path):
    card = json.loads(path.with_suffix(".json").read_text())
    card["classes"] = ["mug", "bowl", "hat", "lamp"]
    path.with_suffix(".json").write_text(json.dumps(card))
    refused(path, "classes: found 4, expected", named=path.with_suffix(".json"))


def test_a_variance_below_zero(path):
    name = "decoder.norms.0.norm.running_var"
    save_file({**load_file(path), name: -torch.ones_like(load_file(path)[name])}, path)
    refused(path, name)


def test_what_is_beyond_half_precision_is_kept_in_full(model, tmp_path):
    large = copy.deepcopy(model)
    large.decoder.last.bias.data.fill_(1e5)
    save_weights(tmp_path / "w.safetensors", large, CARD)
    again, _ = load_model(tmp_path / "w.safetensors")
    assert float(again.decoder.last.bias.detach()[0]) == 1e5
    kept = load_file(tmp_path / "w.safetensors")
    full = {name for name, value in kept.items() if value.dtype == torch.float32}
    assert full == {"decoder.last.bias"}
