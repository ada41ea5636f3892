"""A training run and its folder: checkpoint, TensorBoard logs, a picture, and the weights."""

import os
import threading
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
import torch
from lightning_fabric import Fabric
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
from baselines.training.machine import Machine, check_agreement, launched
from baselines.training.processes import summed
from baselines.training.rooms import read_rooms
from baselines.training.streams import TrainingStreams
from scenegen.common.errors import SceneGenError
from scenegen.files.new_file import check_writable
from scenegen.files.pictures import save_picture

PICTURE, LOGS = "pictures.png", "logs"
LOG_EVERY = 20  # iterations
PRIOR_ITEMS, BATCH = 2048, 64  # items that the prior is fitted to, and batch size for that


@contextmanager
def opened_logs(folder: Path, first: int) -> Iterator[SummaryWriter]:
    """Open TensorBoard's logs in a folder; what they have from iteration `first` on is hidden.

    TensorBoard writes in a thread of its own. An error there, as of a full disk, would be printed
    as a traceback; it comes to this thread, too, with what is logged next.
    """
    before = threading.excepthook

    def quiet(error: threading.ExceptHookArgs) -> None:
        if not isinstance(error.exc_value, OSError):
            before(error)

    threading.excepthook = quiet
    try:
        with _named(folder):
            logs = SummaryWriter(str(folder), purge_step=first)
        try:
            yield logs
        finally:
            with _named(folder):
                logs.close()
    finally:
        threading.excepthook = before


@contextmanager
def _named(folder: Path | str) -> Iterator[None]:
    """Let an OSError of the block name the folder that cannot be written."""
    try:
        yield
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)
        raise OSError(error.errno, f"cannot be written: {why}", str(folder)) from error


def log_numbers(logs: SummaryWriter, values: Mapping[str, float], iteration: int) -> None:
    """Log losses by name. Raises OSError, which names the folder."""
    with _named(logs.log_dir):
        for name, value in values.items():
            logs.add_scalar(name, value, iteration)


def train_run(
    folder: str | Path,
    data: TrainingFiles | TrainingStreams,
    config: ModelConfig | None,
    machine: Machine,
    *,
    labels: int = 0,
    conditional: bool = False,
    start: str | Path | None = None,
    precision: str | None = None,
    chosen: Collection[str] = (),
    progress: Progress = lambda done, total, losses: None,
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
    checkpoint = _written(folder)
    if config is None:
        state, sources = resumed_run(folder, data, precision)
    else:
        check_new(folder)
        state, sources = new_run(
            data,
            config,
            labels=labels,
            conditional=conditional,
            start=start,
            precision=precision or "32",
            chosen=chosen,
        )
    model, settings, began = state.network, state.card.settings, state.card.iteration
    check_request(model, sources, machine.devices * machine.nodes)
    fabric = launched(machine, state.card.precision)
    check_agreement(fabric, "data, settings or checkpoint", state.card)
    first = fabric.is_global_zero
    with alone_in(folder) if first else nullcontext(), readers_kept():
        if first:
            _check_folder(folder, checkpoint)
        stored = sources.shown is None
        if isinstance(sources.images, RoomImages) and settings.matching and stored:
            _match(sources.images, folder, state, fabric, progress)
        state.to(fabric.device)
        iterations = Iterations(model, sources, began, machine.workers, fabric.autocast)
        with opened_logs(folder / LOGS, began + 1) if first else nullcontext() as logs:

            def show(done: int, total: int, losses: Mapping[str, float]) -> None:
                assert logs is not None, "the first process shows"
                if done % LOG_EVERY == 0 or done == total:
                    log_numbers(logs, losses, done)
                if done % machine.every == 0 or done == total:
                    _picture(folder, logs, state, iterations)
                progress(done, total, losses)  # which may fail, as where its output is closed

            fit(
                folder,
                METHOD,
                state,
                iterations,
                learning_rate,
                machine,
                rows=sources.rows(settings),
                prepare=lambda: settings.adversarial or fit_prior(model, sources),
                progress=show,
            )
    summed(torch.zeros(1, device=fabric.device))  # wait for the first process, which writes
    return folder / WEIGHTS if first else None


def learning_rate(config: ModelConfig, iteration: int) -> float:
    """Return the learning rate of an iteration, counted from 0."""
    return falling_late(config, iteration) if config.decay else config.learning_rate


def _written(folder: Path) -> tuple[int, int] | None:
    """Return what tells the folder's checkpoint from every other one; None without one."""
    path = folder / CHECKPOINT
    return (path.stat().st_ino, path.stat().st_mtime_ns) if path.exists() else None


def _check_folder(folder: Path, checkpoint: tuple[int, int] | None) -> None:
    """Raise OSError where the files of a run cannot be written.

    Raises SceneGenError where another run has written there since the checkpoint was looked at.
    """
    if _written(folder) != checkpoint:
        message = "that another run trained there in the meantime"
        raise SceneGenError(folder, message, hint="use --resume, or another folder")
    for name in (CHECKPOINT, PICTURE, WEIGHTS):
        check_writable(folder / name, overwrite=True)


def _match(
    source: RoomImages, folder: Path, state: ModelState, fabric: Fabric, progress: Progress
) -> None:
    """Let training learn from relief that is found by matching, or read from the run's folder.

    Raises SpecError, before the search, where the views of the rooms do not suit.
    """
    card = state.card
    rooms = read_rooms([source.opened.file], card.settings.networks.size)
    source.pick_views(matched_rows(rooms).numpy())

    def show(done: int, total: int) -> None:
        share = {"share of images matched": done / total}
        progress(card.iteration, card.settings.iterations, share)

    for turn in (True, False):  # the first process finds what the others then read
        if turn is fabric.is_global_zero:
            relief = relief_of_rows(rooms, folder, show)
        summed(torch.zeros(1, device=fabric.device))
    source.learn_from(relief.numpy())


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


def _picture(folder: Path, logs: SummaryWriter, state: ModelState, iterations: Iterations) -> None:
    batch, numbers = iterations.batch, torch.Generator().manual_seed(0)
    noise = torch.randn(len(batch.image), state.card.settings.networks.z, generator=numbers)
    picture = training_sheet(state.network, batch, noise.to(batch.image.device))
    save_picture(picture, folder / PICTURE, overwrite=True)
    with _named(logs.log_dir):
        pixels, number = np.asarray(picture), state.card.iteration
        logs.add_image("pictures", pixels, number, dataformats="HWC")
