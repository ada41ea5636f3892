"""Find tables of questions, and read them for the audit: images once, in chunks."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.features.statistics import border, border_color, measure, silhouettes
from iqtt.files.layout import FORMAT, NO_CUBE, SCORED
from iqtt.files.reader import QuestionsFile, answers_beside, table_names
from scenegen.common.records import check
from scenegen.files.content import ColumnDigest, column_digest, dataset_digest, joint_digest
from scenegen.files.input_file import checking
from scenegen.files.rows import content_problems as problems_of_file
from scenegen.files.sets.cluster import Cluster
from scenegen.files.sets.shards import OpenFile, cut, name_of_set

Array = NDArray[Any]
ROLES = ("train", "val", "test", "test-answers")
CHUNK_PIXELS = 2**20  # pixels of questions in memory at once
CHUNKS = 8  # of them that a worker of a cluster reads in one go
TRUTH = (
    *("cubes", "shape_id", "class_id", "world_from_shape"),
    *("distractor_kind", "angle_degrees", "visible_pixels", "camera_distance"),
    *("scene", "in_play", "whole_pixels", "exposure", "picture_seed"),
)


@dataclass(frozen=True, eq=False)
class AuditTable:
    """What was read of a table of Q questions: everything except the pixels.

    Attributes:
        name: short name, such as "iqtt-train.h5 labeled"; no two tables have the same.
        questions: the open table.
        answers: which of the answers is right, (Q,); None if the file does not tell.
        truth: those of the datasets `TRUTH` that there are by name, (Q, ...) each.
        contents: digest of each dataset that was read, by its file and its name there; empty if
            the file has no digests to compare them with.
        truth_changed: whether the file's `truth_digest` is another one than that of its answers.
        background: most frequent colour of the images' borders, as stored, (3,).
        digests: hashes of the images, (Q, I) void.
        silhouette: number of pixels of each image that are not background, (Q, I).
        on_border: number of those pixels on the image's border, (Q, I).
        unfit: number of values of each image that are not finite, or outside 0..1, (Q, I).
        measured: rows that `statistics` describe.
        statistics: of those rows, as `statistics.measure` gives them.
    """

    name: str
    questions: QuestionsFile
    answers: Array | None
    truth: dict[str, Array]
    contents: dict[tuple[Path, str], str]
    truth_changed: bool
    background: Array
    measured: Array
    digests: Array
    silhouette: Array
    on_border: Array
    unfit: Array
    statistics: Array

    @property
    def spec(self) -> Any:
        """The settings of the file, of cubes or of rooms; None for a released one."""
        return self.questions.spec

    @property
    def images(self) -> int:
        """Number of images of a question: the reference, and its answers."""
        return 1 + self.questions.answers

    @property
    def cubes(self) -> Array:
        """Cubes of the images' shapes as stored, (Q, I, most, 3); NO_CUBE if the file has none."""
        blank = (len(self), self.images, 1, 3)
        return self.truth.get("cubes", np.full(blank, NO_CUBE))

    def __len__(self) -> int:
        return len(self.digests)


@contextmanager
def open_paths(paths: Sequence[str | Path]) -> Iterator[dict[str, QuestionsFile]]:
    """Open the tables of question files, by name; of a folder, those of all its files.

    Of a folder that `iqtt make-split` wrote these are iqtt-*.h5, of another all its *.h5, such as
    the released ones. A file of answers stands for the file of questions beside it, which is opened
    with its answers.

    Raises:
        OSError: no such file or folder, or a folder without question files.
        FileFormatError: not a question file.
        SpecError: no paths, or tables with questions of different numbers of answers.
    """
    check(len(paths) > 0, "paths", "none", "question files, or folders of them")
    files: dict[Path, Path] = {}
    for path in map(Path, paths):
        candidates = _files(path) if path.is_dir() else [path]
        if not candidates:
            raise FileNotFoundError(2, "holds no question files *.h5", str(path))
        for file in candidates:
            questions_file = file.with_name(file.stem.removesuffix("-answers") + file.suffix)
            chosen = questions_file if questions_file.is_file() else file
            files.setdefault(chosen.resolve(), chosen)
    names = [path.name for path in files.values()]
    tables: dict[str, QuestionsFile] = {}
    with ExitStack() as stack:
        for path in files.values():
            shown = path.name if names.count(path.name) == 1 else str(path)
            opened = stack.enter_context(OpenFile(path, FORMAT.kind))
            with checking(opened.file):
                parts = table_names(opened, QuestionsFile.CONTENT)
            for part in parts:
                table = QuestionsFile(opened, part, answers_beside(path))
                tables[f"{shown} {part}".rstrip()] = stack.enter_context(table)
        counts = sorted({table.answers for table in tables.values()})
        expected = "the same number in every file; audit the others apart"
        check(len(counts) == 1, "options of a question", " and ".join(map(str, counts)), expected)
        yield tables


def find_splits(paths: Sequence[str | Path]) -> list[list[Path]]:
    """Return what to audit together: all paths, but of a folder of splits, each split alone.

    Such a folder, as `iqtt make-split --preset suite` writes it, holds folders with question files,
    and none itself.
    """
    splits: list[list[Path]] = []
    single: list[Path] = []
    for path in map(Path, paths):
        inner = (
            [folder for folder in sorted(path.iterdir()) if _files(folder)] if path.is_dir() else []
        )
        if inner and not _files(path):
            splits += [[folder] for folder in inner]
        else:
            single.append(path)
    return [single, *splits] if single or not splits else splits


