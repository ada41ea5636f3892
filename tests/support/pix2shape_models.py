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

    names = ("classes", "camera", "z_scene", "z_view", "encoder", "spherical", "rays", "bounded")
    own = {name: settings.pop(name) for name in names if name in settings}
    networks = NetworkSpec(size=size, width=0.05, **own)
    plain = {"iterations": 4, "batch": 4, "critic_steps": 1}
    return ModelConfig(networks=networks, **{**plain, **settings})


def of_questions(train: Path, **settings: Any) -> Any:
    """Return the configuration that training on a file of questions gives a tiny model."""
    from baselines.pix2shape.data.questions import for_questions

    return for_questions(tiny(**settings), train, "unlabeled")


def made(config: Any, seed: int = 0) -> Any:
    """Return a model whose depth maps differ clearly from code to code."""
    import torch

    from baselines.pix2shape.training.state import new_state

    model = new_state(replace(config, seed=seed)).model.eval()
    with torch.no_grad():
        model.encoder.last.weight.mul_(5)
        model.decoder.last.weight.mul_(10)
    return model


def written(path: Path, config: Any, **card: Any) -> Path:
    """Write the weights of such a model."""
    from baselines.pix2shape.weights.storage import Card, save_weights

    names = tuple(f"class {i}" for i in range(config.networks.classes))
    save_weights(path, made(config), Card(config, **{"classes": names, **card}))
    return path


def told(rooms: Path, **more: Any) -> dict[str, Any]:
    """Return what a card tells of the rooms that a model was trained on."""
    with h5py.File(rooms) as file:
        mark, spec = str(file.attrs["fingerprint"]), str(file.attrs["spec"])
    return {"data": spec, "fingerprint": mark, **more}


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
