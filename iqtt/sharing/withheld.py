"""Files that are handed out tell no answer of a test question: whatever else is in one is refused.

A list says what such a file may hold, so that nothing slips through which nobody thought of.
"""

import h5py

from iqtt.files.layout import FORMAT, ROOT_TEXTS, named
from iqtt.questions.specs import SplitSpec
from scenegen.common.errors import SpecError
from scenegen.files.attributes import read_root
from scenegen.files.content import SHA256
from scenegen.files.input_file import checking, describing
from scenegen.files.rows import and_more
from scenegen.files.schema import other_attributes
from scenegen.files.sets.shards import ROW_DIGESTS, SHARDS, OpenFile

COMMAND = "creation_command"  # which may name the seed
DATA = {"questions", SHARDS, ROW_DIGESTS}  # of a file of test questions
TOLD = {"unit", "shape", "frame", "meaning", "scale", "names", SHA256}  # of each of them
ATTRIBUTES = {*ROOT_TEXTS, named("fingerprint", "")} - {COMMAND}


def check_withheld(opened: OpenFile, is_test: bool) -> None:
    """Refuse a file from which the answers of test questions could be learned.

    No file may tell the seed, nor the command that made it, as all answers can be made again with
    them. A file of test questions may hold nothing but images and what names them.

    Raises SpecError, and FileFormatError as `QuestionsFile`.
    """
    path, file = opened.path, opened.file
    with checking(file):
        with describing(f"{path}: attribute 'spec'"):
            spec = SplitSpec.from_json(read_root(file, path, FORMAT)["spec"])
        leaks = ["the seed"] if spec.seed is not None else []
        leaks += ["the command that made it"] if COMMAND in file.attrs else []
        leaks += _beside_images(file) if is_test else []
    if leaks:
        expected = "a file that does not tell the test answers, or --with-answers"
        raise SpecError(path, and_more(leaks), expected)


def _beside_images(file: h5py.File) -> list[str]:
    """Return the names of what a file of test questions must not hold."""
    strange = [name for name in sorted(file) if name not in DATA]
    strange += [f"attribute {name}" for name in sorted(file.attrs) if name not in ATTRIBUTES]
    for name in sorted(DATA & set(file)):
        strange += [f"{name}@{key}" for key in sorted(file[name].attrs) if key not in TOLD]
    if isinstance(digests := file.get(ROW_DIGESTS), h5py.Dataset):
        strange += other_attributes(digests, ROW_DIGESTS, {"names": ["questions"]})
        if digests.shape[1:] != (1, 32):
            strange.append(f"{ROW_DIGESTS} of more than the questions")
    return strange
