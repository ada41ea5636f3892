"""Answers of a trained model to questions, from their images alone."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from baselines.pix2shape.data.questions import check_background
from baselines.pix2shape.data.rooms import channels_first, check_reducible, row_batches
from baselines.pix2shape.network.model import Pix2Shape
from baselines.pix2shape.training.losses import squared_distances
from iqtt.files.reader import open_questions, parts
from metrics.prediction_writer import write_answers
from scenegen.common.errors import SpecError
from scenegen.rendering.ground_truth import decode_image

BATCH = 64  # images at a time
TAUGHT = "told: in training, the lights of its images and the answers of {} questions"


@torch.inference_mode()
def answer_file(
    model: Pix2Shape,
    data: str | Path,
    out: str | Path,
    *,
    labels: int = 0,
    run: str = "",
    overwrite: bool = False,
    progress: Callable[[int, int], Any] = lambda done, total: None,
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
    if len(parts(data)) > 1:
        raise SpecError(data, "training questions", "questions to answer, such as iqtt-test.h5")
    with open_questions(data) as questions:
        check_reducible(data, questions.height, questions.width, spec.size)
        check_background(data, questions.spec, model.config)
        if not len(questions):
            raise SpecError(data, "no questions", "one or more to answer")
        scores = []
        images = 1 + questions.answers
        for rows in row_batches(len(questions), BATCH // images):
            shown = [
                channels_first(decode_image(image), spec.size, f"{data}: row {row}")
                for row in rows
                for image in questions.read("questions", int(row))
            ]
            image = torch.from_numpy(np.stack(shown)).to(device)
            codes = model.codes(image, image.new_empty(len(image), 0))[:, : spec.z_scene]
            distance = squared_distances(codes.view(len(rows), images, -1)).sqrt()
            scores.append(-distance.cpu().double().numpy())
            progress(len(rows), len(questions))
    found = np.concatenate(scores)
    how: dict[str, Any] = {"method": model.config.method, "run": run, "overwrite": overwrite}
    write_answers(out, data, scores=found, notes=TAUGHT.format(labels), **how)
