"""Measure, train and score on a machine with an NVIDIA GPU, within nine minutes and offline.

    python -m benchmarks.gpu.run [--folder gpu] [--minutes 9]

FOLDER/result, of at most 60 MB, gets weights, scores, logs, and `tables.md`. Training files and
checkpoints lie in FOLDER/work. A step that fails or takes too long is told in `tables.md` and
stops no other. A second run passes over what is done, and trains `paper` further.
"""

import argparse
import shlex
import shutil
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from tabulate import tabulate

from benchmarks.commands import is_done, run
from scenegen.files.new_file import write_text

MOST_BYTES = 60_000_000  # of the result
WEIGHTS = "weights.safetensors"
BUNDLED = ("depth-match", "depth-supervised", "depth-completed")
KINDS = ("matched", "mirror-pair", "mirror-pair-2", "other", "near", "mirror")
INTERIORS = "data/interiors.h5"
PAPER = "paper"  # the training that goes on in every run


@dataclass(frozen=True)
class Size:
    """How much is done.

    Attributes:
        images: of each run whose speed is measured.
        scenes, questions: of each training file.
        tests: what makes each test set, by its name.
        options: of all trainings but that of `paper`.
        paper: options of that.
    """

    images: int
    scenes: int
    questions: int
    tests: dict[str, str]
    options: str = ""
    paper: str = "--precision bf16"


QUESTIONS = "rotation-1"
SETS = ("rooms-1", "rooms-shadows-1", "objects-1", QUESTIONS)
FULL = Size(20_000, 7_000, 35_000, {name: f"bench sets make {name} --out sets" for name in SETS})
TOY = Size(
    32, 4, 8,
    {
        "rooms-1": "scenegen render --n 2 --views 0,35 --size 64 --out sets/rooms-1.h5",
        QUESTIONS: "iqtt make-split --preset suite --train 0 --labeled 0 --val 0 --test 2"
        " --size 64 --out sets/rotation-1",
    },
    options="--set batch=4 --set size=64",
    paper="--set batch=2 --set networks.width=0.03125 --set networks.size=64 --workers 0",
)  # fmt: skip


@dataclass(frozen=True)
class Step:
    """A command, and the name that its log and its weights have in the result."""

    name: str
    command: str


@dataclass(frozen=True)
class Stage:
    """Lanes of steps, one lane beside the other, and the share of the time that they get."""

    share: float
    lanes: Sequence[Sequence[Step]]


def training_files(size: Size) -> tuple[dict[str, str], dict[str, str]]:
    """Return the commands that make rooms and questions to train on, by what they make."""
    room = f"scenegen render --views 0,35,80 --size 64 --n {size.scenes}"
    rooms = {
        "data/shapes.h5": f"{room} --seed 201",
        "data/shadows.h5": f"{room} --seed 301 --shadows",
        "data/objects.h5": f"{room} --seed 401 --preset shapenet --object-split train",
        "data/fov.h5": f"{room} --seed 501 --fov 20-60",
        INTERIORS: "scenegen render --preset interiors --object-split train --views 0,20,40"
        f" --size 64 --spp 32 --no-denoise --n {-(-size.scenes // 8)} --seed 601",
    }
    asked = f"iqtt make-split --train {size.questions} --labeled 0 --val 0 --test 0 --with-depth"
    return rooms, {"data/questions/iqtt-train.h5": f"{asked} --seed 101"}


def stages(size: Size, minutes: float, device: str) -> list[Stage]:
    """Return what is run within so many minutes."""
    on, images = f"--device {device}", size.images
    rooms, questions = training_files(size)

    def files(commands: dict[str, str]) -> list[list[Step]]:
        places = [path.removesuffix("/iqtt-train.h5") for path in commands]
        made = zip(places, commands.values(), strict=True)
        return [[Step(Path(path).stem, f"{command} --out {path}")] for path, command in made]

    def training(name: str, data: dict[str, str], share: float, more: str = "") -> Step:
        options = f"{on} --minutes {minutes * share:.4g} {size.options} {more} --out runs/{name}"
        return Step(name, f"bench train {name} --data {' '.join(data)} {options}")

    seen = f"--set start=runs/depth-supervised/{WEIGHTS}"
    paper = (
        f"pix2shape train --config paper --data {next(iter(rooms))} {on} {size.paper}"
        f" --set learning_rate=0.0002 --minutes {0.38 * minutes:.4g} --out runs/{PAPER}"
    )
    measure = [
        Step("agreement", f"benchmarks.gpu.agreement {on} --images {images // 10}"),
        Step("speed", f"benchmarks.gpu.workers {on} --images {images}"),
        Step("surfels", f"benchmarks.surfels {on}"),
    ]
    tests = [Step(name, command) for name, command in size.tests.items()]
    supervised = training("depth-supervised", rooms, 0.26)
    open_rooms = {path: made for path, made in rooms.items() if path != INTERIORS}
    completed = training("depth-completed", open_rooms, 0.11, seen)
    train = [[training("depth-match", questions, 0.38)], [supervised, completed]]
    return [
        Stage(0.24, [measure]),
        Stage(0.12, [*files(rooms), *files(questions), tests]),
        Stage(0.44, [*train, [Step(PAPER, paper)]]),
        Stage(0.2, scores(size)),
    ]


