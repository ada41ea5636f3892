"""A script without `if __name__ == "__main__":` that starts every kind of process runs once."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCRIPT = """
print("begin")
import multiprocessing
multiprocessing.set_start_method("spawn")  # as a script may have it for its own processes
import h5py
import metrics
from baselines.pix2shape.training.run import train_run
from baselines.training.data import TrainingFiles
from baselines.training.machine import Machine
from baselines.trivial import write_room_baseline
from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from metrics.scoring.evaluate import score
from pix2shape_models import tiny
from scenegen.description.specs import DatasetSpec
from scenegen.rooms.make import make_dataset

spec = DatasetSpec(height=32, width=32, min_visible_pixels=1, seed=1)
make_dataset("rooms.h5", spec, 33, workers=2)
write_room_baseline("empty-room", "rooms.h5", "empty.h5")
scored = score(["empty.h5"], "rooms.h5").metrics["rmse"].value
with h5py.File("empty.h5") as file:
    evaluated = metrics.evaluate(file["depth"][:], "rooms.h5").metrics["rmse"].value
assert scored == evaluated
few = {"train": 3, "labeled": 1, "val": 1, "test": 1, "cubes": (6, 7), "min_cube_pixels": 1}
make_split("split", SplitSpec(seed=5, height=24, width=24, **few), workers=2)
train_run("run", TrainingFiles("rooms.h5"), tiny(iterations=1), Machine("cpu", workers=1))
print("end")
"""


@pytest.mark.slow
@pytest.mark.parametrize("words", [["script.py"], ["-"]])
def test_scoring_rendering_questions_and_training_need_no_guard(words, tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests" / "support")])
    done = subprocess.run(
        [sys.executable, *words], input=SCRIPT, cwd=tmp_path, timeout=600, check=False,
        capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "begin\nend\n"), done.stderr
