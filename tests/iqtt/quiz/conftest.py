"""A small study on the split of six questions, and a server of it."""

import pytest

from iqtt.quiz.study import Study


@pytest.fixture(scope="session")
def study(split_folder):
    """Return 5 questions each, after 1 of the validation file."""
    with Study(split_folder / "iqtt-test.h5", questions=5, calibrations=1) as found:
        yield found


@pytest.fixture(scope="session")
def lasting(study, tmp_path_factory):
    """Return a server for tests that begin no more than a session."""
    from quizzes import served

    with served(study, tmp_path_factory.mktemp("quiz") / "answers.db") as running:
        yield running


@pytest.fixture
def site(study, tmp_path):
    """Return a running server."""
    from quizzes import served

    with served(study, tmp_path / "answers.db") as running:
        yield running
