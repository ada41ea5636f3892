"""The tables: which commands make which cells, and what is printed."""

import json
import shlex

import pytest

from benchmarks.results import markdown, questions, rooms
from benchmarks.results.steps import StepError


@pytest.fixture
def ran(monkeypatch):
    """Replace the running of commands; return the commands and the scores that they give."""
    commands = []

    def run(folder, command):
        commands.append(command)
        words = command.split()
        if (words[:2] == ["pix2shape", "train"] and "views" not in words) or words[:3] == [
            "bench",
            "baseline",
            "ptn",
        ]:
            raise StepError("none yet")
        if words[:2] == ["iqtt", "make-split"]:
            base = folder / words[-1]
            parts = [base] if words[-1] != "suite" else [base / kind for kind in questions.KINDS]
            for part in parts:
                part.mkdir(parents=True)
                for name in ("train", "test", "test-answers"):
                    (part / f"iqtt-{name}.h5").write_text(f"{part.name} {name}")
            return
        made = words[words.index("--json" if "--json" in words else "--out") + 1]
        path = folder / made
        if "train" in words[:2]:
            if "--start" in words:
                assert (folder / words[words.index("--start") + 1]).exists()
            path = path / "weights.safetensors"
        path.parent.mkdir(parents=True, exist_ok=True)
        score = {"value": 0.5, "low": 0.4, "high": 0.6, "std": None, "n": 9}
        scores = {"metrics": {"iqtt_accuracy": score, "chamfer": score, "relief_iou": score}}
        skill = {"value": -0.25, "low": -0.5, "high": 0.0}
        scores |= {"skills": {"chamfer": skill, "iqtt_accuracy": skill}}
        scores |= {"by_view_angle": {"35": {"chamfer": score}}}
        path.write_text(json.dumps(scores) if "--json" in words else command)

    monkeypatch.setattr("benchmarks.results.steps.run_command", run)
    monkeypatch.setattr("benchmarks.results.steps.h5py.File", NotData)
    return commands


class NotData:
    """In the place of h5py.File: a file without fingerprint."""

    def __init__(self, path):
        self.attrs = {}

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass


def test_questions_are_trained_once_and_answered_by_kind(ran, tmp_path):
    methods = ["chance", "cnn", "siamese", "pix2shape-compact"]
    failed = questions.run(tmp_path, methods, 2)
    assert len(failed) == 3 * len(questions.KINDS), "pix2shape-compact at 0, 200 and 1,000 labels"
    trained = [c for c in ran if c.startswith("bench train")]
    expected = [
        f"bench train {name} --data mixed/iqtt-train.h5 --labels {labels} --seed {seed}"
        f" --out {name}-{labels}-{seed}"
        for name in ("cnn", "siamese")
        for labels in (200, 1000)
        for seed in (0, 1)
    ]
    assert trained == expected
    scored = [c for c in ran if c.startswith("bench score")]
    assert len(scored) == 6 + 2 * 5 + 2 * 6, "cnn has no answers for questions of two"
    assert (
        "bench score siamese-200-0/answers-near.h5 siamese-200-1/answers-near.h5"
        " --truth suite/near/iqtt-test-answers.h5 --json siamese-200/near-scores.json"
    ) in scored
    count = len(ran)
    questions.run(tmp_path, ["chance", "cnn", "siamese"], 2)
    assert len(ran) == count, "nothing is made twice"
    questions.run(tmp_path, ["siamese"], 3)
    assert sum(c.startswith("bench train") for c in ran[count:]) == 2, "only the third seed"


def test_labels_train_a_last_layer_on_the_run_without(ran, tmp_path):
    questions.run(tmp_path, ["rezende"], 1)
    trained = [c for c in ran if c.startswith("bench train")]
    line = (
        "bench train rezende --data mixed/iqtt-train.h5 --labels {0} --seed 0 --out rezende-{0}-0"
    )
    start = """ --set 'start="rezende-0-0/weights.safetensors"'"""
    assert trained == [line.format(0), line.format(200) + start, line.format(1000) + start]


