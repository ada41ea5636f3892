"""A training run and its folder: checkpoint, TensorBoard logs, a picture, and the weights."""

from collections.abc import Collection, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image
from torch.utils.data import DataLoader
from torch.utils.tensorboard import SummaryWriter

from baselines.pix2shape.images import RoomImages
from baselines.pix2shape.matching import matched_rows, relief_of_rows
from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.pictures import training_sheet
from baselines.pix2shape.training.batches import Sources, readers_kept
from baselines.pix2shape.training.beginnings import ModelState, new_run, resumed_run
from baselines.pix2shape.training.steps import Iterations, check_request
from baselines.pix2shape.weights import METHOD
from baselines.training.checkpoint import CHECKPOINT, WEIGHTS, alone_in, check_new
from baselines.training.data import TrainingFiles
from baselines.training.fit import Progress, falling_late, fit
from baselines.training.machine import Machine, chosen_device
from baselines.training.rooms import read_rooms
from scenegen.files.images.pictures import save_picture
from scenegen.files.new_file import check_writable

PICTURE, LOGS = "pictures.png", "logs"
LOG_EVERY = 20  # iterations
PRIOR_ITEMS, BATCH = 2048, 64  # items that the prior is fitted to, and batch size for that


def train_run(
    folder: str | Path,
    data: TrainingFiles,
    config: ModelConfig | None,
    machine: Machine,
    *,
    labels: int = 0,
    conditional: bool = False,
    start: str | Path | None = None,
    precision: str | None = None,
    chosen: Collection[str] = (),
    progress: Progress = lambda done, total, losses: None,
) -> Path:
    """Train a model, from the start or from the folder's checkpoint.

    Returns the path of the weights.

    Args:
        config: None goes on from the checkpoint, with its labels, classes and precision.
        labels: number of answers that training on questions may use.
        conditional: whether the networks are told the class of a room's only object.
        start: weights of an earlier run with the same networks, to begin a new run from.
        precision: of the networks, "32" or "bf16"; None for 32, or for that of the checkpoint.
        chosen: names of settings, such as "networks.size", that somebody asked for. Others are
            changed where the data need it: rooms ask no questions, for example.

    Raises SpecError where configuration and data do not fit; FileExistsError where a new run finds
    a checkpoint or weights; SceneGenError where another run trains in the folder; TrainingError;
    FileFormatError, OSError.
    """
    folder, device = Path(folder), chosen_device(machine.device)
    with alone_in(folder), readers_kept():
        for name in (CHECKPOINT, PICTURE, WEIGHTS):
            check_writable(folder / name, overwrite=True)
        if config is None:
            state, sources = resumed_run(folder, data, precision)
        else:
            check_new(folder)
            how: dict[str, Any] = {"labels": labels, "conditional": conditional, "start": start}
            state, sources = new_run(
                data, config, precision=precision or "32", chosen=chosen, **how
            )
        model, settings, began = state.network, state.card.settings, state.card.iteration
        check_request(model, sources)
        if isinstance(sources.images, RoomImages) and settings.matching:
            _match(sources.images, folder, state, progress)
        state.to(device)
        half = state.card.precision == "bf16"
        autocast = partial(torch.autocast, device.type, torch.bfloat16, enabled=half)
        iterations = Iterations(model, sources, began, machine.workers, autocast)
        with SummaryWriter(str(folder / LOGS), purge_step=began + 1) as logs:

            def show(done: int, total: int, losses: Mapping[str, float]) -> None:
                if done % LOG_EVERY == 0 or done == total:
                    for name, value in losses.items():
                        logs.add_scalar(name, value, done)
                if done % machine.every == 0 or done == total:
                    picture = _picture(state, iterations)
                    save_picture(picture, folder / PICTURE, overwrite=True)
                    logs.add_image("pictures", np.asarray(picture), done, dataformats="HWC")
                progress(done, total, losses)  # which may fail, as where its output is closed

            fit(
                folder, METHOD, state, iterations, learning_rate, machine,
                prepare=lambda: settings.adversarial or fit_prior(model, sources),
                progress=show,
            )  # fmt: skip
    return folder / WEIGHTS


def learning_rate(config: ModelConfig, iteration: int) -> float:
    """Return the learning rate of an iteration, counted from 0."""
    return falling_late(config, iteration) if config.decay else config.learning_rate


def _match(source: RoomImages, folder: Path, state: ModelState, progress: Progress) -> None:
    """Let training learn from relief that is found by matching, or read from the run's folder.

    Raises SpecError, before the search, where the views of the rooms do not suit.
    """
    card = state.card
    rooms = read_rooms([source.opened.file], card.settings.networks.size)
    source.pick_views(matched_rows(rooms).numpy())

    def show(done: int, total: int) -> None:
        share = {"share of images matched": done / total}
        progress(card.iteration, card.settings.iterations, share)

    source.learn_from(relief_of_rows(rooms, folder, show).numpy())


@torch.no_grad()
def fit_prior(model: Pix2Shape, sources: Sources) -> None:
    """Fit the prior to the codes of the first images, as no critic ties codes to it."""
    source, device = sources.images, next(model.parameters()).device
    loader = DataLoader(source, batch_size=BATCH, sampler=range(min(len(source), PRIOR_ITEMS)))
    learning = model.training
    model.eval()
    codes, conditions = [], []
    for items in loader:
        batch = source.as_batch(items).to(device)
        codes.append(model.encode(batch.image, batch.views))
        conditions.append(batch.views.condition)
    model.prior.fit(torch.cat(codes), torch.cat(conditions))
    model.train(learning)


def _picture(state: ModelState, iterations: Iterations) -> Image.Image:
    batch, numbers = iterations.batch, torch.Generator().manual_seed(0)
    noise = torch.randn(len(batch.image), state.card.settings.networks.z, generator=numbers)
    return training_sheet(state.network, batch, noise.to(batch.image.device))
