"""Untrained weights of every baseline, and how their submissions are written."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import torch
from pix2shape_models import card_of as reference_card
from pix2shape_models import of_questions, tiny, written
from ptn_models import card_of

from baselines.depth_match.network import Card as DepthCard
from baselines.depth_match.network import Settings as DepthSettings
from baselines.depth_match.training import BASELINE as DEPTH
from baselines.pix2shape.predict import predict_file
from baselines.pix2shape.weights import METHOD as REFERENCE
from baselines.ptn.training import BASELINE as PTN
from baselines.relief import depth_completed, depth_supervised
from baselines.relief.network import Card as ReliefCard
from baselines.relief.network import Settings as ReliefSettings
from baselines.resnets import cnn, siamese
from baselines.resnets.training import Card as ResnetCard
from baselines.resnets.training import Settings as ResnetSettings
from baselines.rezende.network import Card as RezendeCard
from baselines.rezende.network import Settings as RezendeSettings
from baselines.rezende.training import BASELINE as REZENDE
from baselines.training.baseline import Baseline, write_submission
from baselines.training.checkpoint import new_state, save_weights

Write = Callable[..., None]  # (data, out, **how)


def stored(folder: Path, method: Any, card: Any, change: Any = lambda network: None) -> Path:
    """Write untrained weights, changed so that predictions differ from image to image."""
    network = new_state(method, card).network
    with torch.no_grad():
        change(network)
    path = folder / f"{method.name}.safetensors"
    save_weights(path, method, network, card)
    return path


def stand_out(network: Any) -> None:
    """Let something stand out of a room."""
    if hasattr(network, "volume"):
        network.volume[-1].weight.mul_(20)
        network.volume[-1].bias.fill_(0.1)
        return
    for last in (module.last for module in network.modules() if hasattr(module, "last")):
        last.weight.mul_(10)
        last.bias.fill_(0.1)


def of_reference(weights: Path) -> Write:
    return partial(predict_file, weights, device="cpu")


def of_baseline(baseline: Baseline, *made: Any) -> Write:
    """Return how untrained weights of a baseline are submitted; `made` as for `stored`."""
    folder, card, *change = made
    weights = stored(folder, baseline.method, card, *change)
    return partial(write_submission, baseline, weights=weights)


def room_writers(folder: Path) -> dict[str, Write]:
    """Return writers of submissions for rooms of 32x32 pixels or a multiple, by method."""
    writers = {
        "pix2shape": of_reference(written(folder / "p.safetensors", tiny())),
        "pix2shape-rays": of_reference(
            stored(folder, REFERENCE, reference_card(tiny(rays=True)), stand_out)
        ),
        "ptn": of_baseline(PTN, folder, card_of(), stand_out),
    }
    for module in (depth_supervised, depth_completed):
        name = module.BASELINE.method.name
        card = ReliefCard(name, ReliefSettings(size=32, width=0.1))
        writers[name] = of_baseline(module.BASELINE, folder, card, stand_out)
    return writers


def answer_writers(folder: Path, train: Path) -> dict[str, Write]:
    """Return writers of answers to questions of 32x32 pixels or a multiple, by method."""
    writers = {"pix2shape": of_reference(written(folder / "p.safetensors", of_questions(train)))}
    for module in (cnn, siamese):
        name = module.BASELINE.method.name
        card = ResnetCard(name, ResnetSettings(width=4, size=16), labels=1)
        writers[name] = of_baseline(module.BASELINE, folder, card)
    writers["ptn"] = of_baseline(PTN, folder, card_of("questions"))
    small = DepthCard("depth-match", DepthSettings(size=32, width=0.1))
    writers["depth-match"] = of_baseline(DEPTH, folder, small, stand_out)
    for labels in (0, 5):
        place = folder / str(labels)
        place.mkdir()
        card = RezendeCard("rezende", RezendeSettings(size=16, code=4), labels=labels)
        writers[f"rezende, {labels} labels"] = of_baseline(REZENDE, place, card)
    return writers
