"""What a run begins from: settings that suit its data, first weights, or a checkpoint."""

import functools
import json
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from baselines.pix2shape.images import QuestionImages, RoomImages, for_questions
from baselines.pix2shape.network.config import METHOD as PAPER
from baselines.pix2shape.network.config import TAUGHT_DEPTH, ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.training.batches import Sources, streamed_source
from baselines.pix2shape.weights import METHOD, Card, open_weights
from baselines.training.checkpoint import State, begun, load_checkpoint
from baselines.training.data import TrainingFiles, only, shared_questions, shared_rooms
from baselines.training.questions import LABELED, UNLABELED, check_labels
from baselines.training.streams import NEIGHBOURS, Shown, TrainingStreams
from iqtt import QuestionsFile
from scenegen.common.errors import SpecError
from scenegen.common.records import check, to_json
from scenegen.description.specs import Request
from scenegen.rooms.reader import RoomsFile

OF_NETWORKS = ("networks", "opacity", "material", "lights", "depth_middle", "depth_reach")
OF_QUESTIONS = (
    "question_batch", "labelled_batch", "turned", "temperature", "hard_negatives", "easy_negatives",
)  # fmt: skip
ModelState = State[Card, Pix2Shape]
Files = RoomsFile | tuple[QuestionsFile, QuestionsFile]  # questions: unlabelled, labelled
FIRST = 1024  # rows of streams that the prior is fitted to


def new_run(
    data: TrainingFiles | TrainingStreams,
    config: ModelConfig,
    *,
    labels: int = 0,
    conditional: bool = False,
    start: str | Path | None = None,
    precision: str = "32",
    chosen: Collection[str] = (),
) -> tuple[ModelState, Sources]:
    """Return a new run's state, and what it learns from.

    The arguments are those of `train_run`. Raises SpecError where they and the data do not fit;
    as `open_weights`, and as the readers of the data.
    """
    files, shown = _tables(data, config)
    suited = _suited(config, files, labels, conditional)
    for name in chosen:
        value, needed = (functools.reduce(getattr, name.split("."), c) for c in (config, suited))
        if value != needed:
            hint = (
                f"leave it out: {data.where}, with {labels} labels, decides it or does not use it"
            )
            raise SpecError(name, f"{value} has no effect here", hint=hint)
    sources = _sources(files, suited, labels, shown)
    card = Card(
        "pix2shape",
        suited,
        labels=labels,
        data=shown.card()["data"] if shown else sources.images.spec.to_json(),
        fingerprint=sources.fingerprint,
        precision=precision,
        classes=sources.images.classes if suited.networks.classes else (),
    )
    state = begun(METHOD, card, None, data.where)
    if start is not None:
        _begin_from(start, state)
    return state, sources


def resumed_run(
    folder: Path, data: TrainingFiles | TrainingStreams, precision: str | None
) -> tuple[ModelState, Sources]:
    """Return the state of a folder's checkpoint, and what it learns from.

    Raises SpecError for another precision or other data than those of the run; as
    `load_checkpoint`, and as the readers of the data.
    """
    earlier = load_checkpoint(folder, METHOD)
    card = earlier.card
    expected = f"{card.precision}, as the run began with"
    check(precision in (None, card.precision), "precision", precision, expected)
    files, shown = _tables(data, card.settings)
    sources = _sources(files, card.settings, card.labels, shown)
    told = replace(card, fingerprint=sources.fingerprint)
    return begun(METHOD, told, earlier, data.where), sources


def _tables(
    data: TrainingFiles | TrainingStreams, config: ModelConfig
) -> tuple[Files, Shown | None]:
    """Return files, or the first rows of streams, and the streams."""
    if isinstance(data, TrainingStreams):
        more = NEIGHBOURS if config.matching and not data.hold_questions else {}
        shown = data.shown(config.networks.size, config.seed, **more)
        rows = shown.whole(FIRST)
        block: Any = next(shown.blocks(0, rows, workers=0))
        return (block, block) if data.hold_questions else block, shown
    if not data.hold_questions:
        return only(data.rooms(), "pix2shape"), None
    unlabelled, labelled = (
        only(data.questions(part), "pix2shape") for part in (UNLABELED, LABELED)
    )
    return (unlabelled, labelled), None


def _sources(files: Files, config: ModelConfig, labels: int, shown: Shown | None) -> Sources:
    """Return what a run learns from; the labelled questions if some of their answers are used."""
    if shown is not None:
        if isinstance(files, tuple):
            check_labels(files[1], labels)
        first: Any = files[0] if isinstance(files, tuple) else files
        return Sources(streamed_source(first, config), shown=shown)
    if isinstance(files, RoomsFile):
        return Sources(RoomImages(shared_rooms(files), config))
    unlabelled, labelled = files
    check_labels(labelled, labels)
    answered = QuestionImages(shared_questions(labelled), config) if labels else None
    return Sources(QuestionImages(shared_questions(unlabelled), config), answered, labels)


def _suited(config: ModelConfig, files: Files, labels: int, conditional: bool) -> ModelConfig:
    """Return the configuration as the data needs it. Raises SpecError where they do not fit."""
    if not isinstance(files, tuple):
        return _for_rooms(config, files.spec, labels, conditional)
    unlabelled = files[0]
    if conditional:
        message = "questions, which have no classes"
        raise SpecError(unlabelled.path, message, "rooms for --conditional")
    config = for_questions(config, unlabelled)
    return config if labels else replace(config, questions=0.0)


def _for_rooms(config: ModelConfig, spec: Request, labels: int, conditional: bool) -> ModelConfig:
    """Return the configuration for rooms; what is of questions alone is off."""
    networks = config.networks
    check(labels == 0, "labels", labels, "0 for rooms, which have no labels")
    check(networks.camera, "camera", networks.camera, "true: rooms are seen by known cameras")
    check(
        networks.classes == 0,
        "classes",
        networks.classes,
        "0; --conditional gives the categories as input",
    )
    if conditional:
        single = spec.objects == (1, 1)
        check(single, "conditional", f"objects {spec.objects}", "one object in every room")
        networks = replace(networks, classes=len(spec.shapes))
    unused: dict[str, Any] = {name: getattr(ModelConfig, name) for name in OF_QUESTIONS}
    off = dict.fromkeys(("mutual_information", "questions", "contrast"), 0.0)
    return replace(config, networks=networks, **unused | off)


def _begin_from(start: str | Path, state: ModelState) -> None:
    """Give a state encoder and decoder of weights; its card then says what taught them.

    Raises SpecError, and as `open_weights`.
    """
    model, card = open_weights(start)
    records = [json.loads(to_json(record)) for record in (card.settings, state.card.settings)]
    for name in OF_NETWORKS:
        group = records[1][name] if isinstance(records[1][name], dict) else {}
        for part in [f"{name}.{key}" for key in group] or [name]:
            there, here = (functools.reduce(dict.get, part.split("."), r) for r in records)
            expected = f"weights of the {part} of this run, {here}"
            check(there == here, "start", f"{start} with {there}", expected)
    if state.card.submission == PAPER:
        expected = f"weights of {PAPER}, as other losses than the paper's would have trained them"
        check(card.submission == PAPER, "start", start, expected)
    same, classes = card.classes == state.card.classes, state.card.classes
    check(same, "start", start, f"weights of the same classes as this run's, {classes}")
    for name in ("encoder", "decoder"):
        getattr(state.network, name).load_state_dict(getattr(model, name).state_dict())
    state.card = replace(
        state.card,
        earlier_labels=card.labels + card.earlier_labels,
        earlier_depth=card.submission == TAUGHT_DEPTH,
    )
