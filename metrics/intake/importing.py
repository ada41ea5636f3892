"""Import folders of predicted images as a submission of rooms, or on measured truth."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from metrics.intake.folders import counted
from metrics.intake.outputs import fitted_to, in_row
from metrics.intake.reading import Reading, geometry_reader
from metrics.measured.reader import Images, MeasuredFile, rays_of, size_of
from metrics.measures.alignment import Alignment
from metrics.submissions.layout import Shown
from metrics.submissions.truths import open_data
from metrics.submissions.writer import RoomPredictionWriter
from scenegen.common.errors import SpecError


def import_rooms(
    pattern: str,
    truth: str | Path | Images,
    out: str | Path,
    *,
    method: str,
    reading: Reading,
    normals: str | None = None,
    confidence: str | None = None,
    shown: Shown = "scored_view",
    run: str = "",
    notes: str = "",
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> str:
    """Write a submission from files of images, and return in words how they were matched.

    Args:
        pattern, normals, confidence: a pattern such as `out/*.png`, a folder, or a single NPY or
            NPZ file with an image for each row.
        truth: the file that is predicted, which may be open.
        shown: which image of a scene the method was shown, as `layout.Shown`.
        progress: called with 1 after every row.

    Raises MatchError, ArrayFileError, OutputError and PredictionError, naming file and row; OSError
    and FileFormatError for the truth.
    """
    with open_data(truth) as rooms:
        if not isinstance(rooms, Images):
            expected = "rooms, or measured ground truth"
            raise SpecError(rooms.path, "questions", expected, "see --responses")
        names, keys = names_of(rooms), partial(keys_of, rooms)
        read, how = geometry_reader(reading, pattern, names, keys, normals, confidence=confidence)
        default: Alignment = "scale_shift" if reading.kind == "disparity" else "none"
        with RoomPredictionWriter(
            out, rooms, method=method, run=run, alignment=reading.alignment or default,
            shown=shown, notes=notes, overwrite=overwrite,
        ) as writer:  # fmt: skip
            for row in range(len(rooms)):
                geometry, where = read(row, partial(rays_of, rooms, row))
                with in_row(out, row, where):
                    fitted = fitted_to(
                        geometry,
                        *size_of(rooms, row),
                        frame=reading.frame,
                        missing=reading.missing,
                    )
                    writer.add(row, **fitted.values)
                progress(1)
    return how


def names_of(rooms: Images) -> list[str]:
    """Return the names of rows: of rooms their numbers, of measured truth those of its pictures."""
    rows = range(len(rooms))
    return [rooms.name(row) if isinstance(rooms, MeasuredFile) else f"row {row}" for row in rows]


def keys_of(rooms: Images) -> list[list[tuple[int, ...]]]:
    """Return the numbers that files of rows may have: scene and view, or those of the row."""
    if isinstance(rooms, MeasuredFile):
        return counted(len(rooms))
    columns = (rooms.read(name, slice(None)).tolist() for name in ("scene_index", "view_index"))
    return [*counted(len(rooms)), list(zip(*columns, strict=True))]
