"""What a run begins from: settings that suit its data, first weights, or a checkpoint."""

import functools
import json
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from baselines.checkpoints import check_data
from baselines.pix2shape.data.questions import QuestionImages, for_questions
from baselines.pix2shape.data.rooms import RoomImages, is_question_file
from baselines.pix2shape.network.config import METHOD, TAUGHT_DEPTH, ModelConfig
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.training.batches import Source
from baselines.pix2shape.training.state import State, load_state, new_state
from baselines.pix2shape.weights.bundled import open_weights
from baselines.pix2shape.weights.storage import PRECISIONS, Card
from iqtt.files.reader import open_questions
from scenegen.common.errors import SpecError
from scenegen.common.records import check, to_json
from scenegen.rooms.reader import RoomsFile

OF_NETWORKS = ("networks", "opacity", "material", "lights", "depth_middle", "depth_reach")
OF_QUESTIONS = (
    "question_batch", "labelled_batch", "turned", "temperature", "hard_negatives",
    "easy_negatives", "compared_information",
)  # fmt: skip
Begun = tuple[State, Card, Source, QuestionImages | None]


def new_run(
    data: str | Path,
    config: ModelConfig,
    *,
    labels: int = 0,
    conditional: bool = False,
    start: str | Path | None = None,
    precision: str = PRECISIONS[0],
    chosen: Collection[str] = (),
) -> Begun:
    """Return a new run's state, with its card, its images and its labelled questions, if any.

    The arguments are those of `train_run`. Raises SpecError where they and the data do not fit;
    as `open_weights`, and as the readers of the data.
    """
    asked, config = config, _suited(config, data, labels, conditional)
    for name in chosen:
        value, needed = (functools.reduce(getattr, name.split("."), c) for c in (asked, config))
        if value != needed:
            hint = f"leave it out: {data}, with {labels} labels, decides it or does not use it"
            raise SpecError(name, value, "nothing", hint)
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


def resumed_run(folder: Path, data: str | Path, precision: str | None) -> Begun:
    """Return the state of a folder's checkpoint, with its card and its data, as `new_run`.

    Raises SpecError for another precision or other data than those of the run; as `load_state`, and
    as the readers of the data.
    """
    state, card = load_state(folder)
    expected = f"{card.precision}, as the run began with"
    check(precision in (None, card.precision), "precision", precision, expected)
    source, labelled = _sources(data, card.config, card.labels)
    check_data(data, _fingerprint(source, labelled), card.fingerprint)
    return state, card, source, labelled


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
        return config if labels else replace(config, questions=0.0, swap=0.0)
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
