"""The differentiable surfel renderer: depth maps and cameras in, shaded images out.

Pix2Shape (IJCV 2020), section "Differentiable 3D Renderer" and appendix "Rendering Details". Each
pixel has one surfel, so nothing has to be searched or sorted and every step is differentiable.
Everything is in the camera frame: x right, y up, looking along -z; pixels and planar depth as in
`scenegen.camera`. All functions take batches of B images of H x W pixels, channels first.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from scenegen.camera import pixel_size


@dataclass(frozen=True, eq=False)
class Scene:
    """The lights and materials that images are shaded with, camera frame.

    Attributes:
        fov_y_degrees: vertical field of view, the same for all images.
        light_position: (B, L, 3), scene units.
        light_color: L_j, (B, L, 3); zero for places without a light.
        ambient: L_a, (B, 3).
        attenuation: (k_l, k_q), (B, 2).
        reflectance: rho, (B, 3), or (B, 3, H, W) of each pixel.
        specular, shininess: Phong's k_s and exponent, (B, H, W) or any shape that broadcasts to
            it; None for matte rooms.
    """

    fov_y_degrees: float
    light_position: Tensor
    light_color: Tensor
    ambient: Tensor
    attenuation: Tensor
    reflectance: Tensor
    specular: Tensor | None = None
    shininess: Tensor | None = None


def pixel_rays(
    height: int, width: int, fov_y_degrees: float, like: Tensor
) -> tuple[Tensor, Tensor]:
    """Return x, (1, W), and y, (H, 1), of the rays (x, y, -1) through the pixels' centres."""
    pixel = pixel_size(height, fov_y_degrees)
    x = (torch.arange(width, dtype=like.dtype, device=like.device) + 0.5 - width / 2) * pixel
    y = (height / 2 - 0.5 - torch.arange(height, dtype=like.dtype, device=like.device)) * pixel
    return x[None], y[:, None]


def back_project(depth: Tensor, fov_y_degrees: float) -> Tensor:
    """Return the surfels' positions from planar depth: (B, H, W) -> (B, 3, H, W), scene units."""
    x, y = pixel_rays(depth.shape[1], depth.shape[2], fov_y_degrees, depth)
    return torch.stack([depth * x, depth * y, -depth], dim=1)


def normals_from_depth(depth: Tensor, fov_y_degrees: float) -> Tensor:
    """Return the normals of the planes fitted to each surfel and its 8 neighbours, (B, 3, H, W).

    Unit, n_z > 0 (the paper's equation "normal_estimation"). A plane n . P = c seen in perspective
    has an inverse depth that is affine over the image, 1 / depth = (n . ray) / c; so the fit is
    linear least squares there, which is two convolutions, and exact on planes. At the border the
    missing neighbours are extrapolated.

    Args:
        depth: (B, H, W), positive, H and W at least 2.
    """
    x, y = pixel_rays(depth.shape[1], depth.shape[2], fov_y_degrees, depth)
    pixel = x[0, 1] - x[0, 0]
    inverse = extrapolated(1 / depth)
    rows = inverse[:, :-2] + inverse[:, 1:-1] + inverse[:, 2:]  # sums over three neighbours
    columns = inverse[:, :, :-2] + inverse[:, :, 1:-1] + inverse[:, :, 2:]
    slope_x = (rows[:, :, 2:] - rows[:, :, :-2]) / (6 * pixel)
    slope_y = (columns[:, :-2] - columns[:, 2:]) / (6 * pixel)  # row 0 is on top
    constant = 1 / depth - slope_x * x - slope_y * y
    least = 1e-3 * torch.sqrt(slope_x**2 + slope_y**2).detach() + 1e-12
    normals = torch.stack([-slope_x, -slope_y, torch.maximum(constant, least)], dim=1)
    return functional.normalize(normals, dim=1)


def extrapolated(values: Tensor) -> Tensor:
    """Add a border of one pixel, each continuing the line through the two next to it."""
    first, last = 2 * values[:, :1] - values[:, 1:2], 2 * values[:, -1:] - values[:, -2:-1]
    values = torch.cat([first, values, last], dim=1)
    first = 2 * values[:, :, :1] - values[:, :, 1:2]
    last = 2 * values[:, :, -1:] - values[:, :, -2:-1]
    return torch.cat([first, values, last], dim=2)


def shade(positions: Tensor, normals: Tensor, scene: Scene) -> Tensor:
    """Return linear radiance by the paper's shading equation: two (B, 3, H, W) -> (B, 3, H, W).

    With `scene.specular`, Phong's lobe is added; the camera is at the origin. The same equation in
    numpy, and its source, are in `scenegen.rendering.shading.shade`.
    """
    batch, _, height, width = positions.shape
    p, n, light = positions.flatten(2), normals.flatten(2), scene.light_position
    # Matrix products instead of a difference for each light halve the memory traffic.
    squared = (p * p).sum(dim=1, keepdim=True) + (light * light).sum(dim=2, keepdim=True)
    squared = torch.baddbmm(squared, light, p, alpha=-2).clamp(min=1e-12)  # (B, L, HW)
    distance = torch.sqrt(squared)
    falloff = scene.attenuation[:, :1, None] * distance + scene.attenuation[:, 1:, None] * squared
    cosine = (torch.bmm(light, n) - (p * n).sum(dim=1, keepdim=True)) / distance
    amount = cosine.clamp(min=0) / falloff
    color = scene.light_color.transpose(1, 2)  # (B, 3, L)
    total = torch.baddbmm(scene.ambient[..., None], color, amount)
    rho = scene.reflectance
    image = total * (rho.flatten(2) if rho.dim() == 4 else rho[..., None])
    if scene.specular is not None and scene.shininess is not None:
        mirrored = functional.normalize(p - 2 * (p * n).sum(dim=1, keepdim=True) * n, dim=1)
        toward = torch.bmm(light, mirrored) - (p * mirrored).sum(dim=1, keepdim=True)
        gloss = (scene.specular, scene.shininess)
        specular, shininess = (v.expand(batch, height, width).flatten(1)[:, None] for v in gloss)
        # At most 1: rounding near a light would give powers without bounds, times a colour of 0.
        lobe = specular * (toward / distance).clamp(1e-6, 1) ** shininess / falloff
        image = image + torch.bmm(color, torch.where(cosine > 0, lobe, 0))
    return image.view(batch, 3, height, width)


def render(depth: Tensor, scene: Scene, normals: Tensor | None = None) -> Tensor:
    """Return the image of a depth map: (B, H, W) -> (B, 3, H, W) linear radiance.

    Args:
        normals: (B, 3, H, W), unit; those of the depth map if None.
    """
    if normals is None:
        normals = normals_from_depth(depth, scene.fov_y_degrees)
    return shade(back_project(depth, scene.fov_y_degrees), normals, scene)
