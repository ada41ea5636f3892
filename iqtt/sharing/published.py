"""Which files of a split are handed out, and which tables of questions they hold."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from iqtt.files.layout import FORMAT
from iqtt.files.reader import QuestionsFile, table_names
from iqtt.files.split import ANSWERS, FILES, MANIFEST
from iqtt.questions.specs import SPLITS
from iqtt.sharing.withheld import check_withheld
from scenegen.common.errors import FileFormatError
from scenegen.files.sets.shards import OpenFile
from scenegen.sharing.card import with_shards


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
        raise FileNotFoundError(2, "no test questions with their answers", str(answers))
    tables: list[QuestionsFile] = []
    with ExitStack() as stack:
        for split, path in paths.items():
            opened = stack.enter_context(OpenFile(path, FORMAT.kind))
            if answers is None:
                _check_withheld(opened, split == "test")
            for part in table_names(opened, QuestionsFile.CONTENT):
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


def handed_out(tables: Sequence[QuestionsFile]) -> list[tuple[Path, str]]:
    """Return the files of the tables of a split, and what each of them holds.

    The manifest lists the file of the test answers, and is handed out with that alone.
    """
    answers = [table.beside.opened for table in tables if table.beside is not None]
    holds = {table.opened: f"questions: {table.split}" for table in tables}
    holds |= dict.fromkeys(answers, "answers to the test questions")
    files: list[tuple[Path, str]] = []
    for opened, meaning in holds.items():
        files += with_shards(opened, meaning, f"{meaning}; shows its shards as one file")
    manifest = tables[0].path.with_name(MANIFEST)
    if answers and manifest.is_file():
        files.append((manifest, "manifest"))
    return files
