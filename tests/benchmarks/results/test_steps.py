"""What is made once is not made again; what changed is; what was stopped goes on."""

import json

import pytest

from benchmarks.results import steps
from benchmarks.results.steps import CHECKPOINT, Step, StepError, each, made, mark, record

TRAIN = Step(
    "bench train cnn --data data.txt --labels 2 --seed 1 --out run",
    "run/w.bin",
    ("data.txt",),
    "run",
)
ANSWER = Step("bench baseline cnn --data data.txt --out a.bin", "a.bin", ("data.txt",))


@pytest.fixture
def kitchen(tmp_path):
    """Return a folder, and a runner that writes what the commands are asked for."""
    (tmp_path / "data.txt").write_text("one")
    commands = []

    def run(folder, command):
        commands.append(command)
        if " train " in command:
            (folder / "run").mkdir(exist_ok=True)
            if len(commands) == 1:
                (folder / "run" / CHECKPOINT).write_text("half")
                raise StepError("killed")
            (folder / "run" / "w.bin").write_text("weights")
        else:
            (folder / "a.bin").write_text("answers")

    return tmp_path, run, commands


def test_a_stopped_run_goes_on_and_is_made_once(kitchen):
    folder, run, commands = kitchen
    with pytest.raises(StepError):
        made(folder, TRAIN, run)
    made(folder, TRAIN, run)
    made(folder, TRAIN, run)
    assert commands == [
        TRAIN.command, "bench train cnn --data data.txt --out run --resume"
    ]  # fmt: skip
    assert not json.loads((folder / "run/w.bin.made.json").read_text())["reads"].keys() - {
        "data.txt"
    }


def test_another_input_or_setting_begins_anew(kitchen):
    folder, run, commands = kitchen
    with pytest.raises(StepError):
        made(folder, TRAIN, run)
    (folder / "data.txt").write_text("two")
    made(folder, TRAIN, run)
    assert commands[1:] == [TRAIN.command], "the checkpoint was of other data"
    assert not (folder / "run" / CHECKPOINT).exists()
    made(folder, ANSWER, run)
    made(folder, ANSWER, run)
    assert len(commands) == 3
    made(folder, Step(f"{ANSWER.command} --seed 1", "a.bin", ("data.txt",)), run)
    assert len(commands) == 4
    (folder / "a.bin").unlink()
    made(folder, Step(f"{ANSWER.command} --seed 1", "a.bin", ("data.txt",)), run)
    assert len(commands) == 5, "the product is gone"


def test_what_somebody_put_there_is_not_removed(kitchen):
    folder, run, commands = kitchen
    (folder / "a.bin").write_text("mine")
    with pytest.raises(StepError):
        made(folder, ANSWER, run)
    assert (folder / "a.bin").read_text() == "mine"
    assert commands == []


def test_a_command_that_makes_nothing_has_failed(kitchen):
    with pytest.raises(StepError):
        made(kitchen[0], ANSWER, lambda folder, command: None)


def test_commands_run_in_the_folder(tmp_path, rooms_path, capfd):
    made(tmp_path, Step(f"bench baseline empty-room --data {rooms_path} --out e.h5", "e.h5"))
    assert (tmp_path / "e.h5").exists()
    with pytest.raises(StepError):
        made(tmp_path, Step("bench baseline chance --data none.h5 --out c.h5", "c.h5"))
    assert "none.h5" in capfd.readouterr().err


def test_scores_are_kept_with_their_settings(tmp_path):
    path, calls = tmp_path / "scores" / "x.json", []

    def score(value):
        calls.append(value)
        return {"accuracy": value}

    assert record(path, {"seeds": 3}, lambda: score(1)) == {"accuracy": 1}
    assert record(path, {"seeds": 3}, lambda: score(2)) == {"accuracy": 1}
    assert record(path, {"seeds": 1}, lambda: score(3)) == {"accuracy": 3}
    assert calls == [1, 3]


def test_marks_are_fingerprints_or_digests(truths, tmp_path):
    train = truths.iqtt.with_name("iqtt-train.h5")
    assert len(mark(train).split()) == 2
    assert mark(train) != mark(truths.iqtt) != mark(truths.rooms)
    (tmp_path / "x").write_text("")
    assert mark(tmp_path / "x").startswith("e3b0c44298fc1c14")
    assert steps.bundled_mark("pix2shape") != steps.bundled_mark("nothing") == ""


def test_one_failure_does_not_stop_the_others(capsys):
    seen = []

    def bad():
        raise StepError("no")

    assert each([("a", bad), ("b", lambda: seen.append("b"))]) == ["a"]
    assert seen == ["b"]
    assert "a: no" in capsys.readouterr().err
