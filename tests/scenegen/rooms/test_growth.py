"""Memory does not grow with the number of rooms: what is kept is bounded by its bytes."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from PIL import Image

from scenegen.common.recent import bytes_alive
from scenegen.objects.catalogue import built_in_shape, interior_shape, outline
from scenegen.objects.families.store import MEMBER_STORE
from scenegen.objects.sources import object_source

CLASSES = ("chair", "table", "sofa", "lamp", "shelf", "cabinet", "plant", "vase", "book", "box")
# Renders the truth of 400 interiors, and prints the peak of memory in kB at their half and end.
# Launches are small: the largest of many rooms would be a peak of its own.
RENDER = """
import sys
from scenegen.description.presets import preset_spec
from scenegen.objects.sources import object_source
from scenegen.rendering.renderer import share_processors
from scenegen.rooms.render import render_items

share_processors(2)
root, cache = sys.argv[1:]
source = object_source("interiors", objects_root=root or None, cache_dir=cache)
small = {"height": 32, "width": 32, "min_visible_pixels": 1}
few = {"objects": (12, 24)} if root else {}
spec = preset_spec("interiors", seed=5, **small, **few, **source.settings)
done = 0
for items in render_items(spec, range(400), 4, "auto", source.objects, ("depth", "object_id")):
    for _ in items:
        done += 1
        if done in (200, 400):
            print(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])
"""


def write_models(root, count, side):
    """Chairs, tables and so on, each a ball on a box with a picture of side x side pixels."""
    ball, box = trimesh.creation.uv_sphere(0.5, count=(24, 24)), trimesh.creation.box((2, 2, 2))
    model = trimesh.util.concatenate([ball.apply_translation((0, 1.5, 0)), box])
    uv = model.vertices[:, :2] / 2 + 0.5
    rng = np.random.default_rng(0)
    for i in range(count):
        folder = root / CLASSES[i % len(CLASSES)]
        folder.mkdir(parents=True, exist_ok=True)
        shades = rng.integers(0, 256, (side // 16, side // 16, 3), np.uint8)
        picture = Image.fromarray(shades).resize((side, side), Image.Resampling.NEAREST)
        material = trimesh.visual.material.SimpleMaterial(image=picture)
        model.visual = trimesh.visual.TextureVisuals(uv, material=material)
        scaled = model.copy().apply_scale([1.0, 1 + i / count, 1.0])
        (folder / f"{i}.glb").write_bytes(scaled.export(file_type="glb"))


def test_outlines_keep_nothing_alive_but_what_placement_reads(tmp_path):
    write_models(tmp_path / "models", 1, 256)
    models = {"objects_root": str(tmp_path / "models"), "cache_dir": str(tmp_path)}
    MEMBER_STORE.use(tmp_path)
    for shape_of, name in (
        (object_source("interiors", **models).objects.shape, "chair/0"),
        (object_source("shapenet", **models).objects.shape, "chair/0"),
        (interior_shape, "sofa/0007"),
        (built_in_shape, "mug/0007"),
        (built_in_shape, "mug/0008"),
    ):
        assert bytes_alive(shape_of(name)) > 20_000
        assert bytes_alive(outline(shape_of, name)) < 15_000, name


@pytest.mark.slow
@pytest.mark.parametrize("models", [0, 300])
def test_the_second_half_of_a_run_takes_no_more_memory(models, tmp_path):
    """Of models, each picture takes 3 MB in memory."""
    root = tmp_path / "models" if models else ""
    if models:
        write_models(root, models, 512)
    done = subprocess.run(
        [sys.executable, "-c", RENDER, root, tmp_path], capture_output=True, text=True, check=True
    )
    half, end = map(float, done.stdout.split())
    assert end < 1.05 * half
