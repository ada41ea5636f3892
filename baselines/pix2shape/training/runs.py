"""A training run and its folder: checkpoint, TensorBoard logs, a picture, and the weights."""

import functools
import json
from collections.abc import Callable, Collection
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from lightning_fabric import Fabric
from torch.utils.data import DataLoader

from baselines.checkpoints import CHECKPOINT, WEIGHTS, alone_in, check_data, check_new
from baselines.pix2shape.data.in_memory import read_rooms
from baselines.pix2shape.data.questions import QuestionImages, for_questions
from baselines.pix2shape.data.rooms import Batch, RoomImages, is_question_file
from baselines.pix2shape.matching import labels as matching
from baselines.pix2shape.network.config import METHOD, TAUGHT_DEPTH, ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.network.shared_batch import summed
from baselines.pix2shape.pictures import training_sheet
from baselines.pix2shape.training.batches import Source, readers_kept
from baselines.pix2shape.training.launch import Machine, check_agreement, launched
from baselines.pix2shape.training.logs import Logs, opened_logs
from baselines.pix2shape.training.loop import check_request, require_finite, train
from baselines.pix2shape.training.state import State, load_state, new_state, save_state
from baselines.pix2shape.weights.bundled import open_weights
from baselines.pix2shape.weights.storage import PRECISIONS, Card, load_card, save_weights
from iqtt.files.reader import open_questions
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.new_file import check_writable
from scenegen.common.records import check, to_json
from scenegen.rooms.preview import save_picture
from scenegen.rooms.reader import RoomsFile

PICTURE, LOGS = "pictures.png", "logs"
LOG_EVERY = 20  # iterations
OF_NETWORKS = ("networks", "opacity", "material", "lights", "depth_middle", "depth_reach")
OF_QUESTIONS = (
    "question_batch", "labelled_batch", "turned", "temperature", "hard_negatives",
    "easy_negatives", "compared_information",
)  # fmt: skip
Begun = tuple[State, Card, Source, QuestionImages | None]
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
    a checkpoint; TrainingError; LostProcessError where another process ended; FileFormatError,
    OSError.
    """
    folder = Path(folder)
    if config is None:
        state, card, source, labelled = _resumed(folder, data, precision)
    else:
        how = labels, conditional, start, precision or PRECISIONS[0], chosen
        state, card, source, labelled = _begun(folder, data, config, *how)
    labels = card.labels
    check_request(card.config, source, labelled, labels, machine.devices * machine.nodes)
    fabric = launched(machine, card.precision)
    check_agreement(fabric, "data, settings or checkpoint", (card, state.iteration))
    first, last = fabric.is_global_zero, card.config.iterations
    with alone_in(folder) if first else nullcontext(), readers_kept():
        for name in (CHECKPOINT, PICTURE, WEIGHTS) if first else ():
            check_writable(folder / name, overwrite=True)
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


def _resumed(folder: Path, data: str | Path, precision: str | None) -> Begun:
    """Return the state of the folder's checkpoint, with its card and its data."""
    state, card = load_state(folder)
    expected = f"{card.precision}, as the run began with"
    check(precision in (None, card.precision), "precision", precision, expected)
    source, labelled = _sources(data, card.config, card.labels)
    check_data(data, _fingerprint(source, labelled), card.fingerprint)
    return state, card, source, labelled


def _begun(
    folder: Path,
    data: str | Path,
    config: ModelConfig,
    labels: int,
    conditional: bool,
    start: str | Path | None,
    precision: str,
    chosen: Collection[str],
) -> Begun:
    """Return a new run's state, with its card and its data."""
    check_new(folder)
    asked, config = config, _suited(config, data, labels, conditional)
    for name in chosen:
        value, needed = (functools.reduce(getattr, name.split("."), c) for c in (asked, config))
        if value != needed:
            hint = f"leave it out: {data}, with {labels} labels, needs this value or uses none"
            raise SpecError(name.replace("_", " "), value, needed, hint)
    source, labelled = _sources(data, config, labels)
    card = Card(
        config,
        data=source.spec.to_json(),
        fingerprint=_fingerprint(source, labelled),
        labels=labels,
        precision=precision,
        classes=source.classes if config.networks.classes else (),
    )
    state = new_state(config)
    if start is not None:
        card = _begin_from(start, state.model, card)
    return state, card, source, labelled


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


def _sources(
    data: str | Path, config: ModelConfig, labels: int
) -> tuple[Source, QuestionImages | None]:
    """Open the images, and the labelled questions if some of their answers are used."""
    if config.networks.camera:
        return RoomImages(data, config), None
    labelled = QuestionImages(data, "labeled", config) if labels else None
    return QuestionImages(data, "unlabeled", config), labelled


def _begin_from(start: str | Path, model: Pix2Shape, card: Card) -> Card:
    """Give a model encoder and decoder of weights; return the card, which says what taught them.

    Raises SpecError, and as `open_weights`.
    """
    earlier, its_card = open_weights(start)
    its, own = (json.loads(to_json(one.config)) for one in (its_card, card))
    for name in OF_NETWORKS:
        group = own[name] if isinstance(own[name], dict) else {}
        for part in [f"{name}.{key}" for key in group] or [name]:
            there, here = (functools.reduce(dict.get, part.split("."), one) for one in (its, own))
            expected = f"weights of the {part} of this run, {here}"
            check(there == here, "start", f"{start} with {there}", expected)
    if card.method == METHOD:
        own = f"weights of {METHOD}, as other losses than the paper's would have trained this run's"
        check(its_card.method == METHOD, "start", start, own)
    same = its_card.classes == card.classes
    check(same, "start", start, f"weights of the same classes as this run's, {card.classes}")
    for name in ("encoder", "decoder"):
        getattr(model, name).load_state_dict(getattr(earlier, name).state_dict())
    return replace(
        card,
        earlier_labels=its_card.labels + its_card.earlier_labels,
        earlier_depth=its_card.method == TAUGHT_DEPTH,
    )


def _fingerprint(source: Source, labelled: QuestionImages | None) -> str:
    """Return the fingerprint of rooms, or those of the parts of a question file that are used."""
    return " ".join(str(one.fingerprint) for one in (source, labelled) if one is not None)


def _suited(config: ModelConfig, data: str | Path, labels: int, conditional: bool) -> ModelConfig:
    """Return the configuration as the data needs it. Raises SpecError where they do not fit."""
    networks = config.networks
    if is_question_file(data):
        if conditional:
            raise SpecError(data, "questions, which have no classes", "rooms for --conditional")
        check(config.depth == 0, "depth", config.depth, "0 for questions, which have no depth maps")
        config = for_questions(config, data, "unlabeled")
        with open_questions(data, "labeled") as questions:
            check(0 <= labels <= len(questions), "labels", labels, f"0 to {len(questions)}")
        return replace(config, questions=config.questions if labels else 0.0)
    check(labels == 0, "labels", labels, "0 for rooms, which ask no questions")
    check(networks.camera, "camera", networks.camera, "true: rooms are seen by known cameras")
    check(networks.classes == 0, "classes", networks.classes, "0; --conditional tells them")
    if conditional:
        with RoomsFile(data) as rooms:
            counts, shapes = rooms.spec.objects, rooms.spec.shapes
        check(counts == (1, 1), "conditional", f"objects {counts}", "one object in every room")
        networks = replace(networks, classes=len(shapes))
    unused: dict[str, Any] = {name: getattr(ModelConfig, name) for name in OF_QUESTIONS}
    off = dict.fromkeys(("mutual_information", "questions", "contrast", "swap"), 0.0)
    return replace(config, networks=networks, **unused | off)
