"""One case: a command line, what was done to its files, and where its output goes.

Seed, target and number give the case; written as JSON it can be run again without them, also when
the formats have changed, as it says what to do to honest files and not what their bytes are.
"""

import json
import os
import shutil
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fuzz.child import call
from fuzz.edits import EDITS, Rng, draw, is_last
from fuzz.programs import OUTPUTS, TARGETS, inputs

SECONDS = 5.0  # that the edits of a case may take
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
        fields = json.loads(text)
        edits = tuple(map(tuple, fields.pop("edits", ())))
        return Case(arguments=tuple(fields.pop("arguments")), edits=edits, **fields)

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
                EDITS[name].change(folder / path, *arguments)
            except Exception as error:  # an edit need not fit a file that others have changed
                print(ascii(f"{path} {name} {arguments}: {type(error).__name__}: {error!s:.100}"))


def drawn(target: str, seed: int, number: int, honest: Path) -> Case:
    """Draw a case of a target."""
    rng = np.random.default_rng([seed, zlib.crc32(target.encode()), number])
    arguments = str(rng.choice(list(TARGETS[target]))).split()
    edits: list[tuple[Any, ...]] = []
    if rng.random() < 0.8:
        files = inputs(arguments, honest)
        for _ in range(1 if rng.random() < 0.75 else int(rng.integers(2, 4))):
            path = str(rng.choice(files))
            edits.append((path, *draw(rng, honest, path, files)))
        edits.sort(key=lambda edit: is_last(edit[1]))
    else:  # never with edits: an output could be a link to a device
        _change_words(rng, arguments)
    stdout = str(rng.choice(["file", "closed pipe", "full"], p=[0.97, 0.02, 0.01]))
    return Case(target, tuple(arguments), tuple(edits), stdout)


def _change_words(rng: Rng, arguments: list[str]) -> None:
    """Replace, add or remove words of a command line, in place; the program and command stay."""
    files = [word for word in arguments[2:] if "." in word and not word.startswith("new")]
    for _ in range(int(rng.integers(1, 4))):
        word = str(rng.choice(WORDS if rng.random() < 0.7 or not files else files))
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
