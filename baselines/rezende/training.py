"""Training: a variational autoencoder whose pictures come from a renderer that is only sampled.

Each iteration i takes a batch of images x and one step down this estimate of the negative evidence
bound, all random choices of which derive from (seed, i):

    E_z E_v |x - render(v)|^2 / (2 noise^2)  +  |decoder(z)|^2 / (2 spread^2)
    +  KL(q(z | x) || N(0, 1)),
    with z ~ q(z | x) and offsets of vertices v ~ N(decoder(z), width^2)

The second term keeps at the sphere what no image shows, the far side.

The first term is behind a renderer that has no gradients. So the decoder's output is taken as the
mean of a Gaussian of fixed width over meshes, and the expected loss is differentiated (REINFORCE:
Williams, Machine Learning 8, 1992), with antithetic pairs of samples: `sampled_gradient`. From
there the gradient goes to decoder and encoder by the chain rule, as z is reparametrised.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import repeat
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional
from torch.optim import AdamW

from baselines.rezende.answers import answers_of
from baselines.rezende.network import METHOD, Card, Head, Model, Settings, codes_of, divergence
from baselines.rezende.rasteriser import Views, project, rasterise
from baselines.training.baseline import Baseline, Lesson, Run
from baselines.training.checkpoint import State, load_weights
from baselines.training.data import only
from baselines.training.fit import Loss
from baselines.training.images import Array, check_reducible
from baselines.training.questions import (
    LABELED,
    UNLABELED,
    check_labels,
    check_truth,
    each_question,
    question_images,
    question_lights,
    training_answers,
)
from iqtt import QuestionsFile
from scenegen.common.random.seeding import Purpose, item_rng, item_seed
from scenegen.common.records import check

MOST_QUESTIONS = 5_000  # that are read; their 20,000 small images take 250 MB
WINDOW = 0.16  # half the side of the window of pixels around a vertex, as a share of the picture
LARGEST_SLOPE = 1000.0  # norm of all gradients
# Of the head.
STEPS, LEARNING_RATE, WEIGHT_DECAY = 300, 0.002, 0.3


@dataclass(frozen=True, eq=False)
class Pictures:
    """N images of one object each, in memory.

    Attributes:
        image: linear radiance, (N, 3, S, S) float32.
        radius: of the sphere that the mesh starts from, in the unit of `views`.
        views: camera and shading of the images, with their N rows of lights.
        fingerprint: of the data, so that a run goes on with the data that it began with.
    """

    image: Array
    radius: float
    views: Views
    fingerprint: str

    def __len__(self) -> int:
        return len(self.image)

    def views_of(self, rows: Array) -> Views:
        """Return the camera and the lights of some images."""
        position, color = self.views.light_position[rows], self.views.light_color[rows]
        return replace(self.views, light_position=position, light_color=color)


def read_question_pictures(questions: QuestionsFile, size: int) -> Pictures:
    """Read the images of a file's first questions, at most MOST_QUESTIONS, four after four.

    As in the Pix2Shape paper, lights, cameras, reflectance and background are told; shapes,
    rotations and answers are not read. The mesh starts from half the sphere that the camera frames.
    Lengths are scaled so that every question has the same distance of the camera, which changes no
    image.

    Raises FileFormatError; SpecError where the file tells no lights, or its images cannot be
    reduced to `size` x `size`.
    """
    check_truth(questions)
    check_reducible(questions.path, questions.height, questions.width, size)
    spec, count = questions.cube_spec, min(len(questions), MOST_QUESTIONS)
    assert spec is not None, "check_truth asks for it"
    images = [image for row in range(count) for image in question_images(questions, row, size)]
    position, color = question_lights(questions, count)
    rows = len(images), position.shape[2], 3
    views = Views(
        size=size,
        fov_y_degrees=spec.fov_y_degrees,
        distance=spec.camera_distance,
        reflectance=np.array(spec.reflectance),
        ambient=np.array(spec.ambient),
        background=np.array(spec.background),
        attenuation=(0.0, 1.0),
        light_position=position.reshape(rows),
        light_color=color.reshape(rows),
    )
    return Pictures(np.stack(images), 0.5 * spec.max_radius, views, str(questions.fingerprint))


def sampled_gradient(
    loss: Callable[[Tensor], Tensor],
    mean: Tensor,
    width: float,
    pairs: int,
    generator: torch.Generator,
) -> Tensor:
    """Return an unbiased estimate of d E[loss(x)] / d mean, x ~ N(mean, width^2), like `mean`.

    The score of a Gaussian is eps / width, where x = mean + width eps. Samples come in pairs of
    eps and -eps, each the baseline of the other:

        gradient = sum_k eps_k (loss_k+ - loss_k-) / (2 width pairs)
        loss_k+ = loss(mean + width eps_k),  loss_k- = loss(mean - width eps_k)

    It is exact in expectation for the smoothed loss, and for a quadratic loss equals the gradient
    of the loss itself. Where an element of x can only change a part of the loss, the rest of the
    loss is noise to it; then `loss` may return to each element its own part.

    Args:
        loss: (M, B, ...) -> (M, B), or (M, B, V) with a part for each of the elements that follow
            B; called once, and no gradient is asked of it.
        mean: (B, ...); gradients of it are not followed.
        pairs: number of antithetic pairs for each of the B.
    """
    with torch.no_grad():
        noise = torch.randn((pairs, *mean.shape), generator=generator)
        steps = width * torch.cat([noise, -noise])
        losses = loss(mean.detach() + steps)
        difference = (losses[:pairs] - losses[pairs:]) / (2 * width)
        weights = difference.view(*difference.shape, *(1,) * (noise.dim() - difference.dim()))
        return (weights * noise).mean(dim=0)


def with_gradient(value: Tensor, gradient: Tensor) -> Tensor:
    """Return a number whose gradient with respect to `value` is `gradient`."""
    return (value * gradient.detach()).sum()


def lesson(run: Run, *, labels: int = 0, start: str | None = None) -> Lesson:
    """Return what a run learns: the images of the unlabelled questions of a file, then the head.

    The renderer is in numpy, so training is on the CPU.

    Args:
        labels: how many of the labelled questions' answers the head is trained on, the first ones.
        start: weights of an earlier run, whose encoder and decoder are kept as they are; only the
            head is trained. So runs with different labels can share them.
    """
    new = run.earlier is None
    check(start is None or new, "start", start, "none, because --resume continues a run")
    labelled = only(run.data.questions(LABELED), run.method)
    model, card = None, Card(run.method, run.settings, labels=labels if new else run.earlier.labels)
    if start is not None:
        model, card = load_weights(start, METHOD)
        card = replace(card, labels=labels)
    check_labels(labelled, card.labels)  # before hours of training
    check_reducible(run.data.where, labelled.height, labelled.width, card.settings.size)
    pictures = None
    if model is None:
        unlabelled = only(run.data.questions(UNLABELED), run.method)
        pictures = read_question_pictures(unlabelled, card.settings.size)
        card = replace(card, fingerprint=pictures.fingerprint)
    finish = partial(_with_head, labelled)
    return Lesson(
        card, lambda _: repeat(pictures), loss_of, clip=LARGEST_SLOPE, network=model, finish=finish
    )


def loss_of(state: State[Card, Model], pictures: Pictures, number: int) -> Loss:
    """Return what an iteration minimises, of pictures in memory."""
    return bound(state.network, pictures, state.card.settings, number)


def _with_head(labelled: QuestionsFile, model: Model, card: Card) -> Card:
    """Train the head of a model on the first answers; return the card as it is."""
    size, labels = card.settings.size, card.labels
    if labels:
        codes = each_question(labelled, size, lambda images: codes_of(model, images), 1, labels)
        train_head(model, codes, training_answers(labelled, labels), card.settings.seed)
    return card


def train_head(model: Model, codes: Tensor, right: Tensor, seed: int) -> list[float]:
    """Train the model's head on labelled questions, all in each step; return the losses.

    Args:
        codes: of the questions, (Q, 1 + A, code).
        right: which answer is right, (Q,).
    """
    flat = codes.flatten(0, 1)
    losses = []
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(item_seed(seed, 1, Purpose.WEIGHTS))
        model.head = head = Head(codes.shape[2])
    head.shift.copy_(flat.mean(dim=0))
    head.scale.copy_(flat.std(dim=0, correction=0).clamp(min=1e-4))
    optimiser = AdamW(head.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    for _ in range(STEPS):
        loss = functional.cross_entropy(head(codes), right)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        losses.append(float(loss.detach()))
    return losses


def bound(model: Model, pictures: Pictures, settings: Settings, number: int) -> Loss:
    """Return what iteration `number` minimises; its numbers are two terms of an image, in nats."""
    rows = item_rng(settings.seed, number, Purpose.TRAINING).integers(
        len(pictures), size=settings.batch
    )
    generator = torch.Generator().manual_seed(item_seed(settings.seed, number, Purpose.TRAINING))
    image = torch.from_numpy(pictures.image[rows])
    mean, log_variance = model.encode(image)
    drawn = torch.randn(mean.shape, generator=generator)
    offsets = model.offsets(mean + drawn * (log_variance / 2).exp())

    def misfit(samples: Tensor) -> Tensor:
        squared = pixel_errors(model, samples, pictures, rows)
        totals.append(squared.sum(axis=(2, 3)).mean() * likelihood)
        return torch.from_numpy(near_vertices(squared, around)) * likelihood

    likelihood, totals = 1 / (2 * settings.noise**2), list[float]()
    around = windows(model, offsets, pictures)
    gradient = sampled_gradient(misfit, offsets, settings.width, settings.pairs, generator)
    nats = divergence(mean, log_variance)
    prior = (offsets**2).sum() / (2 * settings.spread**2)
    loss = (with_gradient(offsets, gradient) + prior + nats.sum()) / settings.batch
    return Loss(loss, {"misfit": torch.tensor(float(totals[0])), "divergence": nats.mean()})


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
    windows, so they bias the gradient a little. A vertex on the far side, none of whose triangles
    faces the camera, changes no pixel: its window is empty.
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


BASELINE = Baseline(
    METHOD,
    Settings,
    Path(__file__).with_name("files"),
    lesson,
    options=("labels", "start"),
    answers=answers_of,
    cpu_only=True,
)
