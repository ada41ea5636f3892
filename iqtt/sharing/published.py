"""Which files of a split are handed out, and which tables of questions they hold."""

from dataclasses import dataclass
from pathlib import Path

from iqtt.files.layout import FORMAT
from iqtt.files.reader import QuestionsFile, parts
from iqtt.files.split import ANSWERS, FILES, MANIFEST
from iqtt.questions.specs import SPLITS
from iqtt.sharing.withheld import check_withheld
from scenegen.common.errors import FileFormatError
from scenegen.files.sets.shards import OpenFile


@dataclass(frozen=True)
class PublishedTable:
    """A table of questions in a file that is handed out.

    Attributes:
        path: the file, or the file that shows shards as one.
        split: "train", "val" or "test".
        part: "labeled" or "unlabeled" of a training file, else "".
        answers: the file of the answers, if that is handed out with the questions.
        count: number of questions.
    """

    path: Path
    split: str
    part: str
    answers: Path | None
    count: int

    @property
    def name(self) -> str:
        """The file's name and the part."""
        return f"{self.path.name} {self.part}".rstrip()

    def open(self) -> QuestionsFile:
        """Open the table. Raises as `QuestionsFile`."""
        return QuestionsFile(self.path, self.part or None, self.answers)


@dataclass(frozen=True)
class PublishedSplit:
    """What is handed out of a split.

    Attributes:
        tables: of questions, those of training first.
        files: each file, and what it holds, in words of ours.
        answers: the file of the test answers, if it is handed out too.
    """

    tables: tuple[PublishedTable, ...]
    files: tuple[tuple[Path, str], ...]
    answers: Path | None

    @property
    def count(self) -> int:
        """Number of questions."""
        return sum(table.count for table in self.tables)


def published_split(folder: str | Path, with_answers: bool = False) -> PublishedSplit:
    """Return what is handed out of a folder that `iqtt make-split` wrote.

    Without `with_answers` the file of the test answers is not looked at, and nothing that could
    tell them is handed out; nor is the manifest, which lists that file.

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
    tables: list[PublishedTable] = []
    files: list[tuple[Path, str]] = []
    for split, path in paths.items():
        pieces = _with_shards(path, f"questions: {split}")
        for piece, _ in pieces if answers is None else ():
            check_withheld(piece, split == "test")
        tables += _tables(path, split, answers if split == "test" else None)
        files += pieces
    if answers is not None:
        files += _with_shards(answers, "answers to the test questions")
        files += [(folder / MANIFEST, "manifest")] if (folder / MANIFEST).is_file() else []
    return PublishedSplit(tuple(tables), tuple(files), answers)


def _with_shards(path: Path, meaning: str) -> list[tuple[Path, str]]:
    """Return a file and, if it shows shards as one, these, and what each of them holds."""
    with OpenFile(path, FORMAT.kind) as opened:
        names = [shard.file for shard in opened.shards]
    shards = [(path.with_name(name), f"shard of {path.name}") for name in names]
    return [(path, f"{meaning}; shows its shards as one file" if names else meaning), *shards]


def _tables(path: Path, split: str, answers: Path | None) -> list[PublishedTable]:
    tables = []
    for part in parts(path):
        with QuestionsFile(path, part, answers) as table:
            if table.spec is None:
                raise FileFormatError(path, "a released file", "one that iqtt make-split wrote")
            if table.split != split:
                raise FileFormatError(path, f"questions for {table.split}", split)
            tables.append(PublishedTable(path, split, part, answers, len(table)))
    return tables
