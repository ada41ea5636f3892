"""Files to learn from: each is opened once, and handed open to whoever reads it.

Test sets are not trained on, unless somebody means it.
"""

import itertools
import json
import os
import shlex
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

from iqtt import QuestionsFile, open_questions
from iqtt.files.reader import holds_questions
from metrics.scoring.known_tests import KNOWN_TESTS, KnownTest, known_test
from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.files.sets.shards import OpenFile
from scenegen.rooms.reader import RoomsFile

FileT = TypeVar("FileT")
SAME = ("seed", "source", "shapes", "object_split")  # settings that make the same scenes


class TrainingFiles:
    """One file or several to learn from, open: all of rooms, or all of questions.

    Use it as a context manager, or close it.

    Attributes:
        opened: the files, in the order in which they were named.
        hold_questions: whether they are files of questions.
        where: their names, for messages.
    """

    def __init__(self, *paths: str | Path) -> None:
        """Open files. Raises OSError, FileFormatError; SpecError for rooms beside questions."""
        with ExitStack() as stack:
            self.opened = [
                stack.enter_context(OpenFile(path, "rooms or question file")) for path in paths
            ]
            kinds = [holds_questions(opened) for opened in self.opened]
            self.hold_questions, self.where = kinds[0], ", ".join(map(str, paths))
            for path, kind in zip(paths, kinds, strict=True):
                if kind != kinds[0]:
                    names = ("questions", "rooms") if kind else ("rooms", "questions")
                    raise SpecError(path, names[0], f"{names[1]}, as {paths[0]} holds")
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close all files."""
        self._stack.close()

    def rooms(self) -> list[RoomsFile]:
        """Return the files as rooms. Raises as `RoomsFile`."""
        return [RoomsFile(opened) for opened in self.opened]

    def questions(self, part: str) -> list[QuestionsFile]:
        """Return the labelled or the unlabelled questions of the files.

        Raises as `QuestionsFile`, and SpecError for files that are not to train on.
        """
        tables = []
        for opened in self.opened:
            try:
                tables.append(QuestionsFile(opened, part))
            except SpecError as error:
                expected = "a training file such as iqtt-train.h5"
                raise SpecError(opened.path, "no training questions", expected) from error
        return tables


def only(files: Sequence[FileT], method: str) -> FileT:
    """Return the one file. Raises SpecError where there are several."""
    if len(files) != 1:
        raise SpecError("data", f"{len(files)} files", f"one, because {method} trains on one file")
    return files[0]


def requests(files: Sequence[RoomsFile] | Sequence[QuestionsFile]) -> dict[str, Any]:
    """Return what a card tells of files: their requests, a line each, and their fingerprints."""
    specs = (file.spec.to_json() for file in files if file.spec is not None)
    marks = (str(file.fingerprint or "") for file in files)
    return {"data": "\n".join(specs), "fingerprint": " ".join(marks)}


class Opened(Generic[FileT]):
    """A file that is open, and that other processes may read, too: each opens it for itself."""

    def __init__(self, opener: Callable[[], FileT], file: FileT | None = None) -> None:
        """Take a file that this process has open, or open it. `opener` can be pickled."""
        self._opener = opener
        self._files = {os.getpid(): opener() if file is None else file}

    @property
    def file(self) -> FileT:
        """The file as this process has it open."""
        if os.getpid() not in self._files:  # in a fork, HDF5 must not use its parent's file
            self._files[os.getpid()] = self._opener()
        return self._files[os.getpid()]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_files": {}}


def shared_rooms(rooms: RoomsFile) -> Opened[RoomsFile]:
    """Return open rooms as a file that other processes may read, too."""
    return Opened(partial(open_rooms, rooms.path), rooms)


def shared_questions(questions: QuestionsFile) -> Opened[QuestionsFile]:
    """Return open questions as a file that other processes may read, too."""
    return Opened(partial(open_questions, questions.path, questions.part), questions)


def refuse_test_set(opened: OpenFile) -> None:
    """Refuse a file to learn from that is a named test set, or rooms of its seed and objects.

    Of questions the pictures alone tell the set, as files without answers have no truth.

    Raises SpecError. Other files pass.
    """
    file = opened.file
    texts = {name: str(value) for name, value in file.attrs.items()}
    pictures = str(file["questions"].attrs.get("sha256", "")) if "questions" in file else ""
    test = known_test(texts.get("truth_digest", "")) or next(
        (t for t in KNOWN_TESTS if pictures and t.pictures == pictures), None
    )
    if test is None:
        try:
            spec = json.loads(texts.get("spec", ""))
            same = [spec[name] for name in SAME]
        except (ValueError, TypeError, KeyError):
            return
        test = next((test for test in KNOWN_TESTS if _settings(test) == same), None)
    if test:
        hint = "use another --seed for training, or --allow-test-set"
        message = f"the seed and the objects of the benchmark {test.name}"
        raise SpecError(opened.path, message, "training data", hint)


def _settings(test: KnownTest) -> list[Any]:
    """Return `SAME` of the scenes of a set of rooms; nothing where the seed is the default."""
    from scenegen.description.presets import preset_spec

    given = dict(itertools.pairwise(shlex.split(test.command)))
    if test.task != "rooms" or "--seed" not in given:
        return []
    split = {"object_split": given["--object-split"]} if "--object-split" in given else {}
    spec = preset_spec(given.get("--preset", "shapes"), seed=int(given["--seed"]), **split)
    return [json.loads(spec.to_json())[name] for name in SAME]
