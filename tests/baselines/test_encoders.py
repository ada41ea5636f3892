"""Layers of an encoder answer questions by the nearest features."""

import numpy as np
import pytest
from click.testing import CliRunner

from cli import bench
from metrics.score_file import read_scores
from metrics.submissions.reader import open_predictions
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.preview import srgb_bytes

torch = pytest.importorskip("torch")
transformers = pytest.importorskip("transformers")


def test_every_layer_answers_and_is_scored(tmp_path):
    from iqtt.files.make import make_split
    from iqtt.files.reader import open_questions
    from iqtt.questions.specs import SplitSpec

    torch.manual_seed(0)
    config = transformers.ResNetConfig(
        embedding_size=4, hidden_sizes=[4, 6], depths=[1, 1], layer_type="basic"
    )
    network = transformers.ResNetModel(config).eval()
    network.save_pretrained(tmp_path / "encoder")
    plain = {"do_resize": False, "do_center_crop": False, "do_normalize": False}
    transformers.BitImageProcessorPil(**plain).save_pretrained(tmp_path / "encoder")
    split, out = tmp_path / "split", tmp_path / "out"
    parts = {"train": 3, "labeled": 0, "val": 3, "test": 6, "distractors": "mixed"}
    spec = SplitSpec(height=32, width=32, min_cube_pixels=2, **parts)
    make_split(split, spec, command="tests")
    words = ["probe", f"hf:{tmp_path / 'encoder'}", "--data", str(split), "--out", str(out)]
    result = CliRunner().invoke(bench, [*words, "--batch", "2"])
    assert result.exit_code == 0, result.output
    layers = sorted(out.glob("*.h5"))
    assert [path.name for path in layers] == [f"layer-{i:02d}.h5" for i in range(3)]
    assert (out / "layers.png").stat().st_size > 5000
    with open_questions(split / "iqtt-test.h5") as questions:
        pictures = srgb_bytes(decode_image(questions.read("questions", slice(None))))
    count, shown = pictures.shape[:2]
    pixels = torch.from_numpy(pictures.reshape(-1, *pictures.shape[2:])).permute(0, 3, 1, 2) / 255
    with torch.inference_mode():
        told = network(pixels, output_hidden_states=True).hidden_states
    for path, layer in zip(layers, told, strict=True):
        features = layer.mean(dim=(2, 3)).double().numpy().reshape(count, shown, -1)
        features /= np.linalg.norm(features, axis=2, keepdims=True)
        expected = (features[:, :1] * features[:, 1:]).sum(axis=2).argmax(axis=1)
        with open_predictions(path) as found:
            np.testing.assert_array_equal(found.answers, expected)
        scores = read_scores(path.with_suffix(".json"))
        assert len(scores.ids) == count
    again = CliRunner().invoke(bench, words)
    assert again.exit_code == 2, "a folder that is there stays as it is"