def scores(size: Size) -> list[list[Step]]:
    """Return a lane for each method and test file: what predicts, and what scores that."""
    asked = dict[str, tuple[str, str, tuple[str, ...]]]()  # data, truth, methods
    for name in size.tests:
        if name == QUESTIONS:
            for kind in KINDS:
                stem = f"sets/{name}/{kind}/iqtt-test"
                asked[f"{name}-{kind}"] = f"{stem}.h5", f"{stem}-answers.h5", ("depth-match",)
        else:
            file = f"sets/{name}.h5"
            asked[name] = file, file, ("depth-supervised", "depth-completed", PAPER)
    lanes = []
    for name, (data, truth, methods) in asked.items():
        for method in methods:
            out, baseline = f"{method}-{name}", "pix2shape" if method == PAPER else method
            predict = f"bench baseline {baseline} --weights runs/{method}/{WEIGHTS} --data {data}"
            score = f"bench score predictions/{out}.h5 --truth {truth} --json scores/{out}.json"
            predict = f"{predict} --out predictions/{out}.h5"
            both = (f"{command} --overwrite" for command in (predict, score))
            lanes.append([Step(out, command) for command in both])
    return lanes


def run_stages(
    folder: Path, planned: Sequence[Stage], seconds: float, again: tuple[str, ...] = ()
) -> list[tuple[str, str, float]]:
    """Run stages in FOLDER/work within so many seconds; return name, outcome, seconds of each step.

    A stage may also use what those before it left of their shares. Where a step is over time, it is
    killed, and those after it in its lane are not begun. Steps named in `again` run though done.
    """
    work, logs = folder / "work", folder / "result" / "logs"
    work.mkdir(parents=True, exist_ok=True)
    logs.mkdir(parents=True, exist_ok=True)
    start, share = time.monotonic(), 0.0

    def lane(steps: Sequence[Step], end: float) -> list[tuple[str, str, float]]:
        told = []
        for step in steps:
            begun = time.monotonic()
            if is_done(work, step.command) and step.name not in again:
                outcome = "done before"
            elif begun >= end:
                outcome = "no time"
            else:
                ok = run(work, step.command, seconds=end - begun, log=logs / f"{step.name}.txt")
                outcome = "done" if ok else "over time" if time.monotonic() >= end else "failed"
            told.append((step.name, outcome, time.monotonic() - begun))
        return told

    outcomes = []
    for stage in planned:
        share += stage.share
        with ThreadPoolExecutor(len(stage.lanes)) as pool:
            end = start + share * seconds
            for told in pool.map(lambda steps, end=end: lane(steps, end), stage.lanes):
                outcomes += told
    return outcomes


def gather(folder: Path, outcomes: Sequence[tuple[str, str, float]]) -> str:
    """Copy weights and scores to FOLDER/result, and return its tables as Markdown."""
    work, result = folder / "work", folder / "result"
    for name in BUNDLED:
        weights = work / "runs" / name / WEIGHTS
        if weights.exists():
            shutil.copyfile(weights, result / f"{name}.safetensors")
    if (work / "scores").is_dir():
        shutil.copytree(work / "scores", result / "scores", dirs_exist_ok=True)
    parts = ["# One run on a GPU"]
    for name in ("agreement", "speed", "surfels"):
        log = result / "logs" / f"{name}.txt"
        parts.append(f"## {name.capitalize()}\n\n{log.read_text() if log.exists() else 'None.'}")
    files = [str(path) for path in sorted((result / "scores").glob("*.json"))]
    ranked = result / "leaderboard.md"
    command = f"bench leaderboard {shlex.join(files)} --overwrite --out {shlex.quote(str(ranked))}"
    if files and run(work, command):
        parts.append(f"## Scores\n\n{ranked.read_text()}")
    rows = [(name, outcome, f"{seconds:.0f}") for name, outcome, seconds in outcomes]
    steps = tabulate(rows, ("step", "outcome", "seconds"), "pipe", disable_numparse=True)
    parts.append(f"## Steps\n\n{steps}")
    return "\n\n".join(parts) + "\n"


def main() -> None:
    """Read the options and run; exit with 1 where a step failed or the result is too large."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gpu.run", description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("gpu"), help="result and work  [gpu]")
    parser.add_argument("--minutes", type=float, default=9.0, help="of everything  [9]")
    parser.add_argument("--device", default="cuda", help="where to compute  [cuda]")
    parser.add_argument("--toy", action="store_true", help="next to nothing of everything")
    options = parser.parse_args()
    size, folder = TOY if options.toy else FULL, options.folder.resolve()
    planned = stages(size, options.minutes, options.device)
    # The last twentieth is for the tables.
    outcomes = run_stages(folder, planned, 57 * options.minutes, again=(PAPER,))
    write_text(folder / "result" / "tables.md", gather(folder, outcomes), overwrite=True)
    size_bytes = sum(path.stat().st_size for path in (folder / "result").rglob("*"))
    print(f"{folder / 'result'}: {size_bytes / 1e6:.0f} MB; tables.md shows it")
    failed = [name for name, outcome, _ in outcomes if not outcome.startswith("done")]
    if failed or size_bytes > MOST_BYTES:
        sys.exit(f"failed: {', '.join(failed) or 'the result is too large'}")


if __name__ == "__main__":
    main()
