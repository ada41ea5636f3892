"""How well the angle between two views is read from z_view.

    python -m benchmarks.experiments.pose --help

A code has numbers for the scene and numbers for the view. If the split means what its name says,
the angle between the views of a question's reference and right answer, which show one shape, can
be read from their z_view and not from their z_scene. Both are asked by ridge regression on both
codes, their differences and their products, fitted on four fifths of the questions and tested on
the fifth, in turn. Shapes have frames of their own at random, so that only relative angles mean
anything.
"""

from pathlib import Path
from typing import Any

import click
import h5py
import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import spearmanr
from sklearn.linear_model import RidgeCV
from sklearn.model_selection import cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from baselines.pix2shape.weights import open_weights
from baselines.training.images import channels_first
from benchmarks.markdown import table
from iqtt.files.reader import open_questions
from scenegen.rendering.ground_truth import decode_image

Array = NDArray[Any]
STRENGTHS = np.logspace(0, 5, 11)  # of the ridge; one is chosen within each training part


@click.command()
@click.option("--weights", default="iqtt", show_default=True, help="Weights of a question model.")
@click.option("--data", type=click.Path(path_type=Path), required=True, help="iqtt-test.h5")
def main(weights: str, data: Path) -> None:
    """Print how far angles are off, in degrees, and how they correlate."""
    torch.set_num_threads(1)
    first, second, angles = codes(weights, data)
    spec = open_weights(weights)[0].config.networks
    parts = {"`z_view`": slice(spec.z_scene, None), "`z_scene`": slice(None, spec.z_scene)}
    guess = np.abs(angles - np.median(angles)).mean()
    rows = [["nothing: the median angle", "0", f"{guess:.1f}", "-"]]
    for name, part in parts.items():
        said = read_angles(first[:, part], second[:, part], angles)
        off, rank = np.abs(said - angles).mean(), spearmanr(said, angles).statistic
        rows.append([name, str(first[:, part].shape[1]), f"{off:.1f}", f"{rank:.3f}"])
    print(table(["read from", "numbers", "mean error, degrees", "rank correlation"], rows))


@torch.inference_mode()
def codes(weights: str, data: Path) -> tuple[Array, Array, Array]:
    """Return the codes of reference and right answer, (Q, z) each, and angles in degrees, (Q,).

    The answers file lies beside `data`.
    """
    model, _ = open_weights(weights)
    size, found = model.config.networks.size, []
    with h5py.File(data.with_name(f"{data.stem}-answers.h5")) as truth:
        right, angles = truth["answers"][:], truth["truth/angle_degrees"][:]
    with open_questions(data) as questions:
        for row, answer in enumerate(right):
            images = decode_image(questions.read("questions", row))[[0, 1 + int(answer)]]
            both = torch.from_numpy(np.stack([channels_first(one, size) for one in images]))
            found.append(model.codes(both, both.new_empty(2, 0)).numpy())
    pairs = np.stack(found)
    return pairs[:, 0], pairs[:, 1], angles


def read_angles(first: Array, second: Array, angles: Array) -> Array:
    """Return angles read from pairs of codes, (Q, n) each, by five-fold cross-validation."""
    told = np.hstack([first, second, np.abs(first - second), first * second])
    ridge = make_pipeline(StandardScaler(), RidgeCV(STRENGTHS))
    return cross_val_predict(ridge, told, angles, cv=5)


if __name__ == "__main__":
    main()
