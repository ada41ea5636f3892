"""What streams share: which rows come, when and to whom, and what processes leave behind."""

import gc
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from counted_rows import COLUMNS, counted

from scenegen.common.errors import PlacementError, SpecError
from scenegen.files.pool import LostWorkerError
from scenegen.files.schema import Column
from scenegen.files.stream import common_columns

# Shows each row once through torch's loader; arguments: start method, and how many loaders.
LOADED = """
import sys, warnings
warnings.simplefilter("ignore", DeprecationWarning)  # 3.12 on: forking a process with threads
from counted_rows import counted
stream = counted(batch=4, start=3, stop=50)
assert "torch" not in sys.modules
import torch
from torch.utils.data import DataLoader, IterableDataset

def shown(loader):
    return [batch["row"].tolist() for batch in loader]

if __name__ == "__main__":
    assert isinstance(stream, IterableDataset)
    expected = [list(range(i, min(i + 4, 50))) for i in range(3, 50, 4)]
    one = DataLoader(stream, batch_size=None)
    assert shown(one) == expected
    array = next(iter(counted(stop=4)))["grid"]
    assert torch.as_tensor(array).data_ptr() == array.ctypes.data
    for workers, kept in ((1, True), (2, False), (2, True), (1, False))[: int(sys.argv[2])]:
        loader = DataLoader(stream, batch_size=None, num_workers=workers,
                            multiprocessing_context=sys.argv[1], persistent_workers=kept)
        assert shown(loader) == shown(loader) == expected, (workers, kept)
    own = DataLoader(counted(batch=4, start=3, stop=50, workers=2), batch_size=None,
                     num_workers=2, multiprocessing_context=sys.argv[1])
    assert shown(own) == expected
    halves = [shown(DataLoader(counted(batch=4, start=3, stop=50, rank=rank, world_size=2),
                               batch_size=None, num_workers=2,
                               multiprocessing_context=sys.argv[1])) for rank in (0, 1)]
    assert halves == [expected[::2], [*expected[1:-1:2], [46, 47, 48, 49]]]
    print("each once")
"""
INTERRUPTED = """
import sys
from counted_rows import counted
for batch in counted(workers=2):
    if batch["row"][0] >= 40:
        print(open(f"/proc/self/task/{__import__('os').getpid()}/children").read(), flush=True)
        sys.stdin.read()
"""


def rows_of(stream):
    return [batch["row"].tolist() for batch in stream]


def children():
    with open(f"/proc/self/task/{os.getpid()}/children") as file:
        return set(file.read().split())


def held():
    """Return the processes that this one started, how many files it has open, and its memory."""
    gc.collect()
    files = [f"/proc/self/fd/{number}" for number in os.listdir("/proc/self/fd")]
    memory = [path for path in files if os.path.islink(path) and "rows" in os.readlink(path)]
    named = [name for name in os.listdir("/dev/shm") if "rows" in name]  # other tests name theirs
    return children(), len(files), memory, named


@pytest.fixture
def nothing_left():
    """No process, no open file and no shared memory more than before."""
    before = held()
    yield
    processes, files, *memory = held()
    assert processes <= before[0]  # what other tests left may end meanwhile
    assert files <= before[1]
    assert memory == [*before[2:]]


linux = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


@pytest.mark.parametrize("batch", [1, 4, 64])
def test_every_row_comes_once_and_in_order(batch):
    rows = rows_of(counted(batch, 3, 50))
    assert rows == [list(range(i, min(i + batch, 50))) for i in range(3, 50, batch)]
    shares = [rows_of(counted(batch, 3, 50, rank=rank, world_size=3)) for rank in range(3)]
    whole = 47 // (3 * batch)  # rounds in which each rank has a whole batch
    assert [share[:whole] for share in shares] == [rows[r : 3 * whole : 3] for r in range(3)]
    assert rows_of(counted(batch, 50, 50)) == rows_of(counted(batch, 51, 50, 2)) == []


