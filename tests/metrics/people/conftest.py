"""Made-up answers, and a small split whose questions people are asked."""

import pytest

MADE_PEOPLE = 12


@pytest.fixture(scope="session")
def answers_db(tmp_path_factory):
    """Return a file with answers of 12 people who finished and one who did not."""
    from quizzes import made_answers

    return made_answers(tmp_path_factory.mktemp("people") / "answers.db", MADE_PEOPLE)


@pytest.fixture(scope="session")
def quiz_split(tmp_path_factory):
    """Return a folder with 24 test questions of 32x32 pixels, their answers, and 3 to calibrate."""
    from iqtt.files.make import make_split
    from iqtt.questions.specs import SplitSpec

    folder = tmp_path_factory.mktemp("quiz") / "split"
    spec = SplitSpec(
        seed=2, train=0, labeled=0, val=3, test=24, height=32, width=32, min_cube_pixels=0
    )
    make_split(folder, spec, command="tests")
    return folder
