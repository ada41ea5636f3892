"""Milliseconds an image of the reference model's renderer, and of the plain way to write it.

    python -m benchmarks.surfels [--size 128] [--batch 16] [--rounds 10] [--device cpu]

The plain way: the plane of each surfel's 8 neighbours from the eigenvectors of their scatter, and
shading by broadcasting over lights. Its eigenvectors end in an error of cuSOLVER, so it is timed
on a CPU alone. Goals there: 1.4 ms forward, 5 ms forward and backward.
"""

import argparse
import math
import statistics
import sys
import warnings
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from baselines.pix2shape.network.surfels import Scene, back_project, render
from benchmarks.timing import repeat
from scenegen.camera import transform_points
from scenegen.description.presets import preset_spec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render as render_rooms
from scenegen.sampling.scenes import sample_scene

Render = Callable[[Tensor, Scene], Tensor]


def plain_render(depth: Tensor, scene: Scene) -> Tensor:
    """Return what `surfels.render` returns, computed as it is written in the paper."""
    positions = back_project(depth, scene.fov_y_degrees)
    patches = functional.unfold(functional.pad(positions, (1, 1, 1, 1), mode="replicate"), 3)
    patches = patches.view(len(depth), 3, 9, *depth.shape[1:])
    differences = patches - positions[:, :, None]
    scatter = torch.einsum("bikhw,bjkhw->bhwij", differences, differences)
    normals = torch.linalg.eigh(scatter)[1][..., 0]
    normals = torch.where(normals[..., 2:] < 0, -normals, normals).movedim(-1, 1)
    toward = scene.light_position[..., None, None] - positions[:, None]  # (B, L, 3, H, W)
    distance = toward.norm(dim=2)
    linear, quadratic = scene.attenuation.movedim(1, 0)[:, :, None, None, None]
    cosine = (toward * normals[:, None]).sum(dim=2) / distance
    amount = cosine.clamp(min=0) / (linear * distance + quadratic * distance**2)
    total = (scene.light_color[..., None, None] * amount[:, :, None]).sum(dim=1)
    rho = scene.reflectance[..., None, None]
    return rho * (scene.ambient[..., None, None] + total)


def rooms(batch: int, size: int, device: torch.device) -> tuple[Tensor, Scene]:
    """Return true depth maps of rooms and what they are shaded with, on a device."""
    spec = preset_spec("shapes", height=size, width=size)
    found = (sample_scene(spec, i) for i in range(4 * batch))
    packed = pack(spec, [scene for scene in found if scene is not None][:batch])
    camera = np.linalg.inv(packed.world_from_camera)
    lights = map(transform_points, camera, packed.light_position)
    known = (
        np.stack(list(lights)),
        packed.light_color,
        packed.ambient,
        packed.attenuation,
        packed.reflectance[:, 0],
    )
    scene = Scene(spec.fov_y_degrees, *(torch.from_numpy(np.float32(v)).to(device) for v in known))
    return torch.from_numpy(render_rooms(packed).depth).to(device), scene


def both_ways(renderer: Render, depth: Tensor, scene: Scene) -> Callable[[], object]:
    """Return an action that renders and takes the gradient to the depth."""
    wanted = depth.clone().requires_grad_()
    weights = torch.ones(len(depth), 3, *depth.shape[1:], device=depth.device)

    def action() -> object:
        return torch.autograd.grad(renderer(wanted, scene), wanted, weights)

    return action


def finished(action: Callable[[], object], device: torch.device) -> Callable[[], object]:
    """Return an action that waits until the device has done it."""

    def waited() -> object:
        done = action()
        if device.type == "cuda":
            torch.cuda.synchronize(device)
        return done

    return waited


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--device", default="cpu")
    arguments = parser.parse_args()
    if arguments.device == "cuda" and not torch.cuda.is_available():
        sys.exit("benchmarks.surfels: torch sees no GPU")
    device = torch.device(arguments.device)
    depth, scene = rooms(arguments.batch, arguments.size, device)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Inductor's own
        methods: dict[str, Render] = {
            "ours": render,
            "ours, torch.compile": torch.compile(render),
        }
        if device.type == "cpu":
            methods["eigenvectors and broadcasting"] = plain_render
        where = f"{torch.get_num_threads()} threads" if device.type == "cpu" else str(device)
        print(f"torch {torch.__version__}, {where}, batches of {arguments.batch}")
        print(f"{'ms an image':32s}{'forward':>10s}{'and backward':>14s}")
        for name, method in methods.items():
            row = []
            for action in (lambda m=method: m(depth, scene), both_ways(method, depth, scene)):
                times = repeat(finished(action, device), arguments.rounds)
                row.append(1e3 * statistics.median(times) / arguments.batch)
            print(f"{name:32s}{row[0]:10.3f}{row[1]:14.3f}", flush=True)
        if device.type == "cpu":
            difference = (render(depth, scene) - plain_render(depth, scene)).abs().median()
            print(f"median difference of the two ways: {float(difference):.1e}")
            assert math.isfinite(float(difference))


if __name__ == "__main__":
    main()
