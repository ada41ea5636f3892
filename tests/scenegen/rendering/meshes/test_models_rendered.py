"""Images of models: the same bits in any batch, and agreement with Embree."""

from dataclasses import replace

import pytest
from model_rooms import FAMILIES, folder_objects, folder_spec, some_scenes
from other_engines import bits

from scenegen.common.errors import BackendError
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import objects_of
from scenegen.rendering import renderer
from scenegen.rendering.packing import SceneBatch, pack
from scenegen.rendering.renderer import parts, render


def all_bits(spec, scenes, objects):
    truth = render(pack(spec, scenes, objects=objects))
    return [bits(truth, row) for row in range(len(scenes))]


@pytest.mark.parametrize("source", ["families", pytest.param("folder", marks=pytest.mark.slow)])
def test_an_image_is_the_same_alone_and_in_any_company(source, model_folder):
    """A model's place in the Mitsuba scene depends on the batch, but no pixel may."""
    spec = FAMILIES if source == "families" else folder_spec(model_folder)
    objects = objects_of(spec) if source == "families" else folder_objects(model_folder)
    scenes = some_scenes(spec, objects, 20)
    some = scenes[::5]
    alone = [all_bits(spec, [scene], objects)[0] for scene in some]
    assert len(set(alone)) == len(alone)
    assert source == "folder" or len(pack(spec, scenes, objects=objects).names) > 30
    assert all_bits(spec, scenes, objects)[::5] == alone
    assert all_bits(spec, some[::-1], objects) == alone[::-1]


@pytest.mark.parametrize(
    "limits",
    [
        {"MOST_MODELS": 3},
        pytest.param({"MOST_FACES": 9000}, marks=pytest.mark.slow),
        pytest.param({"MOST_DRAWN": 9000}, marks=pytest.mark.slow),
    ],
)
def test_a_batch_cut_into_parts_is_the_same(limits, scenes_of, monkeypatch):
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
        counts = [len(part.shape_of(name).triangles) for name in part.names]
        drawn = sum(counts[i] for i in part.shape.ravel().tolist() if i >= 0)
        assert len(part) == 1 or drawn <= renderer.MOST_DRAWN
    cut = render(batch)
    for name in whole.pixels():
        assert getattr(cut, name).tobytes() == getattr(whole, name).tobytes()
    spec = DatasetSpec(height=16, width=16, min_visible_pixels=0)
    basic = pack(spec, scenes_of(spec, 4))
    assert parts(basic) == [basic], "basic shapes are never cut"


def test_path_tracing_is_refused_where_only_the_slow_path_is(scenes_of, monkeypatch):
    spec = DatasetSpec(height=16, width=16, shading="path", spp=1, min_visible_pixels=0)
    batch = pack(spec, scenes_of(spec, 1))
    monkeypatch.setattr(renderer, "select_variant", lambda device: "scalar_rgb")
    with pytest.raises(BackendError) as refused:
        renderer.trace(batch, ["image"])
    assert refused.value.where == "shading path"


def test_rows_with_every_slot_used_and_with_none():
    spec = replace(FAMILIES, objects=(0, 2))
    (scene,) = some_scenes(replace(FAMILIES, objects=(2, 2)), objects_of(FAMILIES), 1)
    batch: SceneBatch = pack(spec, [scene, replace(scene, objects=())])
    assert batch.rows(slice(0, 1)).shape.min() == 0
    empty = batch.rows([1])
    assert (empty.names, empty.shape.tolist()) == ((), [[-1, -1]])
    assert bits(render(empty), 0) == bits(render(batch), 1)
