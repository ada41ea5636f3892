"""Images of models: the same bits in any batch, and agreement with Embree."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_rooms import FAMILIES, folder_objects, folder_spec, some_scenes
from numpy.typing import NDArray
from other_engines import bits, cast_whole_scene
from scipy.ndimage import maximum_filter, minimum_filter

from scenegen.common.errors import BackendError
from scenegen.description.presets import preset_spec
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.rendering import renderer
from scenegen.rendering.packing import SceneBatch, pack
from scenegen.rendering.renderer import parts, render

Array = NDArray[Any]
Scenes = Callable[[DatasetSpec, int], list[SceneSpec]]


def all_bits(spec: DatasetSpec, scenes: list[SceneSpec], objects: Objects) -> list[Any]:
    truth = render(pack(spec, scenes, objects=objects))
    return [bits(truth, row) for row in range(len(scenes))]


@pytest.mark.parametrize("source", ["families", "folder"])
def test_an_image_is_the_same_alone_and_in_any_company(source: str, model_folder: Path) -> None:
    """A model's place in the Mitsuba scene depends on the batch, but no pixel may."""
    spec = FAMILIES if source == "families" else folder_spec(model_folder)
    objects = objects_of(spec) if source == "families" else folder_objects(model_folder)
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
    """A scene with this many bowls, only to fill a batch."""
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


def check_against_whole_scenes(
    spec: DatasetSpec, scenes: list[SceneSpec], objects: Objects
) -> None:
    truth = render(pack(spec, scenes, objects=objects))
    cast = [cast_whole_scene(scene, spec, objects.shape) for scene in scenes]
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


def test_models_of_a_folder_agree_with_another_engine(model_folder: Path) -> None:
    spec, objects = folder_spec(model_folder), folder_objects(model_folder)
    check_against_whole_scenes(spec, some_scenes(spec, objects, 6), objects)


def test_path_tracing_is_refused_where_only_the_slow_path_is(
    scenes_of: Scenes, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = DatasetSpec(height=16, width=16, shading="path", spp=1, min_visible_pixels=0)
    batch = pack(spec, scenes_of(spec, 1))
    monkeypatch.setattr(renderer, "select_variant", lambda device: "scalar_rgb")
    with pytest.raises(BackendError) as refused:
        renderer.launch(batch)
    assert refused.value.where == "shading path"


def test_rows_with_every_slot_used_and_with_none() -> None:
    spec = replace(FAMILIES, objects=(0, 2))
    (scene,) = some_scenes(replace(FAMILIES, objects=(2, 2)), objects_of(FAMILIES), 1)
    batch: SceneBatch = pack(spec, [scene, replace(scene, objects=())])
    assert batch.rows(0, 1).shape.min() == 0
    empty = batch.rows(1, 2)
    assert (empty.names, empty.shape.tolist()) == ((), [[-1, -1]])
    assert bits(render(empty), 0) == bits(render(batch), 1)
