"""Models of many shapes are run, resumed and refused."""

import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from metrics.intake import model_file
from metrics.intake.model_file import ModelError, _with_types, opened_model
from metrics.intake.model_runner import plain
from metrics.intake.running import Call, run_model
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.camera import intrinsics
from scenegen.common.errors import SceneGenError
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import RoomsFile

WALL = "{'depth_metric': np.full(image.shape[:2], 1.5)}"
INFER = f"import numpy as np\ndef infer(image, intrinsics=None):\n    return {WALL}\n"


class Here:
    """A model without a process of its own, for what is made of its values."""

    name = path = "my_model.py"
    sha256, takes_batches, takes_intrinsics, named, metres = "", False, False, False, False
    provenance: ClassVar[dict[str, str]] = {}

    def __init__(self, text):
        exec(text, vars(self))

    def ask_provenance(self):
        pass

    def begin(self, function, where, *arguments):
        value = _with_types(plain(vars(self)[function](*arguments)))
        return lambda: value


@pytest.fixture
def run(truths, tmp_path):
    """Run the text of a model; return what was said. The submission is at `run.out`."""

    def go(text, data=truths.rooms, load=None, keep=None, timeout=None, here=False, **call):
        path = tmp_path / "my_model.py"
        path.write_text(text)
        process = nullcontext(Here(text)) if here else None
        with process or opened_model(path, load, timeout, go.notes.append) as model:
            return run_model(
                model, data, go.out, call=Call(**call), method="m", overwrite=True, keep=keep,
                options=load,
            )  # fmt: skip

    go.out, go.notes = tmp_path / "p.h5", []
    return go


