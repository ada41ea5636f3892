"""Own colours of meshes: those that a viewer shows, at the right corners, rendered as albedo."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from scenegen import DatasetSpec, open_rooms
from scenegen.objects.meshes.appearance.colors import corner_colors
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.sources import object_source
from scenegen.rooms.make import make_dataset
from tests.support.verified import checks_of

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def textured(size=(1.0, 2.0, 1.0)):
    """A box whose texture is red in its left and blue in its right half; u is 0.25 where x < 0."""
    box = trimesh.creation.box(size)
    box.unmerge_vertices()
    uv = np.stack([np.where(box.vertices[:, 0] < 0, 0.25, 0.75), 0 * box.vertices[:, 0] + 0.5], 1)
    pixels = np.zeros((8, 16, 3), np.uint8)
    pixels[:, :8, 0], pixels[:, 8:, 2] = 255, 255
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(pixels))
    box.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return box


def plain(color):
    box = trimesh.creation.box((1, 1, 1))
    box.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(baseColorFactor=color)
    )
    return box


def of(mesh, suffix, up="y"):
    """Corners and their colours of a mesh that is written and read, cleaned as the library does."""
    from scenegen.objects.meshes.clean import clean_mesh
    from scenegen.objects.meshes.read import parse_mesh

    data = mesh.export(file_type=suffix[1:])
    data = data.encode() if isinstance(data, str) else data
    clean = clean_mesh(*parse_mesh(data, suffix), up)
    colors = corner_colors(data, suffix, up, clean.vertices, clean.faces, {})
    return clean.vertices[clean.faces], colors


def test_textures_are_sampled_at_the_corners():
    corners, colors = of(textured(), ".glb")
    expected = np.where(corners[..., :1] < 0, RED, BLUE)
    np.testing.assert_allclose(colors, expected, atol=1e-6)


def test_base_colours_are_linear_and_nodes_are_placed():
    scene = trimesh.Scene()
    scene.add_geometry(plain([255, 0, 0, 255]), transform=np.eye(4))
    moved = trimesh.transformations.translation_matrix((3, 0, 0))
    scene.add_geometry(plain([0, 0, 128, 255]), transform=moved)
    corners, colors = of(scene, ".glb")
    expected = np.where(corners[..., :1] < 0, RED, (0, 0, 128 / 255))
    np.testing.assert_allclose(colors, expected, atol=3e-3)


@pytest.mark.parametrize("up", ["y", "z"])
def test_vertex_colours_of_ply_are_srgb(up):
    box = trimesh.creation.box((1, 2, 3))
    code = np.where(box.vertices[:, 2:] > 0, 188, 0).astype(np.uint8)
    box.visual.vertex_colors = np.concatenate([code, code, code, 0 * code + 255], axis=1)
    corners, colors = of(box, ".ply", up)
    top = corners[..., 1] > 0 if up == "z" else corners[..., 2] > 0
    linear = ((188 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(colors, np.where(top[..., None], linear, 0) * np.ones(3), atol=1e-5)


def test_without_colours_all_are_one():
    assert (of(trimesh.creation.icosphere(1), ".stl")[1] == 1).all()
    with pytest.raises(BadMeshError):
        corner_colors(b"glTF", ".glb", "y", np.eye(3), np.array([[0, 1, 2]]), {})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    root = tmp_path_factory.mktemp("objects")
    (root / "box").mkdir()
    textured().export(root / "box" / "tall.glb")
    textured((1.0, 1.0, 1.5)).export(root / "box" / "low.glb")
    return root


@pytest.mark.parametrize("settings", [{}, {"shadows": True, "spp": 2, "specular": (0.1, 0.2)}])
def test_rooms_show_them_and_albedo_is_truth(folder, tmp_path, settings):
    source = object_source("shapes", objects_root=str(folder))
    spec = DatasetSpec(height=48, width=48, own_reflectance=True, image_dtype="float32",
                       min_visible_pixels=20, **settings, **source.settings)  # fmt: skip
    make_dataset(tmp_path / "x.h5", spec, 3, objects=source.objects)
    with open_rooms(tmp_path / "x.h5") as rooms:
        assert "albedo" in rooms.spec.truth
        for room in rooms:
            on = room.object_id > 0
            albedo = room.truth["albedo"][on]
            share = albedo[:, [0, 2]] / 0.8
            np.testing.assert_allclose(share.sum(axis=1), 1, atol=1e-5)
            np.testing.assert_allclose(albedo[:, 1], 0, atol=1e-6)
            np.testing.assert_allclose(room.truth["albedo"][room.object_id == 0], 0.8, rtol=1e-6)
    assert all(check.ok for check in checks_of(tmp_path / "x.h5", objects=source.objects))


def test_colours_are_blended_between_the_corners(tmp_path):
    """Colours that are linear in the place at all corners are so on the whole surface."""
    extents = np.array([1.0, 2.0, 1.4])
    box = trimesh.creation.box(extents)
    codes = (255 * (box.vertices > 0)).astype(np.uint8)
    box.visual.vertex_colors = np.concatenate([codes, np.full((8, 1), 255, np.uint8)], axis=1)
    (tmp_path / "objects" / "box").mkdir(parents=True)
    box.export(tmp_path / "objects" / "box" / "cube.glb")
    source = object_source("shapes", objects_root=str(tmp_path / "objects"))
    spec = DatasetSpec(height=48, width=48, own_reflectance=True, truth=("coordinates",),
                       **source.settings)  # fmt: skip
    make_dataset(tmp_path / "x.h5", spec, 2, objects=source.objects)
    radius = np.linalg.norm(extents) / 2
    with open_rooms(tmp_path / "x.h5") as rooms:
        for room in rooms:
            on = room.object_id > 0
            place = room.truth["object_coordinates"][on] * radius / extents
            np.testing.assert_allclose(room.truth["albedo"][on], 0.8 * (place + 0.5), atol=1e-4)
