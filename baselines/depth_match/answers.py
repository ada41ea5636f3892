"""Answers to questions, from their pictures and the field of view alone."""

from pathlib import Path

import torch
from torch import Tensor

from baselines.depth_match.matching import least_denials
from baselines.depth_match.network import METHOD, seen_depth
from baselines.training.checkpoint import load_weights
from baselines.training.questions import Progress, each_question, open_test
from iqtt import SplitSpec
from metrics.prediction_writer import write_answers
from scenegen.files.new_file import check_writable

FILES = Path(__file__).with_name("files")
NOTES = (
    "told: in training, true depth and camera distances; the field of view, and that pictures of a"
    " question have one camera distance and the shape's centre on their axis"
)


@torch.inference_mode()
def write_submission(
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write answers to the questions of a file, and their scores, as `baselines.training` says."""
    check_writable(Path(out), overwrite)
    network, card = load_weights(weights or FILES / "depth-match.safetensors", METHOD)
    with open_test(data, card.settings.size) as questions:
        fov = (questions.spec or SplitSpec()).fov_y_degrees

        def scores(images: Tensor) -> Tensor:
            depth = [seen_depth(network, pictures) for pictures in images]
            return -torch.stack([least_denials(one, fov) for one in depth])

        values = each_question(questions, card.settings.size, scores, 1, progress=progress)
    numbers = values.double().numpy()
    write_answers(out, data, method="depth-match", scores=numbers, notes=NOTES, overwrite=overwrite)
