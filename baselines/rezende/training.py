"""Training: a variational autoencoder whose pictures come from a renderer that is only sampled.

Each iteration i takes a batch of images x and one step down this estimate of the negative evidence
bound, all random choices of which derive from (seed, i):

    E_z E_v |x - render(v)|^2 / (2 noise^2)  +  |decoder(z)|^2 / (2 spread^2)
    +  KL(q(z | x) || N(0, 1)),
    with z ~ q(z | x) and offsets of vertices v ~ N(decoder(z), width^2)

The second term keeps at the sphere what no image shows, the far side.

The gradient of the first term with respect to decoder(z) is sampled by
`estimator.sampled_gradient`. From there it goes to decoder and encoder by the chain rule, as z is
reparametrised.
"""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines import checkpoints
from baselines.rezende.card import RECIPE, Card, State
from baselines.rezende.estimator import sampled_gradient, with_gradient
from baselines.rezende.head import train_head
from baselines.rezende.images import Array, Pictures, labelled_answers, read_question_pictures
from baselines.rezende.network import Model, divergence
from baselines.rezende.rasteriser import project, rasterise
from iqtt.files.reader import parts
from scenegen.common.errors import SceneGenError
from scenegen.common.random.seeding import Purpose, item_rng, item_seed
from scenegen.common.records import check, from_json

WINDOW = 0.16  # half the side of the window of pixels around a vertex, as a share of the picture
EVERY = 200  # iterations between checkpoints
Progress = Callable[[int, int, Mapping[str, float]], Any]


@checkpoints.one_at_a_time
def train(
    data: str | Path,
    run_folder: str | Path,
    *,
    labels: int = 0,
    seed: int = 0,
    iterations: int = Card.iterations,
    size: int = Card.size,
    code: int = Card.code,
    batch: int = Card.batch,
    pairs: int = Card.pairs,
    width: float = Card.width,
    noise: float = Card.noise,
    spread: float = Card.spread,
    learning_rate: float = Card.learning_rate,
    start: str | Path | None = None,
    resume: bool = False,
    progress: Progress = lambda done, total, numbers: None,
) -> Path:
    """Train on the images of a question file, then the head on its labels; return the weights.

    Args:
        data: a file such as iqtt-train.h5; its unlabelled questions give the images.
        run_folder: gets checkpoints, and the weights at the end.
        labels: how many of the labelled questions' answers to use, the first ones.
        start: weights of an earlier run, whose encoder and decoder are kept as they are; only the
            head is trained. So runs with different labels can share them.
        resume: whether to go on from the folder's checkpoint, with the run's own settings.
        progress: called after each iteration with its number, how many there will be, and numbers.

    The other settings are those of `Card`.

    Raises SpecError for settings or data that do not fit; FileExistsError where a new run finds a
    checkpoint; SceneGenError where a loss is not finite; OSError, FileFormatError.
    """
    given = {
        "size": size, "code": code, "iterations": iterations, "batch": batch, "pairs": pairs,
        "width": width, "noise": noise, "spread": spread, "learning_rate": learning_rate,
        "seed": seed, "labels": labels,
    }  # fmt: skip
    folder = Path(run_folder)
    if start is not None:
        check(
            isinstance(start, str | Path) and not resume, "start", start, "weights, for a new run"
        )
        checkpoints.check_new(folder)
        state = checkpoints.load_weights(start, RECIPE)
        state.card = replace(state.card, labels=labels)
    else:
        if resume:
            card = checkpoints.load_checkpoint(folder, RECIPE).card
        else:
            card = from_json(Card, json.dumps(given), "settings")
        if card.labels:
            labelled_answers(data, card.labels)  # raises before the long work, not after it
        part = "unlabeled" if len(parts(data)) > 1 else None
        pictures = read_question_pictures(data, card.size, part)
        state = train_pictures(pictures, folder, card, resume=resume, progress=progress)
    if state.card.labels:
        questions = labelled_answers(data, state.card.labels)
        train_head(state.network, *questions, state.card.size, state.card.seed)
    checkpoints.save_weights(folder / checkpoints.WEIGHTS, state)
    return folder / checkpoints.WEIGHTS


def train_pictures(
    pictures: Pictures,
    folder: Path,
    card: Card,
    *,
    resume: bool = False,
    progress: Progress = lambda done, total, numbers: None,
) -> State:
    """Train encoder and decoder on pictures. Raises as `train`.

    With `resume` the checkpoint's card counts, not `card`.
    """
    if resume:
        state = checkpoints.load_checkpoint(folder, RECIPE)
        checkpoints.check_data("data", pictures.fingerprint, state.card.fingerprint)
    else:
        checkpoints.check_new(folder)
        state = checkpoints.new_state(RECIPE, replace(card, fingerprint=pictures.fingerprint))
    folder.mkdir(parents=True, exist_ok=True)
    began = time.monotonic() - state.card.seconds
    while (number := state.card.iteration) < (last := state.card.iterations):
        numbers = _step(state, pictures, number)
        seconds = round(time.monotonic() - began, 3)
        state.card = replace(state.card, iteration=number + 1, seconds=seconds)
        if (number + 1) % EVERY == 0 or number + 1 == last:
            checkpoints.save_checkpoint(folder, state)
        progress(number + 1, last, numbers)
    return state


