"""The run on a GPU: its commands can be read; steps that fail, hang or are done stop no other."""

import re
import shlex

import click
import pytest

import cli
from benchmarks.gpu.run import FULL, PAPER, TOY, Stage, Step, main, run_stages, stages


@pytest.mark.parametrize("size", [FULL, TOY])
def test_every_command_can_be_read(size):
    planned = stages(size, 9, "cuda")
    steps = [step for stage in planned for lane in stage.lanes for step in lane]
    for step in steps:
        program, *words = shlex.split(step.command)
        command = getattr(cli, program, None)
        while isinstance(command, click.Group):
            command = command.get_command(click.Context(command), words.pop(0))
        if command is not None:
            command.make_parser(click.Context(command)).parse_args(words)
    assert sum(stage.share for stage in planned) == pytest.approx(1)
    trained = {step.name for step in steps if re.match("[a-z0-9]+ train ", step.command)}
    assert trained == {"depth-match", "depth-supervised", "depth-completed", PAPER}


def test_steps_that_fail_hang_or_are_done_stop_no_other(tmp_path):
    good, bad = "timeit -n 1 -r 1 pass", "timeit -n 1 -r 1 ("
    slow = "timeit -n 1 -r 1 'import time; time.sleep(99)'"
    first = [Step("bad", bad), Step("good", good)]
    second = [Step("slow", slow), Step("late", "timeit -n 1 -r 1 1")]
    planned = [Stage(0.5, [first, second]), Stage(0.5, [[Step("after", "timeit -n 1 -r 1 2")]])]
    told = dict(step[:2] for step in run_stages(tmp_path, planned, 8))
    assert told == {
        "bad": "failed", "good": "done", "slow": "over time", "late": "no time", "after": "done",
    }  # fmt: skip
    assert "loop" in (tmp_path / "result" / "logs" / "good.txt").read_text()
    assert "SyntaxError" in (tmp_path / "result" / "logs" / "bad.err").read_text()
    steps = [Stage(1, [[Step("good", good)], [Step("again", good)]])]
    told = dict(step[:2] for step in run_stages(tmp_path, steps, 60, again=("again",)))
    assert told == {"good": "done before", "again": "done"}


@pytest.mark.slow
def test_a_toy_run_on_a_cpu_leaves_weights_scores_and_tables(tmp_path, monkeypatch):
    folder = tmp_path / "gpu"
    words = ["run", "--toy", "--device", "cpu", "--minutes", "12", "--folder", str(folder)]
    monkeypatch.setattr("sys.argv", words)
    main()
    result = folder / "result"
    assert len(list(result.glob("*.safetensors"))) == 3
    assert len(list((result / "scores").glob("*.json"))) == 9
    tables = (result / "tables.md").read_text()
    assert all(f"| {kind} " not in tables for kind in ("failed", "over time"))
