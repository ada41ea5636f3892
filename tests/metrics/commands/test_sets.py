"""`bench sets`: what is listed, made, checked and refused; and test sets are not learned from."""

import shutil
from dataclasses import replace

import h5py
import pytest
from click.testing import CliRunner

import cli
from baselines.training.data import refuse_test_set
from metrics.scoring import known_tests
from metrics.scoring.known_tests import KnownTest, sets
from metrics.scoring.truth_digests import file_digests
from scenegen.common.errors import SpecError
from scenegen.files.sets.shards import OpenFile


@pytest.fixture
def run_command():
    def call(group, *arguments):
        return CliRunner().invoke(group, [str(a) for a in arguments], catch_exceptions=False)

    return call


COMMAND = "scenegen render --n 2 --size 32 --seed 77"


@pytest.fixture
def tiny(tmp_path, monkeypatch, run_command):
    """A set of two rooms, made by hand to know its digests; return its line of the table."""
    path = tmp_path / "once.h5"
    assert run_command(cli.scenegen, *COMMAND.split()[1:], "--out", path).exit_code == 0
    truth, pictures, rows = file_digests(path, "rooms")
    test = KnownTest("tiny-1", "rooms", truth, rows, COMMAND, "tests", pictures)
    monkeypatch.setattr(known_tests, "KNOWN_TESTS", (test,))
    monkeypatch.setattr("baselines.training.data.KNOWN_TESTS", (test,))
    return test


def test_the_table_is_consistent():
    names = [test.name for test in known_tests.KNOWN_TESTS]
    digests = [test.digest for test in known_tests.KNOWN_TESTS]
    assert len(set(names)) == len(names)
    assert len(set(digests)) == len(digests)
    assert {"rooms-1", "rooms-shadows-1", "rooms-128-1", "objects-1", "rotation-1"} <= set(sets())
    tests = [test for some in sets().values() for test in some]
    assert all(len(test.digest) == 64 and len(test.pictures) in (0, 64) for test in tests)
    for test in tests:
        words = test.command.split()
        option = "--n" if test.task == "rooms" else "--test"
        views = words[words.index("--views") + 1].split(",") if "--views" in words else [0]
        assert test.rows == int(words[words.index(option) + 1]) * len(views), test.name


def test_a_set_is_made_once_and_known(tiny, run_command, tmp_path):
    made = tmp_path / "sets" / "tiny-1.h5"
    for _ in range(2):
        assert run_command(cli.bench, "sets", "make", "tiny-1", "--out", made.parent).exit_code == 0
    assert [path.name for path in made.parent.iterdir()] == ["tiny-1.h5"]
    with h5py.File(made) as file:
        assert file.attrs["creation_command"].startswith("scenegen render")
    assert "tiny-1" in run_command(cli.bench, "sets").output


def test_another_file_is_told_and_an_unknown_name_lists_the_known(
    tiny, run_command, tmp_path, monkeypatch
):
    other = replace(tiny, pictures="0" * 64)
    monkeypatch.setattr(known_tests, "KNOWN_TESTS", (other,))
    done = run_command(cli.bench, "sets", "make", "tiny-1", "--out", tmp_path / "sets")
    assert done.exit_code == 1
    assert other.pictures in done.output
    assert tiny.pictures in done.output
    done = run_command(cli.bench, "sets", "make", "tinny-1", "--out", tmp_path / "sets")
    assert done.exit_code == 2
    assert "tiny-1" in done.output


def test_the_published_set_is_made_again(run_command, tmp_path):
    assert run_command(cli.bench, "sets", "make", "sample-1", "--out", tmp_path).exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["sample-1.h5"]


def test_test_sets_are_not_learned_from(tiny, tmp_path):
    def learn(path):
        with OpenFile(path, "rooms") as opened:
            refuse_test_set(opened)

    path = tmp_path / "once.h5"
    with pytest.raises(SpecError):
        learn(path)
    more = shutil.copy(path, tmp_path / "more.h5")
    with h5py.File(more, "r+") as file:  # as many other scenes of this seed would have it
        file.attrs["truth_digest"] = "1" * 64
    with pytest.raises(SpecError):
        learn(more)
    with h5py.File(more, "r+") as file:
        file.attrs["spec"] = file.attrs["spec"].replace('"seed":77', '"seed":78')
    learn(more)
