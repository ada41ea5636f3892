"""Import meshes, a file or a folder of files for each image, as layers along its rays."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.intake.folders import files_of, match_files
from metrics.intake.importing import keys_of, names_of
from metrics.intake.outputs import FRAMES
from metrics.intake.reading import Reading
from metrics.measured.reader import size_of
from metrics.measures.hidden.solids import entered_spans
from metrics.measures.surfaces.whole import drawn_points
from metrics.submissions.hints.frames import AXES, frame_text
from metrics.submissions.layout import Shown
from metrics.submissions.writer import RoomPredictionWriter
from scenegen.camera import Lens, pixels_of
from scenegen.common.errors import SpecError
from scenegen.objects.meshes import limits
from scenegen.objects.meshes.errors import BadMeshError, check_most
from scenegen.objects.meshes.read import parse_mesh, read_bytes
from scenegen.rendering.layers import (
    ENTERS,
    LEAVES,
    MOST_LAYERS,
    OPEN,
    Crossings,
    solid_crossings,
    stacked,
    welded,
)
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
ENDINGS = (".glb", ".ply", ".obj")
TRIED = 4  # images in which other frames are tried
POINTS = 2000  # vertices that are tried


def import_meshes(
    pattern: str,
    truth: str | Path | RoomsFile,
    out: str | Path,
    *,
    method: str,
    reading: Reading,
    shown: Shown = "scored_view",
    run: str = "",
    notes: str = "",
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> str:
    """Write a submission from mesh files, and return in words how they were taken, and hints.

    Of a reading, the scale, the frame, the alignment and the matching are used. Other arguments as
    `importing.import_rooms`. Raises MatchError, BadMeshError with the file's name, and as that.
    """
    files, groups = files_of(pattern, ENDINGS), dict[Path, list[Path]]()
    of_folders = not Path(pattern).parent.exists()  # as in 'out/*/*.glb'
    for file in files:
        groups.setdefault(file.parent if of_folders else file, []).append(file)
    with RoomPredictionWriter(
        out, truth, method=method, run=run, alignment=reading.alignment or "none", shown=shown,
        notes=notes, overwrite=overwrite,
    ) as writer:  # fmt: skip
        rooms = writer.truth
        if not isinstance(rooms, RoomsFile):
            raise SpecError(rooms.path, "ground truth of images alone", "rooms")
        paths, how = match_files(
            sorted(groups), names_of(rooms), partial(keys_of, rooms), reading.match
        )
        noun = f"folders of {len(files)} files" if of_folders else "files"
        lines, opened, unseen = [f"{len(paths)} {noun} {how}"], 0, 0
        tried: list[tuple[int, Array]] = []
        for row, path in enumerate(paths):
            vertices, faces, closed = _together(groups[path])
            vertices = vertices * FRAMES[reading.frame] * reading.scale
            camera = *size_of(rooms, row), rooms.lens(row)
            layers = mesh_layers(vertices, faces, closed, *camera)
            points = drawn_points(vertices[faces], row, "prediction")
            writer.add(row, layers=layers, surface_points=points)
            opened += not closed.all()
            unseen += not np.isfinite(layers).any()
            if len(tried) < TRIED:
                tried.append((row, vertices[:: -(-len(vertices) // POINTS)]))
            progress(1)
        if opened:
            lines.append(f"{opened} meshes have open parts, whose crossings are paired in order")
        if unseen:
            lines.append(f"hint: {unseen} meshes are outside of the image")
        if rooms.has_truth and (better := _better_frame(rooms, tried)):
            lines.append(f"hint: meshes look like {better}; see --frame")
    return "; ".join(lines)


def _together(paths: list[Path]) -> tuple[Array, Array, Array]:
    """Return what `layers.welded` makes of each file, as of one. Raises BadMeshError."""
    parts, before, count = [], 0, 0
    for path in paths:
        vertices, faces, closed = welded(*read_mesh(path))
        parts.append((vertices, faces + before, closed))
        before, count = before + len(vertices), count + len(faces)
        check_most(f"{path.parent}: faces", count, limits.MOST_FACES)
    vertices, faces, closed = map(np.concatenate, zip(*parts, strict=True))
    return vertices, faces, closed


def read_mesh(path: Path) -> tuple[Array, Array]:
    """Return vertices (V, 3) and triangles (F, 3) that can be cast.

    Raises BadMeshError, naming the file.
    """
    try:
        vertices, faces = parse_mesh(read_bytes(path), path.suffix)
        vertices, faces = vertices.astype(np.float64), faces.astype(np.int64)
        check_most("faces", len(faces), limits.MOST_FACES)
        faces = faces[((faces >= 0) & (faces < len(vertices))).all(axis=1)]
        with np.errstate(invalid="ignore"):
            finite = np.asarray((np.abs(vertices) < 1e12).all(axis=1))
        faces = faces[finite[faces].all(axis=1)]
        if not len(faces):
            raise BadMeshError("faces", "none with finite corners", "triangles")
    except BadMeshError as error:
        raise error.inside(path) from error
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def mesh_layers(
    vertices: Array, faces: Array, closed: Array, height: int, width: int, lens: Lens
) -> NDArray[np.float32]:
    """Return where rays enter and leave a mesh, (H, W, L), as layers of a submission.

    Args: as `layers.solid_crossings`. Crossings of open parts are paired in order.
    """
    found = solid_crossings(vertices, faces, closed, height, width, lens)
    order = np.lexsort((found.depth, found.pixel, found.kind == OPEN))
    pixel, depth, kind = found.pixel[order], found.depth[order], found.kind[order].copy()
    sheets = np.flatnonzero(kind == OPEN)
    at = pixel[sheets]
    new = np.diff(at, prepend=-1) > 0
    rank = np.arange(len(at)) - np.flatnonzero(new)[np.cumsum(new) - 1]
    kind[sheets] = np.where(rank % 2 == 0, ENTERS, LEAVES)
    alone = sheets[(rank % 2 == 0) & np.append(new[1:], True)[: len(at)]]
    kept = np.delete(np.arange(len(pixel)), alone)
    crossings = Crossings(pixel[kept], depth[kept], kind[kept])
    stored, _, kinds = stacked([crossings], np.ones(len(kept), np.int64), height, width)
    ends = entered_spans(*(x.reshape(-1, MOST_LAYERS).T for x in (stored, kinds)))
    image = np.full((height, width, MOST_LAYERS), np.nan, np.float32)
    pairs = np.stack(ends, axis=1).reshape(-1, height, width).transpose(1, 2, 0)
    image[..., : pairs.shape[2]] = np.where(np.isfinite(pairs), pairs, np.nan)
    return image


def _better_frame(rooms: RoomsFile, tried: list[tuple[int, Array]]) -> str:
    """Return the frame in which vertices are far more often where the truth shows objects."""
    shares = np.zeros((len(AXES), 2))
    for row, vertices in tried:
        pose = rooms.read("camera/world_from_camera", row)
        ids, lens = rooms.read("object_id", row), rooms.lens(row)
        for k, axes in enumerate(AXES):
            for of_world in (0, 1):
                points = vertices @ axes
                points = (points - pose[:3, 3]) @ pose[:3, :3] if of_world else points
                shares[k, of_world] += _share_on_objects(points, ids, lens) / len(tried)
    best = np.unravel_index(shares.argmax(), shares.shape)
    better = shares[best] > 0.5 and shares[0, 0] < shares[best] / 2
    return frame_text(AXES[best[0]].T, bool(best[1])) if better else ""


def _share_on_objects(points: Array, object_id: Array, lens: Lens) -> float:
    """Return the share of points in the camera frame that are seen where objects are."""
    row, column, inside = pixels_of(points, object_id.shape, lens)
    return np.count_nonzero(inside & (object_id[row, column] > 0)) / len(points)