def test_the_views_with_labels_start_from_the_run_without(ran, tmp_path):
    assert questions.run(tmp_path, ["pix2shape-views"], 1) == []
    trained = [shlex.split(c) for c in ran if c.startswith("pix2shape train")]
    outs = [words[words.index("--out") + 1] for words in trained]
    starts = [words[words.index("--start") + 1] for words in trained if "--start" in words]
    assert outs == [f"pix2shape-views-{labels}-0" for labels in (0, 200, 1000)]
    assert starts == ["pix2shape-views-0-0/weights.safetensors"] * 2
    assert {words[words.index("--data") + 1] for words in trained} == {"other/iqtt-train.h5"}
    assert ["iterations=1200" in words for words in trained] == [False, True, True]


def test_table_3(ran, tmp_path):
    questions.run(tmp_path, ["siamese"], 1)
    lines = questions.page(tmp_path).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert cells[0] == ["method", "labels", *(f"`{k}`" for k in questions.KINDS), "paper, Table 3"]
    score = "0.500 [0.400, 0.600]"
    assert cells[2] == ["`siamese`", "200", *[score] * 6, "0.3610"]
    assert cells[3] == ["`siamese`", "1,000", *[score] * 6, "0.3701"]
    assert cells[4] == ["people", "–", *["–"] * 6, "0.7329 ± 0.148"]
    assert cells[10] == ["`siamese`", "200", *["-0.250 [-0.500, 0.000]"] * 6], "skills"
    assert len(cells) == 12


def test_rooms(ran, tmp_path):
    failed = rooms.run(tmp_path, ["mean-depth", "ptn", "oracle"])
    assert failed == [f"ptn, {preset}" for preset in rooms.PRESETS]
    assert (
        "scenegen render --preset shapenet --object-split test --n 300 --views 0,5,35,55,80"
        " --seed 1000 --size 64 --out test-shapenet.h5"
    ) in ran
    assert (
        "bench baseline mean-depth --data test-shapes.h5 --train train-shapes.h5"
        " --out mean-depth-shapes.h5"
    ) in ran
    assert not (tmp_path / "mean-depth-shapes.h5").exists()
    count = len(ran)
    rooms.run(tmp_path, ["mean-depth", "oracle"])
    assert len(ran) == count
    text = rooms.page(tmp_path)
    assert text.count("###") == 3
    row = f"| `oracle` | 0.500 [0.400, 0.600] | {'– | ' * 3}-0.250 [-0.500, 0.000] | – | – |"
    assert row in text
    assert "| 35 | `mean-depth` | – | 0.5000 [0.4000, 0.6000] | – | – | – | – |" in text


def test_every_method_has_one_entry_and_its_paper_name_exists():
    for methods in (questions.METHODS, rooms.METHODS):
        names = [method.name for method in methods]
        assert len(set(names)) == len(names)
    known = {figure.method for figure in questions.TABLES[2].figures}
    assert {m.paper for m in questions.METHODS if m.paper} | {questions.PEOPLE} == known


def test_a_table_goes_between_its_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- x -->\nold\n<!-- end of x -->\nb\n")
    markdown.put(page, "x", "new")
    markdown.put(page, "x", "newer")
    assert page.read_text() == "a\n<!-- x -->\n\nnewer\n\n<!-- end of x -->\nb\n"
    with pytest.raises(ValueError, match="<!-- y -->"):
        markdown.put(page, "y", "new")


def test_the_page_has_the_marks():
    from benchmarks.results.__main__ import PAGE, TABLES

    text = PAGE.read_text()
    assert all(f"<!-- {name} -->" in text and f"<!-- end of {name} -->" in text for name in TABLES)


def commands_of_all_entries():
    for method in questions.METHODS:
        yield method.name, method.answer
        if method.train:
            yield method.name, f"{method.train} {method.start}"
    for step in (
        questions.TRAINING,
        questions.OTHER,
        questions.SUITE,
        *rooms.data("shapenet").values(),
    ):
        yield "data", step.command
    for method in rooms.METHODS:
        yield method.name, f"bench baseline {method.name} --data x --out y {method.options}"


@pytest.mark.parametrize(("name", "command"), list(commands_of_all_entries()))
def test_commands_have_the_options_that_are_named(name, command):
    import cli
    from baselines.commands import ALL

    if name not in ALL and name != "data":
        pytest.skip("not there yet")
    program, verb, *words = shlex.split(command)
    known = {
        option for p in getattr(cli, program).get_command(None, verb).params for option in p.opts
    }
    assert {word for word in words if word.startswith("--")} <= known