def lacking(paths: Sequence[str | Path]) -> list[str]:
    """Return, for each folder that lacks some of a split's four files, a line that says which."""
    lines = []
    for path in map(Path, paths):
        stems = [file.stem for file in _files(path)] if path.is_dir() else []
        lacks = [
            role for role in ROLES if not any(s == role or s.endswith(f"-{role}") for s in stems)
        ]
        if stems and lacks:
            lines.append(f"{path}: no file for {', '.join(lacks)}")
    return lines


def _files(folder: Path) -> list[Path]:
    """Return a folder's question files by name, without shards; none if it is no folder."""
    files = sorted(folder.glob("iqtt-*.h5")) or sorted(folder.glob("*.h5"))
    names = {file.name for file in files}
    return [file for file in files if name_of_set(file.name) not in names]


def read_table(
    name: str,
    questions: QuestionsFile,
    measured: Array,
    progress: Callable[[int], Any] = lambda done: None,
    cluster: Cluster | None = None,
) -> AuditTable:
    """Read an open table.

    Args:
        measured: rows to take statistics of, in rising order.
        cluster: whose workers open the file again and read the images; None for this process.
        progress: is called with the number of questions that were read since the last call.

    Raises OSError and FileFormatError as `QuestionsFile.read`.
    """
    count, everything = len(questions), slice(None)
    pixels = (1 + questions.answers) * questions.height * questions.width
    chunk = max(1, CHUNK_PIXELS // pixels)
    first = questions.read("questions", slice(0, min(chunk, count)))
    background = border_color(first)
    scans: list[tuple[Array, ...]] = []
    digests_of_images: list[bytes] = []
    tasks = cut(count, chunk if cluster is None else CHUNKS * chunk)
    opening: Callable[[], AbstractContextManager[QuestionsFile]] = questions.reopener()
    if cluster is None:
        opening = lambda: nullcontext(questions)  # noqa: E731
    scan = partial(_scan_images, opening, chunk, background, measured)
    scanned = map(scan, tasks) if cluster is None else cluster.results(scan, tasks, _told)
    for parts, digest in scanned:
        scans += parts
        digests_of_images.append(digest)
        progress(sum(len(part[0]) for part in parts))
    scans = scans or [_scan(first, background, measured)]
    truth = {n: questions.read(n, everything) for n in TRUTH if n in questions.fields}
    answers = questions.read("answers", everything) if questions.has_answers else None
    read = truth if answers is None else {"answers": answers, **truth}
    digests = {name: dataset_digest(values) for name, values in read.items()}
    digests["questions"] = column_digest(digests_of_images)
    contents = {questions.stored_at(name): digest for name, digest in digests.items()}
    has_digests = questions.spec is not None  # released files tell no digests
    scored = joint_digest({name: digests[name] for name in SCORED if name in digests})
    return AuditTable(
        name,
        questions,
        answers,
        truth,
        contents if has_digests else {},
        has_digests and questions.has_answers and scored != questions.stored_truth_digest,
        background,
        measured,
        *map(np.concatenate, zip(*scans, strict=True)),
    )


def content_problems(tables: Sequence[AuditTable]) -> list[str]:
    """Return what is not as the digests of the tables' files say.

    Raises FileFormatError where a file cannot be read.
    """
    wrong = "the ground truth does not match its truth_digest"
    problems = [f"{table.name}: {wrong}" for table in tables if table.truth_changed]
    files = {Path(opened.file.filename): opened for table in tables for opened in _opened(table)}
    contents = {place: digest for table in tables for place, digest in table.contents.items()}
    for path in dict.fromkeys(path for path, _ in contents):
        digests = {name: digest for (where, name), digest in contents.items() if where == path}
        problems += [f"{path.name}: {text}" for text in problems_of_file(files[path], digests)]
    return problems


def _opened(table: AuditTable) -> list[OpenFile]:
    """Return the open file of a table, and that of its answers if it is another one."""
    beside = table.questions.beside
    return [table.questions.opened, *([] if beside is None else [beside.opened])]


def _told(rows: range) -> str:
    return f"statistics of questions {rows[0]} to {rows[-1]}"


def _scan_images(
    opening: Callable[[], AbstractContextManager[QuestionsFile]],
    chunk: int,
    background: Array,
    measured: Array,
    rows: range,
) -> tuple[list[tuple[Array, ...]], bytes]:
    """Return what `_scan` finds in these rows, `chunk` at a time, and the digests of the rows."""
    scans, digest = [], ColumnDigest(keep_rows=True)
    with opening() as questions:
        for start in range(rows.start, rows.stop, chunk):
            stop = min(start + chunk, rows.stop)
            images = questions.read("questions", slice(start, stop))
            wanted = measured[(measured >= start) & (measured < stop)] - start
            scans.append(_scan(images, background, wanted))
            digest.update(images)
    return scans, bytes(digest.rows or b"")


def _scan(images: Array, background: Array, wanted: Array) -> tuple[Array, ...]:
    """Return the arrays of `AuditTable`, from `digests` on, of some questions.

    Args:
        wanted: which of the questions to take statistics of, as numbers.
    """
    shown = silhouettes(images, background)
    digests = [
        hashlib.blake2b(image.tobytes(), digest_size=16).digest()
        for image in images.reshape(-1, *images.shape[2:])
    ]
    if images.dtype == np.uint8:
        unfit = np.zeros(images.shape[:2], np.int64)
    else:
        with np.errstate(invalid="ignore"):
            fit = (images >= 0) & (images <= 1)  # NaN is not
        unfit = np.count_nonzero(~fit, axis=(2, 3, 4))
    return (
        np.array(digests, "V16").reshape(images.shape[:2]),
        np.count_nonzero(shown, axis=(2, 3)),
        np.count_nonzero(border(shown), axis=2),
        unfit,
        measure(images[wanted], shown[wanted]),
    )
