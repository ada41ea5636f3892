"""Answers of a trained model to questions, from their images alone."""

from pathlib import Path
from typing import Any

from torch import Tensor

from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.questions import check_background
from baselines.pix2shape.training.losses import squared_distances
from baselines.training.questions import Progress, each_question, open_test
from metrics.prediction_writer import write_answers
from scenegen.common.errors import SpecError

BATCH = 64  # images at a time
TAUGHT = "told: in training, the lights of its images and the answers of {} questions"


def answer_file(
    model: Pix2Shape,
    data: str | Path,
    out: str | Path,
    *,
    labels: int = 0,
    run: str = "",
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write answers to the questions of a file, from images alone.

    An answer's score is minus the distance of its z_scene from the reference's, as in the paper.

    Args:
        labels: answers that training was given; the submission's notes tell this.

    Raises SpecError where the model does not suit questions; else as `iqtt.QuestionsFile`.
    """
    spec, device = model.config.networks, next(model.parameters()).device
    if spec.condition:
        raise SpecError("weights", "a model that is told the camera", "one for questions")

    def scores(images: Tensor) -> Tensor:
        flat = images.flatten(0, 1).to(device)
        codes = model.codes(flat, flat.new_empty(len(flat), 0))[:, : spec.z_scene]
        return -squared_distances(codes.view(*images.shape[:2], -1)).sqrt()

    with open_test(data, spec.size) as questions:
        check_background(questions, model.config)
        batch = BATCH // (1 + questions.answers)
        values = each_question(questions, spec.size, scores, batch, progress=progress)
    how: dict[str, Any] = {"method": model.config.method, "run": run, "overwrite": overwrite}
    notes = TAUGHT.format(labels)
    write_answers(out, data, scores=values.double().numpy(), notes=notes, **how)
