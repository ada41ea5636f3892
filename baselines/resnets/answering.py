"""Answers to questions, from their images alone: scores of a network, submissions, accuracy."""

from pathlib import Path

from torch import Tensor, nn

from baselines.resnets.card import Answerer
from baselines.training.checkpoint import bundled, load_weights
from baselines.training.machine import chosen_device
from baselines.training.questions import Progress, each_question, open_test
from iqtt import QuestionsFile, open_questions
from metrics.prediction_writer import write_answers
from scenegen.common.errors import SpecError
from scenegen.files.new_file import check_writable

FILES = Path(__file__).with_name("files")
BATCH = 32  # questions at a time


def write_submission(
    kind: Answerer,
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    device: str = "auto",
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write answers to the questions of a file, and their scores, as `baselines.training` says.

    Args:
        device: "auto", "cpu" or "cuda".
    """
    name = kind.method.name
    network, card = load_weights(weights or bundled(FILES, kind.method), kind.method)
    check_writable(Path(out), overwrite)
    with open_test(data, card.settings.size) as questions:
        count = questions.answers
        if count != card.answers and not kind.any_number:
            raise SpecError(
                data,
                f"questions of {count} answers",
                f"{card.answers}, as those that {name} was trained on",
                f"its last layer has an output for each answer; train it on questions of {count}",
            )
        network.to(chosen_device(device))
        scores = answer_scores(network, questions, card.settings.size, progress)
    run = f"{card.labels} labels, seed {card.settings.seed}"
    numbers = scores.double().numpy()
    write_answers(out, data, method=name, scores=numbers, run=run, overwrite=overwrite)


def answer_scores(
    network: nn.Module,
    questions: QuestionsFile,
    size: int,
    progress: Progress = lambda done, total: None,
) -> Tensor:
    """Return the score of each answer, (Q, K); the network is put in evaluation mode."""
    network.eval()
    device = next(network.parameters()).device
    return each_question(
        questions, size, lambda images: network(images.to(device)), BATCH, progress=progress
    )


def accuracy(network: nn.Module, path: Path, size: int, answers: int) -> float | None:
    """Return the share of a file's questions that are answered right.

    None where there is no such file, or it has no questions of so many answers, or tells none.
    """
    if not path.is_file():
        return None
    with open_questions(path) as questions:
        if not len(questions) or not questions.has_answers or questions.answers != answers:
            return None
        chosen = answer_scores(network, questions, size).argmax(dim=1).numpy()
        return float((chosen == questions.read("answers", slice(None))).mean())
