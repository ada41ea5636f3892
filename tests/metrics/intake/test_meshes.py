"""Meshes, and files of layers, become submissions of layers."""

import numpy as np
import pytest
import trimesh
from refusals import refused

from metrics.intake.importing import import_rooms
from metrics.intake.meshes import import_meshes, mesh_layers, read_mesh
from metrics.intake.outputs import OutputError, read_output
from metrics.intake.reading import Reading
from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from metrics.submissions.reader import open_predictions
from scenegen.objects.meshes import limits
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.scene_mesh import scene_parts
from scenegen.rooms.reader import RoomsFile

OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def layered(make_rooms, tmp_path_factory):
    path = tmp_path_factory.mktemp("layered") / "rooms.h5"
    return make_rooms(path, 2, height=40, width=40, objects=(1, 2), seed=5, truth=("layers",),
                      shapes=("sphere", "box", "cone"))  # fmt: skip


def in_camera(room, objects_only=False):
    """Return the scene's mesh in the frame of OpenCV cameras."""
    parts = [p.mesh for p in scene_parts(room.scene) if p.object_id or not objects_only]
    mesh = trimesh.util.concatenate(parts)
    return mesh.apply_transform(OPENCV @ np.linalg.inv(room.world_from_camera))


def imported(folder, layered, change=lambda mesh: mesh, ending=".glb", alone=True, **reading):
    folder.mkdir(exist_ok=True)
    with RoomsFile(layered) as rooms:
        for room in rooms:
            change(in_camera(room, alone)).export(folder / f"{room.index}{ending}")
    out = folder.with_suffix(".h5")
    how = import_meshes(str(folder), layered, out, method="m", reading=Reading(**reading))
    found = score([out], layered, Settings(processes=1)).metrics
    values = {name: one.value for name, one in found.items()}
    if values["solid_iou"] > 0.999:  # whole surfaces, but for the room
        assert values["whole_f_score_0.02"] > (0.98 if alone else 0.2)
        assert (values["whole_chamfer"] < 1.1 * values["whole_chamfer_noise"] < 0.02) == alone
    else:
        assert values["whole_chamfer"] > 5 * values["whole_chamfer_noise"]
    return values["solid_iou"], how


@pytest.mark.parametrize(
    ("ending", "change", "reading"),
    [
        (".glb", lambda m: m, {"alone": False}),
        (".ply", lambda m: m.apply_transform(OPENCV), {"frame": "opengl"}),
        (".obj", lambda m: m.apply_scale(1000), {"scale": 1e-3}),
        (".glb", lambda m: m.apply_scale(7.3), {"alignment": "scale"}),
        (".glb", lambda m: (m.invert(), m)[1], {}),  # inside out
    ],
)
def test_the_true_meshes_come_back(ending, change, reading, layered, tmp_path):
    """With the room, whose planes are open, and without."""
    value, how = imported(tmp_path / "meshes", layered, change, ending, **reading)
    assert value >= 0.999
    assert ("open parts" in how) == ("alone" in reading)
    assert "hint" not in how


def test_an_image_may_have_a_file_for_each_object(layered, tmp_path, monkeypatch):
    faces = []
    with RoomsFile(layered) as rooms:
        for room in rooms:
            (folder := tmp_path / f"image-{room.index}").mkdir()
            for k, mesh in enumerate(in_camera(room, True).split()):
                mesh.export(folder / f"{k}.glb")
                faces.append(len(mesh.faces))
    read = {"method": "m", "reading": Reading(), "overwrite": True}
    import_meshes(f"{tmp_path}/*/*.glb", layered, tmp_path / "p.h5", **read)
    found = score([tmp_path / "p.h5"], layered, Settings(processes=1))
    assert found.metrics["solid_iou"].value >= 0.999
    monkeypatch.setattr(limits, "MOST_FACES", max(faces))
    with refused(BadMeshError, "faces"):
        import_meshes(f"{tmp_path}/*/*.glb", layered, tmp_path / "p.h5", **read)


