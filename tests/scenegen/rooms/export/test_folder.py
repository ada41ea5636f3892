"""Folders of other tools: read as the tools do, they give our points, masks and pictures back."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.objects.basic_shapes import unit_shape
from scenegen.rooms.export.encoding import Encoding
from scenegen.rooms.export.folder import CONVENTIONS, export_folder
from scenegen.rooms.export.formats import FOLDER_FORMATS
from tests.support.loaders import check_srgb

ROWS = [0, 1, 5, 3, 2]  # both views of scenes 0 and 1, one of scene 2
FLAT = ("box", "pyramid", "octahedron")  # whose meshes are small
FORMS = sorted({*FOLDER_FORMATS} - {"stereo"})  # of rooms that are no pairs
PICTURES = sorted({*FORMS} - {"glb"})
STEP = 1e-4  # scene units of a depth


@pytest.fixture(scope="module")
def path(make_rooms, tmp_path_factory):
    """Eight images in two views, higher than wide; in some pixels nothing."""
    folder = tmp_path_factory.mktemp("views")
    size = {"height": 40, "width": 32, "min_visible_pixels": 5}
    return make_rooms(folder / "x.h5", 4, seed=8, views=(0.0, 35.0), fov_degrees=60.0,
                      objects=(2, 3), random_reflectance=True, shapes=FLAT, **size)  # fmt: skip


@pytest.fixture(scope="module")
def out(path, tmp_path_factory):
    """Return the folder of a format, exported once."""
    made = {}

    def folder(form):
        if form not in made:
            made[form] = tmp_path_factory.mktemp("out") / form
            with open_rooms(path) as rooms:
                assert np.isnan([rooms[row].depth for row in ROWS]).any()
                export_folder(rooms, form, made[form], ROWS)
        return made[form]

    return folder


def shown(path):
    """The exported rows, by number."""
    with open_rooms(path) as rooms:
        return {row: rooms[row] for row in ROWS}


def pixels(path):
    return np.asarray(Image.open(path))


def unprojected(depth, matrix, first_center):
    """The points of a depth map for cameras with y down and z forward; `matrix` is K."""
    rows, columns = np.indices(depth.shape)
    homogeneous = np.stack([columns + first_center, rows + first_center, 0 * rows + 1], axis=-1)
    return homogeneous @ np.linalg.inv(matrix).T * depth[..., None]


def check_points(points, room, step=STEP):
    """World points of all hits are ours, but for the steps of the depth."""
    hit = room.object_id >= 0
    assert np.abs(points - room.points_world)[hit].max() < step


def test_nerfstudio(path, out):
    rooms, seen = shown(path), []
    for folder in sorted(out("nerfstudio").glob("scene-*")):
        about = json.loads((folder / "transforms.json").read_text())
        ours_from_theirs = np.linalg.inv([*about["applied_transform"], [0, 0, 0, 1]])
        assert ours_from_theirs[:3, :3] @ (0, 0, 1) == pytest.approx((0, 1, 0)), "z up is y up"
        matrix = np.array([[about["fl_x"], 0, about["cx"]], [0, about["fl_y"], about["cy"]],
                           [0, 0, 1]])  # fmt: skip
        clouds = []
        for frame in about["frames"]:
            row = int(frame["file_path"][-10:-4])
            seen.append(row)
            depth = pixels(folder / frame["depth_file_path"]) * about["depth_unit_scale_factor"]
            assert ((depth == 0) == (rooms[row].object_id < 0)).all()
            local = unprojected(depth, matrix, 0.5) * (1, -1, -1)  # OpenGL
            pose = ours_from_theirs @ frame["transform_matrix"]
            check_points(local @ pose[:3, :3].T + pose[:3, 3], rooms[row])
            check_srgb(pixels(folder / frame["file_path"]).astype(float), rooms[row].radiance)
            normal = pixels(folder / frame["normal_file_path"]) / 255 * 2 - 1
            assert np.abs(normal - rooms[row].normal).max() <= 1 / 255 + 1e-6
            clouds.append(rooms[row].points_world[rooms[row].object_id >= 0])
        cloud = trimesh.load(folder / about["ply_file_path"])
        back = cloud.vertices @ ours_from_theirs[:3, :3].T
        np.testing.assert_allclose(back, np.concatenate(clouds), atol=1e-6)
    assert sorted(seen) == sorted(ROWS)


def check_colmap(cameras, images, points, rooms):
    """Of each image its K, (R, t), name, and observations (x, y, point); of points their place.

    Every observation is the projection of its point, and the point lies on what the image shows.
    """
    tracks = {}
    for name, (rotation, translation), camera, observed in images:
        matrix, room = cameras[camera], rooms[int(name[:-4])]
        places = np.array([points[point] for *_, point in observed])
        local = places @ np.array(rotation).T + translation
        found = local @ matrix.T
        expected = np.array([(x, y) for x, y, _ in observed])
        np.testing.assert_allclose(found[:, :2] / found[:, 2:], expected, atol=1e-4)
        nearest = np.floor(expected).astype(int)
        depth = room.depth[nearest[:, 1], nearest[:, 0]]
        exact = np.abs(expected - nearest - 0.5).max(axis=1) < 1e-4
        assert exact.sum() >= (room.object_id >= 0).sum(), "all surfels of the view itself"
        np.testing.assert_allclose(local[exact, 2], depth[exact], atol=1e-4)
        close = np.abs(local[:, 2] - depth) < 0.1
        assert close.mean() > 0.97, "and what is seen from elsewhere lies on the surface"
        for *_, point in observed:
            tracks.setdefault(point, []).append(name)
    assert set(tracks) == set(points)
    return tracks


def test_colmap_text_by_hand(path, out):
    rooms, several = shown(path), 0
    for folder in sorted(out("colmap").glob("scene-*")):
        lines = {
            name: [line for line in text.read_text().splitlines() if not line.startswith("#")]
            for name in ("cameras", "images", "points3D")
            for text in [folder / "sparse/0" / f"{name}.txt"]
        }
        cameras = {}
        for line in lines["cameras"]:
            number, model, width, height, *values = line.split()
            assert (model, int(height), int(width)) == ("PINHOLE", 40, 32)
            fx, fy, cx, cy = map(float, values)
            cameras[number] = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        points = {line.split()[0]: np.array(line.split()[1:4], float) for line in lines["points3D"]}
        images = []
        for about, observed in zip(lines["images"][::2], lines["images"][1::2], strict=True):
            _, *numbers, camera, name = about.split()
            w, x, y, z, *translation = map(float, numbers)
            words = observed.split()
            triples = zip(words[::3], words[1::3], words[2::3], strict=True)
            seen = [(float(u), float(v), point) for u, v, point in triples]
            rotation = trimesh.transformations.quaternion_matrix((w, x, y, z))[:3, :3]
            images.append((name, (rotation, translation), camera, seen))
            check_srgb(
                pixels(folder / "images" / name).astype(float), rooms[int(name[:-4])].radiance
            )
        tracks = check_colmap(cameras, images, points, rooms)
        several += sum(len(track) > 1 for track in tracks.values())
        for line in lines["points3D"]:
            number, *_ = line.split()
            track = np.array(line.split()[8:], int).reshape(-1, 2)
            assert all(images[i - 1][3][k][2] == number for i, k in track)
    assert several > 500, "points are seen from two views"


def test_colmap_by_pycolmap(path, out):
    pycolmap = pytest.importorskip("pycolmap")
    rooms = shown(path)
    for folder in sorted(out("colmap").glob("scene-*")):
        model = pycolmap.Reconstruction(str(folder / "sparse/0"))
        cameras = {k: camera.calibration_matrix() for k, camera in model.cameras.items()}
        points = {k: point.xyz for k, point in model.points3D.items()}
        images = []
        for image in model.images.values():
            pose = image.cam_from_world().matrix()
            observed = [(*p.xy, p.point3D_id) for p in image.points2D]
            images.append((image.name, (pose[:, :3], pose[:, 3]), image.camera_id, observed))
        check_colmap(cameras, images, points, rooms)
        assert model.compute_mean_reprojection_error() < 1e-3


@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
def test_coco_by_pycocotools(path, out, capsys):
    coco_api = pytest.importorskip("pycocotools.coco")
    coco = coco_api.COCO(str(out("coco") / "annotations.json"))
    capsys.readouterr()
    for row, room in shown(path).items():
        (image,) = coco.loadImgs([row])
        check_srgb(pixels(out("coco") / "images" / image["file_name"]).astype(float), room.radiance)
        ids = np.zeros(room.object_id.shape, int)
        annotations = coco.loadAnns(coco.getAnnIds(imgIds=[row]))
        assert len(annotations) == len(room.scene.objects)
        for about in annotations:
            mask = coco.annToMask(about)
            ids[mask > 0] = about["object_id"]
            encoded = coco.annToRLE(about)
            masks = coco_api.maskUtils
            assert about["area"] == masks.area(encoded)
            assert about["bbox"] == masks.toBbox(encoded).tolist()
            (category,) = coco.loadCats([about["category_id"]])
            assert category["name"] == room.scene.objects[about["object_id"] - 1].name
        np.testing.assert_array_equal(ids, room.object_id.clip(0))


def test_bop(path, out):
    engine = pytest.importorskip("trimesh.ray.ray_pyembree")
    rooms, seen, models = shown(path), [], {}
    about = json.loads((out("bop") / CONVENTIONS).read_text())["models"]
    info = json.loads((out("bop") / "models/models_info.json").read_text())
    for number, model in info.items():
        mesh = trimesh.load(out("bop") / f"models/obj_{int(number):06d}.ply")
        models[int(number)] = mesh
        scale = about[number]["scale"] * 1000
        corners = unit_shape(about[number]["shape"]).triangles.reshape(-1, 3)
        low, high = corners.min(axis=0) * scale, corners.max(axis=0) * scale
        assert [model[f"size_{axis}"] for axis in "xyz"] == pytest.approx(
            (high - low)[[0, 2, 1]].tolist(), abs=1e-3
        )
        assert [model[f"min_{axis}"] for axis in "xyz"] == pytest.approx(
            [-model[f"size_{axis}"] / 2 for axis in "xyz"], abs=1e-3
        )
        assert model["diameter"] <= 2.0001 * scale
    for folder in sorted((out("bop") / "test").iterdir()):
        names = ("scene_camera", "scene_gt", "scene_gt_info")
        cameras, poses, infos = (json.loads((folder / f"{n}.json").read_text()) for n in names)
        for key, camera in cameras.items():
            row = int(key)
            room = rooms[row]
            seen.append(row)
            check_srgb(pixels(folder / f"rgb/{row:06d}.png").astype(float), room.radiance)
            depth = pixels(folder / f"depth/{row:06d}.png") * camera["depth_scale"]
            matrix = np.reshape(camera["cam_K"], (3, 3))
            local = unprojected(depth, matrix, 0.0)
            rotation = np.reshape(camera["cam_R_w2c"], (3, 3))
            world = (local - camera["cam_t_w2c"]) @ rotation / 1000  # z up
            check_points(world[..., [0, 2, 1]] * (1, 1, -1), room)
            assert len(poses[key]) == len(infos[key]) == len(room.scene.objects)
            for k, (pose, meta) in enumerate(zip(poses[key], infos[key], strict=True)):
                name = f"{row:06d}_{k:06d}.png"
                whole, visible = (
                    pixels(folder / kind / name) > 0 for kind in ("mask", "mask_visib")
                )
                np.testing.assert_array_equal(visible, room.object_id == k + 1)
                assert whole[visible].all()
                turned = np.reshape(pose["cam_R_m2c"], (3, 3))
                rays = (local[visible] / local[visible][:, 2:]) @ turned  # in the model's frame
                eye = np.broadcast_to(-np.array(pose["cam_t_m2c"]) @ turned, rays.shape)
                hits, index, _ = engine.RayMeshIntersector(
                    models[pose["obj_id"]]
                ).intersects_location(eye, rays, multiple_hits=False)
                assert len(index) > 0.9 * visible.sum(), "all but silhouettes"
                found = (hits @ turned.T + pose["cam_t_m2c"])[:, 2]
                assert np.median(np.abs(found - depth[visible][index])) < 0.1, "millimetres"
    assert sorted(seen) == sorted(ROWS)
    targets = json.loads((out("bop") / "test_targets_bop19.json").read_text())
    assert sum(t["inst_count"] for t in targets) == sum(
        len(r.scene.objects) for r in rooms.values()
    )


@pytest.mark.parametrize("source", ["shapes", pytest.param("families", marks=pytest.mark.slow)])
def test_bop_counts_what_lies_beyond_the_edge(source, make_rooms, tmp_path):
    """As BOP's scripts do, from the exported folder alone: ray casts on three by three images."""
    engine = pytest.importorskip("trimesh.ray.ray_pyembree")
    shapes = FLAT if source == "shapes" else ("chair", "lamp")
    size = {"height": 32, "width": 40, "object_radius": (0.2, 0.22), "objects": (3, 3)}
    make_rooms(tmp_path / "x.h5", 6, seed=3, shapes=shapes, source=source, min_visible_pixels=0,
               allow_cropped=True, **size)  # fmt: skip
    with open_rooms(tmp_path / "x.h5") as rooms:
        export_folder(rooms, "bop", tmp_path / "out")
        ids = [room.object_id for room in rooms]
    cropped, targets = 0, {}
    for scene, object_id in enumerate(ids):
        names = ("scene_camera", "scene_gt", "scene_gt_info")
        folder, key = tmp_path / f"out/test/{scene:06d}", str(scene)
        camera, poses, infos = (json.loads((folder / f"{n}.json").read_text())[key] for n in names)
        rows, columns = np.mgrid[-32:64, -40:80]
        pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1).reshape(-1, 3)
        rays = pixels @ np.linalg.inv(np.reshape(camera["cam_K"], (3, 3))).T
        for k, (pose, info) in enumerate(zip(poses, infos, strict=True)):
            turned = np.reshape(pose["cam_R_m2c"], (3, 3))
            eye = np.broadcast_to(-np.array(pose["cam_t_m2c"]) @ turned, rays.shape)
            mesh = trimesh.load(tmp_path / f"out/models/obj_{pose['obj_id']:06d}.ply")
            wide = engine.RayMeshIntersector(mesh).intersects_any(eye, rays @ turned)
            shown = int((object_id == k + 1).sum())
            assert info["px_count_all"] == pytest.approx(wide.sum(), abs=4)
            assert info["px_count_visib"] == shown
            assert info["visib_fract"] == shown / info["px_count_all"]
            expected = [(columns.ravel()[wide], rows.ravel()[wide]),
                        np.nonzero(object_id == k + 1)[::-1]]  # fmt: skip
            for name, (x, y) in zip(("bbox_obj", "bbox_visib"), expected, strict=True):
                box = [x.min(), y.min(), np.ptp(x), np.ptp(y)] if shown else [-1] * 4
                assert info[name] == pytest.approx(box, abs=2 * (name == "bbox_obj"))
            cropped += info["px_count_all"] > info["px_count_valid"]
            if info["visib_fract"] >= 0.1:
                targets[scene, pose["obj_id"]] = targets.get((scene, pose["obj_id"]), 0) + 1
    listed = json.loads((tmp_path / "out/test_targets_bop19.json").read_text())
    assert {(t["scene_id"], t["obj_id"]): t["inst_count"] for t in listed} == targets
    assert cropped > 5


