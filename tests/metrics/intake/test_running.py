"""Models of many shapes are run, resumed and refused."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from metrics.intake import model_file
from metrics.intake.kept_rows import kept_rows
from metrics.intake.model_file import ModelError, opened_model
from metrics.intake.model_runner import _answer, _loaded, loads, plain
from metrics.intake.outputs import OutputError
from metrics.intake.running import Call, run_model
from metrics.intake.running import _answer as _answer_of
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.camera import intrinsics
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import RoomsFile

WALL = "{'depth_metric': np.full(image.shape[:2], 1.5)}"
INFER = f"import numpy as np\ndef infer(image, intrinsics=None):\n    return {WALL}\n"


@pytest.fixture
def run(truths, tmp_path):
    """Run the text of a model; return what was said. The submission is at `run.out`."""

    def go(text, data=truths.rooms, load=None, keep=None, timeout=None, **call):
        path = tmp_path / "my_model.py"
        path.write_text(text)
        with opened_model(path, load, timeout, go.notes.append) as model:
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
def test_a_model_of_any_shape(name, tmp_path):
    path, image = tmp_path / "my_model.py", np.zeros((4, 6, 3), np.uint8)
    path.write_text(SHAPES[name])
    model = _loaded(str(path), {}, ())
    assert (model.infer(image)["depth_metric"] == np.full((4, 6), 1.5)).all()


@pytest.mark.parametrize("name", ["function", "batch"])
def test_a_model_in_its_process(name, run, truths):
    assert run(SHAPES[name], batch=3) == "depth_metric of 8 images"
    assert [p for p in validate(run.out, truths.rooms) if not p.is_hint] == []
    with open_predictions(run.out) as found:
        assert (found.rows.tolist(), (found.depth(7) == 1.5).all()) == (list(range(8)), True)


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


@pytest.mark.parametrize(
    ("program", "found"),
    [
        ("echo no NumPy here", "no NumPy here"),
        ("echo Python 2.7.18", "Python 2.7.18"),
        ("exit 3", "exit code 3"),
        ("echo hello; cat", "hello"),
    ],
)
def test_a_python_that_cannot_run_models_is_told(program, found, tmp_path):
    """Older ones and those without NumPy say so; what is none says something else, or nothing."""
    (tmp_path / "m.py").write_text(INFER)
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{program}\n")
    python.chmod(0o755)
    with (
        pytest.raises(ModelError) as error,
        opened_model(tmp_path / "m.py", python=python),
    ):
        pass
    assert error.value.where == "--python"
    assert (found in error.value.found) == (found != "hello")


@pytest.mark.parametrize("change", ["modules['numpy'] = None", "version_info = (3, 6)"])
def test_what_begins_the_process_of_a_model_looks_for_what_it_needs(change, capfd):
    text = f"import sys\nsys.{change}\n{model_file.BOOT}"
    done = subprocess.run([sys.executable, "-c", text], check=False)
    assert done.returncode == 0
    assert capfd.readouterr().out.split()[0] in ("no", "Python")


def failing(folder, error="ValueError"):
    """A model that fails once, at its sixth call; it counts its calls in a file."""
    return f"""
import numpy as np
from pathlib import Path
def infer(image):
    count = Path({str(folder / "calls")!r})
    count.write_text((count.read_text() if count.exists() else "") + ".")
    if count.read_text() == "." * 6:
        raise {error}
    return {WALL}
