"""Mental-rotation questions (3D-IQTT): make them, read them, audit them.

Read a file:    `with iqtt.open_questions("iqtt-split/iqtt-val.h5") as q: q[0].images, q[0].answer`
Train on it:    `iqtt.QuestionsDataset("iqtt-split/iqtt-train.h5", "labeled")`
Make a split:   `iqtt.make_split("iqtt-split", iqtt.preset_spec("small", seed=1))`

A question passes through `shapes` (polycubes), `questions` (what it asks and shows), `render` (its
images) and `files`; `audit` checks files. Each may import those before it, and `scenegen`. These
names are loaded when they are first used, so that importing the package is fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from iqtt.files.make import make_split
    from iqtt.files.reader import (
        QuestionRecord,
        QuestionsDataset,
        QuestionsFile,
        open_questions,
    )
    from iqtt.questions.specs import SplitSpec, preset_spec

_HOME = {
    "QuestionRecord": "files.reader",
    "QuestionsDataset": "files.reader",
    "QuestionsFile": "files.reader",
    "SplitSpec": "questions.specs",
    "make_split": "files.make",
    "open_questions": "files.reader",
    "preset_spec": "questions.specs",
}

__all__ = [
    "QuestionRecord",
    "QuestionsDataset",
    "QuestionsFile",
    "SplitSpec",
    "make_split",
    "open_questions",
    "preset_spec",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'iqtt' has no attribute {name!r}")
    return getattr(import_module(f"iqtt.{_HOME[name]}"), name)