def test_what_is_hidden_has_no_annotation_of_coco(make_rooms, tmp_path):
    make_rooms(tmp_path / "x.h5", 30, seed=1, objects=(3, 3), shapes=FLAT, height=24, width=24,
               min_visible_pixels=0, allow_cropped=True)  # fmt: skip
    with open_rooms(tmp_path / "x.h5") as rooms:
        shown = sum(len(set(room.object_id.flat) - {-1, 0}) for room in rooms)
        assert shown < 3 * len(rooms)
        export_folder(rooms, "coco", tmp_path / "out")
    listed = json.loads((tmp_path / "out/annotations.json").read_text())["annotations"]
    assert len(listed) == shown
    assert all(item["area"] > 0 < min(item["bbox"][2:]) for item in listed)


def test_moge(path, out):
    rooms, folder = shown(path), out("moge")
    for name in (folder / ".index.txt").read_text().split():
        room = rooms[int(name[-6:])]
        coded = Image.open(folder / name / "depth.png")
        near, far = float(coded.info["near"]), float(coded.info["far"])
        codes = np.asarray(coded).astype(float)
        depth = near * (far / near) ** ((codes - 1) / 65533)
        hit = room.object_id >= 0
        assert (codes[~hit] == 65535).all(), "infinite"
        assert codes[hit].min() == 1
        off = np.abs(depth / room.depth - 1)[hit].max()
        assert off <= 0.501 * np.log(far / near) / 65533 + 1e-7, "half a step"
        matrix = np.array(json.loads((folder / name / "meta.json").read_text())["intrinsics"])
        assert matrix[0, 2] == matrix[1, 2] == 0.5
        matrix = matrix * [[32], [40], [1]]
        local = unprojected(np.where(hit, depth, 0), matrix, 0.5) * (1, -1, -1)
        pose = room.world_from_camera
        check_points(local @ pose[:3, :3].T + pose[:3, 3], room)
        normal = read_png16(folder / name / "normal.png") / 65535 * 2 - 1
        assert np.abs(normal - room.normal)[hit].max() < 2 / 65535
        segments = Image.open(folder / name / "segmentation.png")
        np.testing.assert_array_equal(np.asarray(segments).astype(int) - 1, room.object_id)
        labels = json.loads(segments.info["labels"])
        assert max(labels.values()) == len(room.scene.objects) + 1
        assert labels["background"] == 0, "MoGe scores no segment of this name"
        jpeg = pixels(folder / name / "image.jpg").astype(float)
        truth = 255 * np.where(room.radiance <= 0.0031308, 12.92 * room.radiance,
                               1.055 * room.radiance ** (1 / 2.4) - 0.055)  # fmt: skip
        assert np.abs(jpeg - truth).mean() < 4