"""


@pytest.mark.parametrize("error", ["ValueError('no')", "KeyboardInterrupt"])
def test_a_stop_loses_nothing(error, run, tmp_path):
    calls = tmp_path / "calls"
    text = failing(tmp_path, error)
    with pytest.raises(KeyboardInterrupt if "Key" in error else ModelError) as caught:
        run(text)
    assert not run.out.exists()
    assert len(list((tmp_path / "p.h5.rows").glob("*.npz"))) == 5
    if "Key" not in error:
        assert "row 5" in caught.value.where
        assert "5 images are kept" in caught.value.hint
    assert run(text) == "depth_metric of 8 images, 5 of them from an earlier run"
    assert calls.read_text() == "." * 9
    assert not (tmp_path / "p.h5.rows").exists()
    with open_predictions(run.out) as found:
        assert [found.depth(row)[0, 0] for row in range(8)] == [1.5] * 8


def test_rows_depend_on_the_model_and_on_weights_beside_it(tmp_path):
    path, weights = tmp_path / "m.py", tmp_path / "weights.pt"

    def digest(text):
        path.write_text(text)
        with opened_model(path) as model:
            return model.sha256

    first = digest(INFER)
    assert digest(INFER) == first != digest(INFER + "\n")
    assert Call(missing="nearest").settings != Call().settings
    weights.write_bytes(b"weights")
    assert digest(INFER) != first


def test_the_model_may_change_its_folder(run, tmp_path, monkeypatch, truths):
    """As many do to find their weights; the paths of the run stay what they are."""
    monkeypatch.chdir(tmp_path)
    run.out = Path("p.h5")
    assert run("import os; os.chdir('/')\n" + INFER, Path(os.path.relpath(truths.rooms))) == (
        "depth_metric of 8 images"
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
    "hang in C": ("import ctypes; ctypes.PyDLL(None).sleep(1000)", "no result after 2 s"),
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


BAD_FILES = {
    "syntax": ("def infer(image:\n", 1, ""),
    "import": ("import no_such_package\n", 1, "no_such_package"),
    "exit": ("\nimport sys; sys.exit(2)\n", 2, "SystemExit"),
    "load raises": ("def load():\n  1 / 0\n", 2, "ZeroDivisionError"),
    "nothing": ("x = 1\n", None, "infer"),
    "two classes": ("class A:\n  def infer(self, i): 0\nclass B(A): 0\n", None, "A, B"),
    "load of nothing": ("def load(): return 3\n", None, "infer"),
}
BAD_CALLS = {
    "raises": ("def f(): [][1]\ndef infer(image): f()\n", ["line 1", "row 0", "IndexError"]),
    "arguments": ("def infer(): pass\n", ["row 0", "TypeError"]),
    "short batch": (INFER + "def infer_batch(images): return [infer(images[0])]\n", ["rows 0 to"]),
    "nothing": ("def infer(image): pass\n", ["row 0", "None"]),
    "an array": ("def infer(image): return image\n", ["row 0", "ndarray of shape (32, 32, 3)"]),
    "infinite": (INFER.replace("1.5", "np.inf"), ["row 0"]),
    "behind": (INFER.replace("1.5", "-1.5"), ["row 0: depth"]),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_file_that_makes_no_model(name, tmp_path):
    text, line, words = BAD_FILES[name]
    path = str(tmp_path / "my_model.py")
    Path(path).write_text(text)
    answer = _answer(path, lambda: _loaded(path, {}, ()))
    told = loads(answer[1:])
    assert answer[:1] == b"-"
    assert told.get("line") == line
    assert ("unusable" in told) == (line is None)
    assert words in str(told)


@pytest.mark.parametrize("name", BAD_CALLS)
def test_one_line_that_says_where(name, run):
    text, words = BAD_CALLS[name]
    with pytest.raises(SceneGenError) as caught:
        run(text)
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    assert [word for word in words if word not in line] == [], line
    assert {path.name for path in run.out.parent.iterdir()} <= {"my_model.py", "__pycache__"}


def test_another_key_in_a_later_row(run):
    text = INFER.replace("metric'", "metric' if next(N) < 5 else 'depth_scale_invariant'")
    with pytest.raises(SceneGenError, match="row 5"):
        run("import itertools\nN = itertools.count()\n" + text)


@pytest.mark.parametrize("load", [{"device": "cuda"}, {"batch": 4}])
def test_settings_that_the_model_does_not_take(load, run):
    with pytest.raises(ModelError) as caught:
        run(INFER, load=load)
    assert caught.value.where == f"--{next(iter(load))}"
    run(INFER + f"def load(**more):\n    assert more == {load}\n", load=load)


@pytest.mark.parametrize("value", ["2", "[0.5, 1.0, 2.0]"])
def test_questions(value, run, truths):
    assert "6 questions" in run(
        "import numpy as np\ndef infer(reference, answers):\n"
        "    assert reference.shape == (32, 32, 3) and answers.shape == (3, 32, 32, 3)\n"
        f"    assert reference.dtype == answers.dtype == np.uint8\n    return {value}\n",
        truths.iqtt,
    )
    with open_predictions(run.out) as found:
        assert found.answers.tolist() == [2] * 6
        assert (found.scores is None) == (value == "2")


def test_answers_of_many_kinds():
    for value in (2, np.int8(2), np.array([1, 0, 9])):
        np.testing.assert_array_equal(_answer_of(value, 3, "row 0"), value)
    for value in (None, 3, -2, "B", [1.0, 2.0], [1.0, 2.0, np.nan]):
        with pytest.raises(OutputError):
            _answer_of(value, 3, "row 0")


ONE, OTHER = {"model": "a"}, {"model": "b"}


@pytest.fixture
def folder(tmp_path):
    """Rows 0 and 1 of a run that failed."""
    error = SceneGenError("row 2", "an error")

    def fail():
        with kept_rows(tmp_path / "p.h5", ONE, None) as rows:
            for row in range(2):
                rows.write(row, {"depth": np.full(3, row)})
            raise error

    with pytest.raises(SceneGenError):
        fail()
    assert "2 images" in error.hint
    return tmp_path / "p.h5.rows"


def read(out, settings, keep=None):
    """The number of kept rows, and the first number of rows 0 to 2; None where one is lacking."""
    with kept_rows(out, settings, keep) as rows:
        stored = [rows.read(row) for row in range(3)]
        return rows.count, [None if row is None else int(row["depth"][0]) for row in stored]


@pytest.mark.parametrize(
    ("settings", "keep", "expected"),
    [
        (ONE, None, (2, [0, 1, None])),
        (OTHER, "resume", (2, [0, 1, None])),
        (ONE, "restart", (0, [None] * 3)),
        (OTHER, "restart", (0, [None] * 3)),
    ],
)
def test_the_next_run(settings, keep, expected, folder):
    assert read(folder.with_suffix(""), settings, keep) == expected
    assert not folder.exists()


def test_rows_of_other_settings_are_refused(folder):
    with pytest.raises(SpecError) as caught:
        read(folder.with_suffix(""), OTHER)
    assert caught.value.where == str(folder)
    assert read(folder.with_suffix(""), ONE)[0] == 2


def test_a_row_that_was_cut_off_is_lacking(folder):
    (folder / "00000001.npz").write_bytes(b"PK")
    assert read(folder.with_suffix(""), ONE)[1] == [0, None, None]


def test_nothing_is_left_where_no_row_was_done(tmp_path):
    with pytest.raises(KeyboardInterrupt), kept_rows(tmp_path / "p.h5", ONE, None):
        raise KeyboardInterrupt
    assert not list(tmp_path.glob("*.rows"))
