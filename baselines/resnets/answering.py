"""Answers to questions, from their images alone: scores of a network, and its accuracy."""

from pathlib import Path

from torch import Tensor, nn

from baselines.resnets.card import Card
from baselines.training.baseline import Answers
from baselines.training.machine import chosen_device
from baselines.training.questions import each_question
from iqtt import QuestionsFile, open_questions
from scenegen.common.errors import SpecError

BATCH = 32  # questions at a time


def answers_of(
    any_number: bool, network: nn.Module, card: Card, questions: QuestionsFile
) -> Answers:
    """Return how a network answers questions.

    Args:
        any_number: whether it answers questions of another number of answers than it was trained
            on.

    Raises SpecError where it does not.
    """
    count = questions.answers
    if count != card.answers and not any_number:
        raise SpecError(
            questions.path,
            f"questions of {count} answers",
            f"{card.answers}, as those that {card.method} was trained on",
            f"its last layer has an output for each answer; train it on questions of {count}",
        )
    device = chosen_device("auto")
    network.to(device)
    run = f"{card.labels} labels, seed {card.settings.seed}"
    return Answers(lambda images: scores(network, images.to(device)), BATCH, run=run)


def scores(network: nn.Module, images: Tensor) -> Tensor:
    """Return the score of each answer, (Q, K), of images on the network's device."""
    answered: Tensor = network.eval()(images)
    return answered


def accuracy(network: nn.Module, path: Path, size: int, answers: int) -> float | None:
    """Return the share of a file's questions that are answered right.

    None where there is no such file, or it has no questions of so many answers, or tells none.
    """
    if not path.is_file():
        return None
    device = next(network.parameters()).device
    with open_questions(path) as questions:
        if not len(questions) or not questions.has_answers or questions.answers != answers:
            return None
        values = each_question(
            questions, size, lambda images: scores(network, images.to(device)), BATCH
        )
        chosen = values.argmax(dim=1).numpy()
        return float((chosen == questions.read("answers", slice(None))).mean())
