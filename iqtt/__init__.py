"""Mental-rotation questions (3D-IQTT): make them, read them, audit them.

Read a file:    `with iqtt.open_questions("iqtt-split/iqtt-val.h5") as q: q[0].images, q[0].answer`
Train on it:    `iqtt.QuestionsDataset("iqtt-split/iqtt-train.h5", "labeled")`
Make a split:   `iqtt.make_split("iqtt-split", iqtt.preset_spec("small", seed=1))`

Questions pass through `shapes` (polycubes), `questions` (reference, options and views), `render`
(images) and `files`; `audit` checks files, and `sharing` publishes files. Each of these may import
the ones before it, and `scenegen`. Names are loaded on first use, so importing the package is fast.
"""

from typing import TYPE_CHECKING

from scenegen.common.lazy_names import lazy_names

if TYPE_CHECKING:
    from iqtt.files.make import make_split as make_split
    from iqtt.files.reader import QuestionRecord as QuestionRecord
    from iqtt.files.reader import QuestionsDataset as QuestionsDataset
    from iqtt.files.reader import QuestionsFile as QuestionsFile
    from iqtt.files.reader import open_questions as open_questions
    from iqtt.files.stream import QuestionStream as QuestionStream
    from iqtt.questions.specs import SplitSpec as SplitSpec
    from iqtt.questions.specs import preset_spec as preset_spec

HOMES = {
    "files.make": "make_split",
    "files.reader": "QuestionRecord QuestionsDataset QuestionsFile open_questions",
    "files.stream": "QuestionStream",
    "questions.specs": "SplitSpec preset_spec",
}
__all__ = [name for names in HOMES.values() for name in names.split()]
__getattr__ = lazy_names(__name__, HOMES)
