"""Commands that are run once. A note beside what a command makes says how it was made."""

import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from scenegen.files.new_file import write_text

ROOT = Path(__file__).parents[2]
FINGERPRINTS = ("fingerprint", "fingerprint_labeled", "fingerprint_unlabeled")
CHECKPOINT = "checkpoint.safetensors"


class StepError(Exception):
    """A command failed; it has printed why."""


@dataclass(frozen=True)
class Step:
    """A command and the files around it; paths are relative to the folder of results.

    Attributes:
        command: such as "bench train cnn --data mixed/iqtt-train.h5 --out cnn-200-0".
        makes: the file or the folder that is there when the command is done.
        reads: files whose content decides what is made.
        run: folder of a training run, which can be resumed; or empty.
    """

    command: str
    makes: str
    reads: tuple[str, ...] = ()
    run: str = ""


def made(folder: Path, step: Step, run: Callable[[Path, str], None] | None = None) -> None:
    """Make what a step makes, unless it is there.

    Args:
        run: runs a command in a folder, and raises StepError; None for `run_command`.

    Raises StepError; also where the product is there without a note, as it may be somebody's.
    """
    run = run or run_command
    note = folder / f"{step.makes}.made.json"
    told: dict[str, Any] = {"command": step.command}
    told["reads"] = {name: mark(folder / name) for name in step.reads}
    old = json.loads(note.read_text()) if note.exists() else {}
    done, same = old.pop("done", False), old == told
    product = folder / step.makes
    if same and done and product.exists():
        return
    if product.exists() and not old:
        raise StepError(f"{product}: nothing tells how it was made; move it away")
    command = step.command
    if same and step.run and (folder / step.run / CHECKPOINT).exists():
        command = _resuming(command)
    else:
        for old_one in {product, folder / (step.run or step.makes)}:
            _remove(old_one)
    note.parent.mkdir(parents=True, exist_ok=True)
    _write(note, {**told, "done": False})  # tells a later start whose checkpoint this is
    run(folder, command)
    if not product.exists():
        raise StepError(f"{command}: made no {step.makes}")
    _write(note, {**told, "done": True})


def _resuming(command: str) -> str:
    """Return the command that goes on with a run: it keeps the run's own settings."""
    words = shlex.split(command)
    start = next(i for i, word in enumerate(words) if word.startswith("--"))
    kept = words[:start]
    for option in ("--data", "--out"):
        kept += [option, words[words.index(option) + 1]]
    return shlex.join([*kept, "--resume"])


def run_command(folder: Path, command: str) -> None:
    """Run a command of this project in a folder. Raises StepError."""
    print(f"$ {command}", flush=True)
    program, *words = shlex.split(command)
    code = f"import sys, cli; sys.argv[0] = {program!r}; cli.{program}()"
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "PYTHONPATH": path}
    shown = subprocess.DEVNULL if words[0] == "score" else None  # pages of tables; JSON has them
    python = [sys.executable, "-c", code, *words]
    done = subprocess.run(python, cwd=folder, env=environment, stdout=shown, check=False)
    if done.returncode:
        raise StepError(f"{command}: exit code {done.returncode}")


def mark(path: Path) -> str:
    """Return what tells a file's content: the fingerprints of data, else SHA-256."""
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            marks = [file.attrs[name] for name in FINGERPRINTS if name in file.attrs]
        if marks:
            return " ".join(map(str, marks))
    return hashlib.sha256(path.read_bytes()).hexdigest()


def bundled_mark(method: str) -> str:
    """Return SHA-256 of the weights that come with a baseline; empty where none do."""
    name = "pix2shape" if method.startswith("pix2shape") else method.replace("-", "_")
    package = ROOT / "baselines" / name
    found = sorted(package.rglob("files/*.safetensors"))
    digests = "".join(mark(path) for path in found)
    return hashlib.sha256(digests.encode()).hexdigest() if found else ""


def record(
    path: Path, settings: dict[str, Any], make: Callable[[], dict[str, Any]]
) -> dict[str, Any]:
    """Return the scores of a file of results, which are made first where it has others' settings.

    The file is JSON: {"settings": ..., "scores": ...}.
    """
    if path.exists():
        old = json.loads(path.read_text())
        if old["settings"] == json.loads(json.dumps(settings)):
            return dict(old["scores"])
    scores = make()
    path.parent.mkdir(parents=True, exist_ok=True)
    _write(path, {"settings": settings, "scores": scores})
    return scores


def each(what: Iterable[tuple[str, Callable[[], Any]]]) -> list[str]:
    """Call functions one after another; return the names of those that failed."""
    failed = []
    for name, call in what:
        try:
            call()
        except StepError as error:
            print(f"failed: {name}: {error}", file=sys.stderr, flush=True)
            failed.append(name)
    return failed


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _write(path: Path, content: dict[str, Any]) -> None:
    write_text(path, json.dumps(content, indent=1) + "\n", overwrite=True)
