"""Scoring in several processes that the machine stops."""

import signal

import numpy as np
import pytest
from refusals import refused
from threadpoolctl import threadpool_info

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


def threads():
    return {library["filepath"]: library["num_threads"] for library in threadpool_info()}


@pytest.mark.parametrize("processes", [None, 1])
def test_small_products_use_one_thread(tmp_path, rooms_path, monkeypatch, processes):
    """Of OpenBLAS and the like, which would let others spin beside them; and as before after it."""
    write_room_baseline("oracle", rooms_path, tmp_path / "oracle.h5")
    before, found, score = threads(), [], module.RowScorer.score

    def watched(self, triples):
        found.extend(threads().values())
        return score(self, triples)

    monkeypatch.setattr(module.RowScorer, "score", watched)
    with open_predictions(tmp_path / "oracle.h5") as file, RoomsFile(rooms_path) as rooms:
        module.score_rows([file], rooms, np.arange(4), Settings(processes=processes))
    assert set(found) == {1}
    assert {path: count for path, count in threads().items() if path in before} == before