SHAPES = {
    "function": INFER,
    "image alone": INFER.replace(", intrinsics=None", ""),
    "class": INFER.replace("def infer(", "class M:\n  def infer(self, "),
    "load": INFER.replace("def infer(", "class M:\n  def infer(self, ")
    + "class N(M): pass\ndef load(): return N()\n",
    "load first": INFER + "def load():\n    print('loading')\n",
    "batch": INFER + "def infer_batch(images):\n    return [infer(image) for image in images]\n",
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_model_of_any_shape(name, run, truths):
    assert run(SHAPES[name], batch=3) == "depth_metric of 8 rows"
    assert [p for p in validate(run.out, truths.rooms) if not p.is_hint] == []
    with open_predictions(run.out) as found:
        assert (found.rows.tolist(), (found.depth(7) == 1.5).all()) == (list(range(8)), True)
    assert {path.name for path in run.out.parent.iterdir()} <= {
        "my_model.py",
        "p.h5",
        "__pycache__",
    }


def test_images_are_srgb_bytes_and_cameras_are_told_only_on_request(run, truths, tmp_path):
    text = INFER.replace("    return", "    np.savez(f'{DIR}/{len(list(DIR.iterdir()))}', image="
                         "image, intrinsics=np.zeros(0) if intrinsics is None else intrinsics)\n"
                         "    return")  # fmt: skip
    for told in (False, True):
        folder = tmp_path / f"seen{told}"
        folder.mkdir()
        run(f"from pathlib import Path\nDIR = Path({str(folder)!r})\n{text}", intrinsics=told)
        with RoomsFile(truths.rooms) as rooms:
            for room in rooms:
                seen = np.load(folder / f"{room.index}.npz")
                assert (seen["image"].dtype, seen["image"].shape) == (np.uint8, (32, 32, 3))
                assert np.array_equal(seen["image"], srgb_bytes(room.radiance))
                camera = intrinsics(32, 32, room.fov_y_degrees, pixel_centers="half")
                assert np.array_equal(seen["intrinsics"], camera if told else np.zeros(0))
        with open_predictions(run.out) as found:
            assert ("intrinsics" in found.notes) == told


def test_a_model_sees_developed_pictures_as_they_are(run, interior_path, tmp_path):
    keep = f"    np.save({str(tmp_path / 'seen.npy')!r}, image)\n    return"
    run(INFER.replace("    return", keep), data=interior_path)
    with RoomsFile(interior_path) as rooms:
        np.testing.assert_array_equal(np.load(tmp_path / "seen.npy"), rooms[0].image)


def returning(**keys):
    values = ", ".join(f"{name!r}: {value}" for name, value in keys.items())
    return f"""
import numpy as np
def infer(image):
    d = np.full((32, 32), 2.0)
    return {{{values}}}
"""


POINTS = "np.dstack([0 * d, 0 * d + 0.5, d])"


@pytest.mark.parametrize(
    ("keys", "kind", "alignment", "value"),
    [
        ({"depth_metric": "d.astype('f2')"}, "depth", "none", 2.0),
        ({"depth_scale_invariant": "d[None, ..., None]"}, "depth", "scale", 2.0),
        ({"depth_affine_invariant": "__import__('torch').tensor(d)"}, "depth", "scale_shift", 2.0),
        ({"disparity_affine_invariant": "d.tolist()"}, "disparity", "scale_shift", 2.0),
        ({"points_metric": POINTS, "depth_affine_invariant": "d"}, "points", "none", -2.0),
        ({"points_affine_invariant": POINTS}, "points", "scale_shift", -2.0),
        ({"depth_metric": "np.kron(d, np.ones((3, 3)))", "other": "'x'"}, "depth", "none", 2.0),
    ],
)
def test_the_keys_say_what_is_predicted(keys, kind, alignment, value, run):
    run(returning(**keys, normal="np.dstack([0 * d, 0 * d, -d])",
                  intrinsics="np.array([[1.2, 0, .5], [0, 1.2, .5], [0, 0, 1]])"),
        here=True)  # fmt: skip
    with open_predictions(run.out) as found:
        view = found.view(3)
    assert (view.kind, view.alignment) == (kind, alignment)
    last = view.geometry[..., -1] if kind == "points" else view.geometry
    assert (last == value).all()
    if kind == "points":
        assert (view.geometry[..., 1] == -0.5).all()
    assert (view.normal == [0.0, 0.0, 2.0]).all()
    assert view.fov_y_degrees == pytest.approx(np.degrees(2 * np.arctan(0.5 / 1.2)))


def test_another_key_may_be_taken(run):
    text = returning(points_metric=POINTS, depth_scale_invariant="d + 1")
    run(text, here=True, key="depth_scale_invariant")
    with open_predictions(run.out) as found:
        assert (found.kind, found.alignment, found.depth(0)[0, 0]) == ("depth", "scale", 3.0)


def test_a_mask_takes_values_out(run):
    text = returning(depth_metric="d + np.arange(32)", mask="np.arange(32) * (d > 0) > 3")
    with pytest.raises(SceneGenError) as caught:
        run(text, here=True)
    assert "--missing nearest" in caught.value.hint
    run(text, here=True, missing="nearest")
    with open_predictions(run.out) as found:
        assert found.depth(0)[5].tolist() == [6.0] * 4 + list(range(6, 34))


# ---- resuming ----


def failing(folder, error="ValueError"):
    """A model that fails once, at its sixth call; it counts its calls in a file."""
    return f"""
import numpy as np
from pathlib import Path
from typing import ClassVar
def infer(image):
    count = Path({str(folder / "calls")!r})
    count.write_text((count.read_text() if count.exists() else "") + ".")
    if count.read_text() == "." * 6:
        raise {error}
    return {WALL}
"""


@pytest.mark.parametrize("error", ["ValueError('no')", "KeyboardInterrupt", "SystemExit(3)"])
def test_a_stop_loses_nothing(error, run, tmp_path):
    calls = tmp_path / "calls"
    text = failing(tmp_path, error)
    with pytest.raises(KeyboardInterrupt if "Key" in error else ModelError) as caught:
        run(text)
    assert not run.out.exists()
    assert len(list((tmp_path / "p.h5.rows").glob("*.npz"))) == 5
    if "Key" not in error:
        assert "row 5" in caught.value.where
        assert "5 rows are kept" in caught.value.hint
    assert run(text) == "depth_metric of 8 rows, 5 of them from an earlier run"
    assert calls.read_text() == "." * 9
    resumed = run.out.read_bytes()
    run(text)
    assert run.out.read_bytes() == resumed
    assert not (tmp_path / "p.h5.rows").exists()


def test_a_row_that_was_cut_off_is_done_again(run, tmp_path):
    with pytest.raises(ModelError):
        run(failing(tmp_path))
    (tmp_path / "p.h5.rows" / "00000002.npz").write_bytes(b"PK")
    run(failing(tmp_path))
    assert (tmp_path / "calls").read_text() == "." * 10


def test_rows_of_another_model_are_not_mixed_in_silence(run, tmp_path):
    text = failing(tmp_path)
    with pytest.raises(ModelError):
        run(text)
    other = text.replace("1.5", "2.5")
    weights = tmp_path / "weights.pt"
    for changed in ({"text": other}, {"text": text, "missing": "nearest"}, {"text": text}):
        if changed == {"text": text}:
            weights.write_bytes(b"other weights")
        with pytest.raises(SceneGenError) as caught:
            run(**changed)
        assert caught.value.where == str(tmp_path / "p.h5.rows")
    weights.unlink()
    run(other, keep="resume")
    with open_predictions(run.out) as found:
        assert [found.depth(i)[0, 0] for i in (4, 5)] == [1.5, 2.5]
    (tmp_path / "calls").unlink()
    with pytest.raises(ModelError):
        run(text)
    run(other, keep="restart")
    with open_predictions(run.out) as found:
        assert found.depth(4)[0, 0] == 2.5


# ---- a process of its own ----


def test_the_model_may_change_its_folder(run, tmp_path, monkeypatch, truths):
    """As many do to find their weights; the paths of the run stay what they are."""
    monkeypatch.chdir(tmp_path)
    run.out = Path("p.h5")
    assert run("import os; os.chdir('/')\n" + INFER, Path(os.path.relpath(truths.rooms))) == (
        "depth_metric of 8 rows"
    )
    assert (tmp_path / "p.h5").exists()


def test_names_of_ours_in_the_folder_of_the_model_are_its_own(run, tmp_path):
    for name in ("metrics", "baselines", "scenegen", "iqtt"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("depth = 1.5\n")
    for name in ("cli", "outputs", "running", "model_runner", "matching"):
        (tmp_path / f"{name}.py").write_text("depth = 1.5\n")
    text = "import numpy as np\nfrom {0} import depth\nimport {1}\nassert {1}.depth == depth\n"
    text = "".join(text.format(*names) for names in [("metrics", "cli"), ("scenegen", "outputs"),
                   ("baselines", "running"), ("iqtt", "model_runner")])  # fmt: skip
    run(text + f"def infer(image): return {WALL.replace('1.5', 'depth')}\n")
    with open_predictions(run.out) as found:
        assert found.depth(7)[0, 0] == 1.5


def test_nothing_of_ours_is_loaded_and_no_variable_limits_its_threads(run):
    run(
        "import os, sys\n"
        "ours = {'scenegen', 'iqtt', 'metrics', 'baselines', 'cli', 'click', 'h5py'}\n"
        "assert not ours & {name.partition('.')[0] for name in sys.modules}\n"
        f"assert os.environ.get('OMP_NUM_THREADS') == {os.environ.get('OMP_NUM_THREADS')!r}\n"
        + INFER
    )


def gone(group):
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


ENDS = {
    "crash": ("import ctypes; ctypes.string_at(0)", "SIGSEGV"),
    "exit": ("import os; os._exit(0)", "exit code 0"),
    "killed": ("import os; os.kill(os.getpid(), 9)", "SIGKILL"),
    "hang": ("import time; time.sleep(1000)", "no answer after 2 s"),
    "hang in C": ("import ctypes; ctypes.PyDLL(None).sleep(1000)", "no answer after 2 s"),
    "child": ("import os; os.fork() and os._exit(3); import time; time.sleep(1000)", "code 3"),
}


@pytest.mark.skipif(sys.platform != "linux", reason="signals of Linux")
@pytest.mark.parametrize("how", ENDS)
def test_what_ends_or_hangs_is_named_by_its_row_and_rows_are_kept(how, run, tmp_path, monkeypatch):
    monkeypatch.setattr(model_file, "SILENCE", 0.5)
    code, words = ENDS[how]
    text = f"import os\nopen({str(tmp_path / 'group')!r}, 'w').write(str(os.getpgid(0)))\n"
    text += INFER.replace("    return", f"    if next(N) == 5:\n        {code}\n    return")
    with pytest.raises(ModelError) as caught:
        run(f"import itertools\nN = itertools.count()\n{text}", timeout=2)
    assert "row 5" in caught.value.where
    assert words in caught.value.found
    assert len(list((tmp_path / "p.h5.rows").glob("*.npz"))) == 5
    assert any("row 5" in note for note in run.notes) == ("hang" in how)
    assert gone(int((tmp_path / "group").read_text())), "the model, or what it has started, lives"
    assert run(INFER, keep="resume") == "depth_metric of 8 rows, 5 of them from an earlier run"


@pytest.mark.skipif(sys.platform != "linux", reason="signals of Linux")
@pytest.mark.parametrize(
    "number",
    [
        signal.SIGKILL,
        *(pytest.param(n, marks=pytest.mark.slow) for n in (signal.SIGINT, signal.SIGTERM)),
    ],
)
def test_a_hanging_model_ends_with_the_command(number, tmp_path, truths):
    text = INFER.replace("    return", "    if next(N) == 5: print(os.getpid(), flush=True);"
                         " subprocess.run(['sleep', '1000'])\n    return")  # fmt: skip
    text = f"import itertools, os, subprocess\nN = itertools.count()\n{text}"
    (tmp_path / "my_model.py").write_text(text)
    code = "import cli; cli.bench()"
    words = ["run", "my_model.py", "--data", str(truths.rooms), "--out", "p.h5"]
    with subprocess.Popen(
        [sys.executable, "-c", code, *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])},
    ) as command:  # fmt: skip
        group = next(int(line) for line in command.stderr if line.strip().isdecimal())
        while len(list((tmp_path / "p.h5.rows").glob("*.npz"))) < 5:
            time.sleep(0.05)
        command.send_signal(number)
        said = command.stderr.read()
    assert gone(group), "the model, or what it has started, lives"
    assert ("stopped at row 5" in said) == (number != signal.SIGKILL)
    assert len(list((tmp_path / "p.h5.rows").glob("*.npz"))) == 5


