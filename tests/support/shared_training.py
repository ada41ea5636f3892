"""Trains one run after another, as a program that Lightning Fabric can run in several processes.

Its argument is a JSON file with a list of runs: folder, data, configuration (null to go on from the
folder's checkpoint), labels and number of processes. The first process writes the losses of every
iteration to `losses.json` in each folder.
"""

import json
import sys
from pathlib import Path
from typing import Any

from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.training.launch import Machine
from baselines.pix2shape.training.runs import train_run


def train_all(runs: list[dict[str, Any]]) -> None:
    """Train each run, and write its losses."""
    for run in runs:
        found: list[dict[str, float]] = []
        config = run["config"] and ModelConfig.from_json(run["config"])
        machine = Machine("cpu", run["processes"], workers=0, every=2)
        how = {"labels": run["labels"], "progress": lambda _, losses, to=found: to.append(losses)}
        if train_run(run["folder"], run["data"], config, machine, **how) is not None:
            (Path(run["folder"]) / "losses.json").write_text(json.dumps(found))


if __name__ == "__main__":
    train_all(json.loads(Path(sys.argv[1]).read_text()))
