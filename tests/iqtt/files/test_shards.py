"""Splits in shards: one file to every reader, the same bytes after a kill, and one seed only."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

import cli
from iqtt.audit.audit import audit
from iqtt.files.make import make_split, make_suite
from iqtt.files.merge import merge_questions
from iqtt.files.reader import AnswersFile, QuestionsFile
from iqtt.files.shards import ALL_FILES, MANIFEST
from iqtt.files.verify import verify_split
from iqtt.questions.specs import SUITE, SplitSpec
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.files.manifest import read_manifest

SEED = 8_123_456_789_012_345
SPEC = SplitSpec(
    seed=SEED, train=13, labeled=5, val=4, test=9, cubes=(6, 7), height=24, width=32,
    min_cube_pixels=1, lights=(1, 2), with_depth=True,
)  # fmt: skip
SIZE, COMMAND = 4, f"iqtt make-split --seed {SEED}"
NONE_LABELLED = replace(SPEC, labeled=0, with_depth=False)
SPECS = [
    pytest.param(SPEC, id="some labelled"),
    pytest.param(NONE_LABELLED, id="none labelled", marks=pytest.mark.slow),
]


@pytest.fixture(scope="module", params=SPECS)
def made(request, tmp_path_factory):
    """Return a spec, and its files in shards and whole."""
    folder, spec = tmp_path_factory.mktemp("made"), request.param
    make_split(folder / "shards", spec, shard_size=SIZE, command=COMMAND)
    make_split(folder / "whole", spec, command=COMMAND)
    return spec, folder / "shards", folder / "whole"


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.h5")}


def everything(path):
    """Return the values of all data sets that plain h5py reads, and the attributes of the root."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda n, x: found.update({n: x[()]}) if hasattr(x, "dtype") else None)
        return found, {k: v for k, v in file.attrs.items() if k != "content_digest"}


@pytest.mark.parametrize("name", ALL_FILES)
def test_plain_h5py_and_a_merge_give_the_whole_file(made, tmp_path, name, monkeypatch):
    monkeypatch.chdir("/")
    (values, told), (expected, attributes) = (everything(folder / name) for folder in made[1:])
    values.pop("shards", None)
    assert values.keys() == expected.keys()
    for key, value in values.items():
        np.testing.assert_array_equal(value, expected[key])
    assert told == attributes
    merge_questions(made[1] / name, tmp_path / name)
    assert (tmp_path / name).read_bytes() == (made[2] / name).read_bytes()


def test_shards_hold_what_they_say(made):
    spec, folder, _ = made
    manifest = read_manifest(folder / MANIFEST)
    assert manifest.complete
    assert {shard.file for shard in manifest.shards} == {
        path.name for path in folder.glob("*.h5")
    } - {"iqtt-train.h5", "iqtt-test.h5", "iqtt-test-answers.h5"}
    labelled = [shard.rows for shard in manifest.shards_of("iqtt-train.h5")]
    assert labelled == ([4, 1, 4, 4] if spec.labeled else [4, 4, 4, 1])
    with QuestionsFile(folder / "iqtt-test-00001-of-00003.h5") as shard:
        assert len(shard) == SIZE
    assert all(check.ok for check in verify_split(folder))


def test_the_audit_finds_the_same(made):
    audits = [audit([folder]) for folder in made[1:]]
    found = [json.dumps(one.record()) for one in audits]
    assert found[0].replace(str(made[1]), str(made[2])) == found[1]
    assert audits[0].passed


def test_commands_take_shards(made, tmp_path):
    def call(*words):
        result = CliRunner().invoke(cli.bench, [str(word) for word in words])
        assert result.exit_code == 0, result.output

    found = []
    for folder in made[1:]:
        answers, score = tmp_path / f"{folder.name}.h5", tmp_path / f"{folder.name}.json"
        data = folder / "iqtt-test.h5"
        call("baseline", "chance", "--data", data, "--out", answers)
        call("score", answers, "--truth", folder / "iqtt-test-answers.h5", "--json", score)
        found.append(json.loads(score.read_text())["summary"]["metrics"])
    assert found[0] == found[1]


