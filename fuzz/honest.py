"""The honest files that cases are made from: tiny, and written by the commands.

python -m fuzz.honest FOLDER [--weights]
"""

import json
import os
import sys
from pathlib import Path

import click
import h5py
import numpy as np

import cli

STEPS = (
    "scenegen render --n 4 --size 32 --views 0,35 --seed 3 --out rooms.h5",
    "scenegen render --n 3 --size 32 --seed 9 --out train.h5",
    "scenegen render --n 3 --size 16 --objects-root meshes --cache-dir cache --seed 4"
    " --out models.h5",
    "iqtt make-split --train 6 --labeled 3 --val 6 --test 6 --size 32 --cubes 5-6"
    " --min-cube-pixels 2 --seed 987654321 --out iqtt",
    "bench baseline empty-room --data rooms.h5 --out predictions.h5",
    "bench baseline constant --train train.h5 --data rooms.h5 --out constant.h5",
    "bench baseline chance --data iqtt/iqtt-test.h5 --out answers.h5",
    "bench score predictions.h5 --truth rooms.h5 --json scores.json",
    "bench score constant.h5 --truth rooms.h5 --json other.json",
    "bench score answers.h5 --truth iqtt/iqtt-test-answers.h5 --json answer-scores.json",
)
WEIGHTS = (  # untrained ones of the smallest networks
    "pix2shape train --data rooms.h5 --out run --set networks.size=32 --set networks.width=0.05"
    " --set iterations=1 --set batch=2 --set critic_steps=1 --workers 0"
)


def make(folder: Path, weights: bool) -> None:
    """Write the honest files into an existing folder; weights take seconds, as torch does."""
    os.chdir(folder)
    _meshes(Path("meshes/mug"))
    for step in (*STEPS, *[WEIGHTS] * weights):
        program, *arguments = step.split()
        getattr(cli, program).main(arguments, standalone_mode=False)
    Path("answers.json").write_text(json.dumps([0, 1, 2, 2, 1, 0]))
    named = {"answers": {str(i): i % 3 for i in range(6)}, "method": "mine", "run": "seed 0"}
    Path("named.json").write_text(json.dumps(named))
    with h5py.File("released.h5", "w") as file:  # nothing but images and answers
        file["questions"] = np.random.default_rng(3).random((4, 4, 16, 16, 3)).astype("f4")
        file["answers"] = np.arange(4) % 3
    _people(Path("people.db"))
    if weights:
        Path("run/weights.safetensors").rename("weights.safetensors")


def _people(path: Path) -> None:
    """Write the answers of three people, of whom one did not finish."""
    from iqtt.quiz import sessions
    from iqtt.quiz.schema import open_answers
    from iqtt.quiz.study import Study

    with Study("iqtt/iqtt-test.h5", questions=4, calibrations=1) as study:
        db = open_answers(path, study.settings)
        for count in (5, 5, 2):
            name = sessions.begin(db, study.draw, 3)
            for position in range(count):
                sessions.show(db, name)
                sessions.answer(db, name, position, position % 3, 0.0)
                if position == 0:
                    sessions.go_on(db, name, position)
    db.execute("PRAGMA journal_mode = DELETE")
    db.close()


def _meshes(folder: Path) -> None:
    """Write a model in each format that is read."""
    import trimesh

    folder.mkdir(parents=True)
    cylinder, ball = trimesh.creation.cylinder(1, 2, sections=8), trimesh.creation.icosphere(1)
    trimesh.creation.box((1, 2, 1)).export(folder / "box.obj")
    trimesh.creation.cone(1, 1, sections=8).export(folder / "cone.off")
    trimesh.creation.annulus(0.5, 1, 1, sections=8).export(folder / "ring.glb")
    cylinder.export(folder / "cylinder.stl")
    cylinder.export(folder / "text.stl", file_type="stl_ascii")
    ball.export(folder / "ball.ply")
    ball.export(folder / "text.ply", encoding="ascii")


if __name__ == "__main__":
    try:
        make(Path(sys.argv[1]), "--weights" in sys.argv)
    except click.ClickException as error:
        raise SystemExit(f"no honest files: {error.format_message()}") from error
