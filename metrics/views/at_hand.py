"""Files that a score file names and that still lie there unchanged, for their pictures.

A score file comes from anybody, and so do the paths in it. Only regular files are opened, and
only those of the recorded content: a submission of the same SHA-256, a truth of the same digest.
"""

import hashlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from metrics.measured.reader import open_images
from metrics.scoring.records import ScoreFile, Task
from metrics.scoring.truth_digests import stated_truth
from scenegen.common.errors import SceneGenError
from scenegen.files import trial


def truth_at_hand(file: ScoreFile, named: Path | None = None) -> Path | None:
    """Return where the truth of a score file lies; None where it does not, or is another one.

    Args:
        named: the truth that a person named, in place of the recorded path.
    """
    places = [named] if named is not None else _places(file, file.meta.truth_path)
    for path in places:
        if os.path.isfile(path) and _stated_truth(file, path) == file.truth:
            return path
    return None


def submission_at_hand(file: ScoreFile, named: Sequence[Path] = ()) -> Path | None:
    """Return where the first run that was scored lies; None where no file there has its SHA-256.

    Args:
        named: submissions that a person named; they are tried first.
    """
    first = file.meta.submissions[0]
    for path in (*named, *_places(file, first.path)):
        if os.path.isfile(path) and _sha256(path) == first.sha256:
            return path
    return None


def _places(file: ScoreFile, recorded: str) -> Iterator[Path]:
    """Yield where a recorded path may lead: from here, and from the score file's folder."""
    if recorded and "\0" not in recorded:
        yield Path(recorded)
        if file.path is not None:
            yield file.path.parent / recorded
            yield file.path.parent / Path(recorded).name


def _stated_truth(file: ScoreFile, path: Path) -> tuple[Task, str | None] | None:
    """Return what a file says that it is, if it is a truth of the task; else None."""
    try:
        trial.try_file(path)
        if file.task != "iqtt":
            with open_images(path) as images:
                return stated_truth(images)
        from iqtt.files.reader import AnswersFile

        with AnswersFile(path) as answers:
            return stated_truth(answers)
    except (OSError, SceneGenError):
        return None


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""
