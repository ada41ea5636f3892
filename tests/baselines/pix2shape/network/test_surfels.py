"""The surfel renderer: the files' images again, planes exactly, gradients by differences."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from baselines.pix2shape.network import surfels
from baselines.pix2shape.network.surfels import Scene, normals_from_depth, render
from scenegen.camera import pixel_directions, transform_points
from scenegen.description.presets import PRESETS, preset_spec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render as render_rooms
from scenegen.rendering.shading import shade as shade_in_numpy
from scenegen.sampling.scenes import sample_scene

FOV = 30.0
LIT = ("light_position", "light_color", "ambient", "attenuation", "reflectance")


def plane_depth(normal: NDArray[np.float64], offset: float, height: int, width: int) -> object:
    """Depth map of the plane normal . P = -offset, camera frame, (1, H, W) float64."""
    rays = pixel_directions(height, width, FOV)
    return torch.tensor(-offset / (rays @ normal))[None]


def some_scene(batch: int, height: int = 6, width: int = 5, gloss: bool = False) -> Scene:
    """Three lights behind the camera, float64."""
    rng = np.random.default_rng(0)
    place = rng.normal(size=(batch, 3, 3)) + np.array([0, 0, 1.5])
    ranges = [(0.2, 1, (3, 3)), (0, 0.3, (3,)), (0.2, 1, (2,)), (0.2, 1, (3,))]
    ranges += [(0.2, 1, (height, width)), (1, 20, (height, width))] if gloss else []
    others = (rng.uniform(low, high, (batch, *shape)) for low, high, shape in ranges)
    return Scene(FOV, *map(torch.tensor, (place, *others)))


@pytest.mark.parametrize("name", [n for n in PRESETS if n not in ("furniture-256", "interiors")])
def test_ground_truth_gives_the_files_images_back(name: str) -> None:
    spec = replace(preset_spec(name, height=48, width=48), image_dtype="float32")
    scenes = [s for i in range(6) if (s := sample_scene(spec, i)) is not None][:4]
    batch = pack(spec, scenes)
    truth = render_rooms(batch)
    camera = np.linalg.inv(batch.world_from_camera)
    lights = np.stack(list(map(transform_points, camera, batch.light_position)))
    assert (truth.object_id >= 0).all()
    row, tensor = np.arange(len(scenes))[:, None, None], partial(torch.tensor, dtype=torch.float32)
    reflectance = np.moveaxis(batch.reflectance[row, truth.object_id], -1, 1)
    gloss = np.moveaxis(batch.gloss[row, truth.object_id], -1, 0)
    told = (lights, batch.light_color, batch.ambient, batch.attenuation, reflectance, *gloss)
    scene = Scene(float(batch.fov_y_degrees[0]), *map(tensor, told))
    normals = tensor(np.moveaxis(truth.normal, -1, 1))
    image = render(tensor(truth.depth), scene, normals).numpy()
    np.testing.assert_allclose(np.moveaxis(image, 1, -1), truth.image, atol=4e-5, rtol=4e-5)


@pytest.mark.parametrize("gloss", [False, True])
def test_shading_is_the_numpy_equation(gloss: bool) -> None:
    scene = some_scene(2, gloss=gloss)
    rng = np.random.default_rng(1)
    depth = torch.tensor(rng.uniform(1, 2, (2, 6, 5)))
    normals = torch.nn.functional.normalize(torch.tensor(rng.normal(size=(2, 3, 6, 5))), dim=1)
    image = surfels.shade(surfels.back_project(depth, FOV), normals, scene).numpy()
    for b in range(2):
        expected = shade_in_numpy(
            pixel_directions(6, 5, FOV) * depth[b, :, :, None].numpy(),
            np.moveaxis(normals[b].numpy(), 0, -1),
            *(getattr(scene, name)[b].numpy() for name in (LIT[-1], *LIT[:-1])),
            specular=scene.specular[b].numpy() if gloss else 0.0,
            shininess=scene.shininess[b].numpy() if gloss else 1.0,
            viewpoint=np.zeros(3) if gloss else None,
        )
        np.testing.assert_allclose(np.moveaxis(image[b], 0, -1), expected, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("normal", [(0, 0, 1), (0.5, 0.3, 0.8), (-0.7, 0.2, 0.4), (0.1, -0.9, 0.2)])
def test_normals_of_planes_are_exact(normal: tuple[float, float, float]) -> None:
    """At the border, too."""
    unit = np.array(normal) / np.linalg.norm(normal)
    found = normals_from_depth(plane_depth(unit, 1.5, 12, 9), FOV)[0].numpy()
    np.testing.assert_allclose(np.moveaxis(found, 0, -1) - unit, 0, atol=1e-12)


@pytest.mark.parametrize("size", [64, 256])
def test_normals_of_a_sphere_are_off_by_the_resolution(size: int) -> None:
    rays = pixel_directions(size, size, FOV)
    middle = np.array([0.0, 0.0, -2.0])
    along = (rays @ middle) / (rays**2).sum(-1)
    half = along**2 - (middle @ middle - 0.9**2) / (rays**2).sum(-1)
    assert (half > 0).all(), "the sphere fills the image"
    depth = along - np.sqrt(half)
    found = normals_from_depth(torch.tensor(depth)[None], FOV)[0].numpy()
    true = (depth[..., None] * rays - middle) / 0.9
    cosine = (np.moveaxis(found, 0, -1) * true).sum(-1)[1:-1, 1:-1]
    pixel = 2 * math.tan(math.radians(FOV) / 2) / size
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < np.degrees(3 * pixel)


@pytest.mark.parametrize("gloss", [False, True])
def test_gradients_agree_with_finite_differences(gloss: bool) -> None:
    scene = some_scene(2, gloss=gloss)
    depth = 1.5 + 0.05 * torch.rand(2, 6, 5, dtype=torch.float64)
    towards = np.array([0, 0, 3.0])[:, None, None]
    raw = torch.tensor(np.random.default_rng(3).normal(size=(2, 3, 6, 5)) + towards)
    normals = torch.nn.functional.normalize(raw, dim=1)
    assert torch.autograd.gradcheck(lambda d: render(d, scene), depth.requires_grad_())
    assert torch.autograd.gradcheck(
        lambda n: render(depth.detach(), scene, n), normals.requires_grad_()
    )
    assert torch.autograd.gradcheck(
        lambda c, r: render(depth.detach(), replace(scene, light_color=c, reflectance=r)),
        (scene.light_color.requires_grad_(), scene.reflectance.requires_grad_()),
    )


def test_a_dark_light_on_a_shining_surface_harms_no_gradient() -> None:
    """Slots without a light hold a place in the room, where rounding makes any distance 0."""
    number, size = torch.Generator().manual_seed(0), 32
    depth = (1.5 + 0.01 * torch.rand(1, size, size, generator=number)).requires_grad_()
    place = 0.9995 * surfels.back_project(depth, FOV).detach()[0].flatten(1).T[None]
    black, one = torch.zeros(1, size * size, 3), torch.ones(1, 3)
    gloss = torch.ones(1, 1, 1), torch.full((1, 1, 1), 128.0)
    scene = Scene(FOV, place, black, one, one[:, :2], one, *gloss)
    render(depth, scene).sum().backward()
    assert torch.isfinite(depth.grad).all()
