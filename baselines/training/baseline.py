"""A trained baseline as data, and the training and the submissions that all share."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from baselines.training.checkpoint import (
    WEIGHTS,
    Method,
    Settings,
    State,
    alone_in,
    begun,
    bundled,
    check_new,
    load_checkpoint,
    load_weights,
    save_weights,
)
from baselines.training.data import TrainingFiles
from baselines.training.fit import Loss, Progress, falling_late, fit
from baselines.training.images import Array, read_ahead
from baselines.training.machine import Machine, chosen_device
from baselines.training.questions import each_question, is_question_file, open_test
from iqtt import QuestionsFile
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.common.records import check
from scenegen.files.new_file import check_writable
from scenegen.rooms.reader import RoomsFile

RowsDone = Callable[[int, int], Any]  # rows done since the last call, rows in all


@dataclass(frozen=True, eq=False)
class Run:
    """What is asked of a training run.

    Attributes:
        method: name of the baseline.
        data: open files to learn from.
        earlier: the card of the checkpoint that the run goes on from; None for a new run.
    """

    method: str
    data: Any
    folder: Path
    settings: Any
    machine: Machine
    earlier: Any
    progress: Progress


@dataclass(frozen=True, eq=False)
class Lesson:
    """What a run learns. Nothing in it has been computed that takes long.

    Attributes:
        card: of a new run on these data.
        batches: yields the batches of an iteration and of those after it, without end.
        loss: of a state, a batch and the number of an iteration.
        rate: the learning rate of a card's settings in an iteration.
        clip: largest norm of the gradients of a step; None for any.
        prepare: is given the network before its first iteration.
        network: one that is trained already, so that only `finish` is left to do.
        finish: is given the trained network and its card, and returns the card to keep.
    """

    card: Any
    batches: Callable[[int], Iterator[Any]]
    loss: Callable[[State[Any, Any], Any, int], Loss]
    rate: Callable[[Any, int], float] = falling_late
    clip: float | None = None
    prepare: Callable[[Any], Any] = lambda network: None
    network: Any = None
    finish: Callable[[Any, Any], Any] = lambda network, card: card


@dataclass(frozen=True, eq=False)
class Answers:
    """How a network answers questions.

    Attributes:
        scores: of images, (B, 1 + K, 3, S, S), the reference first: (B, K), the most for the
            answer that is given.
        batch: questions at a time.
        notes, run: of the submission.
    """

    scores: Callable[[Tensor], Tensor]
    batch: int = 1
    notes: str = ""
    run: str = ""


@dataclass(frozen=True, eq=False)
class Views:
    """What a network predicts of rooms.

    Attributes:
        predicted: rows, (B,), with what `RoomPredictionWriter.add` takes of them, by name.
        shown: which image each view is predicted from, as `RoomPredictionWriter` says.
        method, notes, run: of the submission.
    """

    predicted: Iterator[tuple[Array, Mapping[str, Array]]]
    shown: Any
    method: str = ""
    notes: str = ""
    run: str = ""


@dataclass(frozen=True, eq=False)
class Baseline:
    """A trained baseline.

    Attributes:
        method: its cards and networks.
        settings: class of its settings.
        files: folder of the weights that come with the package.
        lesson: makes what a run learns; further arguments are those of `options`.
        options: names of these arguments.
        answers: how its network answers an open file of questions; None for rooms alone.
        views: what its network predicts of an open file of rooms; None for questions alone.
        cpu_only: whether it trains on the CPU alone.
    """

    method: Method[Any, Any]
    settings: type[Settings]
    files: Path
    lesson: Callable[..., Lesson]
    options: tuple[str, ...] = ()
    answers: Callable[[Any, Any, QuestionsFile], Answers] | None = None
    views: Callable[[Any, Any, RoomsFile], Views] | None = None
    cpu_only: bool = False


def train(
    baseline: Baseline,
    data: TrainingFiles,
    run_folder: str | Path,
    settings: Settings | None = None,
    machine: Machine | None = None,
    *,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
    **options: Any,
) -> Path:
    """Train a baseline and return the path of its weights.

    The same arguments without a limit of time give the same weights on one machine, however often a
    run is resumed.

    Args:
        run_folder: gets checkpoint and weights.
        settings: by default the baseline's own.
        machine: where and how long; by default on a GPU if there is one.
        resume: go on from the checkpoint, with the run's own settings.
        progress: is called after each iteration with its number, how many there will be, and losses
            by name.
        options: those of `baseline.options`.

    Raises:
        SpecError: settings and data do not fit, or there is no such device.
        FileExistsError: a new run finds files of another.
        TrainingError, FileFormatError, OSError.
    """
    folder, machine, method = Path(run_folder), machine or Machine(), baseline.method
    if baseline.cpu_only:
        check(machine.device != "cuda", "device", "cuda", f"cpu, where {method.name} computes")
    device = chosen_device("cpu" if baseline.cpu_only else machine.device)
    with alone_in(folder):
        if not resume:
            check_new(folder)
        earlier = load_checkpoint(folder, method) if resume else None
        before = None if earlier is None else earlier.card
        chosen = before.settings if before else settings or baseline.settings()
        run = Run(method.name, data, folder, chosen, machine, before, progress)
        lesson = baseline.lesson(run, **options)
        network, card = lesson.network, lesson.card
        if network is None:
            state = begun(method, lesson.card, earlier, data.where)
            state.to(device)
            lesson.prepare(state.network)
            batches = read_ahead(lesson.batches(state.card.iteration), device)

            def losses(number: int) -> Iterator[Loss]:
                yield lesson.loss(state, next(batches), number)

            how: dict[str, Any] = {"clip": lesson.clip, "progress": progress}
            fit(folder, method, state, losses, lesson.rate, machine, **how)
            network, card = state.network, state.card
        save_weights(folder / WEIGHTS, method, network, lesson.finish(network, card))
    return folder / WEIGHTS


def write_submission(
    baseline: Baseline,
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    overwrite: bool = False,
    progress: RowsDone = lambda done, total: None,
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
    predict: Any = partial(tasks[task], network, card)  # type: ignore[arg-type, misc]
    how: dict[str, Any] = {"overwrite": overwrite, "progress": progress}
    submit(data, out, method.name, card.settings.size, predict, **how)


@torch.inference_mode()
def submit(
    data: str | Path,
    out: str | Path,
    method: str,
    size: int,
    predict: Callable[[Any], Any],
    *,
    overwrite: bool = False,
    progress: RowsDone = lambda done, total: None,
) -> None:
    """Write answers to questions and their scores, or predict every view of rooms.

    Args:
        method: of the submission, unless `Views` have another one.
        size: of the images of questions that the network takes, pixels.
        predict: gives `Answers` of an open file of questions, or `Views` of one of rooms. It raises
            SpecError where it cannot.
    """
    check_writable(Path(out), overwrite)
    how: dict[str, Any] = {"overwrite": overwrite}
    if is_question_file(data):
        with open_test(data, size) as questions:
            told = predict(questions)
            values = each_question(questions, size, told.scores, told.batch, progress=progress)
        how |= {"method": method, "run": told.run, "notes": told.notes}
        write_answers(out, data, scores=values.double().numpy(), **how)
        return
    with open_rooms(data) as rooms:
        views = predict(rooms)
        how |= {"method": views.method or method, "run": views.run, "notes": views.notes}
        with RoomPredictionWriter(out, data, shown=views.shown, **how) as submission:
            for rows, arrays in views.predicted:
                for place, row in enumerate(rows.tolist()):
                    submission.add(row, **{name: each[place] for name, each in arrays.items()})
                progress(len(rows), len(rooms))
