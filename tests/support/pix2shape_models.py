"""Tiny models of the reference model's kinds, their weights those of a seed; nothing is trained.

torch is imported when one is made: the commands are tested without it, too.
"""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

SIZE = 32  # pixels a side that the networks take


def tiny(size: int = SIZE, **settings: Any) -> Any:
    """Return a configuration of the smallest networks; networks' own settings among the others."""
    from baselines.pix2shape.network.architecture import NetworkSpec
    from baselines.pix2shape.network.config import ModelConfig

    names = ("classes", "camera", "z_scene", "z_view", "encoder", "spherical", "rays")
    of_networks = {name: settings.pop(name) for name in names if name in settings}
    networks = NetworkSpec(size=size, width=0.05, **of_networks)
    plain = {"iterations": 4, "batch": 4, "critic_steps": 1}
    return ModelConfig(networks=networks, **{**plain, **settings})


def in_memory(path: Path, size: int, **how: Any) -> Any:
    """Return the rooms of a file in memory."""
    from baselines.training.rooms import read_rooms
    from scenegen import open_rooms

    with open_rooms(path) as rooms:
        return read_rooms([rooms], size, **how)


def room_source(path: Path, config: Any) -> Any:
    """Return the images of a rooms file as a model of this configuration is shown them."""
    from baselines.pix2shape.images import RoomImages
    from baselines.training.data import shared_rooms
    from scenegen import open_rooms

    return RoomImages(shared_rooms(open_rooms(path)), config)


def question_source(path: Path, part: str | None, config: Any) -> Any:
    """Return the images of a question file, as `room_source`."""
    from baselines.pix2shape.images import QuestionImages
    from baselines.training.data import shared_questions
    from iqtt import open_questions

    return QuestionImages(shared_questions(open_questions(path, part)), config)


def suited(config: Any, path: Path, part: str | None = "unlabeled") -> Any:
    """Return the configuration that training on a file of questions gives a model."""
    from baselines.pix2shape.images import for_questions
    from iqtt import open_questions

    with open_questions(path, part) as questions:
        return for_questions(config, questions)


def of_questions(train: Path, **settings: Any) -> Any:
    """Return the configuration that training on a file of questions gives a tiny model."""
    return suited(tiny(**settings), train)


def state_of(config: Any, **card: Any) -> Any:
    """Return the untrained state of a configuration."""
    from baselines.pix2shape.weights import METHOD
    from baselines.training.checkpoint import new_state

    return new_state(METHOD, card_of(config, **card))


def card_of(config: Any, **card: Any) -> Any:
    """Return a card of a configuration."""
    from baselines.pix2shape.weights import Card

    names = tuple(f"class {i}" for i in range(config.networks.classes))
    return Card("pix2shape", config, **{"classes": names, **card})


def made(config: Any, seed: int = 0) -> Any:
    """Return a model whose depth maps differ clearly from code to code."""
    import torch

    model = state_of(replace(config, seed=seed)).network.eval()
    with torch.no_grad():
        model.encoder.last.weight.mul_(5)
        model.decoder.last.weight.mul_(10)
    return model


def stored(path: Path, network: Any, card: Any) -> Path:
    """Write weights and their card."""
    from baselines.pix2shape.weights import METHOD
    from baselines.training.checkpoint import save_weights

    save_weights(path, METHOD, network, card)
    return path


def written(path: Path, config: Any, **card: Any) -> Path:
    """Write the weights of such a model."""
    return stored(path, made(config), card_of(config, **card))


def origin(rooms: Path) -> dict[str, Any]:
    """Return what a card tells of the rooms that a model was trained on."""
    with h5py.File(rooms) as file:
        return {"data": str(file.attrs["spec"]), "fingerprint": str(file.attrs["fingerprint"])}


def edited(path: Path, to: Path, *edits: Callable[[h5py.File], Any]) -> Path:
    """Copy a file and let `edits` at the copy."""
    shutil.copy(path, to)
    with h5py.File(to, "r+") as file:
        for edit in edits:
            edit(file)
    return to


def of_rows(rows: list[int]) -> Callable[[h5py.File], None]:
    """Keep some rows of a rooms file, in this order; the attributes stay as they are."""

    def edit(file: h5py.File) -> None:
        count, names = file["image"].shape[0], []
        file.visit(names.append)
        for name in names:
            old = file[name]
            if isinstance(old, h5py.Dataset) and old.shape[:1] == (count,):
                values, attributes, dtype = old[()][rows], dict(old.attrs), old.dtype
                del file[name]
                file.create_dataset(name, data=values, dtype=dtype).attrs.update(attributes)
        file.attrs["count"] = len(rows)

    return edit


def released(path: Path, right: list[int], size: int = SIZE) -> Path:
    """Write questions as the paper's authors released theirs; the right answer is the reference.

    -1: two answers are the reference, -2: all three.
    """
    images = np.random.default_rng(3).random((len(right), 4, size, size, 3)).astype(np.float32)
    for row, answer in enumerate(right):
        same = [answer] if answer >= 0 else [0, 2] if answer == -1 else [0, 1, 2]
        for k in same:
            images[row, 1 + k] = images[row, 0]
    with h5py.File(path, "w") as file:
        file["questions"] = images
    return path
