"""What holds for every baseline that is trained: runs go on bit for bit, and refuse what is wrong.

`training/test_fit.py` has the loop itself; here each method's batches, seeds and settings take
part.
"""

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import h5py
import pytest
import torch
from h5_edits import attribute
from pix2shape_models import edited
from refusals import refused

from baselines.commands import HOMES
from baselines.relief import depth_supervised
from baselines.training.baseline import Baseline
from baselines.training.baseline import train as fit
from baselines.training.checkpoint import CHECKPOINT, WEIGHTS, load_tensors
from baselines.training.data import TrainingFiles
from baselines.training.machine import Machine
from scenegen.common.errors import SceneGenError, SpecError

RELIEF = {"size": 32, "width": 0.25, "batch": 4}
RESNET = {"size": 16, "width": 4, "batch": 2}
PTN = {"size": 16, "width": 2, "batch": 2, "rays": 40, "samples": 12}
REZENDE = {"size": 16, "code": 4, "batch": 4, "pairs": 1}
CASES: dict[str, tuple[str, str, dict[str, Any], dict[str, Any]]] = {
    "cnn": ("cnn", "questions", RESNET, {}),
    "siamese": ("siamese", "questions", RESNET, {"labels": 2}),
    "depth-match": ("depth-match", "questions", RELIEF, {}),
    "unet": ("depth-supervised", "rooms", RELIEF, {}),
    "completed": ("depth-completed", "rooms", RELIEF, {}),
    "view-pairs": ("view-pairs", "rooms", RELIEF, {}),
    "solids": ("solid-supervised", "layers", RELIEF, {}),
    "ptn, rooms": ("ptn", "rooms", PTN, {}),
    "ptn, ids": ("ptn", "rooms", {**PTN, "silhouettes": "ids"}, {}),
    "ptn, questions": ("ptn", "questions", PTN, {"labels": 2}),
    "rezende": ("rezende", "questions", REZENDE, {"labels": 2}),
}
# Which share most of their code with another case.
VARIANTS = ("siamese", "completed", "solids", "ptn, ids")
each = pytest.mark.parametrize(
    "case", [pytest.param(c, marks=[pytest.mark.slow] * (c in VARIANTS)) for c in CASES]
)
Train = Callable[..., Path]


def baseline_of(name: str) -> Baseline:
    baseline: Baseline = import_module(f"baselines.{HOMES[name]}").BASELINE
    return baseline


@pytest.fixture(scope="session")
def data(turned_path: Path, truths: Any, make_rooms: Any, tmp_path_factory: Any) -> dict[str, Path]:
    """Return rooms of 3 views, and 3 labelled questions and 3 others, all of 32x32 pixels."""
    layers = tmp_path_factory.mktemp("layers") / "layers.h5"
    make_rooms(layers, 4, height=32, width=32, truth=("layers",))
    questions = Path(truths.iqtt).with_name("iqtt-train.h5")
    return {"rooms": turned_path, "layers": layers, "questions": questions}


