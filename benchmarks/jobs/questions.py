"""iqtt's pipeline for questions, its parts, and one Mitsuba render for each of the images."""

import shutil
import statistics
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from benchmarks.jobs import plain_mitsuba as plain
from benchmarks.jobs.inputs import Mesh
from benchmarks.jobs.timing import processors_busy, repeat
from iqtt.files.make import make_split
from iqtt.questions.distractors import make_pools
from iqtt.questions.packing import Question, cube_centres, pack_questions
from iqtt.questions.specs import SplitSpec
from iqtt.render import render_questions
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.scene_mesh import welded
from scenegen.rendering.renderer import launch_fields, useful_workers


def end_to_end(questions: int, repeats: int, folder: str) -> dict[str, Any]:
    """Time make_split from nothing to closed files: all the images in one of them."""
    spec = SplitSpec(train=questions, labeled=0, val=0, test=0)
    out = Path(tempfile.mkdtemp(dir=folder)) / "split"
    make_split(out, replace(spec, train=64))  # compiles the kernels
    seconds, busy = [], []
    for _ in range(repeats):
        shutil.rmtree(out)
        found = processors_busy(lambda: make_split(out, spec, workers=0))
        seconds.append(found[0])
        busy.append(found[1])
    size = sum(path.stat().st_size for path in out.iterdir())
    shutil.rmtree(out)
    used = useful_workers(4 * questions, "llvm_ad_rgb")
    note = f"{questions / min(seconds):.0f} questions/s; {size / questions / 1024:.1f} KiB each;"
    note += f" {used} workers, {statistics.median(busy):.2f} processors busy"
    return {"seconds": seconds, "images": 4 * questions, "note": note, "workers": used}


def cast(questions: int, repeats: int, blocks: bool) -> dict[str, Any]:
    """Time pack, launch and fetch of colour and ids, by the cubes' kernel or the general one."""
    spec = SplitSpec()
    batch = pack_questions(spec, _questions(spec, questions))
    batch = replace(batch, cubes_only=blocks)
    names = ("image", "object_id")
    seconds = repeat(lambda: launch_fields(batch, names)(), repeats)  # noqa: PLW0108
    return {"seconds": seconds, "images": 4 * questions, "note": "pixels of one batch"}


def per_image(questions: int, repeats: int, variant: str) -> dict[str, Any]:
    """Time one `mi.load_dict` and one `mi.render` an image, colour only, no file, no refusals.

    The cubes of a shape enter as one mesh, made outside the clock, in the camera's frame.
    """
    spec = SplitSpec()
    made = _questions(spec, questions)
    plain.choose(variant)
    images = [_image(spec, question, i) for question in made for i in range(4)]
    integrator = mi.load_dict(plain.DIRECT)
    seconds = repeat(partial(_render_all, images, integrator), repeats)
    return {"seconds": seconds, "images": len(images), "note": "one load_dict, one render each"}


def _questions(spec: SplitSpec, count: int) -> list[Question]:
    pools = make_pools(spec)
    batches = render_questions(spec, pools, "train", 0, count)
    return [one.question for batch in batches for one in batch]


def _image(spec: SplitSpec, question: Question, i: int) -> dict[str, Any]:
    """Return mesh, lights, background and camera of an image as `mi.load_dict` wants them."""
    cubes = question.shapes.cubes[i]
    box = welded(unit_shape("box"))
    corners = np.asarray(box.vertices) * np.sqrt(3) / 2
    centres = cube_centres([cubes], len(cubes))[0]
    points = (centres[:, None] + corners).reshape(-1, 3) @ question.world_from_shape[i].T
    faces = np.concatenate([np.asarray(box.faces) + k * len(corners) for k in range(len(cubes))])
    mesh = Mesh(points, np.zeros_like(points), faces)
    contents = {"mesh": plain.mitsuba_mesh("cubes", mesh, plain.diffuse(spec.reflectance))}
    contents["sensor"] = plain.sensor(spec, spec.camera(question.camera_distance))
    for j in range(int(question.light_count[i])):
        position, color = question.light_position[i, j], question.light_color[i, j]
        contents[f"light{j}"] = plain.point_light(position.tolist(), color.tolist())
    return contents


def _render_all(images: list[dict[str, Any]], integrator: Any) -> None:
    for number, contents in enumerate(images):
        scene = mi.load_dict({"type": "scene", "integrator": integrator, **contents})
        np.array(mi.render(scene, spp=1, seed=number))
