"""Trains one run after another, as a program that Lightning Fabric can run in several processes.

Its argument is a JSON file with a list of runs: folder, data, configuration (null to go on from the
folder's checkpoint), labels and number of processes. The first process writes the losses of every
iteration to FOLDER/losses.json, and keeps the checkpoint of iteration 2 in FOLDER-half.
"""

import json
import shutil
import sys
from pathlib import Path
from typing import Any

from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.training.run import train_run
from baselines.training.data import TrainingFiles
from baselines.training.machine import Machine


def train_all(runs: list[dict[str, Any]]) -> None:
    """Train each run."""
    for run in runs:
        train(run, Path(run["folder"]))


def train(run: dict[str, Any], folder: Path) -> None:
    """Train a run of four iterations."""
    reported: list[dict[str, float]] = []

    def progress(done: int, total: int, losses: dict[str, float]) -> None:
        reported.append(losses)
        if done == 3:  # the checkpoint is that of iteration 2
            shutil.copytree(folder, f"{folder}-half", dirs_exist_ok=True)

    config = run["config"] and ModelConfig.from_json(run["config"])
    machine = Machine("cpu", run["processes"], workers=0, every=2)
    how = {"labels": run["labels"], "progress": progress}
    if train_run(folder, TrainingFiles(run["data"]), config, machine, **how) is not None:
        (folder / "losses.json").write_text(json.dumps(reported))


if __name__ == "__main__":
    train_all(json.loads(Path(sys.argv[1]).read_text()))
