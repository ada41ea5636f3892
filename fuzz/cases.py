"""One case: a command line, what was done to its files, and where its output goes.

Seed, target and number give the case; written as JSON it can be run again without them, also when
the formats have changed, as it says what to do to honest files and not what their bytes are.
"""

import json
import os
import shutil
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fuzz import byte_edits, hdf5_edits, json_edits
from fuzz.child import call
from fuzz.programs import OUTPUTS, Target

Rng = np.random.Generator
SECONDS = 5.0  # that the edits of a case may take
# Files that a command finds by way of others.
FOUND_BY = {
    "rooms.h5": ("predictions.h5", "constant.h5"),
    "weights.json": ("weights.safetensors",),
    "iqtt/iqtt-test-answers.h5": ("iqtt/iqtt-test.h5",),
}
EDITS = {**byte_edits.EDITS, **hdf5_edits.EDITS, **json_edits.EDITS}
# Words of a command line. None is a device or an absolute path, which a broken command could
# replace; the special files are made when the case is put up.
WORDS = (
    "", " ", "-", "--", "-1", "0", "1", "nan", "inf", "1e999", str(2**63), str(2**200), "9" * 5000,
    "0-99999999999", "3-1", ",", "0,0,0", "x", "x" * 300, "x" * 5000, ".", "..", "a/b/c", "no/way",
    "\x1b[2J", "a\nb", "\u202ex", "\udcff\udcfe", "\udcffx.h5", "~", "%s", "--help", "--version",
    "--overwrite", "--nonsense", "--seed=-1", "fifo", "folder", "loop", "dangling", "to-input",
    "hard-input", "cache", "new.h5", "new.png", "new.json", "new.html", "new.gif", "new.JPG", "new",
    ".hidden",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A case.

    Attributes:
        target: name of the target.
        arguments: the command line; its first word is the program.
        edits: what is done to files of the honest folder, in order: path, name of the edit, and
            its arguments.
        stdout: where standard output goes: "file", "closed pipe" or "full".
    """

    target: str
    arguments: tuple[str, ...]
    edits: tuple[tuple[Any, ...], ...] = ()
    stdout: str = "file"

    def to_json(self) -> str:
        """Return the case as one line of JSON."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> "Case":
        """Read a case."""
        told = json.loads(text)
        arguments, edits = tuple(told.pop("arguments")), tuple(map(tuple, told.pop("edits", ())))
        return Case(arguments=arguments, edits=edits, **told)

    def put_up(self, honest: Path, folder: Path) -> list[str]:
        """Make the folder that the command runs in; return the edits that could not be made.

        Edits are made in a child, which may use up the memory it has, or be ended by HDF5.
        """
        shutil.copytree(honest, folder, symlinks=True)
        os.mkfifo(folder / "fifo")
        (folder / "folder").mkdir()
        (folder / "loop").symlink_to("loop")
        (folder / "dangling").symlink_to("nowhere")
        (folder / "to-input").symlink_to("rooms.h5")
        os.link(folder / "rooms.h5", folder / "hard-input")
        if not self.edits:
            return []
        done = call(lambda: self._edit(folder), folder, SECONDS)
        return done.out.decode(errors="replace").splitlines() + ["ended"] * (done.code != 0)

    def _edit(self, folder: Path) -> None:
        for path, name, *arguments in self.edits:
            try:
                EDITS[name](folder / path, *arguments)
            except Exception as error:  # an edit need not fit a file that others have changed
                print(ascii(f"{path} {name}: {type(error).__name__}: {error!s:.100}"))


def draw(target: Target, seed: int, number: int, honest: Path) -> Case:
    """Draw a case of a target."""
    rng = np.random.default_rng([seed, zlib.crc32(target.name.encode()), number])
    arguments = str(rng.choice(list(target.lines))).split()
    edits: list[tuple[Any, ...]] = []
    if rng.random() < 0.8:
        read = [name for name in target.inputs if _is_read(name, arguments)] or list(target.inputs)
        for _ in range(1 if rng.random() < 0.75 else int(rng.integers(2, 4))):
            path = str(rng.choice(read))
            edits.append((path, *_draw_edit(rng, honest, path, target.inputs)))
        edits.sort(key=lambda edit: edit[1] in byte_edits.EDITS)  # others need a readable file
    else:  # never with edits: an output could be a link to a device
        _change_words(rng, arguments)
    stdout = str(rng.choice(["file", "closed pipe", "full"], p=[0.97, 0.02, 0.01]))
    return Case(target.name, tuple(arguments), tuple(edits), stdout)


def _is_read(name: str, arguments: Sequence[str]) -> bool:
    """Return whether a command line names a file, or its folder, or a file that names it."""
    return not {name, Path(name).parts[0], *FOUND_BY.get(name, ())}.isdisjoint(arguments)


def _draw_edit(rng: Rng, honest: Path, path: str, inputs: Sequence[str]) -> list[Any]:
    """Draw a change that suits the kind of file."""
    others = [os.path.relpath(name, Path(path).parent) for name in (*inputs, "train.h5")]
    suffix, chance = Path(path).suffix, rng.random()
    if suffix == ".h5" and chance < 0.6:
        return hdf5_edits.draw(rng, honest / path)
    if suffix == ".h5" and chance < 0.75:
        found = _texts_of_json(honest / path)
        if found:
            where, name = found[int(rng.integers(len(found)))]
            return ["json_inside", where, name, float(rng.random()), *json_edits.draw(rng)]
    if suffix == ".json" and chance < 0.75:
        return ["json_file", *json_edits.draw(rng)]
    if suffix == ".json" and chance < 0.85:
        return json_edits.draw_frame(rng)
    if suffix == ".safetensors" and chance < 0.6:
        return ["json_header", *json_edits.draw(rng)]
    if suffix not in (".h5", ".json", ".safetensors") and chance < 0.5:
        return byte_edits.draw_numerals(rng)
    return byte_edits.draw(rng, others)


def _texts_of_json(path: Path) -> list[tuple[str, str]]:
    """Return the JSON in an HDF5 file: (object, name of the attribute or nothing)."""
    found = []
    with h5py.File(path, "r") as file:
        for name in hdf5_edits.objects(path):
            item = file[name]
            for key, value in item.attrs.items():
                if isinstance(value, str) and value.startswith("{"):
                    found.append((name, key))
            if isinstance(item, h5py.Dataset) and h5py.check_string_dtype(item.dtype):
                found.append((name, ""))
    return found


def _change_words(rng: Rng, arguments: list[str]) -> None:
    """Replace, add or remove words of a command line, in place; the program and command stay."""
    inputs = [word for word in arguments[2:] if "." in word and not word.startswith("new")]
    for _ in range(int(rng.integers(1, 4))):
        word = (
            str(rng.choice(WORDS)) if rng.random() < 0.7 or not inputs else str(rng.choice(inputs))
        )
        values = [i for i in range(2, len(arguments)) if arguments[i - 1].startswith("--")]
        outputs = [i for i in values if arguments[i - 1] in OUTPUTS]
        places = [values, outputs, range(2, len(arguments))][rng.integers(3)]
        act = rng.choice(["replace", "insert", "remove", "overwrite"], p=[0.7, 0.1, 0.05, 0.15])
        if act == "replace" and len(places):
            arguments[int(rng.choice(places))] = word
        elif act == "insert":
            arguments.insert(int(rng.integers(2, len(arguments) + 1)), word)
        elif act == "remove" and len(arguments) > 2:
            arguments.pop(int(rng.integers(2, len(arguments))))
        else:
            arguments.append("--overwrite")