@pytest.mark.parametrize("turn", [np.diag([1.0, -1, -1]), np.eye(3)[[2, 0, 1]]])
def test_a_turned_mesh_gets_a_hint(turn, layered, tmp_path):
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    value, how = imported(tmp_path / "meshes", layered, lambda m: m.apply_transform(matrix))
    assert value < 0.1
    assert "look like" in how


def test_open_parts_are_paired_in_order():
    lid = trimesh.creation.box((1, 1, 1))
    lid.update_faces(lid.triangles_center[:, 2] < 0.49)  # no front
    lid.apply_translation((0.07, 0.05, -3))
    layers = mesh_layers(lid.vertices, lid.faces, np.zeros(len(lid.faces), bool), 3, 3, 20.0)
    assert np.isnan(layers[1, 1]).all()
    lid = trimesh.util.concatenate([lid, lid.copy().apply_translation((0, 0, -2))])
    layers = mesh_layers(lid.vertices, lid.faces, np.zeros(len(lid.faces), bool), 3, 3, 20.0)
    np.testing.assert_allclose(layers[1, 1, :2], [3.5, 5.5], rtol=1e-6)
    assert np.isnan(layers[1, 1, 2:]).all()


@pytest.mark.parametrize("content", [b"", b"junk", b"glTF" + bytes(40)])
def test_files_that_are_none_are_refused(content, layered, tmp_path):
    for row in range(2):
        (tmp_path / f"{row}.glb").write_bytes(content)
    with refused(BadMeshError):
        import_meshes(str(tmp_path / "*.glb"), layered, tmp_path / "p.h5", method="m",
                      reading=Reading())  # fmt: skip
    assert not (tmp_path / "p.h5").exists()


def test_huge_meshes_are_refused_and_broken_faces_left_out(monkeypatch, tmp_path):
    mesh = trimesh.creation.icosphere(2)
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in mesh.vertices) + "v nan 0 0\n"
    text += "".join(f"f {a} {b} {c}\n" for a, b, c in mesh.faces + 1) + "f 1 2 163\nf 1 2 999\n"
    (tmp_path / "m.obj").write_text(text)
    assert len(read_mesh(tmp_path / "m.obj")[1]) == len(mesh.faces)
    monkeypatch.setattr(limits, "MOST_FACES", 100)
    with refused(BadMeshError):
        read_mesh(tmp_path / "m.obj")


@pytest.mark.parametrize("kind", ["depth", "distance", "points"])
def test_files_of_layers(kind, layered, tmp_path):
    with RoomsFile(layered) as rooms:
        for room in rooms:
            layers = room.truth["layers/depth"].astype(float)
            rays = room.points / room.depth[..., None] * OPENCV.diagonal()[:3]
            values = layers
            if kind == "distance":
                values = layers * np.linalg.norm(rays, axis=-1, keepdims=True)
            elif kind == "points":
                values = layers[..., None] * rays[:, :, None]
            np.save(tmp_path / f"{room.index}.npy", np.nan_to_num(2 * values, nan=-9.0))
    reading = Reading(kind=kind, layered=True, scale=0.5, invalid=(-9.0,), alignment="scale")
    import_rooms(f"{tmp_path}/*.npy", layered, tmp_path / "p.h5", method="m", reading=reading)
    with open_predictions(tmp_path / "p.h5") as found, RoomsFile(layered) as rooms:
        assert (found.kind, found.alignment) == ("layers", "scale")
        for row in range(2):
            true = rooms.read("layers/depth", row)
            np.testing.assert_allclose(found.geometry(row), true, rtol=1e-6)


def test_models_return_layers():
    """Of points, with the number of layers of each pixel, and in another size."""
    points = np.arange(2 * 2 * 3 * 3.0).reshape(2, 2, 3, 3)
    count = np.array([[3, 1], [0, 2]])
    found = read_output({"layers_scale_invariant": points, "layer_count": count}, 4, 4)
    assert (found.kind, found.alignment, found.geometry.shape) == ("layers", "scale", (4, 4, 3))
    np.testing.assert_array_equal(np.isfinite(found.geometry).sum(axis=-1)[::2, ::2], count)
    np.testing.assert_array_equal(found.geometry[0, 0], points[0, 0, :, 2])
    with refused(OutputError):
        read_output({"layers_metric": np.ones((4, 4, 65))}, 4, 4)
