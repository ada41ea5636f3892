"""What a run begins from: settings that suit its data, first weights, or a checkpoint."""

import functools
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from baselines.pix2shape.images import QuestionImages, RoomImages, for_questions
from baselines.pix2shape.network.config import METHOD as PAPER
from baselines.pix2shape.network.config import TAUGHT_DEPTH, ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.training.batches import Sources
from baselines.pix2shape.weights import METHOD, Card, open_weights
from baselines.training.checkpoint import State, begun, load_checkpoint
from baselines.training.data import TrainingFiles, only, shared_questions, shared_rooms
from baselines.training.questions import LABELED, UNLABELED, check_labels
from iqtt import QuestionsFile
from scenegen.common.errors import SpecError
from scenegen.common.records import check
from scenegen.description.specs import Request
from scenegen.rooms.reader import RoomsFile

OF_NETWORKS = ("opacity", "material", "lights", "depth_middle", "depth_reach")
OF_QUESTIONS = (
    "question_batch", "labelled_batch", "turned", "temperature", "hard_negatives", "easy_negatives",
)  # fmt: skip
ModelState = State[Card, Pix2Shape]
Files = RoomsFile | tuple[QuestionsFile, QuestionsFile]  # questions: unlabelled, labelled


def new_run(
    data: TrainingFiles,
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
    files = _tables(data)
    suited = _suited(config, files, labels, conditional)
    for name in chosen:
        value, needed = (functools.reduce(getattr, name.split("."), c) for c in (config, suited))
        if value != needed:
            hint = (
                f"leave it out: {data.where}, with {labels} labels, decides it or does not use it"
            )
            raise SpecError(name, f"{value} has no effect here", hint=hint)
    sources = _sources(files, suited, labels)
    card = Card(
        "pix2shape",
        suited,
        labels=labels,
        data=sources.images.spec.to_json(),
        fingerprint=sources.fingerprint,
        precision=precision,
        classes=sources.images.classes if suited.networks.classes else (),
    )
    state = begun(METHOD, card, None, data.where)
    if start is not None:
        _begin_from(start, state)
    return state, sources


def resumed_run(
    folder: Path, data: TrainingFiles, precision: str | None
) -> tuple[ModelState, Sources]:
    """Return the state of a folder's checkpoint, and what it learns from.

    Raises SpecError for another precision or other data than those of the run; as
    `load_checkpoint`, and as the readers of the data.
    """
    earlier = load_checkpoint(folder, METHOD)
    card = earlier.card
    expected = f"{card.precision}, as the run began with"
    check(precision in (None, card.precision), "precision", precision, expected)
    sources = _sources(_tables(data), card.settings, card.labels)
    told = replace(card, fingerprint=sources.fingerprint)
    return begun(METHOD, told, earlier, data.where), sources


def _tables(data: TrainingFiles) -> Files:
    """Return the rooms, or the two tables of questions."""
    if not data.hold_questions:
        return only(data.rooms(), "pix2shape")
    unlabelled, labelled = (
        only(data.questions(part), "pix2shape") for part in (UNLABELED, LABELED)
    )
    return unlabelled, labelled


def _sources(files: Files, config: ModelConfig, labels: int) -> Sources:
    """Return what a run learns from; the labelled questions if some of their answers are used."""
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
    there, here = ({**vars(c.settings), **vars(c.settings.networks)} for c in (card, state.card))
    for name in (*vars(card.settings.networks), *OF_NETWORKS):
        message = f"{start} with {name} {there[name]}"
        check(there[name] == here[name], "start", message, f"{here[name]}, as in this run")
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
