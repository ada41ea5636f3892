"""A training run and its folder: checkpoint, TensorBoard logs, a picture, and the weights."""

from collections.abc import Callable, Collection
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from lightning_fabric import Fabric
from torch.utils.data import DataLoader

from baselines.checkpoints import CHECKPOINT, WEIGHTS, alone_in, check_new
from baselines.pix2shape.data.in_memory import read_rooms
from baselines.pix2shape.data.rooms import Batch, RoomImages
from baselines.pix2shape.matching import labels as matching
from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.network.shared_batch import summed
from baselines.pix2shape.pictures import training_sheet
from baselines.pix2shape.training.batches import Source, readers_kept
from baselines.pix2shape.training.beginnings import new_run, resumed_run
from baselines.pix2shape.training.launch import Machine, check_agreement, launched
from baselines.pix2shape.training.logs import Logs, opened_logs
from baselines.pix2shape.training.loop import check_request, require_finite, train
from baselines.pix2shape.training.state import State, save_state
from baselines.pix2shape.weights.storage import PRECISIONS, Card, load_card, save_weights
from scenegen.common.errors import FileFormatError, SceneGenError
from scenegen.files.new_file import check_writable
from scenegen.rooms.preview import save_picture

PICTURE, LOGS = "pictures.png", "logs"
LOG_EVERY = 20  # iterations
PRIOR_ITEMS, BATCH = 2048, 64  # items that the prior is fitted to, and batch size for that


def train_run(
    folder: str | Path,
    data: str | Path,
    config: ModelConfig | None,
    machine: Machine,
    *,
    labels: int = 0,
    conditional: bool = False,
    start: str | Path | None = None,
    precision: str | None = None,
    chosen: Collection[str] = (),
    progress: Callable[[State, dict[str, float]], Any] = lambda state, losses: None,
) -> Path | None:
    """Train a model, from the start or from the folder's checkpoint.

    Where several processes train, all but the first call this only to compute: the first alone
    writes and reports progress. Returns the path of the weights; None in the others.

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
    LostProcessError where another process ended; FileFormatError, OSError.
    """
    folder = Path(folder)
    if config is None:
        state, card, source, labelled = resumed_run(folder, data, precision)
    else:
        check_new(folder)
        state, card, source, labelled = new_run(
            data,
            config,
            labels=labels,
            conditional=conditional,
            start=start,
            precision=precision or PRECISIONS[0],
            chosen=chosen,
        )
    labels = card.labels
    check_request(card.config, source, labelled, labels, machine.devices * machine.nodes)
    fabric = launched(machine, card.precision)
    check_agreement(fabric, "data, settings or checkpoint", (card, state.iteration))
    first, last = fabric.is_global_zero, card.config.iterations
    with alone_in(folder) if first else nullcontext(), readers_kept():
        if first:
            _check_folder(folder, None if config is not None else card)
        if isinstance(source, RoomImages) and card.config.matching:
            _match(source, folder, card.config, fabric, lambda losses: progress(state, losses))
        opened = opened_logs(folder / LOGS, state.iteration + 1) if first else nullcontext()
        with opened as logs:
            for losses, batch in train(
                state, source, fabric, labelled=labelled, labels=labels, workers=machine.workers
            ):
                if logs is None:
                    continue
                done = state.iteration == last
                if state.iteration % LOG_EVERY == 0 or done:
                    logs.numbers(losses, state.iteration)
                if state.iteration % machine.every == 0 or done:
                    card = replace(card, iteration=state.iteration, seconds=round(state.seconds, 1))
                    _fit_prior(state, source)
                    save_state(folder, state, card)
                    _picture(folder, logs, state, batch)
                    save_weights(folder / WEIGHTS, state.model, card)
                progress(state, losses)  # which may fail, as where its output is closed
        if first and not _complete(folder / WEIGHTS, last):
            _fit_prior(state, source)
            save_weights(folder / WEIGHTS, state.model, card)
    summed(torch.zeros(1, device=fabric.device))  # wait for the first process, which writes
    return folder / WEIGHTS if first else None


def _check_folder(folder: Path, resumed: Card | None) -> None:
    """Raise OSError where the files of a run cannot be written.

    Another run may have ended in the folder before it was locked: raise FileExistsError where a new
    run finds files of it, and SceneGenError where the checkpoint is not `resumed` any more.
    """
    if resumed is None:
        check_new(folder)
    elif load_card(folder / CHECKPOINT) != resumed:
        raise SceneGenError(folder, "that another run went on meanwhile", hint="say --resume again")
    for name in (CHECKPOINT, PICTURE, WEIGHTS):
        check_writable(folder / name, overwrite=True)


def _match(
    source: RoomImages,
    folder: Path,
    config: ModelConfig,
    fabric: Fabric,
    progress: Callable[[dict[str, float]], Any],
) -> None:
    """Let training learn from relief that is found by matching, or read from the run's folder.

    Raises SpecError, before the search, where the views of the rooms do not suit.
    """
    rooms = read_rooms(source.path, config.networks.size)
    source.pick_views(matching.matched_rows(rooms).numpy())
    for turn in (True, False):  # the first process finds what the others then read
        if turn is fabric.is_global_zero:
            relief = matching.labels(
                rooms, folder, lambda done, n: progress({"share of images matched": done / n})
            )
        summed(torch.zeros(1, device=fabric.device))
    source.learn_from(relief.numpy())


def _complete(weights: Path, last: int) -> bool:
    """Return whether the weights of the last iteration are there; the card is written last."""
    try:
        return weights.exists() and load_card(weights).iteration == last
    except (OSError, FileFormatError):
        return False


def _fit_prior(state: State, source: Source) -> None:
    """Fit the prior, unless a critic ties codes to it.

    Raises TrainingError for what is not finite, so that it replaces no checkpoint and no weights.
    """
    require_finite(state)
    if not state.model.config.adversarial:
        fit_prior(state.model, source)
    require_finite(state)


@torch.no_grad()
def fit_prior(model: Pix2Shape, source: Source) -> None:
    """Fit the prior to the codes of the first images."""
    device = next(model.parameters()).device
    loader = DataLoader(source, batch_size=BATCH, sampler=range(min(len(source), PRIOR_ITEMS)))
    learning = model.training
    model.eval()
    batches = (source.as_batch(items).to(device) for items in loader)
    found = [(model.encode(one.image, one.views), one.views.condition) for one in batches]
    codes, conditions = map(torch.cat, zip(*found, strict=True))
    model.prior.fit(codes, conditions)
    model.train(learning)


def _picture(folder: Path, logs: Logs, state: State, batch: Batch) -> None:
    numbers = torch.Generator().manual_seed(0)
    noise = torch.randn(len(batch.image), state.model.config.networks.z, generator=numbers)
    picture = training_sheet(state.model, batch, noise.to(batch.image.device))
    save_picture(picture, folder / PICTURE, overwrite=True)
    logs.picture(picture, state.iteration)
