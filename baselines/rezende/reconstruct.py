"""What trained weights see in images: meshes and their pictures, and how far these are off."""

from dataclasses import dataclass

import numpy as np
import torch
from PIL import Image

from baselines.rezende.images import Pictures
from baselines.rezende.network import Model
from baselines.rezende.rasteriser import rasterise
from baselines.rezende.sphere import icosphere
from baselines.training.images import Array

BATCH = 64  # images at a time
ZOOM, GAP = 3, 2  # pixels of a sheet for each of an image, and between images


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """Meshes of N images, and their pictures.

    Attributes:
        vertices: (N, V, 3), frame and unit of the pictures' views.
        image: linear radiance, (N, S, S, 3).
        depth: planar, (N, S, S); infinite where there is no mesh.
    """

    vertices: Array
    image: Array
    depth: Array


@torch.no_grad()
def meshes_of(model: Model, image: Array) -> Array:
    """Return the meshes of images (N, 3, S, S) by the codes' means, (N, V, 3), sphere radius 1."""
    meshes = [
        model.vertices(model.offsets(model.encode(torch.from_numpy(part))[0])).numpy()
        for part in np.split(image, range(BATCH, len(image), BATCH))
    ]
    return np.concatenate(meshes)


def reconstruct(model: Model, pictures: Pictures) -> Reconstruction:
    """Return the meshes of all pictures, rendered under each picture's own lights."""
    vertices = pictures.radius * meshes_of(model, pictures.image)
    return Reconstruction(vertices, *rasterise(vertices, model.faces, pictures.views))


def untrained(pictures: Pictures) -> Reconstruction:
    """Return the sphere that every mesh starts from, as the reconstruction of each picture."""
    corners, faces = icosphere()
    vertices = np.tile(pictures.radius * corners.astype(np.float32), (len(pictures), 1, 1))
    return Reconstruction(vertices, *rasterise(vertices, faces, pictures.views))


def errors(made: Reconstruction, pictures: Pictures) -> dict[str, float]:
    """Return means over pictures of known depth.

    `radiance` is the root mean squared difference of all pixels; `silhouette_iou` the intersection
    of the two silhouettes over their union; `depth` the mean absolute difference over pixels of
    both silhouettes, in radii of the starting sphere. NaN where no picture has such pixels.
    """
    assert pictures.depth is not None
    mine, true = np.isfinite(made.depth), np.isfinite(pictures.depth)
    both, either = mine & true, mine | true
    difference = np.where(both, made.depth, 0) - np.where(both, pictures.depth, 0)
    pixels = both.sum(axis=(1, 2))
    depth = np.abs(difference).sum(axis=(1, 2))[pixels > 0] / pixels[pixels > 0]
    overlap = pixels / np.maximum(either.sum(axis=(1, 2)), 1)
    radiance = np.sqrt(((made.image - np.moveaxis(pictures.image, 1, 3)) ** 2).mean(axis=(1, 2, 3)))
    return {
        "radiance": float(radiance.mean()),
        "silhouette_iou": float(overlap.mean()),
        "depth": float(depth.mean() / pictures.radius) if len(depth) else float("nan"),
    }


def sheet(made: Reconstruction, pictures: Pictures, rows: range) -> Image.Image:
    """Return a picture: inputs, their reconstructions, and those meshes turned by 90 degrees."""
    turned = made.vertices[rows][:, :, [2, 1, 0]] * np.array([-1.0, 1.0, 1.0], np.float32)
    _, faces = icosphere()
    beside, _ = rasterise(turned, faces, pictures.views_of(np.array(rows)))
    inputs = np.moveaxis(pictures.image[rows], 1, 3)
    strips = []
    for images in (inputs, made.image[rows], beside):
        framed = np.pad(images, ((0, 0), (0, GAP), (0, GAP), (0, 0)), constant_values=0.5)
        strips.append(np.concatenate(list(framed), axis=1))
    pixels = np.rint(255 * np.concatenate(strips).clip(0, 1) ** (1 / 2.2)).astype(np.uint8)
    picture = Image.fromarray(pixels)
    return picture.resize((ZOOM * picture.width, ZOOM * picture.height), Image.Resampling.NEAREST)
