"""Submit answers: python examples/submit_iqtt.py iqtt-split/iqtt-test.h5 answers.h5

What it answers by is a dummy, the mean brightness of a picture; put your model in its place.
"""

import argparse

import numpy as np

import iqtt
from metrics.prediction_writer import write_answers
from scenegen import SceneGenError


def score(reference, candidates):
    """Radiance (H, W, 3) and (A, H, W, 3) to scores (A,) of A answers, best highest: a dummy."""
    return -np.abs(candidates.mean((1, 2, 3)) - reference.mean())


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("questions")
parser.add_argument("answers")
parser.add_argument("--overwrite", action="store_true", help="replace an existing file")
arguments = parser.parse_args()
questions, out = arguments.questions, arguments.answers
try:
    with iqtt.open_questions(questions) as file:
        scores = [score(question.radiance[0], question.radiance[1:]) for question in file]
    write_answers(
        out,
        questions,
        method="dummy brightness",
        scores=scores,
        overwrite=arguments.overwrite,
    )
except OSError as error:
    parser.exit(2, f"Error: {error.filename}: {error.strerror}\n")
except SceneGenError as error:
    parser.exit(2, f"Error: {error}\n")
print(f"now: bench score {out} --truth {questions}")
