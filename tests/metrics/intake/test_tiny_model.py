"""A real model of pictures and text, of random weights, is asked the whole way: it is at chance."""

import io
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chat_server import KEY, completion, picture_of, serving
from click.testing import CliRunner
from PIL import Image

from cli import bench
from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from metrics.scoring.evaluate import score

transformers = pytest.importorskip("transformers")
SIDE, PATCH, BYTES = 64, 16, 256  # text is bytes, so that no tokeniser is needed


def tiny_model() -> Any:
    import torch

    torch.manual_seed(0)
    sizes = {"hidden_size": 32, "intermediate_size": 64, "num_hidden_layers": 2,
             "num_attention_heads": 2}  # fmt: skip
    config = transformers.LlavaConfig(
        vision_config=transformers.CLIPVisionConfig(**sizes, image_size=SIDE, patch_size=PATCH),
        text_config=transformers.LlamaConfig(**sizes, vocab_size=BYTES + 1),
        image_token_index=BYTES,
        vision_feature_layer=-1,
    )
    return transformers.LlavaForConditionalGeneration(config).eval()


def letter(model: Any, png: bytes, text: str) -> str:
    """Return the likeliest letter after a picture and a text."""
    import torch

    picture = Image.open(io.BytesIO(png)).resize((SIDE, SIDE))
    pixels = torch.from_numpy(np.array(picture, np.float32)).permute(2, 0, 1)[None] / 127.5 - 1
    tokens = torch.tensor([[BYTES] * (SIDE // PATCH) ** 2 + list(text[-200:].encode())])
    with torch.no_grad():
        scores = model(input_ids=tokens, pixel_values=pixels).logits[0, -1]
    return max("ABC", key=lambda name: float(scores[ord(name)]))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of transformers
def test_a_model_of_random_weights_is_at_chance(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = SplitSpec(
        seed=2, train=0, labeled=0, val=30, test=0, cubes=(6, 7), height=32, width=32,
        distractors="mirror-pair", min_cube_pixels=2,
    )  # fmt: skip
    make_split(tmp_path / "split", spec, command="tests")
    file, model, lock = tmp_path / "split" / "iqtt-val.h5", tiny_model(), threading.Lock()

    def reply(body: dict[str, Any], _: int) -> tuple[int, bytes]:
        with lock:
            text = body["messages"][0]["content"][-1]["text"]
            return completion(letter(model, picture_of(body), text))

    monkeypatch.setenv("TINY_KEY", KEY)
    with serving(reply) as (server, _):
        done = CliRunner().invoke(
            bench,
            ["ask", str(file), "--model", "openai:tiny", "--base-url", server.base_url,
             "--key-from", "TINY_KEY", "--size", "64", "--log", str(tmp_path / "log.jsonl"),
             "--out", str(tmp_path / "tiny.h5")],
        )  # fmt: skip
    assert done.exit_code == 0, done.output
    for path in tmp_path.glob("*.*"):
        assert KEY.encode() not in path.read_bytes()
    accuracy = score([tmp_path / "tiny.h5"], file).metrics["iqtt_accuracy"]
    assert accuracy.n == 30
    assert accuracy.low < 1 / 3 < accuracy.high
