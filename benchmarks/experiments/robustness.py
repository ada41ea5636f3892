"""How robust explicit 3D is: `cubes` and `depth-match` on pictures that are disturbed in one way,
or drawn by a path tracer.

    iqtt make-split --distractors mirror-pair --train 0 --labeled 0 --val 0 --test 50 --seed 9101 \
        --out pairs
    python -m benchmarks.experiments.robustness --data pairs/iqtt-test.h5 --count 50

It prints the accuracy of each method on the first questions with a Wilson interval, as Markdown.
"""

import argparse
import io
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage, stats
from tqdm import tqdm

from baselines.cubes.answer import answer_scores
from baselines.depth_match.answers import FILES, least_denials
from baselines.depth_match.network import METHOD, seen_depth
from baselines.training.checkpoint import load_weights
from baselines.training.images import channels_first
from benchmarks.markdown import table
from iqtt import QuestionsFile, SplitSpec, open_questions
from iqtt.files.reader import answers_beside
from iqtt.questions.packing import pack_questions
from iqtt.vlm.pictures import stored_question
from scenegen.rendering.ground_truth import decode_image
from scenegen.rendering.renderer import launch_fields

Array = NDArray[Any]
Disturb = Callable[[Array, np.random.Generator], Array]  # a picture (H, W, 3) uint8 to another
Pictures = Callable[[QuestionsFile, int], Array]  # of a row: (1 + K, H, W, 3) uint8
RAYS = 64  # of a pixel that is path-traced


def noise(level: float) -> Disturb:
    """Return Gaussian noise of this standard deviation, of 255."""
    return lambda picture, rng: _rounded(picture + rng.normal(0, level, picture.shape))


def blur(sigma: float) -> Disturb:
    """Return a Gaussian blur of this standard deviation, pixels."""
    return lambda picture, _: _rounded(
        ndimage.gaussian_filter(picture.astype(float), (sigma, sigma, 0))
    )


def jpeg(quality: int) -> Disturb:
    """Return compression to JPEG and back."""

    def disturb(picture: Array, _: np.random.Generator) -> Array:
        file = io.BytesIO()
        Image.fromarray(picture).save(file, "JPEG", quality=quality)
        return np.asarray(Image.open(file))

    return disturb


def halved(picture: Array, _: np.random.Generator) -> Array:
    """Return a picture of half the width and height."""
    height, width = picture.shape[:2]
    return _rounded(picture.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3)))


def _rounded(values: Array) -> Array:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def disturbed(disturb: Disturb) -> Pictures:
    """Return a way to read a question's pictures, each disturbed."""

    def pictures(file: QuestionsFile, row: int) -> Array:
        rng = np.random.default_rng(row)
        return np.stack([disturb(picture, rng) for picture in file.read("questions", row)])

    return pictures


def path_traced(file: QuestionsFile, row: int) -> Array:
    """Return a question's pictures with shadows and light that bounces, `RAYS` a pixel."""
    spec, truth = file.spec, file.truth(row)
    assert spec is not None, "files of ours have settings"
    assert truth is not None, "answers hold the truth"
    batch = pack_questions(spec, [stored_question(spec, truth)])
    traced = replace(batch, spec=replace(batch.spec, shading="path", spp=RAYS))
    return np.asarray(launch_fields(traced, ("image",))()["image"])


WAYS: Mapping[str, Pictures] = {
    "as made": disturbed(lambda picture, _: picture),
    "noise of 1 of 255": disturbed(noise(1)), "noise of 4 of 255": disturbed(noise(4)),
    "blur of 0.5 pixels": disturbed(blur(0.5)), "blur of 1 pixel": disturbed(blur(1)),
    "JPEG, quality 95": disturbed(jpeg(95)), "JPEG, quality 75": disturbed(jpeg(75)),
    "half the size": disturbed(halved),
    "path-traced": path_traced,
}  # fmt: skip


def by_cubes(pictures: Array, spec: SplitSpec, row: int) -> int:
    """Return the answer of `cubes` to pictures, (1 + K, H, W, 3) uint8, as the command does."""
    return int(answer_scores(pictures, spec, row).argmax())


def by_depth(pictures: Array, spec: SplitSpec, _: int) -> int:
    """Return the answer of `depth-match`."""
    network, card = _depth_match()
    images = [channels_first(decode_image(one), card.settings.size) for one in pictures]
    with torch.inference_mode():
        depth = seen_depth(network, torch.from_numpy(np.stack(images)))
        return int(least_denials(depth, spec.fov_y_degrees).argmin())


@cache
def _depth_match() -> tuple[Any, Any]:
    return load_weights(FILES / "depth-match.safetensors", METHOD)


METHODS = {"`cubes`": by_cubes, "`depth-match`": by_depth}


def accuracies(pictures: Pictures, file: QuestionsFile, count: int) -> list[str]:
    """Return each method's share of right answers with its 95% Wilson interval."""
    assert file.spec is not None, "files of ours have settings"
    right = np.zeros(len(METHODS), int)
    for row in range(count):
        seen, answer = pictures(file, row), int(file.read("answers", row))
        right += [method(seen, file.spec, row) == answer for method in METHODS.values()]
    cells = []
    for n in right.tolist():
        low, high = stats.binomtest(n, count).proportion_ci(method="wilson")
        cells.append(f"{n / count:.2f} [{low:.2f}, {high:.2f}]")
    return cells


def main() -> None:
    """Read the options and print a row for each way to disturb."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--ways", nargs="+", default=list(WAYS), choices=WAYS)
    options = parser.parse_args()
    with open_questions(options.data, answers=answers_beside(options.data)) as file:
        count = min(options.count, len(file))
        lines = [[way, *accuracies(WAYS[way], file, count)] for way in tqdm(options.ways)]
    print(table(["pictures", *METHODS], lines))


if __name__ == "__main__":
    main()
