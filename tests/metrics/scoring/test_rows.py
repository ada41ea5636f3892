"""Scoring in several processes that the machine stops."""

import signal

import numpy as np
import pytest
from refusals import refused

from baselines.trivial import write_room_baseline
from metrics.scoring import rows as module
from metrics.scoring.runs import ScoringError, Settings
from metrics.submissions.reader import open_predictions
from scenegen.rooms.reader import RoomsFile


def killed(job, chunk):
    signal.raise_signal(signal.SIGKILL)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="sends signals")
def test_a_killed_worker_is_an_error_and_no_traceback(tmp_path, rooms_path, monkeypatch):
    """As Linux does where memory is short."""
    write_room_baseline("oracle", rooms_path, tmp_path / "oracle.h5")
    monkeypatch.setattr(module, "_score_in_worker", killed)
    monkeypatch.setattr(module, "CHUNK", 2)
    with (
        open_predictions(tmp_path / "oracle.h5") as file,
        RoomsFile(rooms_path) as rooms,
        refused(ScoringError, str(tmp_path / "oracle.h5"), hint="--processes"),
    ):
        module.score_rows([file], rooms, np.arange(8), Settings(processes=2))
