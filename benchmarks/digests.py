"""Digests of everything the commands write: does a change of the code change an output?

    python -m benchmarks.digests write before.json --tree ../other-checkout
    python -m benchmarks.digests write after.json
    python -m benchmarks.digests compare before.json after.json

`write` runs the commands of one checkout from fresh files: rooms of every preset and of the options
that change pixels, questions of every kind, trivial and learned submissions, scores, comparisons,
leaderboards, exports. `compare` names what differs, of two kinds:

    data   arrays of HDF5 files, pictures and meshes, and the numbers of printed tables and CSV
    text   attributes, fields of JSON, texts in HDF5 files, other files, and what was printed

It exits with 1 if data differ. Texts may differ between formats and releases.
"""

import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import h5py
import numpy as np
from PIL import Image

from scenegen.files.new_file import write_text

PRESETS = (
    "shapes", "shapes-single", "shapenet", "shapenet-single", "furniture-256", "specular",
    "two-tone", "albedo", "random-lights", "views",
)  # fmt: skip
OPTIONS = {
    "path": "--shading path --spp 4 --size 32",
    "shadows": "--shadows --spp 4",
    "float16": "--image-dtype float16 --compression none",
    "float32": "--image-dtype float32 --compression lzf --pose any",
    "wide": "--size 48x96 --object-radius 0.08-0.1 --views 0,35,80 --lights 0-16",
    "empty": "--objects 0",
    "models": "--objects-root {folder} --up z --cache-dir {folder}-cache --objects 2",
    "shards": "--shard-size 2 --workers 1",
}
QUESTIONS = {
    **{f"{kind}-chain": f"--distractors {kind}" for kind in ("other", "near", "mirror", "mixed")},
    **{f"{kind}-tree": f"--distractors {kind} --shapes tree" for kind in ("mixed", "mirror")},
    "depth": "--with-depth --image-dtype float16 --compression none --background 0.2,0.4,0.6",
    "large": "--size 96 --lights 1-4 --cubes 7 --max-radius 3 --seed 5",
}
PRINTED = ("bench score", "bench compare", "bench leaderboard")  # commands whose tables count
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
TEXTS = (".md", ".markdown", ".latex", ".csv", ".json", ".txt", ".mtl")


def run(tree: Path, folder: Path, command: str) -> tuple[int, str]:
    """Run `bench score ...` and the like with the code of a checkout.

    Returns:
        Exit code, and what it printed.
    """
    program, *arguments = command.split()
    call = f"from cli import {program}; {program}()"
    done = subprocess.run(
        [sys.executable, "-c", call, *arguments], cwd=folder, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(tree)}, check=False,
    )  # fmt: skip
    if done.returncode not in (0, 1):
        print(f"exit code {done.returncode}: {command}\n{done.stderr[-500:]}", file=sys.stderr)
    return done.returncode, done.stdout


def commands(folder: Path) -> Iterator[str]:
    """Yield the commands, in an order in which each finds the files that it needs."""
    models = folder / "models"
    for preset in PRESETS:
        yield f"scenegen render --n 5 --seed 3 --preset {preset} --out {preset}.h5"
    for name, options in OPTIONS.items():
        yield f"scenegen render --n 4 --seed 7 --out {name}.h5 {options.format(folder=models)}"
    for name, options in QUESTIONS.items():
        yield f"iqtt make-split --train 12 --labeled 4 --val 6 --test 6 --out iqtt-{name} {options}"
    yield "scenegen preview views.h5 --out views.png"
    for form in ("exr", "png", "ply", "obj"):
        yield f"scenegen export shapenet.h5 --items 0,2 --format {form} --out export"
    yield "iqtt show iqtt-mixed-chain/iqtt-test.h5 --mark-correct --out questions.png"
    yield "iqtt audit iqtt-mixed-chain iqtt-near-chain --json audit.json"
    yield "scenegen render --n 12 --seed 4 --views 0,35 --out truth.h5"
    for seed in (5, 6):
        yield f"scenegen render --n 6 --seed {seed} --out train-{seed}.h5"
        learn = f"--data truth.h5 --train train-{seed}.h5"
        yield f"bench baseline constant {learn} --out constant-{seed}.h5"
    yield "bench baseline mean-depth --data truth.h5 --train train-5.h5 --out mean-depth.h5"
    for name in ("empty-room", "oracle"):
        yield f"bench baseline {name} --data truth.h5 --out {name}.h5"
    yield "pix2shape predict --weights shapes-rays --data truth.h5 --out pix2shape.h5"
    questions = "iqtt-mixed-chain/iqtt-test"
    yield f"pix2shape predict --weights iqtt --data {questions}.h5 --out answers.h5"
    yield f"bench baseline chance --data {questions}.h5 --out chance.h5"
    for name in ("constant-5", "mean-depth", "empty-room", "oracle", "pix2shape"):
        outputs = f"--json {name}.json --csv {name}.csv --markdown"
        yield f"bench score {name}.h5 --truth truth.h5 {outputs}"
    yield "bench score constant-5.h5 constant-6.h5 --truth truth.h5 --json runs.json"
    for name in ("chance", "answers"):
        yield f"bench score {name}.h5 --truth {questions}-answers.h5 --json {name}.json"
    yield "bench compare constant-5.json mean-depth.json empty-room.json --json compare.json"
    yield "bench compare chance.json answers.json --json compare-answers.json"
    for form in ("markdown", "latex"):
        yield f"bench leaderboard constant-5.json empty-room.json --format {form}"
        yield f"bench leaderboard chance.json --format {form}"


