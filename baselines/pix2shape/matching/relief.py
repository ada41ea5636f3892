"""Relief of all images of a file, found by matching, which training then takes for the truth.

The labels lie in the folder of a run, a file for each block of scenes, so that a run that was
stopped need not find them again.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from baselines.pix2shape.matching.search import (
    NOISE,
    ROUNDED_NOISE,
    STEP,
    STEPS,
    best_relief,
    joint_cost,
    matching_cost,
    paper_rooms_only,
    semi_global,
)
from baselines.pix2shape.network.empty_rooms import Cameras
from baselines.training.checkpoint import check_tensors, load_tensors, save_tensors
from baselines.training.rooms import Rooms
from scenegen.common.errors import FileFormatError, SpecError

WIDEST = 20.0  # degrees between two views that are matched
BLOCK = 50  # scenes in each file of labels
FOLDER = "labels"
Progress = Callable[[int, int], Any]  # images done, in all


def pairs_of(rooms: Rooms) -> list[tuple[list[int], list[int]]]:
    """Return for each row the rows that it is matched with, to its one side and to the other.

    They show the same scene from at most WIDEST degrees away. Raises SpecError for unknown angles.
    """
    rows_of: dict[int, list[int]] = {}
    for row, scene in enumerate(rooms.scene.tolist()):
        rows_of.setdefault(scene, []).append(row)
    angles = rooms.angle.tolist()
    if not all(map(math.isfinite, angles)):
        where = f"rooms: view_angle_degrees, row {rooms.angle.isfinite().int().argmin()}"
        raise SpecError(where, "an angle that is not finite", "degrees")
    pairs = []
    for row, scene in enumerate(rooms.scene.tolist()):
        turns = [(angles[other] - angles[row], other) for other in rows_of[scene]]
        before = [other for turn, other in turns if -WIDEST <= turn < 0]
        after = [other for turn, other in turns if 0 < turn <= WIDEST]
        pairs.append((before, after))
    return pairs


@torch.inference_mode()
def relief_of_row(rooms: Rooms, row: int, sides: tuple[list[int], list[int]]) -> Tensor:
    """Return the relief of one row by matching, (S, S), scene units, at most 32 steps of 0.02.

    Costs are averaged over the images of one side; the better side counts.
    """
    noise = ROUNDED_NOISE if rooms.rounded else NOISE
    costs = []
    for others in filter(None, sides):
        rows = torch.tensor([row]).expand(len(others))
        images = rooms.image[rows].float(), rooms.image[others].float()
        cameras, other_cameras = (
            Cameras(rooms.world_from_camera[views], rooms.fov_of(views)) for views in (rows, others)
        )
        cost = matching_cost(images[0], cameras, images[1], other_cameras, noise)
        costs.append(cost.mean(dim=0, keepdim=True))
    return best_relief(semi_global(joint_cost(costs)))[0]


def matched_rows(rooms: Rooms) -> Tensor:
    """Return the rows that have a partner, (M,). Raises SpecError where there are none."""
    return _with_partner(pairs_of(rooms))


def _with_partner(pairs: list[tuple[list[int], list[int]]]) -> Tensor:
    matched = torch.tensor([row for row, sides in enumerate(pairs) if any(sides)], dtype=torch.long)
    if not len(matched):
        expected = f"views of a scene at most {WIDEST:.0f} degrees apart"
        raise SpecError("rooms", "no such views", expected, "use scenegen render --views 0,10,20")
    return matched


def relief_of_rows(
    rooms: Rooms, run_folder: str | Path | None, progress: Progress = lambda done, total: None
) -> Tensor:
    """Return the relief of all rows, (N, S, S) float16; 0 for those that have no partner.

    Labels that the run's folder holds are read, the others found and written; None for no folder.

    Raises SpecError as `matched_rows`, and for closed rooms; OSError; FileFormatError where the
    folder's labels are not those of these rooms.
    """
    paper_rooms_only(rooms.room_size)
    pairs = pairs_of(rooms)
    matched = _with_partner(pairs)
    folder = None if run_folder is None else Path(run_folder) / FOLDER
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    relief = torch.zeros(len(rooms), *rooms.image.shape[2:], dtype=torch.float16)
    blocks = rooms.scene[matched] // BLOCK
    done = 0
    for block in sorted(set(blocks.tolist())):
        rows = matched[blocks == block]
        path = folder / f"{block:05d}.safetensors" if folder else None
        if path and path.exists():
            relief[rows] = _read(path, relief[rows], rooms.fingerprint)
        else:
            maps = [relief_of_row(rooms, row, pairs[row]) for row in rows.tolist()]
            relief[rows] = torch.stack(maps).half()
            if path:
                save_tensors(path, {"relief": relief[rows]}, {"fingerprint": rooms.fingerprint})
        done += len(rows)
        progress(done, len(matched))
    return relief


def _read(path: Path, like: Tensor, fingerprint: str) -> Tensor:
    tensors, notes = load_tensors(path)
    if notes.get("fingerprint") != fingerprint:
        expected = f"those of the rooms {fingerprint[:12]}"
        raise FileFormatError(path, "labels of other rooms", expected, "name another folder")
    check_tensors(path, tensors, {"relief": like})
    relief = tensors["relief"]
    if relief.min() < 0 or relief.max() > STEPS * STEP:
        raise FileFormatError(f"{path}: relief", "numbers out of range", f"0 to {STEPS * STEP}")
    return relief
