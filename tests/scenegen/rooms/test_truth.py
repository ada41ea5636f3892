"""Truth that `--with` adds: stored, checked, handed on; files without it stay as they were."""

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from h5_edits import put, values
from verified import checks_of

from scenegen import RoomsDataset, open_rooms
from scenegen.common.errors import SpecError
from scenegen.description.specs import TRUTHS, DatasetSpec
from scenegen.layout import FURTHER
from scenegen.objects.catalogue import objects_of
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render
from scenegen.rooms.info import describe
from scenegen.rooms.make import merge_rooms
from scenegen.rooms.truth import View, truth_problems, visible_fraction

COLUMNS = [column.name for columns in FURTHER.values() for column in columns]


@pytest.fixture(scope="module")
def full(make_rooms, tmp_path_factory):
    """Three views of each of three scenes, in shards, with everything; some rays meet nothing."""
    path = tmp_path_factory.mktemp("full") / "set.h5"
    return make_rooms(path, 3, {"shard_size": 2}, height=48, width=40, views=(0.0, 20.0, 40.0),
                      objects=(2, 3), random_reflectance=True, truth=TRUTHS, seed=2,
                      fov_degrees=50.0, object_radius=(0.15, 0.25),
                      min_visible_pixels=5)  # fmt: skip


@pytest.fixture(scope="module")
def merged(full):
    """The same in one file."""
    path = full.with_name("one.h5")
    with open_rooms(full) as rooms:
        merge_rooms(rooms, path)
    return path


def test_what_is_stored(full):
    with open_rooms(full) as rooms:
        overlapping = 0
        for room in rooms:
            assert sorted(room.truth) == sorted(COLUMNS)
            masks, fraction = (
                room.truth[f"object/{n}"] for n in ("amodal_mask", "visible_fraction")
            )
            for k in range(len(room.scene.objects)):
                shown = room.object_id == k + 1
                assert masks[k][shown].all()
                assert fraction[k] == pytest.approx(shown.sum() / masks[k].sum())
            overlapping += (masks.sum(axis=0) > 1).sum()
            hit = room.object_id >= 0
            np.testing.assert_array_equal(np.isnan(room.truth["albedo"]).all(axis=-1), ~hit)
            rho = np.array(
                [room.scene.room_reflectance] + [o.reflectance for o in room.scene.objects]
            )
            np.testing.assert_allclose(
                room.truth["albedo"][hit], rho[room.object_id[hit]], rtol=1e-7
            )
            np.testing.assert_array_equal(room.truth["layers/depth"][..., 0], room.depth)
            np.testing.assert_array_equal(room.truth["layers/object_id"][..., 0], room.object_id)
            ids = room.truth["layers/object_id"]
            np.testing.assert_array_equal(
                masks, [(ids == k + 1).any(axis=-1) for k in range(len(masks))]
            )
            coordinates = room.truth["object_coordinates"]
            np.testing.assert_array_equal(np.isnan(coordinates[..., 0]), room.object_id <= 0)
            assert 0.5 < np.nanmax(np.abs(coordinates)) < 1 + 1e-5
            assert ((room.truth["flow_occluded"] == 1) | hit).all()
            np.testing.assert_array_equal(np.isnan(room.truth["flow"][..., 0]), ~hit)
        assert overlapping > 50, "or silhouettes are only what shows"


def test_masks_are_those_of_each_object_rendered_alone(full):
    """Against scenes whose description has that object only."""
    with open_rooms(full) as rooms:
        spec = replace(rooms.spec, truth=(), objects=(0, 3))
        for room in rooms:
            for k, item in enumerate(room.scene.objects):
                lone = replace(room.scene, objects=(item,), room_reflectance=None)
                batch = pack(spec, [lone], (room.view_index,), objects_of(spec))
                ids = render(batch).object_id[0]
                np.testing.assert_array_equal(room.truth["object/amodal_mask"][k], ids == 1)


def test_all_that_handles_files_knows_it(full, merged, tmp_path, run):
    checks = checks_of(full)
    assert [check for check in (*checks, *checks_of(merged, 1)) if not check.ok] == []
    assert set(TRUTHS) <= {check.name for check in checks}
    described = describe(full)
    assert all(name in described for name in COLUMNS)
    row = RoomsDataset(full, fields=COLUMNS)[1]
    with open_rooms(full) as rooms:
        for name in COLUMNS:
            np.testing.assert_array_equal(row[name], rooms[1].truth[name])
    result = run("export", full, "--format", "webdataset", "--out", "tar")
    assert result.exit_code == 0
    columns = json.loads((tmp_path / "tar" / "config.json").read_text())["columns"]
    assert {name.replace("/", "_") for name in COLUMNS} <= set(columns)


def mask_of_no_object(file):
    row = int((file["object/count"][()] == 2).argmax())
    file["object/amodal_mask"][row, 2, 5, 5] = 1


@pytest.mark.parametrize(
    ("edit", "check"),
    [
        (put("object/amodal_mask", (2, 0), 0), "amodal"),
        (put("object/amodal_mask", (2, 0, 0, 0), 1), "amodal"),
        (put("object/amodal_mask", (2, 0, 20, 20), 7), "amodal"),
        (mask_of_no_object, "amodal"),
        (put("object/visible_fraction", (1, 0), 0.123), "amodal"),
        (values("object_coordinates", lambda stored: stored + 1e-4), "coordinates"),
        (values("flow", lambda stored: stored + 0.01), "flow"),
        (values("flow_occluded", lambda stored: 1 - stored), "flow"),
        (values("albedo", lambda stored: stored + 1e-3), "albedo"),
        (values("layers/depth", lambda stored: stored + 1e-3), "layers"),
        (values("layers/depth", lambda stored: stored[..., ::-1]), "layers"),
        (values("layers/object_id", lambda stored: stored.clip(0)), "layers"),
        (values("layers/entering", lambda stored: -stored), "layers"),
        (put("object/closed", (0, 2), 7), "layers"),
    ],
)
def test_each_is_checked_against_depth_and_poses(edit, check, merged, tmp_path):
    shutil.copy(merged, tmp_path / "one.h5")
    with h5py.File(tmp_path / "one.h5", "r+") as file:
        edit(file)
    failed = {found.name for found in checks_of(tmp_path / "one.h5", 0) if not found.ok}
    assert check in failed


@pytest.mark.parametrize(
    ("settings", "where"), [({"truth": ("depths",)}, "truth"), ({"truth": ("flow",)}, "flow")]
)
def test_refused(settings, where):
    with pytest.raises(SpecError) as error:
        DatasetSpec(**settings)
    assert error.value.where == where


@pytest.mark.parametrize(("depth", "count"), [(1.9, 0), (2.05, 0), (2.2, 1)])
def test_nothing_behind_an_object_shows_in_its_mask(depth, count):
    """Its bounding sphere of radius 0.1 is 2 away; pixels of the mask show what is there."""
    matrix = np.diag([0.1, 0.1, 0.1, 1.0])
    matrix[2, 3] = -2.0
    ids = np.zeros((9, 9), int)
    masks = np.zeros((1, 9, 9), np.uint8)
    masks[0, 3:6, 3:6] = 1
    view = View(np.full((9, 9), depth), np.zeros((9, 9, 3)), ids, np.eye(4), 10.0)
    stored = {
        "object/amodal_mask": masks,
        "object/visible_fraction": visible_fraction(ids, masks),
        "object/world_from_object": matrix[None],
    }
    spec, scene = SimpleNamespace(truth=("amodal",)), SimpleNamespace(objects=[None])
    assert len(list(truth_problems(spec, stored, view, view, scene))) == count
