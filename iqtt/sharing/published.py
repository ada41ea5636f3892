"""Which files of a split are handed out; a file that tells answers of test questions is refused.

A list says what such a file may hold, so that nothing slips through which nobody thought of.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import h5py

from iqtt.files.layout import FORMAT, ROOT_TEXTS, named
from iqtt.files.reader import QuestionsFile, table_names
from iqtt.files.split import ANSWERS, FILES
from iqtt.perspective.specs import split_spec
from iqtt.questions.specs import SPLITS
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.files.attributes import read_root
from scenegen.files.content import SHA256
from scenegen.files.input_file import checking, describing
from scenegen.files.rows import and_more
from scenegen.files.schema import other_attributes
from scenegen.files.sets.shards import ROW_DIGESTS, SHARDS, OpenFile
from scenegen.sharing.card import with_shards

COMMAND = "creation_command"  # which may name the seed
DATA = {"questions", SHARDS, ROW_DIGESTS}  # of a file of test questions
TOLD = {"unit", "shape", "frame", "meaning", "scale", "names", SHA256}  # of each of them
ATTRIBUTES = {*ROOT_TEXTS, named("fingerprint", "")} - {COMMAND}


@contextmanager
def open_split(folder: str | Path, with_answers: bool = False) -> Iterator[list[QuestionsFile]]:
    """Open what is handed out of a folder that `iqtt make-split` wrote: training tables first.

    Without `with_answers` the file of the test answers is not looked at, and no file is opened that
    could tell them. With it, it is `beside` the table of the test questions.

    Raises:
        OSError: no such folder, or no question files in it; or no answers, where they are wanted.
        FileFormatError: a file is damaged, a released one, or not of the split that its name says.
        SpecError: a file would tell the answers that are not handed out.
    """
    folder = Path(folder)
    paths = {s: folder / FILES[s][0] for s in SPLITS if (folder / FILES[s][0]).is_file()}
    if not paths:
        raise FileNotFoundError(2, "holds no question files of iqtt make-split", str(folder))
    answers = folder / ANSWERS if with_answers else None
    if answers is not None and not ("test" in paths and answers.is_file()):
        raise FileNotFoundError(2, "no test questions with an answer key", str(answers))
    tables: list[QuestionsFile] = []
    with ExitStack() as stack:
        for split, path in paths.items():
            opened = stack.enter_context(OpenFile(path, FORMAT.kind))
            if answers is None:
                _check_withheld(opened, split == "test")
            with checking(opened.file):
                parts = table_names(opened, QuestionsFile.CONTENT)
            for part in parts:
                table = QuestionsFile(opened, part, answers if split == "test" else None)
                tables.append(stack.enter_context(table))
                if table.spec is None:
                    raise FileFormatError(path, "a released file", "one that iqtt make-split wrote")
                if table.split != split:
                    raise FileFormatError(path, f"questions for {table.split}", split)
        yield tables


def _check_withheld(opened: OpenFile, is_test: bool) -> None:
    """Check a file, and each of its shards."""
    check_withheld(opened, is_test)
    for shard in opened.shards:
        with OpenFile(opened.folder / shard.file, FORMAT.kind) as part:
            check_withheld(part, is_test)


def check_withheld(opened: OpenFile, is_test: bool) -> None:
    """Refuse a file from which the answers of test questions could be learned.

    No file may tell the seed, nor the command that made it, as all answers can be made again with
    them. A file of test questions may hold nothing but images and what names them.

    Raises SpecError, and FileFormatError as `QuestionsFile`.
    """
    path, file = opened.path, opened.file
    with checking(file):
        with describing(f"{path}: attribute 'spec'"):
            spec = split_spec(read_root(file, path, FORMAT)["spec"])
        leaks = ["the seed"] if spec.seed is not None else []
        leaks += ["the command that made it"] if COMMAND in file.attrs else []
        leaks += _beside_images(file) if is_test else []
    if leaks:
        expected = "a file that does not reveal the answer key, or --with-answer-key"
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


def handed_out(tables: Sequence[QuestionsFile]) -> list[tuple[Path, str]]:
    """Return the files of the tables of a split, and what each of them holds."""
    answers = [table.beside.opened for table in tables if table.beside is not None]
    holds = {table.opened: f"questions: {table.split}" for table in tables}
    holds |= dict.fromkeys(answers, "answer key of the test questions")
    files: list[tuple[Path, str]] = []
    for opened, meaning in holds.items():
        files += with_shards(opened, meaning)
    return files