@pytest.mark.parametrize("left", [0, 5, 21])
def test_a_run_goes_on_and_only_with_its_seed(made, tmp_path, left):
    spec, done = made[0], []

    def stop(rows):
        done.append(rows)
        if sum(done) > left:
            raise KeyboardInterrupt

    folder = tmp_path / "split"
    options = {"shard_size": SIZE, "command": COMMAND, "batch": 2}
    with pytest.raises(KeyboardInterrupt):
        make_split(folder, spec, **options, progress=stop)
    kept = [path for path in folder.glob("*.h5") if left]
    others = [(replace(spec, min_angle_degrees=31), options), (spec, {**options, "shard_size": 5})]
    for other, how in [*others, *([(replace(spec, seed=1), options)] if kept else [])]:
        with pytest.raises(SpecError):
            make_split(folder, other, **how)
    again = []
    make_split(folder, spec, **options, progress=again.append)
    assert sum(again) == 26
    assert contents(folder) == contents(made[1])
    assert not list(folder.glob(".*"))
    with pytest.raises(FileExistsError):
        make_split(folder, spec, **options)


def test_another_seed_is_refused_without_training(tmp_path):
    spec = replace(SPEC, train=0, labeled=0, val=0)

    def stop(_rows):
        if len(list(tmp_path.glob("split/*-answers-*"))) > 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_split(tmp_path / "split", spec, shard_size=SIZE, batch=2, progress=stop)
    with pytest.raises(SpecError):
        make_split(tmp_path / "split", replace(spec, seed=1), shard_size=SIZE)
    with pytest.raises(SpecError):
        make_split(tmp_path / "split", spec, shard_size=SIZE, secret=True)


def test_a_damaged_shard_is_named_and_made_again(made, tmp_path):
    folder = tmp_path / "split"
    make_split(folder, made[0], shard_size=SIZE, command=COMMAND)
    name = "iqtt-train-00002-of-00004.h5"
    data = bytearray((folder / name).read_bytes())
    data[len(data) // 2] ^= 1
    (folder / name).write_bytes(data)
    wrong = {check.name: check.detail for check in verify_split(folder) if not check.ok}
    assert wrong.keys() == {"checksums"}
    assert name in wrong["checksums"]
    (folder / "iqtt-test-answers-00000-of-00003.h5").unlink()
    with pytest.raises(FileFormatError):
        AnswersFile(folder / "iqtt-test-answers.h5")
    make_split(folder, made[0], shard_size=SIZE, command=COMMAND)
    assert contents(folder) == contents(made[1])


def test_no_file_but_the_answers_tells_the_seed(made):
    for path in made[1].iterdir():
        tells = str(SEED).encode() in path.read_bytes()
        assert tells == path.name.startswith("iqtt-test-answers"), path.name


def test_whole_and_sharded_splits_replace_each_other(made, tmp_path):
    folder = tmp_path / "split"
    make_split(folder, made[0], command=COMMAND)
    make_split(folder, made[0], shard_size=SIZE, command=COMMAND, overwrite=True)
    assert contents(folder) == contents(made[1])
    make_split(folder, made[0], command=COMMAND, overwrite=True)
    assert contents(folder) == contents(made[2])
    assert len(list(folder.iterdir())) == 4


@pytest.mark.parametrize("size", [4, 100])
def test_a_suite_goes_on(tmp_path, size):
    spec = replace(SPEC, train=5, labeled=2, val=1, test=1, cubes=(8, 9))
    home, done = tmp_path / "suite", []

    def stop(rows):
        done.append(rows)
        if sum(done) > 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_suite(home, spec, shard_size=size, progress=stop)
    first = next(iter(SUITE))
    before = {p: p.stat().st_mtime_ns for p in (home / first).iterdir()}
    with pytest.raises(SpecError):
        make_suite(home, replace(spec, seed=1), shard_size=size)
    make_suite(home, spec, shard_size=size)
    assert {p: p.stat().st_mtime_ns for p in before} == before
    assert {p.name for p in home.iterdir()} == set(SUITE)
    with pytest.raises(FileExistsError):
        make_suite(home, spec, shard_size=size)
