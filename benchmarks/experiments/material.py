"""How well materials and lights are read from one image.

    python -m benchmarks.experiments.material --help

A model of `--set material=true` gives each surfel an albedo and Phong's lobe, and one of
`--set lights=L` says where the lights are. From the first view of each room these are compared with
the truth, and the image that follows from them with the one that the model saw. Two floors stand
beside them that see no object: the means over the test file itself, which for objects are the means
over their own pixels, and, for albedo, the image divided by what a white empty room would look like
under the true lights.
"""

from collections import defaultdict
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import default_collate

from baselines.pix2shape.network.empty_rooms import empty_rooms
from baselines.pix2shape.network.model import Pix2Shape, Views, shaded
from baselines.pix2shape.network.surfels import render
from baselines.pix2shape.pictures import image_tiles, sheet
from baselines.pix2shape.rooms import RoomImages
from baselines.pix2shape.weights import open_weights
from baselines.training.data import Opened
from baselines.training.images import reduced
from baselines.training.rooms import input_views
from benchmarks.markdown import table
from metrics.measures.statistics import bootstrap_interval
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
LEAST = 0.02  # radiance of the white empty room that an image is divided by at least
SHOWN = 8  # rooms of the picture


@click.command()
@click.option("--weights", required=True, help="Weights of a model that learned materials.")
@click.option("--data", type=click.Path(path_type=Path), required=True, help="Rooms to test on.")
@click.option("--picture", type=click.Path(path_type=Path), help="PNG to draw eight rooms to.")
def main(weights: str, data: Path, picture: Path | None) -> None:
    """Print errors of albedo, k_s, image and lights: means and 95% intervals over rooms."""
    torch.set_num_threads(1)
    model, _ = open_weights(weights)
    if not model.config.material:
        raise click.UsageError(
            f"--weights {weights}: expected a model that learned materials, as"
            " `pix2shape train --set material=true` trains"
        )
    found = read(model, data)
    rows = [[name, *map(_interval, columns)] for name, columns in errors(found).items()]
    head = ["error", "model", "mean of the file", "image / white empty room"]
    print(table(head, [row + ["-"] * (len(head) - len(row)) for row in rows]))
    if picture is not None:
        shown = (found[name][:SHOWN] for name in ("input", "image", "albedo", "true albedo"))
        tiles = [image_tiles(torch.from_numpy(np.moveaxis(one, -1, 1))) for one in shown]
        sheet(tiles).save(picture)


@torch.inference_mode()
def read(model: Pix2Shape, data: Path) -> dict[str, Array]:
    """Return what the model says of each room's first view, and the truth, (N, S, S, ...) each.

    Lights are directions from the camera's target, (N, L, 3), NaN in slots that are not used.
    """
    opened, size = Opened(partial(RoomsFile, data)), model.config.networks.size
    source, found = RoomImages(opened, model.config), defaultdict(list)
    with opened.file as rooms:
        target = np.array(rooms.spec.camera_target)
        for row in map(int, input_views(rooms)[0]):
            batch = source.as_batch(default_collate([source[row]]))
            code = model.encode(batch.image, batch.views)
            surfels = model.surfels(code, batch.views.condition, batch.views.cameras)
            assert surfels.material is not None, "main sees to it"
            ids, position = rooms.read("object_id", row), rooms.read("light/position", row)
            maps = {
                name: reduced(rooms.read(f"material/{stored}", row)[ids].astype(float), size)
                for name, stored in (("true albedo", "reflectance"), ("true k_s", "specular"))
            }
            pictures = {
                "input": batch.image,
                "image": shaded(surfels, model.lit(code, batch.views)),
                "albedo": surfels.material.albedo,
                "white room": white_room(batch.views, position, size),
            }
            maps |= {name: np.moveaxis(one[0].numpy(), 0, -1) for name, one in pictures.items()}
            maps |= {"k_s": surfels.material.specular[0].numpy()}
            maps["object"] = reduced((ids > 0).astype(float), size)
            if model.config.lights:
                used = np.arange(len(position)) < rooms.read("light/count", row)
                maps["true light"] = np.where(used[:, None], position - target, np.nan)
                maps["light"] = model.decoder.light_positions(code)[0].numpy() - target
            for name, one in maps.items():
                found[name].append(one)
    return {name: np.stack(many) for name, many in found.items()}


def white_room(views: Views, position: Array, size: int) -> torch.Tensor:
    """Return the image of an empty room of reflectance 1, (1, 3, S, S), under lights (L, 3)."""
    cameras = views.cameras
    assert cameras is not None, "rooms have cameras"
    pose = cameras.world_from_camera
    lights = (torch.from_numpy(np.float32(position)) - pose[:, None, :3, 3]) @ pose[:, :3, :3]
    white = replace(views.scene, light_position=lights, reflectance=torch.ones(1, 3))
    return render(empty_rooms(pose, cameras.fov_y_degrees, size)[0], white)


def errors(found: dict[str, Array]) -> dict[str, list[Array]]:
    """Return each error of each room, (N,), of the model and then of the floors."""
    true, on, k_s = found["true albedo"], found["object"], found["true k_s"]
    divided = np.clip(found["input"] / np.maximum(found["white room"], LEAST), 0, 1)
    middles = [
        np.average(true, axis=(0, 1, 2), weights=np.broadcast_to(weight[..., None], true.shape))
        for weight in (np.ones_like(on), on)
    ]
    albedo, of_objects = (
        [((said - true) ** 2).mean(axis=3) for said in (found["albedo"], middle, divided)]
        for middle in middles
    )
    lobes = [(said - k_s) ** 2 for said in (found["k_s"], (k_s * on).sum() / on.sum())]
    images = [
        (said - found["input"]) ** 2 for said in (found["image"], found["input"].mean(axis=0))
    ]
    rows = {
        "albedo, MSE": [one.mean(axis=(1, 2)) for one in albedo],
        "albedo of objects, MSE": [_weighted(one, on) for one in of_objects],
        "k_s of objects, MSE": [_weighted(one, on) for one in lobes],
        "image, MSE": [one.mean(axis=(1, 2, 3)) for one in images],
    }
    if "light" in found:
        true = found["true light"]
        middle = np.broadcast_to(np.nanmean(true, axis=(0, 1)), true.shape)
        rows["lights, degrees"] = [_angle(said, true) for said in (found["light"], middle)]
    return rows


def _weighted(values: Array, weight: Array) -> Array:
    """Return the weighted mean of each room that has any weight: (N, S, S) -> (M,)."""
    total = weight.sum(axis=(1, 2))
    return ((values * weight).sum(axis=(1, 2))[total > 0]) / total[total > 0]


def _angle(one: Array, other: Array) -> Array:
    """Return the mean angle between directions of each room, degrees: (N, L, 3) -> (N,)."""
    lengths = np.linalg.norm(one, axis=2) * np.linalg.norm(other, axis=2)
    return np.nanmean(np.degrees(np.arccos(np.clip((one * other).sum(axis=2) / lengths, -1, 1))), 1)


def _interval(values: Array) -> str:
    low, high = bootstrap_interval(values[:, None], 0)
    digits = 1 if values.mean() > 1 else 4
    return f"{values.mean():.{digits}f} [{low[0]:.{digits}f}, {high[0]:.{digits}f}]"


if __name__ == "__main__":
    main()