def read_png16(path):
    import png

    width, height, rows, about = png.Reader(bytes=path.read_bytes()).read()
    return np.array([list(row) for row in rows]).reshape(height, width, about["planes"])


@pytest.mark.parametrize("form", FORMS)
def test_conventions_are_in_the_folder_and_it_can_be_written_again(form, path, tmp_path):
    with open_rooms(path) as rooms:
        export_folder(rooms, form, tmp_path / "out", [0, 1])
        before = contents(tmp_path / "out")
        about = json.loads(before[CONVENTIONS])
        assert (about["format"], about["source"]["fingerprint"]) == (form, rooms.fingerprint)
        assert {"pixel_centers", "pictures"} <= set(about)
        with pytest.raises(FileExistsError):
            export_folder(rooms, form, tmp_path / "out", [0])
        export_folder(rooms, form, tmp_path / "out", [3], overwrite=True)
        assert contents(tmp_path / "out").keys() != before.keys()
        export_folder(rooms, form, tmp_path / "out", [0, 1], overwrite=True)
        assert contents(tmp_path / "out") == before, "the same bytes, and nothing of others"
        (tmp_path / "out" / "mine").mkdir()
        with pytest.raises(FileExistsError):
            export_folder(rooms, form, tmp_path / "out", [0, 1], overwrite=True)


def contents(folder):
    files = (file for file in folder.rglob("*") if file.is_file())
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


@pytest.mark.parametrize("form", FORMS)
def test_what_does_not_fit_is_refused_and_nothing_is_left(form, path, tmp_path):
    too_bright = Encoding(exposure=50.0)
    too_deep = replace(Encoding(), depth_unit=1e-6)
    with open_rooms(path) as rooms:
        for encoding, forms in ((too_bright, PICTURES), (too_deep, ("nerfstudio", "bop"))):
            if form in forms:
                with pytest.raises(SpecError) as refused:
                    export_folder(rooms, form, tmp_path / "out", encoding=encoding)
                assert refused.value.hint.startswith("use --")
        for rows in ([], [99], [0, 0]):
            with pytest.raises(SpecError):
                export_folder(rooms, form, tmp_path / "out", rows)
    assert list(tmp_path.iterdir()) == []


def test_the_command(run, path):
    result = run("export", path, "--format", "coco", "--items", "0-2")
    assert result.exit_code == 0
    about = json.loads(Path("x-coco/annotations.json").read_text())
    assert [image["id"] for image in about["images"]] == [0, 1, 2]
