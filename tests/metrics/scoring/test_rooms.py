"""Scoring in several processes that the machine stops."""

import os
import signal

import numpy as np
import pytest
from refusals import refused

from baselines.trivial import write_room_baseline
from metrics.scoring import rooms as module
from metrics.scoring.runs import ScoringError
from metrics.submissions.reader import open_predictions


def kill(job: object, rows: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="sends signals")
def test_a_killed_worker_is_an_error_and_no_traceback(tmp_path, rooms_path, monkeypatch):
    """As Linux does where memory is short."""
    write_room_baseline("oracle", rooms_path, tmp_path / "oracle.h5")
    monkeypatch.setattr(module, "_score_in_worker", kill)
    monkeypatch.setattr(module, "CHUNK", 2)
    with (
        open_predictions(tmp_path / "oracle.h5") as file,
        refused(ScoringError, str(tmp_path / "oracle.h5"), hint="--processes"),
    ):
        module.score_rows([file], rooms_path, np.arange(8), "none", 2)
