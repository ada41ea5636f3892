"""Digests of everything the commands write: does a change of the code change an output?

    python -m benchmarks.digests write before.json
    python -m benchmarks.digests write after.json --tree ../changed-checkout
    python -m benchmarks.digests compare before.json after.json

`write` runs the commands of one checkout from fresh files: rooms of every preset and of the options
that change pixels, questions of every kind, trivial and learned submissions, scores, comparisons,
leaderboards, exports. Each data set, attribute and file gets a digest of its own, so that `compare`
names what differs. Command lines and versions are not compared, as they differ between runs.
"""

import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import h5py
import numpy as np

from scenegen.files.new_file import write_text

VOLATILE = (
    "creation_command", "writer", "versions", "submissions", "format_version",
    "mitsuba_version", "drjit_version", "llvm_version",
)  # fmt: skip
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
}
QUESTIONS = {
    **{f"{kind}-chain": f"--distractors {kind}" for kind in ("other", "near", "mirror", "mixed")},
    **{f"{kind}-tree": f"--distractors {kind} --shapes tree" for kind in ("mixed", "mirror")},
    "depth": "--with-depth --image-dtype float16 --compression none --background 0.2,0.4,0.6",
    "large": "--size 96 --lights 1-4 --cubes 7 --max-radius 3 --seed 5",
}


def run(tree: Path, folder: Path, command: str) -> bytes:
    """Run `bench score ...` and the like with the code of a checkout; returns what it printed."""
    program, *arguments = command.split()
    call = f"import sys; sys.path.insert(0, {str(tree)!r}); from cli import {program}; {program}()"
    done = subprocess.run(
        [sys.executable, "-c", call, *arguments], cwd=folder, capture_output=True, check=False
    )
    if done.returncode not in (0, 1) or b"Traceback" in done.stderr:
        raise click.ClickException(f"{command}: {done.stderr.decode()}")
    return done.stdout


def commands(folder: Path) -> Iterator[str]:
    """Name the commands, in an order in which each finds the files that it needs."""
    models = folder / "models"
    for preset in PRESETS:
        yield f"scenegen render --n 5 --seed 3 --preset {preset} --out {preset}.h5"
    for name, options in OPTIONS.items():
        said = options.format(folder=models)
        yield f"scenegen render --n 4 --seed 7 --out {name}.h5 {said}"
    for name, options in QUESTIONS.items():
        yield f"iqtt make-split --train 12 --labeled 4 --val 6 --test 6 --out iqtt-{name} {options}"
    yield "scenegen preview views.h5 --out views.png"
    for form in ("exr", "png", "ply", "obj"):
        yield f"scenegen export shapenet.h5 --items 0,2 --format {form} --out export"
    yield "iqtt show iqtt-mixed-chain/iqtt-test.h5 --answers --out questions.png"
    yield "iqtt audit iqtt-mixed-chain iqtt-near-chain --json audit.json"
    yield "scenegen render --n 12 --seed 4 --views 0,35 --out truth.h5"
    yield "scenegen render --n 6 --seed 5 --out train.h5"
    for name in ("constant", "mean-depth", "empty-room", "oracle"):
        train = "--train train.h5" if name in ("constant", "mean-depth") else ""
        yield f"bench baseline {name} --data truth.h5 {train} --out {name}.h5"
    yield "pix2shape predict --weights shapes --data truth.h5 --out pix2shape.h5"
    answers = "iqtt-mixed-chain/iqtt-test"
    told = f"--weights iqtt --data {answers}.h5"
    yield f"pix2shape predict {told} --out pix2shape-answers.h5"
    yield f"bench baseline chance --data {answers}.h5 --out chance.h5"
    for name in ("constant", "mean-depth", "empty-room", "oracle", "pix2shape"):
        outputs = f"--json {name}.json --csv {name}.csv --markdown"
        yield f"bench score {name}.h5 --truth truth.h5 {outputs}"
    yield "scenegen render --n 6 --seed 6 --out train-2.h5"
    yield "bench baseline constant --data truth.h5 --train train-2.h5 --out constant-2.h5"
    yield "bench score constant.h5 constant-2.h5 --truth truth.h5 --json runs.json"
    for name in ("chance", "pix2shape-answers"):
        yield f"bench score {name}.h5 --truth {answers}-answers.h5 --json {name}.json"
    yield "bench compare constant.json mean-depth.json empty-room.json --json compare.json"
    yield "bench compare chance.json pix2shape-answers.json --json compare-answers.json"
    for form in ("markdown", "latex"):
        yield f"bench leaderboard constant.json empty-room.json --format {form} --out board.{form}"
        yield f"bench leaderboard chance.json --format {form} --out board-iqtt.{form}"


def digests(path: Path) -> Iterator[tuple[str, str]]:
    """Give (part, digest) of one file: data sets, attributes and JSON fields apart."""
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            names: list[str] = []
            file.visit(names.append)
            for name in ["/", *sorted(names)]:
                for key, value in sorted(file[name].attrs.items()):
                    yield f"{name}@{key}", digest(repr(value))
                if isinstance(file[name], h5py.Dataset):
                    yield name, digest(content(file[name][()]))
    elif path.suffix == ".json":
        yield from leaves(json.loads(path.read_text()), "")
    else:
        yield "", digest(path.read_bytes())


def leaves(value: Any, where: str) -> Iterator[tuple[str, str]]:
    """Give (field, digest) of JSON, objects field by field."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, f"{where}/{key}")
    else:
        yield where, digest(json.dumps(value))


def content(values: Any) -> bytes:
    """Return a data set's values as bytes; of texts, the texts."""
    array = np.asarray(values)
    plain = repr(array.tolist()).encode() if array.dtype.kind == "O" else array.tobytes()
    return f"{array.dtype} {array.shape}".encode() + plain


def digest(data: bytes | str) -> str:
    """SHA-256, the first 16 digits."""
    return hashlib.sha256(data.encode() if isinstance(data, str) else data).hexdigest()[:16]


def is_content(part: str) -> bool:
    """Return whether a part is compared, because it is no command line and no version."""
    return not any(word in VOLATILE for word in part.replace("@", "/").lower().split("/"))


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
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(keep or temporary).resolve()
        make_models(folder / "models")
        for command in commands(folder):
            printed = run(Path(tree).resolve(), folder, command)
            if (
                command.startswith(("bench compare", "bench leaderboard"))
                or "--markdown" in command
            ):
                found[f"$ {command}"] = digest(printed)
            print(command, flush=True)
        for path in sorted(folder.rglob("*")):
            inside = path.relative_to(folder)
            if path.is_file() and not inside.parts[0].startswith("models"):
                found |= {f"{inside} {part}": value for part, value in digests(path)}
    write_text(out, json.dumps(found, indent=1) + "\n", overwrite=True)
    print(f"{out}: {len(found):,} digests")


@main.command()
@click.argument("before")
@click.argument("after")
def compare(before: str, after: str) -> None:
    """Name what differs; exits with 1 if any content does."""
    old, new = (json.loads(Path(path).read_text()) for path in (before, after))
    differ = [key for key in {**old, **new} if old.get(key) != new.get(key) and is_content(key)]
    for key in differ:
        what = "gone" if key not in new else "new" if key not in old else "differs"
        print(f"{what:8} {key}")
    same = sum(is_content(key) for key in old) - sum(key in old for key in differ)
    print(f"{same:,} parts equal, {len(differ)} not")
    sys.exit(1 if differ else 0)


if __name__ == "__main__":
    main()