def test_what_a_model_prints_and_reads_is_kept_apart(run, capfd):
    text = "import os, sys\nos.write(1, b'loud\\n')\nassert sys.stdin.read() == ''\n"
    run(text + INFER.replace("    return", "    print('row')\n    return"))
    out, err = capfd.readouterr()
    assert (out, err.count("row\n"), err.count("loud\n")) == ("", 8, 1)


VALUES = {
    "np.float32(3)": 3.0, "torch.ones(2, requires_grad=True) * 3": [3.0, 3.0],
    "[[1, 2], [3, 4]]": [[1, 2], [3, 4]], "torch.ones(1, dtype=torch.bfloat16)": [1.0],
    "[torch.ones(2), np.zeros(2)]": [[1.0, 1.0], [0.0, 0.0]],
}  # fmt: skip


@pytest.mark.parametrize("value", VALUES)
def test_values_arrive_as_they_are(value):
    import torch

    found = np.asarray(plain(eval(value, {"np": np, "torch": torch})))
    assert np.array_equal(found, VALUES[value])


# ---- refusals ----

BAD = {
    "syntax": ("def infer(image:\n", ["my_model.py, line 1"]),
    "import": ("import no_such_package\n", ["my_model.py, line 1", "no_such_package"]),
    "exit": ("\nimport sys; sys.exit(2)\n", ["my_model.py, line 2", "SystemExit"]),
    "nothing": ("x = 1\n", ["infer"]),
    "two classes": ("class A:\n  def infer(self, i): 0\nclass B(A): 0\n", ["A, B"]),
    "load of nothing": ("def load(): return 3\n", ["infer"]),
    "load raises": ("def load():\n  1 / 0\n", ["line 2", "load()", "ZeroDivisionError"]),
    "raises": ("def f(): [][1]\ndef infer(image): f()\n", ["line 1", "row 0", "IndexError"]),
    "arguments": ("def infer(): pass\n", ["row 0", "TypeError"]),
    "short batch": (INFER + "def infer_batch(images): return [infer(images[0])]\n", ["rows 0 to"]),
}
BAD_VALUES = {
    "None": ("def infer(image): pass\n", ["row 0", "None"]),
    "an array": ("def infer(image): return image\n", ["row 0", "ndarray of shape (32, 32, 3)"]),
    "other keys": (returning(depth="d"), ["row 0", "'depth'"]),
    "text": (returning(depth_metric="'far'"), ["row 0", "depth_metric"]),
    "shape": (returning(depth_metric="d[0]"), ["row 0", "depth_metric", "(32,)"]),
    "channels first": (returning(points_metric=f"{POINTS}.transpose(2, 0, 1)"), ["(3, 32, 32)"]),
    "NaN": (returning(depth_metric="d * np.nan"), ["row 0", "depth_metric"]),
    "infinite": (returning(depth_metric="np.where(np.eye(32), np.inf, d)"), ["row 0: depth"]),
    "behind": (returning(depth_metric="-d"), ["row 0: depth"]),
    "mask": (returning(depth_metric="d", mask="d[1:] > 0"), ["row 0", "mask"]),
    "camera": (returning(depth_metric="d", intrinsics="d"), ["row 0", "intrinsics"]),
    "normal": (returning(depth_metric="d", normal="d"), ["row 0", "normal"]),
}


