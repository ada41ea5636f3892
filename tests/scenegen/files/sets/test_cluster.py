"""A cluster of Dask: the same bytes as one process, whatever dies; and who is let in."""

import json
import os
import signal
from dataclasses import replace
from functools import partial

import pytest
from click.testing import CliRunner
from cluster_tasks import crash, shared, slow_square, version_by_process

import cli
from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from metrics.scoring.runs import scorer_versions
from scenegen.common.errors import SceneGenError
from scenegen.files.pool import LostWorkerError
from scenegen.files.sets.cluster import LOCAL, connected
from scenegen.files.sets.making import REQUEST
from scenegen.rendering.sameness import renderer_identity

pytest.importorskip("distributed")
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
SPLIT = SplitSpec(
    seed=5, train=6, labeled=2, val=2, test=2, cubes=(6, 7), height=24, width=24, min_cube_pixels=1
)  # fmt: skip


@pytest.fixture(scope="module")
def cluster():
    """Return a cluster of two worker processes."""
    with connected(LOCAL, 2, renderer_identity) as found:
        yield found


@pytest.fixture(scope="module")
def plain(cluster):
    """Return the same cluster, whose processes need not render a picture to be compared."""
    return replace(cluster, versions=dict)


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.h5")}


def test_rooms_and_questions_are_those_of_one_process(cluster, make_rooms, tmp_path):
    rows = []
    for name, how in (("one", {}), ("many", {"cluster": cluster, "progress": rows.append})):
        folder = tmp_path / name
        folder.mkdir()
        make_rooms(folder / "rooms.h5", 4, {"shard_size": 3, **how}, views=(0.0, 40.0))
        make_split(folder / "split", SPLIT, shard_size=5, **how)
    assert sum(rows) == 8 + 10
    assert contents(tmp_path / "many") == contents(tmp_path / "one")
    assert contents(tmp_path / "many" / "split") == contents(tmp_path / "one" / "split")


def test_tasks_of_workers_that_die_go_to_others(plain, tmp_path):
    """One of two is killed in the midst of it."""
    squares = plain.results(partial(slow_square, tmp_path), range(12))
    assert next(squares) == 0
    os.kill(int((tmp_path / "0").read_text()), signal.SIGKILL)
    assert [*squares] == [number * number for number in range(1, 12)]


def test_a_crash_is_tried_again_and_named(plain, tmp_path):
    once = plain.results(partial(crash, tmp_path, False), range(5))
    assert list(once) == [0, 1, 2, 3, 4]
    with pytest.raises(LostWorkerError) as lost:
        list(plain.results(partial(crash, tmp_path, True), range(5), "part {}".format))
    assert lost.value.where.startswith("part 3:")
    assert lost.value.found == "signal 11, SIGSEGV"


def test_workers_with_other_versions_are_refused(cluster):
    here = partial(version_by_process, os.getpid())
    address = cluster.client.scheduler.address
    with pytest.raises(SceneGenError) as refused, connected(address, 0, here) as other:
        list(other.results(len, ["a"]))
    assert "mitsuba_version 3.8.0, not 3.9.1" in refused.value.found


def test_a_folder_that_workers_do_not_see_is_named(plain, tmp_path):
    """Or one in which another run has begun."""
    home, asked = tmp_path / ".rooms.h5.parts", {"n": 1}
    with pytest.raises(SceneGenError) as refused:
        list(plain.results(shared, [(home, asked)]))
    assert str(home) in refused.value.where
    home.mkdir()
    (home / REQUEST).write_text('{"n": 1}')
    list(plain.results(shared, [(home, asked)]))
    with pytest.raises(SceneGenError) as refused:
        list(plain.results(shared, [(home, {"n": 2})]))
    assert "n 1, not 2" in refused.value.found


@pytest.mark.slow
def test_a_scheduler_that_goes_away_is_one_line(tmp_path):
    with connected(LOCAL, 1, scorer_versions) as found:
        results = found.results(partial(slow_square, tmp_path), range(50))
        next(results)
        found.client.cluster.close()
        with pytest.raises(SceneGenError) as lost:
            list(results)
    assert "scheduler" in lost.value.where


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "tls://127.0.0.1:9", "ucx://a:1", "no"])
def test_no_scheduler_is_one_line(monkeypatch, address):
    """Of tls:// Dask wants certificates, and of ucx:// a package."""
    monkeypatch.setattr("scenegen.files.sets.cluster.PATIENCE", 1)
    words = ["render", "--n", "1", "--scheduler", address, "--out", "rooms.h5"]
    result = CliRunner().invoke(cli.scenegen, words)
    assert (result.exit_code, len(result.stderr.splitlines())) == (2, 1)
    assert address in result.stderr


def test_scores_are_those_of_one_process(cluster, make_rooms, tmp_path):
    def call(*words):
        result = CliRunner().invoke(cli.bench, [str(word) for word in words])
        assert result.exit_code == 0, result.output

    rooms, prediction = make_rooms(tmp_path / "rooms.h5", 9), tmp_path / "empty.h5"
    call("baseline", "empty-room", "--data", rooms, "--out", prediction)
    scores = []
    for name, how in (("one", []), ("many", ["--scheduler", cluster.client.scheduler.address])):
        call("score", prediction, "--truth", rooms, "--json", tmp_path / f"{name}.json", *how)
        scores.append(json.loads((tmp_path / f"{name}.json").read_text()))
    assert scores[0]["summary"] == scores[1]["summary"]
