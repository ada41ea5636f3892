"""Public depth models come in by their names, and wrappers of MoGe's evaluation as they are."""

import ast
import importlib.util
from pathlib import Path

import numpy as np
import pytest

from metrics.intake import model_file, model_runner
from metrics.intake.model_file import ModelError, opened_model
from metrics.intake.running import Call, run_model
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import RoomsFile

torch = pytest.importorskip("torch")
pytest.importorskip("transformers")
from tiny_depth_models import MODELS, save  # noqa: E402

from metrics.intake.doors import MoGe, driver_version, load, provenance_of  # noqa: E402

TORCHVISION = pytest.mark.skipif(
    importlib.util.find_spec("torchvision") is None, reason="its processor needs torchvision"
)
MARKS = {"zoedepth": TORCHVISION, "depth-pro": TORCHVISION}
MARKS |= dict.fromkeys(
    ("depth-anything-metric", "prompt-depth-anything", "dpt-dinov2", "tipsv2"), pytest.mark.slow
)
CLASSES = [pytest.param(name, marks=MARKS.get(name, ())) for name in MODELS]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    made = {}

    def folder(name):
        if name not in made:
            made[name] = save(name, tmp_path_factory.mktemp(name))
        return made[name]

    return folder


@pytest.mark.parametrize("name", CLASSES)
def test_what_a_class_predicts_and_where(name, folders):
    """A known plane of numbers comes out at every size in its place, and under its right key."""
    model = load(f"hf:{folders(name)}")
    key = MODELS[name][0]
    forward = model.network.forward

    def plane(rows, columns):
        y, x = (np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns
        return 1.0 + y[:, None] + 0.25 * x

    def known(*args, **more):
        found = forward(*args, **more)
        (rows, columns), pixels = found.predicted_depth.shape[1:], args[0]
        values = torch.tensor(plane(rows, columns), dtype=torch.float32)
        found["predicted_depth"] = values.expand(len(pixels), rows, columns)
        return found

    rng = np.random.default_rng(0)
    for height, width in (48, 64), (128, 96):
        images = rng.integers(0, 256, (2, height, width, 3), dtype=np.uint8)
        model.network.forward = forward
        random = model.infer_batch(images)
        assert [next(iter(one)) for one in random] == [key, key]
        model.network.forward = known
        for one in model.infer_batch(images):
            values = np.asarray(one[key])
            assert (values.dtype, values.shape) == (np.float32, (height, width))
            expected = plane(height, width)
            if name == "depth-pro":  # it predicts 1 / depth times the focal length over the width
                matrix = one["intrinsics"]
                expected = matrix[0, 0] / width / expected
            inner = np.s_[height // 6 : -height // 6, width // 6 : -width // 6]
            np.testing.assert_allclose(values[inner], expected[inner], rtol=0.02)


@pytest.mark.slow
def test_a_run_is_the_import_of_the_same_arrays_and_says_what_it_was(folders, truths, tmp_path):
    folder, out = folders("depth-anything-metric"), tmp_path / "p.h5"
    with opened_model(f"hf:{folder}") as model:
        said = run_model(model, truths.rooms, out, call=Call(batch=3), method=model.title)
        told = model.provenance
    assert said == "depth_metric of 8 images"
    assert [p for p in validate(out, truths.rooms) if not p.is_hint] == []
    here = load(f"hf:{folder}")
    with open_predictions(out) as found, RoomsFile(truths.rooms) as rooms:
        # Metres are not the unit of these rooms, so the scale is left open.
        assert (found.kind, found.alignment) == ("depth", "scale")
        assert found.method == Path(folder).name
        for row in (0, 7):
            expected = here.infer(srgb_bytes(rooms[row].radiance))["depth_metric"]
            np.testing.assert_allclose(found.depth(row), expected, rtol=1e-3, atol=1e-3)
        for text in told["weights_sha256"], "DepthAnythingForDepthEstimation", "input: 70x70":
            assert text in found.notes
    with torch.no_grad():
        next(here.network.parameters()).add_(1.0)

    changed = provenance_of(here.network, "", "", "cpu", torch.float32, "transformers")
    assert changed["weights_sha256"] != told["weights_sha256"]


@pytest.mark.parametrize(
    ("told", "version"),
    [
        ("NVRM version: NVIDIA UNIX x86_64 Kernel Module  535.104.05  Sat Aug", "535.104.05"),
        ("NVRM version: NVIDIA UNIX Open Kernel Module for x86_64  580.82.07", "580.82.07"),
        ("no numbers", ""),
    ],
)
def test_the_driver_is_named_where_it_tells(told, version, tmp_path):
    assert driver_version(str(tmp_path / "version")) == ""
    (tmp_path / "version").write_text(told)
    assert driver_version(str(tmp_path / "version")) == version


def refused(name, **more):
    with pytest.raises(ModelError) as caught, opened_model(name, **more):
        pass
    return caught.value


@pytest.mark.slow
def test_one_line_says_what_is_wrong(tmp_path, folders, truths, monkeypatch):
    from transformers import BertConfig

    (tmp_path / "bert").mkdir()
    BertConfig(hidden_size=8, num_attention_heads=1, num_hidden_layers=1).save_pretrained(
        tmp_path / "bert"
    )
    broken = tmp_path / "broken"
    broken.mkdir()
    for file in Path(folders("depth-anything")).iterdir():
        (broken / file.name).write_bytes(file.read_bytes())
    from safetensors.torch import load_file, save_file

    weights = load_file(broken / "model.safetensors")
    del weights["head.conv3.bias"]
    save_file(weights, broken / "model.safetensors", metadata={"format": "pt"})
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    for name, settings in (
        (f"hf:{tmp_path / 'nowhere'}", {}),
        ("hf:nobody/knows-this", {}),
        (f"hf:{tmp_path / 'bert'}", {}),
        (f"hf:{broken}", {}),
        (f"hf:{folders('dpt')}", {"dtype": "int8"}),
    ):
        error = refused(name, settings=settings)
        assert error.where.startswith(name)
        assert "\n" not in f"{error}"
    assert refused(f"hf:{broken}", python=tmp_path).where == "--python"
    with opened_model(f"hf:{folders('dpt')}") as model, pytest.raises(ModelError):
        run_model(model, truths.iqtt, tmp_path / "q.h5", call=Call(), method="m")


BASELINE = """
import click, torch

class Baseline:
    def __init__(self, factor, device):
        self.factor, self.device = factor, torch.device(device)

    @click.command()
    @click.option("--factor", type=float, default=1.0)
    @click.option("--device", default="cuda:0")
    @staticmethod
    def load(factor, device):
        return Baseline(factor, device)

    def infer(self, image, intrinsics=None):
        raise AssertionError("infer_for_evaluation goes first")

    def infer_for_evaluation(self, image, intrinsics=None):
        assert image.shape[0] == 3 and 0.0 <= image.min() and image.max() <= 1.0
        depth = self.factor + image.mean(dim=0)
        out = {"depth_metric": depth}
        if intrinsics is not None:
            assert torch.allclose(intrinsics[:2, 2], torch.tensor([0.5, 0.5]))
            out["intrinsics"] = intrinsics
        return out
"""


@pytest.mark.parametrize("told", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_wrapper_of_moges_evaluation_runs_as_it_is(told, truths, tmp_path):
    path, out = tmp_path / "wrapped.py", tmp_path / "p.h5"
    path.write_text(BASELINE)
    with opened_model(path, {"device": "cpu"}, arguments=["--factor", "2.5"]) as model:
        run_model(model, truths.rooms, out, call=Call(intrinsics=told), method="m")
    with open_predictions(out) as found, RoomsFile(truths.rooms) as rooms:
        seen = srgb_bytes(rooms[3].radiance).astype(float).mean(axis=-1) / 255.0
        np.testing.assert_allclose(found.depth(3), 2.5 + seen, rtol=1e-6)
        assert found.alignment == "scale"
        if told:
            fov = found.view(3).fov_y_degrees
            assert fov == pytest.approx(rooms[3].fov_y_degrees, abs=1e-4)


@pytest.mark.slow
def test_options_of_a_wrapper_are_checked(tmp_path):
    path = tmp_path / "wrapped.py"
    path.write_text(BASELINE)
    assert refused(path, settings={"device": "cpu"}, arguments=["--nothing"]).where
    assert refused(path, settings={"batch": 3}).where == "--batch"
    path.write_text("def infer(image): pass")
    assert "--" in refused(path, arguments=["--factor", "2.5"]).where


def test_what_goes_between_processes_needs_no_numpy_of_one_version():
    rng = np.random.default_rng(0)
    value = {"a": rng.random((3, 4)).astype(">f4"), "b": [1, None, "x", np.zeros((), bool)]}
    back = model_runner.loads(model_runner.dumps(value))
    assert (back["a"].dtype, back["a"].flags.writeable) == (np.dtype(">f4"), True)
    np.testing.assert_array_equal(back["a"], value["a"])
    assert back["b"][:3] == [1, None, "x"]
    masked = np.ma.masked_less(np.arange(5.0), 2.0)
    again = model_runner.loads(model_runner.dumps(masked))
    assert again.mask.tolist() == masked.mask.tolist()
    assert b"numpy" not in model_runner.dumps(value)


@pytest.mark.parametrize("path", [model_runner.__file__, model_file.DOORS])
def test_what_runs_elsewhere_is_python_3_9(path):
    tree = ast.parse(Path(path).read_text(), feature_version=(3, 9))
    names = {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
    froms = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    ours = {"scenegen", "metrics", "iqtt", "baselines"}
    assert not {name.split(".")[0] for name in names | froms} & ours
    assert "__future__" in froms, "annotations are not evaluated"


def test_moge_refuses_a_camera_of_which_a_field_of_view_says_too_little():
    model = object.__new__(MoGe)
    camera = np.array([[60.0, 0, 50], [0, 60, 20], [0, 0, 1]])
    with pytest.raises(ValueError, match="principal point"):
        model.infer(np.zeros((60, 100, 3), np.uint8), camera)


MOGE = """
import sys, torch
from moge.model import import_model_class_by_version as version
torch.manual_seed(0)
def head(out):
    return {"dim_in": [8] * 5, "dim_res_blocks": [8] * 5, "dim_out": [None] * 4 + [out],
            "resamplers": ["bilinear"] * 4, "res_block_in_norm": "none",
            "res_block_hidden_norm": "none"}
neck = {**head(8), "dim_in": [18, 2, 2, 2, 2], "dim_out": [8] * 5}
encoder = {"backbone": "dinov2_vits14", "intermediate_layers": 4, "dim_out": 16}
common = {"remap_output": "exp", "num_tokens_range": [16, 64]}
v2 = {"encoder": encoder, "neck": neck, "points_head": head(3), "mask_head": head(1),
      "normal_head": head(3), "scale_head": {"dims": [384, 16, 1]}, **common}
v1 = {"encoder": "dinov2_vits14", "intermediate_layers": 4, "dim_proj": 16,
      "dim_upsample": [8, 8, 8], "res_block_norm": "layer_norm", "mask_threshold": -1.0, **common}
for name, config in ("v1", v1), ("v2", v2):
    network = version(name)(**config)
    if name == "v2":
        list(network.mask_head.parameters())[-1].data += 9.0
    torch.save({"model_config": config, "model": network.state_dict()}, sys.argv[1] + name)
"""


@pytest.mark.slow
def test_both_versions_of_moge(truths, tmp_path, monkeypatch):
    import os
    import subprocess
    import sys

    packages = ["dlr-moge==2.0.0", "dlr-utils3d==1.3", "dlr-pipeline", "opencv-python-headless"]
    target = tmp_path / "packages"
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(target)]
    subprocess.run([*pip, *packages], check=True, timeout=300)
    places = [str(target), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, places)))
    subprocess.run([sys.executable, "-c", MOGE, f"{tmp_path}/"], check=True)
    for name, key in ("v1", "points_scale_invariant"), ("v2", "points_metric"):
        out = tmp_path / f"{name}.h5"
        with opened_model(f"moge:{tmp_path / name}") as model:
            call = Call(intrinsics=True, batch=3, missing="nearest")
            said = run_model(model, truths.rooms, out, call=call, method=model.title)
        assert said == f"{key} of 8 images"
        with open_predictions(out) as found, RoomsFile(truths.rooms) as rooms:
            assert (found.kind, found.alignment) == ("points", "scale")
            assert found.has_normals == (name == "v2")
            fov = found.view(5).fov_y_degrees
            assert fov == pytest.approx(rooms[5].fov_y_degrees, abs=1e-3)
