"""Which models scenes show: drawn uniformly, split by split, each by a stream of its own."""

from dataclasses import replace

import numpy as np
from model_rooms import FAMILIES, folder_objects, folder_spec, some_scenes

from scenegen.objects.catalogue import built_in_shape, objects_of


def test_splits_of_families_share_no_model():
    by_split = {}
    for split in ("train", "val", "test", "all"):
        spec = replace(FAMILIES, object_split=split, objects=(2, 3), object_radius=(0.06, 0.1))
        models = objects_of(spec).models
        by_split[split] = {name for some in models.values() for name in some}
        assert all(name.split("/")[0] == kind for kind, some in models.items() for name in some)
        used = {o.shape for s in some_scenes(spec, objects_of(spec), 6) for o in s.objects}
        assert used <= by_split[split]
        assert len(used) > 10
    train, val, test = (by_split[name] for name in ("train", "val", "test"))
    assert not train & val
    assert not (train | val) & test
    assert train | val | test == by_split["all"]
    assert min(len(train), len(val), len(test)) > 0.05 * len(by_split["all"])
    assert len(train) > len(by_split["all"]) / 2


def test_classes_and_models_are_drawn_uniformly():
    spec = replace(FAMILIES, objects=(3, 3), object_radius=(0.02, 0.03), shapes=("mug", "can"))
    names = [o.shape for s in some_scenes(spec, objects_of(spec), 40) for o in s.objects]
    mugs = [name for name in names if name.startswith("mug/")]
    assert abs(len(mugs) - len(names) / 2) < 3 * (len(names) / 4) ** 0.5
    assert len(set(names)) > 0.9 * len(names), "of 1000 each, two seldom alike"
    numbers = np.array([int(name.split("/")[1]) for name in names])
    assert np.bincount(numbers // 250, minlength=4).min() > len(names) / 10


def test_drawing_another_class_for_one_object_changes_no_other():
    """The k-th object's model has a stream of its own."""
    spec = replace(FAMILIES, objects=(3, 3), object_radius=(0.02, 0.03))
    wide, one = (some_scenes(replace(spec, shapes=s), objects_of(replace(spec, shapes=s)), 5)
                 for s in (("mug", "bowl"), ("mug",)))  # fmt: skip
    for mixed, mugs in zip(wide, one, strict=True):
        for a, b in zip(mixed.objects, mugs.objects, strict=True):
            assert a.shape.split("/")[1] == b.shape.split("/")[1]


def test_scene_descriptions_of_models_name_the_file_behind_them(model_folder):
    objects = folder_objects(model_folder)
    scenes = some_scenes(folder_spec(model_folder), objects, 6)
    for item in (o for scene in scenes for o in scene.objects):
        assert item.mesh == objects.digest(item.shape)
        assert len(item.mesh) == 16
        assert int(item.mesh, 16) >= 0
    built_in = some_scenes(FAMILIES, objects_of(FAMILIES), 2)
    assert {o.mesh for scene in built_in for o in scene.objects} == {""}
    assert built_in_shape(built_in[0].objects[0].shape).name == built_in[0].objects[0].shape