def file_parts(path: Path) -> Iterator[tuple[str, str, Any]]:
    """Yield (kind, part, value) of one file: data sets, attributes and fields of JSON apart."""
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            names: list[str] = []
            file.visit(names.append)
            for name in ["/", *sorted(names)]:
                for key, value in sorted(file[name].attrs.items()):
                    yield "text", f"{name}@{key}", repr(value)
                if isinstance(file[name], h5py.Dataset):
                    array = np.asarray(file[name][()])
                    if array.dtype.kind in "OS":
                        yield "text", name, repr(array.tolist())
                    else:
                        head = f"{array.dtype} {array.shape}".encode()
                        yield "data", name, head + array.tobytes()
    elif path.suffix == ".json":
        yield from leaves(json.loads(path.read_text()), "")
    elif path.suffix == ".png":
        with Image.open(path) as image:
            yield "data", "pixels", f"{image.mode} {image.size}".encode() + image.tobytes()
            yield "text", "texts", repr(sorted(image.info.items(), key=str))
    elif path.suffix == ".csv":
        yield from printed_parts(path.read_text())
    else:
        yield "text" if path.suffix in TEXTS else "data", "", path.read_bytes()


def leaves(value: Any, where: str) -> Iterator[tuple[str, str, str]]:
    """Yield the fields of JSON, objects field by field."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, f"{where}/{key}")
    else:
        yield "text", where, json.dumps(value)


def printed_parts(text: str) -> Iterator[tuple[str, str, str]]:
    """Yield the numbers of a text, and the text."""
    yield "data", "numbers", " ".join(NUMBER.findall(text))
    yield "text", "text", text


def make_models(folder: Path) -> None:
    """Write a small folder of meshes in several formats."""
    import trimesh

    for index, name in enumerate(("ply", "stl", "obj", "off", "glb")):
        where = folder / ("a" if index % 2 else "b")
        where.mkdir(parents=True, exist_ok=True)
        mesh = trimesh.creation.box((1, 2 + index, 3)) if index % 2 else trimesh.creation.cone(1, 2)
        mesh.export(where / f"{name}.{name}")


@click.group()
def main() -> None:
    """Compare what two checkouts of the code write."""


@main.command()
@click.argument("out")
@click.option("--tree", default=".", help="Checkout whose code runs.")
@click.option("--keep", help="Empty folder for the files  [a temporary one].")
def write(out: str, tree: str, keep: str | None) -> None:
    """Run the commands of a checkout and write the digests of their files."""
    digests: dict[str, str] = {}

    def add(name: str, kind: str, part: str, value: Any) -> None:
        data = value.encode() if isinstance(value, str) else value
        digests[f"{kind} {name} {part}".strip()] = hashlib.sha256(data).hexdigest()[:16]

    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(keep or temporary).resolve()
        make_models(folder / "models")
        for command in commands(folder):
            print(command, flush=True)
            name = command.replace(str(folder), "FOLDER")
            code, output = run(Path(tree).resolve(), folder, command)
            add(f"$ {name}", "data", "exit code", str(code))
            if command.startswith(PRINTED):
                for part in printed_parts(output):
                    add(f"$ {name}", *part)
        for path in sorted(folder.rglob("*")):
            inside = path.relative_to(folder)
            if path.is_file() and not inside.parts[0].startswith("models"):
                for part in file_parts(path):
                    add(str(inside), *part)
    write_text(out, json.dumps(digests, indent=1) + "\n", overwrite=True)
    print(f"{out}: {len(digests):,} digests")


@main.command()
@click.argument("before")
@click.argument("after")
@click.option("--texts", is_flag=True, help="Name the texts that differ, too.")
def compare(before: str, after: str, texts: bool) -> None:
    """Name what differs; exits with 1 if data differ."""
    old, new = (json.loads(Path(path).read_text()) for path in (before, after))
    keys = list({**old, **new})
    differing = [key for key in keys if old.get(key) != new.get(key)]
    for key in differing:
        if texts or key.startswith("data"):
            print(f"{'gone' if key not in new else 'new' if key not in old else 'differs':8} {key}")
    for kind in ("data", "text"):
        count = sum(key.startswith(kind) for key in differing)
        print(f"{kind}: {sum(key.startswith(kind) for key in keys) - count:,} equal, {count:,} not")
    sys.exit(any(key.startswith("data") for key in differing))


if __name__ == "__main__":
    main()
