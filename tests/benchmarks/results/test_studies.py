"""The ablations: every row is trained with every seed, and its cells are means over the runs."""

import json
from dataclasses import replace

import pytest

from baselines.pix2shape.network.config import model_config
from benchmarks.results import studies
from benchmarks.results.steps import StepError


@pytest.fixture
def ran(monkeypatch):
    """Replace the running of commands; the score is 0.25 for seed 0 and 0.75 for the others."""
    commands = []

    def run(folder, command):
        commands.append(command)
        words = command.split()
        made = folder / words[words.index("--json" if "--json" in words else "--out") + 1]
        if words[0] == "iqtt":
            for name in ("train", "test", "test-answers"):
                (made / f"iqtt-{name}.h5").parent.mkdir(parents=True, exist_ok=True)
                (made / f"iqtt-{name}.h5").write_text(name)
            return
        if "adversarial=1" in words and words[1] == "train":
            raise StepError("none of these")
        path = made / "weights.safetensors" if words[1] == "train" else made
        path.parent.mkdir(parents=True, exist_ok=True)
        score = {"value": 0.25 if "-0/" in command else 0.75, "low": None, "high": None}
        scores = {"metrics": {"iqtt_accuracy": score}, "by_view_angle": {"35": {"chamfer": score}}}
        path.write_text(json.dumps(scores) if "--json" in words else command)

    class NoData:
        def __init__(self, path):
            self.attrs = {}

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

    monkeypatch.setattr("benchmarks.results.steps.run_command", run)
    monkeypatch.setattr("benchmarks.results.steps.h5py.File", NoData)
    return commands


def test_every_row_is_trained_with_every_seed_once(ran, tmp_path):
    assert studies.run(tmp_path, ["information-200"], 2) == []
    trained = [command for command in ran if command.startswith("pix2shape train")]
    weights = (0.1, 0.4, 0.6, 0.8, 1.0)
    assert [c.count("--labels 200") for c in trained] == [1] * 10
    for place, command in enumerate(trained):
        weight, seed = weights[place // 2], place % 2
        assert f"--set mutual_information={weight} --set seed={seed} --out" in command
    studies.run(tmp_path, ["information-200"], 3)
    assert len([command for command in ran if command.startswith("pix2shape train")]) == 15
    page = studies.page(tmp_path)
    assert "| 0.4 | 3 | 0.583 ± 0.289 |" in page
    assert page.count("###") == 1, "what was not run has no table"


def test_a_run_that_fails_is_told_and_leaves_the_others(ran, tmp_path):
    failed = studies.run(tmp_path, ["losses"], 1)
    assert failed == ["losses, adversarial, seed 0", "losses, adversarial, reconstruction, seed 0"]
    head, _, *rows = studies.page(tmp_path).split("\n\n")[1].splitlines()
    place = head.split(" | ").index("CD")
    found = {tuple(row.split(" | ")[:3]): row.split(" | ")[place] for row in rows}
    assert len(found) == 10, "a floor and a row in five views"
    assert found["| 35°", "reconstruction", "1"] == "0.2500"
    assert found["| 0°", "reconstruction", "1"] == "–"
    assert found["| 35°", "empty-room", "1"] == "0.2500"
    assert [c for c in ran if "bench baseline empty-room --data study-test.h5" in c]


def test_a_row_counts_its_own_runs_alone(tmp_path):
    """The name of one row may begin with that of another."""
    (tmp_path / "scores").mkdir()
    columns = dict.fromkeys(studies.STUDIES["losses"].scores, 0.5)
    for run in ("adversarial-0", "adversarial-12", "adversarial-reconstruction-0"):
        path = tmp_path / "scores" / f"study-losses-{run}.json"
        row, _, seed = run.rpartition("-")
        row = {"adversarial": row}.get(row, "adversarial, reconstruction")
        commands = studies.commands_of("losses", row, int(seed))
        settings = {"commands": commands, "files": {}}
        path.write_text(json.dumps({"scores": columns, "settings": settings}))
    rows = studies.page(tmp_path).splitlines()[4:6]
    assert [row.split(" | ")[2] for row in rows] == ["2", "1"]


def test_runs_of_other_settings_are_not_averaged_with_todays(ran, tmp_path, monkeypatch):
    studies.run(tmp_path, ["information-200"], 2)
    study = studies.STUDIES["information-200"]
    changed = replace(study, rows={**study.rows, "0.4": "mutual_information=0.4 batch=8"})
    monkeypatch.setitem(studies.STUDIES, "information-200", changed)
    assert "| 0.1 | 2 |" in studies.page(tmp_path)
    assert "| 0.4 |" not in studies.page(tmp_path)
    studies.run(tmp_path, ["information-200"], 1)
    assert "| 0.4 | 1 |" in studies.page(tmp_path)


@pytest.mark.parametrize("study", studies.STUDIES.values(), ids=studies.STUDIES)
def test_every_row_is_a_model_of_its_own(study):
    config = "paper" if "--config paper" in study.options else "compact"
    found = []
    for settings in study.rows.values():
        values = [setting.split("=") for setting in settings.split()]
        found.append(model_config(config, **{name: json.loads(value) for name, value in values}))
    assert len(set(found)) == len(found) > 1
