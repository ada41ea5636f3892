"""Images of models: the same bits in any company, and what another engine sees."""

import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from trimesh.ray.ray_pyembree import RayMeshIntersector

from scenegen import renderer
from scenegen.camera import pixel_directions
from scenegen.dataset import make_dataset
from scenegen.meshes.folders import open_objects
from scenegen.meshes.store import MeshStore
from scenegen.objects import Objects, built_in_shape, mesh_objects, objects_of
from scenegen.packing import SceneBatch, pack
from scenegen.presets import preset_spec
from scenegen.renderer import parts, render
from scenegen.sampling import sample_scene
from scenegen.scenes import FAMILY_NAMES, SceneSpec
from scenegen.shapes import scene_mesh
from scenegen.specs import DatasetSpec
from scenegen.truth import GroundTruth

Array = NDArray[Any]
Scenes = Callable[[DatasetSpec, int], list[SceneSpec]]
FAMILIES = DatasetSpec(
    height=33, width=47, source="families", shapes=FAMILY_NAMES, objects=(1, 3), seed=12,
    image_dtype="float32", shadows=True, min_visible_pixels=0,
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of nine models in two classes."""
    root = tmp_path_factory.mktemp("models")
    for name in ("block", "round"):
        (root / name).mkdir()
    rng = np.random.default_rng(0)
    for i in range(5):
        trimesh.creation.box(rng.uniform(0.5, 1, 3)).export(root / "block" / f"{i}.obj")
    for i in range(4):
        trimesh.creation.torus(1, 0.2 + 0.1 * i).export(root / "round" / f"{i}.stl")
    return root


def folder_objects(root: Path) -> Objects:
    return mesh_objects(MeshStore(open_objects(root), None))


def folder_spec(root: Path) -> DatasetSpec:
    listing = open_objects(root)
    return replace(FAMILIES, source="folder", shapes=listing.classes, listing=listing.digest())


def some_scenes(spec: DatasetSpec, objects: Objects, count: int) -> list[SceneSpec]:
    found = [sample_scene(spec, index, 0, objects) for index in range(4 * count)]
    return [scene for scene in found if scene][:count]


def bits(truth: GroundTruth, row: int) -> tuple[bytes, ...]:
    return tuple(getattr(truth, name)[row].tobytes() for name in vars(truth))


def all_bits(spec: DatasetSpec, scenes: list[SceneSpec], objects: Objects) -> list[Any]:
    truth = render(pack(spec, scenes, objects=objects))
    return [bits(truth, row) for row in range(len(scenes))]


@pytest.mark.parametrize("source", ["families", "folder"])
def test_an_image_is_the_same_alone_and_in_any_company(source: str, folder: Path) -> None:
    """Where a model lies in a batch's scene depends on the batch; nothing that is seen may."""
    spec = FAMILIES if source == "families" else folder_spec(folder)
    objects = objects_of(spec) if source == "families" else folder_objects(folder)
    scenes = some_scenes(spec, objects, 40)
    some = scenes[::8]
    alone = [all_bits(spec, [scene], objects)[0] for scene in some]
    assert len(set(alone)) == len(alone)
    assert all_bits(spec, some, objects) == alone
    assert all_bits(spec, some[::-1], objects) == alone[::-1]
    everything = pack(spec, scenes, objects=objects)
    assert source == "folder" or len(everything.names) > 60
    assert all_bits(spec, scenes, objects)[::8] == alone
    assert all_bits(spec, scenes[::-1], objects)[::-1][::8] == alone
    assert all_bits(spec, [some[2]] * 3, objects) == [alone[2]] * 3


def one_of_each(count: int) -> SceneSpec:
    """A scene that names so many members of a class, for its company alone."""
    (scene,) = some_scenes(replace(FAMILIES, objects=(1, 1)), objects_of(FAMILIES), 1)
    (item,) = scene.objects
    crowd = tuple(replace(item, shape=f"bowl/{i:04d}") for i in range(count))
    return replace(scene, objects=crowd)


def test_hundreds_of_other_models_change_no_bit() -> None:
    """At the far end of a lattice of 7 x 7 x 7, and at its beginning."""
    spec = replace(FAMILIES, objects=(0, 100))
    objects = objects_of(spec)
    (scene,) = some_scenes(FAMILIES, objects, 1)
    first = replace(scene, objects=(replace(scene.objects[0], shape="bag/0007"),))
    last = replace(scene, objects=(replace(scene.objects[0], shape="table/0007"),))
    alone = [all_bits(spec, [s], objects)[0] for s in (first, last)]
    crowd = one_of_each(300)
    crowds = [replace(crowd, objects=crowd.objects[i : i + 100]) for i in (0, 100, 200)]
    together = render(pack(spec, [*crowds, first, last]))
    assert [bits(together, row) for row in (3, 4)] == alone


@pytest.mark.parametrize("limits", [{"MOST_FACES": 1}, {"MOST_FACES": 9000}, {"MOST_MODELS": 3}])
def test_a_batch_cut_into_parts_is_the_same(
    limits: dict[str, int], scenes_of: Scenes, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenes = scenes_of(FAMILIES, 7)
    batch = pack(FAMILIES, scenes)
    whole = render(batch)
    assert len(parts(batch)) == 1
    for name, value in limits.items():
        monkeypatch.setattr(renderer, name, value)
    some = parts(batch)
    assert 1 < len(some) <= 7
    assert sum(map(len, some)) == 7
    assert [i for part in some for i in part.index.tolist()] == batch.index.tolist()
    for part in some:
        shown = {i for i in part.shape.ravel().tolist() if i >= 0}
        assert shown == set(range(len(part.names))), "no models but its own"
        faces = sum(len(part.shape_of(name).triangles) for name in part.names)
        assert len(part) == 1 or faces <= renderer.MOST_FACES
        assert len(part) == 1 or len(part.names) <= renderer.MOST_MODELS
    cut = render(batch)
    for name in vars(whole):
        assert getattr(cut, name).tobytes() == getattr(whole, name).tobytes()


def test_basic_shapes_are_never_cut(scenes_of: Scenes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(renderer, "MOST_FACES", 1)
    spec = DatasetSpec(height=16, width=16, min_visible_pixels=0)
    batch = pack(spec, scenes_of(spec, 4))
    assert parts(batch) == [batch]


def whole_scene(
    scene: SceneSpec, spec: DatasetSpec, shape_of: Callable[[str], Any]
) -> tuple[Array, Array, Array]:
    """Depth, object id and face normal, camera frame, by Embree on one mesh of it all."""
    camera = scene.cameras[0]
    matrix, size = camera.world_from_camera, (spec.height, spec.width)
    rays = pixel_directions(*size, camera.fov_y_degrees).reshape(-1, 3) @ matrix[:3, :3].T
    mesh = scene_mesh(scene, shape_of)
    points, hit, faces = RayMeshIntersector(mesh).intersects_location(
        np.broadcast_to(matrix[:3, 3], rays.shape), rays, multiple_hits=False
    )
    depth, ids = np.full(len(rays), np.nan), np.full(len(rays), -1)
    normal = np.zeros_like(rays)
    counts = [6, *(len(shape_of(item.shape).triangles) for item in scene.objects)]
    depth[hit] = (matrix[:3, 3] - points) @ matrix[:3, 2]
    ids[hit] = np.repeat(np.arange(len(counts)), counts)[faces]
    normal[hit] = mesh.face_normals[faces] @ matrix[:3, :3]
    return depth.reshape(size), ids.reshape(size), normal.reshape(*size, 3)


def check_against_whole_scenes(
    spec: DatasetSpec, scenes: list[SceneSpec], objects: Objects
) -> None:
    truth = render(pack(spec, scenes, objects=objects))
    cast = [whole_scene(scene, spec, objects.shape) for scene in scenes]
    depth, ids, normal = (np.stack(part) for part in zip(*cast, strict=True))
    steps = np.stack([maximum_filter(d, 3) - minimum_filter(d, 3) for d in depth])
    edges = steps > 0.02  # silhouettes, of an object's own parts too
    off = ~(abs(truth.depth - depth) <= 1e-4)
    assert off.mean() <= 2e-3
    assert not (off & ~edges).any(), "depth disagrees away from silhouettes"
    assert ((truth.object_id != ids) & ~edges).mean() < 1e-4, "but where an object meets the floor"
    assert (truth.object_id != ids).mean() < 2e-3
    facing = abs((truth.normal * normal).sum(axis=-1))
    assert np.quantile(facing, 0.01) > 0.9, "smooth normals are near the faces'"
    assert (truth.object_id > 0).mean() > 0.02


@pytest.mark.parametrize("name", ["shapenet", "furniture-256"])
def test_presets_of_models_agree_with_another_engine(name: str, scenes_of: Scenes) -> None:
    spec = replace(preset_spec(name), image_dtype="float32", seed=5)
    check_against_whole_scenes(spec, scenes_of(spec, 4), objects_of(spec))


def test_models_of_a_folder_agree_with_another_engine(folder: Path) -> None:
    spec, objects = folder_spec(folder), folder_objects(folder)
    check_against_whole_scenes(spec, some_scenes(spec, objects, 6), objects)


SCALAR = """
import pickle, sys
from scenegen import renderer
from scenegen.packing import pack
renderer.select_variant = lambda device: "scalar_rgb"
spec, scenes = pickle.load(sys.stdin.buffer)
truth = renderer.render(pack(spec, scenes))
assert "scenegen.wavefront" not in sys.modules
pickle.dump(truth, sys.stdout.buffer)
"""


def test_the_scalar_fallback_draws_models_with_gloss_alike() -> None:
    spec = replace(FAMILIES, height=24, width=24, specular=(0.2, 0.5), shininess=(3.0, 9.0))
    scenes = some_scenes(spec, objects_of(spec), 3)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", SCALAR],
        input=pickle.dumps((spec, scenes)),
        capture_output=True,
        check=False,
        cwd=Path(renderer.__file__).parents[1],
        timeout=120,
    )
    assert done.returncode == 0, done.stderr.decode()
    slow: GroundTruth = pickle.loads(done.stdout)
    fast = render(pack(spec, scenes))
    same = fast.object_id == slow.object_id
    assert same.mean() > 0.997
    assert (fast.object_id > 0).mean() > 0.03
    assert (abs(fast.depth - slow.depth)[same] < 1e-5).mean() > 0.995
    assert (abs(fast.normal - slow.normal).max(axis=-1) < 1e-3)[same].mean() > 0.99
    assert (abs(fast.image - slow.image).max(axis=-1) < 1e-3).mean() > 0.985


def test_path_tracing_is_refused_where_only_the_slow_path_is(
    scenes_of: Scenes, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = DatasetSpec(height=16, width=16, shading="path", spp=1, min_visible_pixels=0)
    batch = pack(spec, scenes_of(spec, 1))
    monkeypatch.setattr(renderer, "select_variant", lambda device: "scalar_rgb")
    with pytest.raises(renderer.BackendError, match="shading path: needs the fast path"):
        renderer.launch(batch)


def test_splits_of_families_share_no_model(tmp_path: Path) -> None:
    by_split = {}
    for split in ("train", "val", "test", "all"):
        spec = replace(FAMILIES, object_split=split, objects=(2, 3), object_radius=(0.06, 0.1))
        models = objects_of(spec).models
        by_split[split] = {name for some in models.values() for name in some}
        assert all(name.split("/")[0] == kind for kind, some in models.items() for name in some)
        make_dataset(tmp_path / f"{split}.h5", spec, 6)
        with h5py.File(tmp_path / f"{split}.h5") as file:
            used = {name.decode() for name in file["object/model"][:].ravel()} - {""}
        assert used <= by_split[split]
        assert len(used) > 10
    train, val, test = (by_split[name] for name in ("train", "val", "test"))
    assert not train & val
    assert not (train | val) & test
    assert train | val | test == by_split["all"]
    assert min(len(train), len(val), len(test)) > 0.05 * len(by_split["all"])
    assert len(train) > len(by_split["all"]) / 2


def test_classes_and_models_are_drawn_uniformly() -> None:
    spec = replace(FAMILIES, objects=(3, 3), object_radius=(0.02, 0.03), shapes=("mug", "can"))
    names = [o.shape for s in some_scenes(spec, objects_of(spec), 150) for o in s.objects]
    mugs = [name for name in names if name.startswith("mug/")]
    assert abs(len(mugs) - len(names) / 2) < 3 * (len(names) / 4) ** 0.5
    assert len(set(names)) > 0.8 * len(names), "of 1000 each, two seldom alike"
    numbers = np.array([int(name.split("/")[1]) for name in names])
    assert np.bincount(numbers // 250, minlength=4).min() > len(names) / 8


def test_drawing_another_class_for_one_object_changes_no_other() -> None:
    """The k-th object's model has a stream of its own."""
    spec = replace(FAMILIES, objects=(3, 3), object_radius=(0.02, 0.03))
    wide, one = (some_scenes(replace(spec, shapes=s), objects_of(replace(spec, shapes=s)), 5)
                 for s in (("mug", "bowl"), ("mug",)))  # fmt: skip
    for mixed, mugs in zip(wide, one, strict=True):
        for a, b in zip(mixed.objects, mugs.objects, strict=True):
            assert a.shape.split("/")[1] == b.shape.split("/")[1]


def test_scene_descriptions_of_models_name_the_file_behind_them(folder: Path) -> None:
    objects = folder_objects(folder)
    scenes = some_scenes(folder_spec(folder), objects, 6)
    for item in (o for scene in scenes for o in scene.objects):
        assert item.mesh == objects.digest(item.shape)
        assert len(item.mesh) == 16
        assert int(item.mesh, 16) >= 0
    built_in = some_scenes(FAMILIES, objects_of(FAMILIES), 2)
    assert {o.mesh for scene in built_in for o in scene.objects} == {""}
    assert built_in_shape(built_in[0].objects[0].shape).name == built_in[0].objects[0].shape


def test_rows_of_a_batch_are_the_batch_of_those_scenes(scenes_of: Scenes) -> None:
    scenes = scenes_of(FAMILIES, 6)
    batch = pack(FAMILIES, scenes)
    for start, end in ((0, 6), (2, 5), (5, 6)):
        some, expected = batch.rows(start, end), pack(FAMILIES, scenes[start:end])
        assert some.names == expected.names
        for name, value in vars(expected).items():
            if isinstance(value, np.ndarray):
                found = getattr(some, name)
                np.testing.assert_array_equal(found, value, err_msg=name)
                assert found.dtype == value.dtype


def test_rows_with_every_slot_used_and_with_none() -> None:
    spec = replace(FAMILIES, objects=(0, 2))
    (scene,) = some_scenes(replace(FAMILIES, objects=(2, 2)), objects_of(FAMILIES), 1)
    batch: SceneBatch = pack(spec, [scene, replace(scene, objects=())])
    assert batch.rows(0, 1).shape.min() == 0
    empty = batch.rows(1, 2)
    assert (empty.names, empty.shape.tolist()) == ((), [[-1, -1]])
    assert bits(render(empty), 0) == bits(render(batch), 1)
