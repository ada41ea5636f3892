"""Submissions of trained weights: depth and normals of rooms, or answers to questions."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import torch

from baselines.training.baseline import Answers, Baseline, Views
from baselines.training.checkpoint import bundled, load_weights
from baselines.training.questions import each_question, is_question_file, open_test
from iqtt import QuestionsFile
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.files.new_file import check_writable
from scenegen.rooms.reader import RoomsFile

Progress = Callable[[int, int], Any]  # rows done since the last call, rows in all


def write_submission(
    baseline: Baseline,
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Predict rooms or answer questions with the weights of a baseline.

    Args:
        weights: a file that `train` wrote; None for those of the package.

    Raises SpecError where weights and data do not fit; FileFormatError; OSError.
    """
    method, tasks = baseline.method, {"questions": baseline.answers, "rooms": baseline.views}
    task = "questions" if is_question_file(data) else "rooms"
    able = [name for name, act in tasks.items() if act]
    if task not in able:
        raise SpecError(data, task, f"{able[0]}, which {method.name} is for")
    name = method.name if len(able) == 1 else f"{method.name}-{task}"
    network, card = load_weights(weights or bundled(baseline.files, method, name), method)
    how: dict[str, Any] = {"overwrite": overwrite, "progress": progress}
    if baseline.answers is not None and task == "questions":
        answers = partial(baseline.answers, network, card)
        answer_questions(data, out, method.name, card.settings.size, answers, **how)
    elif baseline.views is not None:
        predict_rooms(data, out, partial(baseline.views, network, card), **how)


@torch.inference_mode()
def answer_questions(
    data: str | Path,
    out: str | Path,
    method: str,
    size: int,
    answers_of: Callable[[QuestionsFile], Answers],
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write answers to the questions of a file, and their scores.

    Args:
        size: of the images that the network takes, pixels.
        answers_of: how an open file is answered. It raises SpecError where it cannot be.
    """
    check_writable(Path(out), overwrite)
    with open_test(data, size) as questions:
        answers = answers_of(questions)
        values = each_question(questions, size, answers.scores, answers.batch, progress=progress)
    texts: dict[str, Any] = {"method": method, "run": answers.run, "notes": answers.notes}
    write_answers(out, data, scores=values.double().numpy(), overwrite=overwrite, **texts)


@torch.inference_mode()
def predict_rooms(
    data: str | Path,
    out: str | Path,
    views_of: Callable[[RoomsFile], Views],
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write depth and normals of every view of a file of rooms.

    Args:
        views_of: what is predicted of an open file. It raises SpecError where nothing can be.
    """
    check_writable(Path(out), overwrite)
    with open_rooms(data) as rooms:
        views = views_of(rooms)
        texts: dict[str, Any] = {"method": views.method, "run": views.run, "notes": views.notes}
        with RoomPredictionWriter(
            out, data, shown=views.shown, overwrite=overwrite, **texts
        ) as submission:
            for rows, depths, normals in views.predicted:
                for row, depth, normal in zip(rows.tolist(), depths, normals, strict=True):
                    submission.add(row, depth, normal)
                progress(len(rows), len(rooms))
