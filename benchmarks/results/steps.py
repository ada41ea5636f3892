"""Commands that are run once. A note beside each product says how it was made."""

import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import h5py

from scenegen.files.new_file import write_text

ROOT = Path(__file__).parents[2]
BUNDLED = "bundled weights"  # stands among `Step.reads` for all weights that come with the package


class StepError(Exception):
    """A command failed. It has printed the reason."""


@dataclass(frozen=True)
class Step:
    """Commands that make one product. Paths are relative to the folder of results.

    Attributes:
        commands: such as "bench train cnn --data mixed/iqtt-train.h5 --out cnn-200-0", in order.
        makes: the file or folder that exists when they are done.
        reads: files whose content decides the product.
        run: folder of a training run, which can be resumed; or empty.
        scratch: files between the commands, which are removed in the end.
    """

    commands: tuple[str, ...]
    makes: str
    reads: tuple[str, ...] = ()
    run: str = ""
    scratch: tuple[str, ...] = ()


def make_all(folder: Path, steps: Iterable[Step]) -> list[str]:
    """Make the products of steps, one after another; return the products that failed."""
    failed = []
    for step in steps:
        try:
            make(folder, step)
        except (StepError, OSError) as error:
            print(f"failed: {step.makes}: {error}", file=sys.stderr, flush=True)
            failed.append(step.makes)
    return failed


def make(folder: Path, step: Step) -> None:
    """Make the product of a step, unless the same commands made it from the same files.

    A training run that was stopped goes on. Raises StepError, also where the product has no note,
    as it may be somebody's.
    """
    product, note = folder / step.makes, folder / f"{step.makes}.made.json"
    expected: dict[str, Any] = {"commands": list(step.commands)}
    expected["reads"] = {name: mark(folder / name) for name in step.reads}
    made = json.loads(note.read_text()) if note.exists() else {}
    same = {**made, "done": True} == {**expected, "done": True}
    if same and made["done"] and product.exists():
        return
    if product.exists() and not made:
        raise StepError(f"{product}: nothing tells how it was made; move it away")
    commands = step.commands
    if same and step.run and list((folder / step.run).glob("checkpoint*")):
        commands = tuple(map(_resuming, commands))
    else:
        for name in {step.makes, step.run or step.makes, *step.scratch}:
            _remove(folder / name)
    for name in (step.makes, *step.scratch):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
    _write(note, {**expected, "done": False})  # tells a later start whose checkpoint this is
    for command in commands:
        _run(folder, command)
    if not product.exists():
        raise StepError(f"{commands[-1]}: made no {step.makes}")
    for name in step.scratch:
        _remove(folder / name)
    _write(note, {**expected, "done": True})


def mark(path: Path) -> str:
    """Return a text that tells a file's content: fingerprints of data, else SHA-256."""
    if path.name == BUNDLED:
        return _bundled()
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            marks = [str(v) for k, v in file.attrs.items() if k.startswith("fingerprint")]
        if marks:
            return " ".join(marks)
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def _bundled() -> str:
    weights = sorted((ROOT / "baselines").rglob("files/*.safetensors"))
    return hashlib.sha256("".join(map(mark, weights)).encode()).hexdigest()


def _resuming(command: str) -> str:
    """Return the command that goes on with a run; the run keeps its settings."""
    words = shlex.split(command)
    first = next(i for i, word in enumerate(words) if word.startswith("--"))
    kept = [words[words.index(option) + 1] for option in ("--data", "--out")]
    return shlex.join([*words[:first], "--data", kept[0], "--out", kept[1], "--resume"])


def _run(folder: Path, command: str) -> None:
    print(f"$ {command}", flush=True)
    program, *words = shlex.split(command)
    code = f"import sys, cli; sys.argv[0] = {program!r}; cli.{program}()"
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    stdout = subprocess.DEVNULL if words[0] == "score" else None  # pages of tables; JSON has them
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        cwd=folder, env={**os.environ, "PYTHONPATH": path}, stdout=stdout, check=False,
    )  # fmt: skip
    if done.returncode:
        raise StepError(f"{command}: exit code {done.returncode}")


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _write(path: Path, content: dict[str, Any]) -> None:
    write_text(path, json.dumps(content, indent=1) + "\n", overwrite=True)
