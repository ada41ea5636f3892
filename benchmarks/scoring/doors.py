"""Seconds of `bench run hf:FOLDER` beside a bare loop over the same network.

    python -m benchmarks.scoring.doors [--images 24] [--size 512] [--batch 8] [--rounds 3]

The network has the form of Depth Anything V2 Small and random weights. Times begin when it is
loaded. The loop keeps its predictions in memory; `bench run` checks and writes them. Goal: 5%.
"""

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from metrics.intake.doors import load
from metrics.intake.model_file import opened_model
from metrics.intake.running import Call, run_model
from scenegen.description.presets import preset_spec
from scenegen.rooms.make import make_dataset
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import RoomsFile


def save_network(folder: Path) -> None:
    """Write a network and its image processor as `from_pretrained` takes them."""
    import torch
    import transformers

    torch.manual_seed(0)
    backbone = transformers.Dinov2Config(
        hidden_size=384, num_hidden_layers=12, num_attention_heads=6, image_size=518,
        patch_size=14, out_features=["stage3", "stage6", "stage9", "stage12"],
        reshape_hidden_states=False,
    )  # fmt: skip
    settings = transformers.DepthAnythingConfig(
        backbone_config=backbone, reassemble_hidden_size=384,
        neck_hidden_sizes=[48, 96, 192, 384], fusion_hidden_size=64, head_hidden_size=32,
    )  # fmt: skip
    transformers.DepthAnythingForDepthEstimation(settings).save_pretrained(folder)
    processor: Any = transformers.DPTImageProcessor(
        size={"height": 518, "width": 518}, ensure_multiple_of=14, keep_aspect_ratio=True
    )
    processor.save_pretrained(folder)


def bare_loop(network: Any, path: Path, batch: int) -> float:
    """Return the seconds of reading images, predicting them in batches and keeping the results."""
    start, kept = time.perf_counter(), []
    with RoomsFile(path) as rooms:
        for first in range(0, len(rooms), batch):
            rows = range(first, min(first + batch, len(rooms)))
            images = np.stack([srgb_bytes(rooms[row].radiance) for row in rows])
            kept += [next(iter(one.values())).numpy() for one in network.infer_batch(images)]
    return time.perf_counter() - start


def main() -> None:
    """Print one line for each round, and the ratio of the medians."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scoring.doors", description=__doc__)
    parser.add_argument("--images", type=int, default=24)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    os.environ["HF_HUB_OFFLINE"] = "1"
    with tempfile.TemporaryDirectory(prefix="bench-") as name:
        folder = Path(name)
        save_network(folder / "network")
        spec = preset_spec("shapes", height=options.size, width=options.size)
        make_dataset(folder / "rooms.h5", spec, options.images)
        door = f"hf:{folder / 'network'}"
        network, loops, runs = load(door), list[float](), list[float]()
        with opened_model(door, {"batch": options.batch}) as model:
            for number in range(options.rounds):
                loops.append(bare_loop(network, folder / "rooms.h5", options.batch))
                out, start = folder / f"{number}.h5", time.perf_counter()
                call = Call(batch=options.batch)
                run_model(model, folder / "rooms.h5", out, call=call, method="m")
                runs.append(time.perf_counter() - start)
                print(f"loop {loops[-1]:7.2f} s   bench run {runs[-1]:7.2f} s", flush=True)
    ratio = statistics.median(runs) / statistics.median(loops)
    print(f"{options.images} images of {options.size} pixels: bench run / loop {ratio:.3f}")


if __name__ == "__main__":
    main()
