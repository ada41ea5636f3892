"""Features of a bundled network, frozen, for `bench baseline features`.

    python -m benchmarks.experiments.frozen_features --data iqtt-test.h5 --network depth-match \
        --out test.npy

`pix2shape-views` gives its z_scene; `depth-match` the means of its coarsest maps. Of a training
file it takes the labelled questions.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from baselines.depth_match.answers import FILES
from baselines.depth_match.network import METHOD, channels
from baselines.outline import open_labelled
from baselines.pix2shape.weights import open_weights
from baselines.training.checkpoint import load_weights
from baselines.training.images import channels_first
from scenegen.rendering.ground_truth import decode_image

Encoder = Callable[[Tensor], Tensor]  # linear radiance (B, 3, S, S) to features (B, D)


def views() -> tuple[Encoder, int]:
    """Return the encoder of `pix2shape-views` and its image size."""
    model, _ = open_weights("iqtt")
    spec = model.config.networks
    return lambda x: model.codes(x, x.new_empty(len(x), 0))[:, : spec.z_scene], spec.size


def depth() -> tuple[Encoder, int]:
    """Return the encoder of `depth-match` and its image size."""
    network, card = load_weights(FILES / "depth-match.safetensors", METHOD)
    coarsest: list[Tensor] = []
    network.down[-1].register_forward_hook(lambda _, __, maps: coarsest.append(maps))

    def encode(radiance: Tensor) -> Tensor:
        network.relief(channels(radiance.clamp(min=0).sqrt()))
        return coarsest.pop().mean(dim=(2, 3))

    return encode, card.settings.size


NETWORKS = {"pix2shape-views": views, "depth-match": depth}


def main() -> None:
    """Read the options and write the features, (Q, 1 + K, D) float32."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--network", choices=NETWORKS, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    encode, size = NETWORKS[options.network]()
    features = []
    with open_labelled(options.data) as file, torch.inference_mode():
        for row in tqdm(range(len(file))):
            pictures = decode_image(file.read("questions", row))
            small = np.stack([channels_first(picture, size) for picture in pictures])
            features.append(encode(torch.from_numpy(small).float()).numpy())
    np.save(options.out, np.array(features, np.float32))


if __name__ == "__main__":
    main()
