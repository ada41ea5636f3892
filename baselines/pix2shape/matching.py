"""Relief of rooms by matching several images of a scene, which training then takes for the truth.

A plane sweep: for each pixel every relief of a list is tried (Collins 1996). The point is projected
into another image of the scene, and the colours are compared. So the photometric loss is minimised
by search and not by gradients, which end in the nearest local minimum: a flat room. Nothing is
learned here, and neither depth, normals nor ids are read.

If the depth is right, and the point not hidden from the other camera, both images show the same
colour there: matte surfaces under fixed lights look the same from everywhere. That is what learning
depth from several views rests on (Zhou et al. 2017; Godard et al. 2019).

The relief of a whole file lies in the folder of a run, so that a run that was stopped need not find
it again.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from baselines.pix2shape.network.empty_rooms import Cameras, empty_rooms, half_slope, rays
from baselines.training.checkpoint import check_tensors, load_tensors, save_tensors
from baselines.training.rooms import Rooms
from scenegen.common.errors import FileFormatError, SpecError

NEAR = 0.05  # scene units; points nearer to the other camera than this, or behind it, are not seen
STEPS, STEP = 32, 0.02  # reliefs that are tried: 0, STEP, ..., scene units
NOISE, ROUNDED_NOISE = 0.001, 0.003  # radiance; differences expected everywhere; of 8 bits
SHIFT = 0.25  # pixels; error of place that is expected, as pixels are samples
SCALE = 0.5  # squared differences, over the expected ones, at which the cost is a half
UNSEEN = 0.3  # cost where the other image does not show the point
RISE = 0.15  # cost of the largest relief beside that of none, so that doubt decides for the room
WINDOW = 3  # pixels a side; costs are averaged over it
SMALL, LARGE = 0.05, 0.3  # costs of a change by one step, and by more, from pixel to pixel
WIDEST = 20.0  # degrees between two views that are matched
LABELS = "labels.safetensors"
Progress = Callable[[int, int], Any]  # images done, in all


def reprojected(
    values: Tensor, others: Cameras, depth: Tensor, cameras: Cameras
) -> tuple[Tensor, Tensor, Tensor]:
    """Return other images' values at surface points, the points' depths there, and which are shown.

    Args:
        values: of the other cameras' images, (B, C, S, S).
        depth: D depths for each pixel of the images of `cameras`, planar, scene units,
            (B, D, S, S).

    Returns:
        Bilinear values, (B, C, D, S, S), planar depths, (B, D, S, S), and a mask of the points that
        lie within these images, (B, D, S, S). Whether something stands between
        a point and the other camera is not asked.
    """
    batch, count, size, _ = depth.shape
    other_from_camera = torch.linalg.solve(others.world_from_camera, cameras.world_from_camera)
    toward = other_from_camera[:, :3, :3] @ rays(size, cameras.fov_y_degrees, depth).flatten(-2)
    points = (
        toward[:, :, None] * depth.flatten(2)[:, None] + other_from_camera[:, :3, 3, None, None]
    )
    away = -points[:, 2]
    edge = half_slope(others.fov_y_degrees) * away.clamp(min=NEAR)
    place = torch.stack([points[:, 0], -points[:, 1]], dim=3) / edge[..., None]
    shown = functional.grid_sample(values, place, padding_mode="border", align_corners=False)
    seen = (place.abs() < 1).all(dim=3) & (away > NEAR)
    shape = (batch, count, size, size)
    return shown.view(batch, -1, count, size, size), away.view(shape), seen.view(shape)


def reliefs(like: Tensor) -> Tensor:
    """Return the reliefs that are tried, (STEPS,), scene units."""
    return STEP * torch.arange(STEPS, dtype=like.dtype, device=like.device)


def paper_rooms_only(room_size: Tensor | None) -> None:
    """Raise SpecError for closed rooms, where more relief than STEPS * STEP is to be expected."""
    if room_size is not None and room_size.isfinite().any():
        expected = "box rooms, which this search supports"
        raise SpecError("rooms", "closed rooms in metres", expected)


def matching_cost(
    image: Tensor, cameras: Cameras, other: Tensor, others: Cameras, noise: float = NOISE
) -> Tensor:
    """Return the cost, 0 to about 1, of each relief at each pixel, (B, STEPS, S, S).

    With Geman and McClure's robust function of squared differences of colour, over those that are
    expected where image and other image change quickly.

    Args:
        image, other: linear radiance, (B, 3, S, S).
        noise: difference of radiance that is expected everywhere.
    """
    size = image.shape[-1]
    walls, entry, _ = empty_rooms(cameras.world_from_camera, cameras.fov_y_degrees, size)
    tried = reliefs(image)[:, None, None]
    depth = torch.maximum(walls[:, None] - tried, entry[:, None])
    slope, other_slope = _squared_slope(image), _squared_slope(other)
    values = torch.cat([other, other_slope], dim=1)
    shown, _, seen = reprojected(values, others, depth, cameras)
    squared = (shown[:, :3] - image[:, :, None]).square().sum(dim=1)
    ratio = squared / (3 * noise**2 + SHIFT**2 * (shown[:, 3] + slope) / 2)
    return torch.where(seen, ratio / (ratio + SCALE), UNSEEN) + RISE * tried / tried[-1]


def _squared_slope(image: Tensor) -> Tensor:
    """Return the squared change of colour from pixel to pixel, (B, 3, S, S) -> (B, 1, S, S)."""
    wide = functional.pad(image, (1, 1, 1, 1), mode="replicate")
    across = (wide[:, :, 1:-1, 2:] - wide[:, :, 1:-1, :-2]) / 2
    down = (wide[:, :, 2:, 1:-1] - wide[:, :, :-2, 1:-1]) / 2
    return (across.square() + down.square()).sum(dim=1, keepdim=True)


def joint_cost(costs: list[Tensor]) -> Tensor:
    """Return the least cost over the sides, each (B, STEPS, S, S), averaged over a window.

    What is hidden from cameras on one side is mostly seen from the other (Kang et al. 2001).
    """
    least = torch.stack(costs).amin(dim=0)
    wide = functional.pad(least, (WINDOW // 2,) * 4, mode="replicate")
    return functional.avg_pool2d(wide, WINDOW, 1)


def semi_global(cost: Tensor) -> Tensor:
    """Return costs with those of the best ways to each pixel, (B, D, S, S).

    Semi-global matching (Hirschmueller 2008), along four directions: relief should not change from
    pixel to pixel but where colours demand it.
    """
    across, down = cost, cost.transpose(2, 3)
    ways = _along_rows(across) + _along_rows(across.flip(3)).flip(3)
    turned = _along_rows(down) + _along_rows(down.flip(3)).flip(3)
    return ways + turned.transpose(2, 3)


def _along_rows(cost: Tensor) -> Tensor:
    """Return the cost of the best way from the left border to each pixel, less a constant."""
    columns = cost.permute(3, 1, 0, 2).contiguous()  # (S, D, B, S): each step reads one block
    ways = torch.empty_like(columns)
    ways[0] = columns[0]
    for number, column in enumerate(columns[1:]):
        before, way = ways[number], ways[number + 1]
        best = before.amin(dim=0)
        least = torch.minimum(before, best + LARGE)
        torch.minimum(least[1:], before[:-1] + SMALL, out=least[1:])
        torch.minimum(least[:-1], before[1:] + SMALL, out=least[:-1])
        torch.add(least - best, column, out=way)
    return ways.permute(2, 1, 3, 0)


def best_relief(cost: Tensor) -> Tensor:
    """Return the relief of least cost, between the steps by a parabola: (B, S, S), scene units."""
    best = cost.argmin(dim=1, keepdim=True)
    middle = best.clamp(1, cost.shape[1] - 2)
    below, at, above = (cost.gather(1, middle + step) for step in (-1, 0, 1))
    curve = (below - 2 * at + above).clamp(min=1e-6)
    between = (middle + ((below - above) / (2 * curve)).clamp(-0.5, 0.5)).clamp(min=0)
    return STEP * torch.where(best == middle, between, best)[:, 0]


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
    rooms: Rooms, run_folder: str | Path, progress: Progress = lambda done, total: None
) -> Tensor:
    """Return the relief of all rows, (N, S, S) float16; 0 for those that have no partner.

    Labels that the run's folder holds are read; else they are found and written.

    Raises SpecError as `matched_rows`, and for closed rooms; OSError; FileFormatError where the
    folder's labels are not those of these rooms.
    """
    paper_rooms_only(rooms.room_size)
    pairs = pairs_of(rooms)
    matched = _with_partner(pairs)
    path = Path(run_folder) / LABELS
    relief = torch.zeros(len(rooms), *rooms.image.shape[2:], dtype=torch.float16)
    if path.exists():
        tensors, notes = load_tensors(path)
        if notes.get("fingerprint") != rooms.fingerprint:
            expected = f"those of the rooms {rooms.fingerprint[:12]}"
            raise FileFormatError(path, "labels of other rooms", expected, "name another folder")
        check_tensors(path, tensors, {"relief": relief})
        return tensors["relief"]
    for done, row in enumerate(matched.tolist(), 1):
        relief[row] = relief_of_row(rooms, row, pairs[row]).half()
        progress(done, len(matched))
    save_tensors(path, {"relief": relief}, {"fingerprint": rooms.fingerprint})
    return relief
