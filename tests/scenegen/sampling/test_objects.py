"""Which models scenes show: drawn uniformly, split by split, each by a stream of its own."""

from dataclasses import replace

from model_rooms import FAMILIES, some_scenes

from scenegen.objects.catalogue import objects_of


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
