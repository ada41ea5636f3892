"""The smallest split, the content of folders, and how a test stops a run."""

from pathlib import Path

from iqtt.questions.specs import SplitSpec

TINY = SplitSpec(
    seed=1, train=3, labeled=2, val=2, test=2, cubes=(6, 6), height=16, width=16, min_cube_pixels=0
)


def listing(folder: Path) -> dict[str, bytes | None]:
    """Return all there is in a folder, hidden names too."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


class StopError(Exception):
    """What the test's progress bar raises."""