@pytest.mark.parametrize(
    ("ranks", "batch", "stop", "workers"),
    [(2, 4, 20, 0), (2, 4, 22, 2), (3, 4, 25, 0), (4, 8, 9, 0), (3, 5, 30, 0), (3, 1, 4, 1),
     (8, 4, 3, 0)],
)  # fmt: skip
def test_ranks_get_equally_many_rows_in_equally_many_batches(ranks, batch, stop, workers):
    """All rows are shown, some of the end twice; or none twice, and too few for all are not."""
    for drop_last in (False, True):
        shares = [rows_of(counted(batch, 0, stop, workers * (rank == 1), rank, ranks,
                                  drop_last=drop_last)) for rank in range(ranks)]  # fmt: skip
        assert len({tuple(map(len, share)) for share in shares}) == 1
        shown = [row for share in shares for rows in share for row in rows]
        assert set(shown) == set(range(stop - stop % ranks if drop_last else stop))
        assert len(shown) == (len(set(shown)) if drop_last else -(-stop // ranks) * ranks)
        assert all(rows == sorted(rows) for share in shares for rows in share)


def test_states_of_other_requests_are_refused():
    stream = counted(requests=["a"])
    stream.load_state_dict({"row": 4})  # of an earlier release
    state = stream.state_dict()
    counted(8, workers=2, requests=["a"], rank=1, world_size=2).load_state_dict(state)
    for other in ({"requests": ["b"]}, {"requests": ["a"], "shares": [1.0, 2.0]}):
        with pytest.raises(SpecError):
            counted(**other).load_state_dict(state)
    for wrong in ({}, {"row": -1}, {"row": "4"}):
        with pytest.raises(SpecError):
            stream.load_state_dict(wrong)


@linux
def test_processes_are_kept_between_loops(nothing_left):
    """Through loops that end early, a state, and a process that is lost meanwhile."""
    others, stream = children(), counted(4, 3, 120, workers=2)
    whole = rows_of(stream)
    started = children() - others
    assert len(started) == 2
    for _ in range(3):
        assert next(iter(stream))["row"].tolist() == [3, 4, 5, 6]
    stream.load_state_dict({"row": 43})
    assert rows_of(stream) == whole[10:]
    assert rows_of(stream) == whole
    assert children() - others == started
    assert len(stream._workers.memory._maps) < 9, "memory of earlier loops is used again"
    os.kill(int(min(started)), signal.SIGKILL)
    assert rows_of(stream) == whole
    assert len(children() - others) == 2


def test_a_stream_goes_on_where_its_state_was_asked_for():
    for ranks in (1, 3):
        stream = counted(4, 3, rank=0, world_size=ranks)
        batches = iter(stream)
        for _ in range(5):
            next(batches)
        state, following = stream.state_dict(), next(batches)["row"].tolist()
        again = counted(4, 3, rank=0, world_size=ranks)
        again.load_state_dict(state)
        assert again.state_dict() == state
        assert next(iter(again))["row"].tolist() == following
        assert next(iter(again))["row"].tolist() == [3, 4, 5, 6], "the next loop"
        others = counted(2, 3, rank=1, world_size=2)  # other batches, other ranks
        others.load_state_dict(state)
        assert next(iter(others))["row"][0] == 3 + 5 * 4 * ranks + 2


def test_requests_are_mixed_by_their_shares():
    for together in (1, 5):
        batches = list(counted(64, stop=6400, shares=[3, 1, 1], together=together))
        assert [len(b["row"]) for b in batches] == [64] * 100
        assert np.array_equal(np.concatenate([b["row"] for b in batches]), range(6400))
        each = np.array([np.bincount(b["spec"], minlength=3) / 64 for b in batches])
        assert np.abs(each.mean(axis=0) - [0.6, 0.2, 0.2]).max() < 0.005
        assert np.abs(each - [0.6, 0.2, 0.2]).max() < 0.1 * together
        turns = np.concatenate([b["spec"] for b in batches]).reshape(-1, together)
        assert (turns == turns[:, :1]).all(), "views of a scene belong together"


def test_settings_out_of_range():
    wrong = {"start": -1, "workers": 257, "rank": 0, "world_size": 2}
    for name, value in wrong.items():
        with pytest.raises(SpecError):
            counted(**{name: value})
    for shares in ([], [1, 0], [float("nan")]):
        with pytest.raises((SpecError, IndexError)):
            counted(shares=shares)
    with pytest.raises(SpecError):
        counted(rank=2, world_size=2)
    wide = {"row": Column("row", (2,), "int64")}
    with pytest.raises(SpecError, match="row"):
        common_columns([COLUMNS, {**COLUMNS, **wide}])


@linux
def test_processes_make_the_same_rows_in_memory_that_is_not_written_again(nothing_left):
    whole = rows_of(counted(4, 3, 120))
    assert rows_of(counted(4, 3, 120, workers=2)) == whole
    kept = list(counted(4, 3, 120, workers=2))  # more than the processes make ahead
    assert [batch["row"].tolist() for batch in kept] == whole
    assert all((b["grid"] == b["row"][:, None, None]).all() for b in kept)
    part = kept[0]["grid"][1:, 0]
    del kept
    assert (part == [[4] * 3, [5] * 3, [6] * 3]).all()
    stream = counted(4, workers=1)
    addresses = {batch["row"].ctypes.data for batch, _ in zip(stream, range(40))}
    assert len(addresses) <= 5, "memory of batches that are gone is used again"


@linux
def test_a_loop_that_ends_early_leaves_nothing(nothing_left):
    for batch in counted(workers=2):
        if batch["row"][0] > 20:
            break
    with pytest.raises(ZeroDivisionError):
        [1 / int(20 - batch["row"][0]) for batch in counted(workers=2)]


@linux
def test_what_goes_wrong_in_a_process_ends_the_loop(nothing_left):
    for workers in (0, 1):
        shown = []
        with pytest.raises(PlacementError) as caught:
            shown += (batch["row"][0] for batch in counted(refused=41, workers=workers))
        assert caught.value.where == "row 41"
    for found in (rows_of, list):
        with pytest.raises(LostWorkerError) as lost:
            found(counted(killed=41, workers=1))
        assert lost.value.found == "signal 9, SIGKILL"
        assert lost.value.where.startswith("rows 40 to 43:")


@linux
@pytest.mark.parametrize(("workers", "share"), [(1, (None, None)), (2, (1, 3))])
def test_batches_whose_process_a_signal_ended_are_made_again(workers, share, nothing_left):
    """It is ended while it waits, and while it makes the next batches."""
    how = {"start": 3, "stop": 190, "rank": share[0], "world_size": share[1]}
    batches, others = iter(counted(workers=workers, **how)), children()
    rows = []
    for number, batch in enumerate(batches):
        rows.append(batch["row"].tolist())
        for process in children() - others if number in (2, 20) else ():
            time.sleep(0.2 * (number == 20))
            os.kill(int(process), signal.SIGKILL)
    assert rows == rows_of(counted(**how))


@linux
@pytest.mark.parametrize("how", ["SIGINT", "SIGKILL"])
def test_no_process_outlives_one_that_is_interrupted(how):
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        start_new_session=True, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    pids = process.stdout.readline().split()
    assert len(pids) == 2
    if how == "SIGINT":  # as a terminal sends it, to all
        os.killpg(process.pid, signal.SIGINT)
    else:
        process.kill()
    process.communicate(timeout=20)
    deadline = time.monotonic() + 20
    while any(os.path.exists(f"/proc/{pid}") for pid in pids):
        assert time.monotonic() < deadline
        time.sleep(0.05)


@linux
@pytest.mark.parametrize(
    ("method", "loaders"),
    [
        ("fork", "2"),
        *(pytest.param(m, "4", marks=pytest.mark.slow) for m in ("fork", "spawn", "forkserver")),
    ],
)
def test_torch_loads_each_row_once(method, loaders, tmp_path):
    pytest.importorskip("torch")
    script = tmp_path / "script.py"  # some methods start workers from the file of the main module
    script.write_text(LOADED)
    done = subprocess.run(
        [sys.executable, str(script), method, loaders],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout == "each once\n", done.stderr