def _step(state: State, pictures: Pictures, number: int) -> dict[str, float]:
    """Take one step; return the bound's two terms for an image, in nats."""
    card, model = state.card, state.network
    rows = item_rng(card.seed, number, Purpose.TRAINING).integers(len(pictures), size=card.batch)
    generator = torch.Generator().manual_seed(item_seed(card.seed, number, Purpose.TRAINING))
    image = torch.from_numpy(pictures.image[rows])
    mean, log_variance = model.encode(image)
    drawn = torch.randn(mean.shape, generator=generator)
    offsets = model.offsets(mean + drawn * (log_variance / 2).exp())

    def misfit(samples: Tensor) -> Tensor:
        squared = pixel_errors(model, samples, pictures, rows)
        totals.append(squared.sum(axis=(2, 3)).mean() * likelihood)
        return torch.from_numpy(near_vertices(squared, around)) * likelihood

    likelihood, totals = 1 / (2 * card.noise**2), list[float]()
    around = windows(model, offsets, pictures)
    gradient, _ = sampled_gradient(misfit, offsets, card.width, card.pairs, generator)
    nats = divergence(mean, log_variance)
    prior = (offsets**2).sum() / (2 * card.spread**2)
    loss = (with_gradient(offsets, gradient) + prior + nats.sum()) / card.batch
    terms = {"misfit": float(totals[0]), "divergence": float(nats.mean().detach())}
    if not np.isfinite(sum(terms.values())):
        hint = "begin again with a smaller learning rate"
        raise SceneGenError(f"iteration {number}", "a loss that is not finite", hint=hint)
    for group in state.optimiser.param_groups:
        group["lr"] = card.learning_rate * min(1.0, 2 * (1 - number / card.iterations))
    state.optimiser.zero_grad()
    torch.autograd.backward(loss)
    torch.nn.utils.clip_grad_norm_(state.optimiser.param_groups[0]["params"], 1000.0)
    state.optimiser.step()
    return terms


@torch.no_grad()
def pixel_errors(model: Model, offsets: Tensor, pictures: Pictures, rows: Array) -> Array:
    """Return squared differences of rendered and true pixels, summed over RGB, (M, B, S, S).

    Args:
        offsets: (M, B, V, 3), before they are smoothed.
        rows: (B,) of the pictures.
    """
    vertices = pictures.radius * model.vertices(offsets).flatten(0, 1).numpy()
    views = pictures.views_of(np.tile(rows, len(offsets)))
    image, _ = rasterise(vertices, model.faces, views)
    wanted = np.moveaxis(pictures.image[rows], 1, 3)
    difference = image.reshape(-1, *wanted.shape) - wanted
    return np.einsum("mbhwc,mbhwc->mbhw", difference, difference)


@torch.no_grad()
def windows(model: Model, offsets: Tensor, pictures: Pictures) -> tuple[Array, ...]:
    """Return the pixels around each vertex of the mean meshes: top, bottom, left, right, (B, V).

    A vertex only changes the pixels of its triangles, and, as offsets are smoothed, those of its
    neighbours. What happens elsewhere is noise to it. Smoothing reaches a little beyond the
    windows, so they bias the gradient a little; docs/baselines.md has the figures. A vertex on the
    far side, none of whose triangles faces the camera, changes no pixel: its window is empty.
    """
    size = pictures.views.size
    vertices = pictures.radius * model.vertices(offsets.detach()).numpy()
    x, y, _ = project(vertices, pictures.views)
    (ax, bx, cx), (ay, by, cy) = (np.moveaxis(value[:, model.faces], 2, 0) for value in (x, y))
    facing = (bx - ax) * (cy - ay) < (cx - ax) * (by - ay)  # rows go down, see the rasteriser
    corner = np.zeros((len(model.faces), vertices.shape[1]), np.float32)
    corner[np.arange(len(corner))[:, None], model.faces] = 1
    half = np.where(facing @ corner > 0, WINDOW * size, -1)
    edges = (np.ceil(y - half), np.floor(y + half) + 1, np.ceil(x - half), np.floor(x + half) + 1)
    top, bottom, left, right = (np.clip(edge, 0, size).astype(np.int64) for edge in edges)
    return top, np.maximum(top, bottom), left, np.maximum(left, right)


def near_vertices(squared: Array, around: tuple[Array, ...]) -> Array:
    """Return the sums of errors, (M, B, S, S), in the window of each vertex, (M, B, V)."""
    sums = np.pad(squared, ((0, 0), (0, 0), (1, 0), (1, 0))).cumsum(axis=2).cumsum(axis=3)
    items = np.arange(squared.shape[1])[:, None]
    top, bottom, left, right = around
    total: Array = sums[:, items, bottom, right] - sums[:, items, top, right]
    total += sums[:, items, top, left] - sums[:, items, bottom, left]
    return total.astype(np.float32)