@pytest.fixture(scope="session")
def unet(data: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    settings = depth_supervised.BASELINE.settings(**RELIEF, iterations=1)
    folder = tmp_path_factory.mktemp("unet")
    return fit(depth_supervised.BASELINE, TrainingFiles(data["rooms"]), folder, settings)


@pytest.fixture
def train(case: str, data: dict[str, Path], unet: Path, tmp_path: Path) -> Train:
    """Train a case into a folder; settings are those of the case unless it goes on."""
    name, kind, settings, how = CASES[case]
    if case == "completed":
        how = {"start": str(unet)}
    baseline = baseline_of(name)

    def run(folder: str, path: Path | None = None, **more: Any) -> Path:
        names = baseline.settings.__dataclass_fields__
        changed = {key: more.pop(key) for key in more.keys() & names.keys()}
        goes_on = more.get("resume", False)
        made = baseline.settings(**{"iterations": 5, **settings, **changed})
        given = {} if goes_on else {"settings": made, **how}
        with TrainingFiles(path or data[kind]) as files:
            machine = Machine("cpu", every=2)
            return fit(baseline, files, tmp_path / folder, machine=machine, **{**given, **more})

    return run


def content(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the tensors of a file, and its card, without the seconds that training took."""
    tensors, notes = load_tensors(path)
    (card,) = map(json.loads, notes.values())
    return tensors, {**card, "seconds": 0}


def differing(one: Path, other: Path) -> list[str]:
    found, expected = content(one)[0], content(other)[0]
    assert found.keys() == expected.keys()
    return [name for name in found if not torch.equal(found[name], expected[name])]


def killed_at(iteration: int) -> Callable[..., None]:
    def progress(done: int, total: int, numbers: Any) -> None:
        if done == iteration:
            raise KeyboardInterrupt

    return progress


@each
def test_a_stop_in_the_middle_changes_nothing(case, train, tmp_path):
    """Weights, moments and card to the bit; the seed decides, and nothing else."""
    steps: list[Any] = []
    whole = train("whole", seed=7, progress=lambda *now: steps.append(now))
    assert [now[:2] for now in steps if now[0]][:5] == [(done, 5) for done in range(1, 6)]
    with pytest.raises(KeyboardInterrupt):
        train("cut", seed=7, progress=killed_at(3))
    assert content(tmp_path / "cut" / CHECKPOINT)[1]["iteration"] == 2
    with pytest.raises(FileExistsError):
        train("cut")
    again: list[int] = []
    cut = train("cut", resume=True, progress=lambda done, *_: again.append(done))
    assert [done for done in again if done > 2][:3] == [3, 4, 5]
    for name in (WEIGHTS, CHECKPOINT):
        assert differing(whole.with_name(name), cut.with_name(name)) == []
        assert content(whole.with_name(name))[1] == content(cut.with_name(name))[1]
    assert differing(whole, train("other", seed=8))


@each
def test_the_card_tells_data_and_labels(case, train, data):
    name, kind, settings, how = CASES[case]
    card = content(train("run", iterations=1))[1]
    with h5py.File(data[kind]) as file:
        part = "labeled" if name in ("cnn", "siamese") else "unlabeled"
        mark = file.attrs[f"fingerprint_{part}" if kind == "questions" else "fingerprint"]
    labels = 3 if name == "cnn" else how.get("labels", 0)
    assert (card["method"], card["fingerprint"], card["labels"]) == (name, mark, labels)
    assert card["settings"].items() >= settings.items()


@each
def test_a_run_goes_on_with_its_own_data_alone(case, train, data, tmp_path):
    train("run", iterations=1)
    kind = CASES[case][1]
    of_questions = ["fingerprint_labeled", "fingerprint_unlabeled"]
    marks = of_questions if kind == "questions" else ["fingerprint"]
    edits = [attribute(name, "0" * 64) for name in marks]
    other = edited(data[kind], tmp_path / "other.h5", *edits)
    with refused(SpecError, str(other), "recipe hash 000000000000"):
        train("run", other, resume=True)
    with pytest.raises(FileNotFoundError):
        train("none", resume=True)


@each
@pytest.mark.parametrize("what", ["nothing.h5", "other", "iqtt-test.h5", "batch", "labels"])
def test_what_cannot_be_trained_on_leaves_no_folder(case, what, train, data, tmp_path):
    kind = CASES[case][1]
    if what == "iqtt-test.h5":
        kind = "rooms"
    paths = {"other": data["rooms" if kind == "questions" else "questions"]}
    path = paths.get(what, data["questions"].with_name(what) if "h5" in what else data[kind])
    how = {"batch": 0} if what == "batch" else {}
    if what == "labels" and CASES[case][0] == "depth-match":
        return  # it has none
    if what == "labels" and kind == "questions":
        how = {"labels": 4}
    elif what in ("other", "labels") and CASES[case][0] == "ptn":
        path, how = data["rooms"], {"labels": 1}
    elif what == "labels":
        return
    with pytest.raises((SceneGenError, OSError)):
        train("run", path, **how)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("name", "settings", "keyword"), [("ptn", PTN, "networks"), ("rezende", REZENDE, "start")]
)
def test_labels_alone_are_learned_from_weights_of_another_run(
    name, settings, keyword, data, tmp_path
):
    """The networks stay as they are stored, and the card says what is new."""
    baseline, path = baseline_of(name), TrainingFiles(data["questions"])
    plain = fit(baseline, path, tmp_path / "plain", baseline.settings(**settings, iterations=2))
    later = fit(baseline, path, tmp_path / "later", labels=3, **{keyword: str(plain)})
    (_, before), (tensors, card) = content(plain), content(later)
    heads = {key for key in tensors if key.startswith("head.")}
    assert set(differing(plain, later)) == heads
    assert (before["labels"], card["labels"]) == (0, 3)
    new = {key for key in card if card[key] != before[key]}
    assert new == ({"labels", "head"} if name == "ptn" else {"labels"})
    with pytest.raises(FileExistsError):
        fit(baseline, path, tmp_path / "later", **{keyword: str(plain)})
    if name == "rezende":
        where, wrong = "plain", {"resume": True}
    else:
        where, wrong = "wrong", {"settings": baseline.settings(width=2)}
    with refused(SpecError, keyword):
        fit(baseline, path, tmp_path / where, **wrong, **{keyword: str(plain)})


def test_depth_supervised_begins_with_given_weights(unet, data, tmp_path):
    baseline = depth_supervised.BASELINE
    settings = baseline.settings(**RELIEF, iterations=1, learning_rate=1e-12)
    how = {"start": str(unet)}
    with TrainingFiles(data["rooms"]) as files:
        found = content(fit(baseline, files, tmp_path / "run", settings, **how))[0]
        for name, expected in content(unet)[0].items():
            if "running" not in name and "batches" not in name:
                torch.testing.assert_close(found[name], expected, rtol=0, atol=1e-9)
        with refused(SpecError, "start"):
            fit(baseline, files, tmp_path / "run", resume=True, **how)
        with refused(SpecError, "start"):
            wider = baseline.settings(**{**RELIEF, "width": 1.0}, iterations=1)
            fit(baseline, files, tmp_path / "other", wider, **how)


IMPOSSIBLE = {
    "depth-supervised": {
        "size": 48, "width": 100.0, "iterations": 0, "batch": 1,
        "learning_rate": -1.0, "seed": -1,
    },
    "ptn": {
        "silhouettes": "guess", "width": 3, "size": 20, "samples": 1, "iterations": 0,
        "learning_rate": 0.0, "weight_decay": 2.0,
    },
    "cnn": {
        "depth": 34, "width": 10**9, "size": 0, "batch": 0, "learning_rate": float("nan"),
        "iterations": 0, "seed": -1,
    },
    "rezende": {
        "size": 20, "code": 10**9, "pairs": 0, "width": float("inf"), "iterations": 0, "seed": -1,
    },
}  # fmt: skip


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_impossible_settings_are_refused(name):
    for setting, value in IMPOSSIBLE[name].items():
        with refused(SpecError, setting.replace("_", " ")):
            baseline_of(name).settings(**{setting: value})