@pytest.mark.parametrize("name", [*BAD, *BAD_VALUES])
def test_one_line_that_says_where(name, run):
    text, words = (BAD | BAD_VALUES)[name]
    with pytest.raises(SceneGenError) as caught:
        run(text, here=name in BAD_VALUES)
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    assert [word for word in words if word not in line] == [], line
    assert {path.name for path in run.out.parent.iterdir()} <= {"my_model.py", "__pycache__"}


def test_another_key_in_a_later_row(run):
    text = INFER.replace(
        "depth_metric'", "depth_metric' if next(N) < 5 else 'depth_scale_invariant'"
    )
    with pytest.raises(SceneGenError, match="row 5"):
        run("import itertools\nN = itertools.count()\n" + text)


@pytest.mark.parametrize("load", [{"device": "cuda"}, {"batch": 4}])
def test_settings_that_the_model_does_not_take(load, run):
    with pytest.raises(ModelError) as caught:
        run(INFER, load=load)
    assert caught.value.where == f"--{next(iter(load))}"


def test_settings_that_it_takes(run):
    text = INFER + "def load(device, **more):\n    assert (device, more) == ('cpu', {'batch': 2})\n"
    run(text, load={"device": "cpu", "batch": 2})


# ---- questions ----


@pytest.mark.parametrize("value", ["2", "[0.5, 1.0, 2.0]", "np.array([1, 0, 9])", "np.int8(2)"])
def test_questions(value, run, truths):
    assert "6 questions" in run(
        "import numpy as np\ndef infer(reference, answers):\n"
        "    assert reference.shape == (32, 32, 3) and answers.shape == (3, 32, 32, 3)\n"
        f"    assert reference.dtype == answers.dtype == np.uint8\n    return {value}\n",
        truths.iqtt,
        here=value != "2",
    )
    with open_predictions(run.out) as found:
        assert found.answers.tolist() == [2] * 6
        assert (found.scores is None) == (value in ("2", "np.int8(2)"))


@pytest.mark.parametrize("value", ["None", "3", "'B'", "[1.0, 2.0]", "[1.0, 2.0, float('nan')]"])
def test_what_is_no_answer(value, run, truths, tmp_path):
    with pytest.raises(SceneGenError, match="row 0"):
        run(f"def infer(reference, answers): return {value}\n", truths.iqtt, here=True)
    assert not run.out.exists()
    assert not (tmp_path / "p.h5.rows").exists()
