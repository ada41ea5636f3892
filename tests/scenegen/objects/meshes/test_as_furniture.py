"""Meshes as furniture: their own textures and colours, their size and front, rooms with them."""

import base64
import io
import json
import struct
import zlib

import h5py
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from scenegen import open_rooms
from scenegen.common.srgb import decoded, encoded
from scenegen.objects.catalogue import changed_meshes, furniture_models
from scenegen.objects.families.members import MEMBERS
from scenegen.objects.furniture.furnishing import CLAMP, MIRROR, REPEAT, furnishing
from scenegen.objects.furniture.shapes import piece
from scenegen.objects.meshes import limits
from scenegen.objects.meshes.appearance import materials, textures
from scenegen.objects.meshes.appearance.colors import corner_colors
from scenegen.objects.meshes.as_furniture import mesh_furniture
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.listing import ModelFile, ModelFolder
from scenegen.objects.meshes.store import MeshStore
from scenegen.objects.sources import object_source
from tests.support.verified import checks_of

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
COLORS = [[200, 10, 10], [10, 200, 10]], [[10, 10, 200], [200, 200, 200]]  # lower row last


def store_of(path, kind="folder"):
    """A folder whose only model is this file, as "thing/a"."""
    return named(path, "thing/a", kind)


def named(path, name, kind="folder"):
    kept = ModelFile(name, path)
    return MeshStore(ModelFolder(kind, "y", (name[:-2],), {name[:-2]: (kept,)}), None)


def quad(folder, picture="picture.png", material="map_Kd"):
    """A square with a picture of four colours, as files in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    place = folder / picture.replace("\\", "/")
    place.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.array(COLORS, np.uint8)).save(place)
    text = f"newmtl m\nKd 1 1 1\n{material} {picture}\n" if material else "newmtl m\nKd 1 0 0\n"
    (folder / "a.mtl").write_text(text)
    path = folder / "a.obj"
    path.write_text(f"mtllib a.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3 4/4\n")
    return path


def shown(paint, corners, point):
    """The linear colour at a point of a square in the plane z = 0, of the nearest pixel."""
    for triangle, uv, number in zip(corners, paint.uv, paint.texture, strict=True):
        a, b, c = triangle[:, :2]
        s, t = np.linalg.solve(np.stack([b - a, c - a], axis=1), np.subtract(point, a))
        if min(s, t, 1 - s - t) > -1e-9:
            u, v = uv[0] + s * (uv[1] - uv[0]) + t * (uv[2] - uv[0])
            color = paint.textures[number].color
            rows, columns = color.shape[:2]
            return color[int(v % 1 * rows), int(u % 1 * columns)]
    raise AssertionError(point)


@pytest.mark.parametrize(
    "picture", ["picture.png", "maps/p.png", "../images/p.png", "..\\i\\p.png"]
)
def test_pictures_beside_a_model_lie_where_its_file_says(tmp_path, picture):
    store = store_of(quad(tmp_path / "root" / "models", picture))
    paint, mesh = store.paint("thing/a"), store.shape("thing/a").mesh
    corners = mesh.vertices[mesh.faces].astype(float)
    half = corners.max() / 2
    expected = np.array(COLORS[::-1], float) / 255
    expected = np.where(expected > 0.04045, ((expected + 0.055) / 1.055) ** 2.4, expected / 12.92)
    for row, y in enumerate((-half, half)):
        for column, x in enumerate((-half, half)):
            np.testing.assert_allclose(
                shown(paint, corners, (x, y)), expected[row, column], atol=1e-6
            )


@pytest.mark.parametrize("picture", ["../../secret.png", "{root}/secret.png"])
def test_files_elsewhere_are_not_read(tmp_path, picture, monkeypatch):
    path = quad(tmp_path / "root" / "models", "own.png")
    Image.new("RGB", (2, 2), "red").save(tmp_path / "secret.png")
    mtl = path.with_name("a.mtl")
    mtl.write_text(mtl.read_text().replace("own.png", picture.format(root=tmp_path)))
    read, real = [], textures.read_bytes
    monkeypatch.setattr(textures, "read_bytes", lambda p: (read.append(p.name), real(p))[1])
    with pytest.warns(UserWarning, match="secret.png"):
        assert len(store_of(path).paint("thing/a").textures) == 1
    assert read == ["a.obj", "a.mtl"]


@given(st.lists(st.tuples(*2 * [st.floats(0.05, 1.0)]), min_size=5, max_size=9))
def test_coordinates_follow_the_surface_however_polygons_are_cut(points):
    angles = 2 * np.pi * np.arange(len(points)) / len(points)
    radii = np.array(points)[:, 0]
    flat = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    theirs = np.stack([0 * flat, flat, np.roll(flat, -1, axis=0)], axis=1)  # a fan
    theirs = np.concatenate([theirs, np.zeros((*theirs.shape[:2], 1))], axis=2)
    matrix = np.array([[0.5, 0.2], [-0.1, 2.0], [0.0, 0.0]])
    ours = np.concatenate([theirs[:, [1, 2]], theirs[:, [1]] * 0.5], axis=1)
    found = textures._carried_over(theirs @ matrix, theirs, ours)
    np.testing.assert_allclose(found, ours @ matrix, atol=1e-6)


def test_colours_without_pictures_and_files_that_tell_nothing(tmp_path):
    box = trimesh.creation.box((1, 2, 1))
    box.visual.face_colors = [[255, 0, 0, 255]] * 6 + [[0, 0, 255, 255]] * 6
    box.export(tmp_path / "a.ply")
    paint = store_of(tmp_path / "a.ply").paint("thing/a")
    (texture,) = paint.textures
    seen = {tuple(texture.color[0, int(u * texture.color.shape[1])]) for u in paint.uv[:, 0, 0]}
    assert seen == {(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)}
    for suffix in (".stl", ".obj"):
        trimesh.creation.box((1, 2, 1)).export(tmp_path / f"b{suffix}")
        assert store_of(tmp_path / f"b{suffix}").paint("thing/a") is None
    vase = mesh_furniture(named(tmp_path / "b.stl", "vase/a"), "vase/a").furnished.thing
    assert vase.materials[0] in ("ceramic", "terracotta")
    assert not vase.textures
    sides = [x - np.roll(x, 1, axis=1) for x in (vase.corner_uv, vase.vertices[vase.faces])]
    metres = [np.linalg.norm(side, axis=2) for side in sides]
    np.testing.assert_allclose(*metres, atol=1e-6)


def test_too_large_pictures_are_refused_and_large_ones_reduced(tmp_path, monkeypatch):
    path = quad(tmp_path / "models")
    monkeypatch.setattr(materials, "KEPT_PIXELS", 1)
    assert store_of(path).paint("thing/a").textures[0].color.shape == (1, 1, 3)
    monkeypatch.setattr(materials, "MOST_PIXELS", 1)
    store = store_of(path)
    with pytest.raises(BadMeshError):
        store.paint("thing/a")
    assert "thing/a" in store.problems
    monkeypatch.setattr(limits, "MOST_BYTES", 150)  # too few for the picture, not for the model
    path.with_name("picture.png").write_bytes(b"0" * 151)
    with pytest.warns(UserWarning, match="picture.png"):
        assert len(store_of(path).paint("thing/a").textures[0].color) == 1


@pytest.mark.parametrize(("kind", "front"), [("shapenet-v1", 0), ("shapenet-v2", 2), ("folder", 2)])
def test_meshes_stand_with_their_front_to_z_as_large_as_their_kind(tmp_path, kind, front):
    nose = trimesh.creation.box((0.2, 0.2, 0.2))
    sign = -1 if kind == "shapenet-v2" else 1
    nose.apply_translation(np.eye(3)[front] * 1.0 * sign)
    mesh = trimesh.util.concatenate([trimesh.creation.box((1.0, 2.0, 1.0)), nose])
    mesh.export(tmp_path / "a.obj")
    thing = mesh_furniture(named(tmp_path / "a.obj", "chair/a", kind), "chair/a").furnished.thing
    low, high = thing.vertices.min(axis=0), thing.vertices.max(axis=0)
    np.testing.assert_allclose((low + high)[[0, 2]], 0, atol=1e-6)
    assert low[1] == 0
    small = thing.vertices[np.abs(thing.vertices[:, 0]) < 0.3 * high[0]]
    assert small[:, 2].max() == high[2]
    assert small[:, 2].min() > -high[2]
    built_in = furnishing("chair", zlib.crc32(b"chair/a") % MEMBERS).vertices
    same = np.linalg.norm(np.ptp(built_in, axis=0))
    assert np.linalg.norm(high - low) == pytest.approx(same, abs=1e-5)


@pytest.mark.parametrize("wound", [1, -1])
def test_things_stand_on_meshes_of_tables_however_they_are_wound(tmp_path, wound):
    top = trimesh.creation.box((2.0, 0.1, 1.0))
    top.apply_translation((0, 1.0, 0))
    legs = [trimesh.creation.box((0.1, 1.0, 0.1)) for _ in range(4)]
    for leg, (x, z) in zip(legs, ((-1, -1), (-1, 1), (1, -1), (1, 1)), strict=True):
        leg.apply_translation((0.9 * x, 0.45, 0.4 * z))
    table = trimesh.util.concatenate([top, *legs])
    table.faces = table.faces[:, ::wound]
    table.export(tmp_path / "a.ply")
    store = named(tmp_path / "a.ply", "table/a")
    found = piece(lambda name: mesh_furniture(store, name), "table/a")
    (y, x0, x1, z0, z1) = found.surfaces[-1]
    assert y == pytest.approx(found.height, abs=1e-3)
    assert (x1 - x0) * (z1 - z0) > 0.85 * 4 * found.half[0] * found.half[1]


@pytest.fixture
def own(tmp_path):
    """A folder with a textured chair, tables, and things of an unknown class, some broken."""
    root = tmp_path / "own"
    for name in ("chair", "table", "dragon"):
        for i, number in enumerate("abc"):
            mesh = trimesh.creation.box((1.0, 0.6 + 0.2 * i, 0.8))
            mesh.visual.face_colors = [[255 - 40 * i, 30, 30, 255]]
            (root / name).mkdir(parents=True, exist_ok=True)
            mesh.export(root / name / f"{number}.ply")
    (root / "dragon" / "bad.obj").write_text("nothing of use")
    return root


def test_rooms_with_meshes_are_verified(own, run):
    options = ("--preset", "interiors", "--size", 24, "--spp", 1, "--no-denoise", "--seed", 5)
    result = run("render", "--n", 3, *options, "--objects-root", own)
    assert result.exit_code == 0, result.output
    with h5py.File("rooms.h5") as file:
        names = json.loads(file.attrs["spec"])["shapes"]
        numbers = dict(zip(names, file["object/shape"].attrs["nyu40"], strict=True))
        scenes = [json.loads(text) for text in file["scene"].asstr()]
    assert (numbers["chair"], numbers["dragon"]) == (5, 40)
    used = [(item["shape"], item["mesh"]) for scene in scenes for item in scene["objects"]]
    mine = {name for name, mesh in used if mesh}
    assert {name.partition("/")[0] for name in mine} == {"chair", "table", "dragon"}
    assert not {name for name, mesh in used if not mesh and name.startswith(("chair/", "table/"))}
    assert "dragon/bad" not in mine
    assert len({name for name, mesh in used if not mesh}) > 5

    objects = object_source("interiors", objects_root=str(own)).objects
    assert set(furniture_models(objects)["object"]) == {
        f"dragon/{n}" for n in ("a", "b", "bad", "c")
    }
    checks = checks_of("rooms.h5", objects=objects)
    assert all(check.ok for check in checks), checks
    table = next(name for name in mine if name.startswith("table/"))
    trimesh.creation.icosphere(1).export(own / f"{table}.ply")
    changed = object_source("interiors", objects_root=str(own)).objects
    with open_rooms("rooms.h5") as rooms:
        assert any(table in changed_meshes(changed, room.scene) for room in rooms)


@pytest.mark.parametrize(
    "options", [("--classes", "chair,nonsense"), ("--classes", "rug"), ("--shapes", "box")]
)
def test_classes_that_nobody_has_are_refused(own, refuses, options):
    refuses("render", "--n", 1, "--preset", "interiors", "--objects-root", own, *options)


@pytest.mark.parametrize(
    "line", ["v nan 0 0\nf 5/1 1/1 2/2", "v 99 50 9\nf 5/1 5/1 5/2"], ids=["not finite", "no area"]
)
def test_faces_that_cleaning_drops_move_no_picture(tmp_path, line):
    path = quad(tmp_path / "models")
    usual = store_of(path).paint("thing/a")
    path.write_text(f"{path.read_text()}{line}\n")
    found = store_of(path).paint("thing/a")
    np.testing.assert_allclose(found.uv, usual.uv, atol=1e-6)


def test_pictures_of_16_bits_and_options_of_materials(tmp_path):
    path = quad(tmp_path / "models", material="map_Kd -s 2 2 1 -o 0.5 0 0")
    place = path.with_name("picture.png")
    Image.fromarray(np.array([[0, 257 * 128], [257 * 200, 65535]], np.uint16)).save(place)
    texture = store_of(path).paint("thing/a").textures[0]
    np.testing.assert_allclose(np.sort(encoded(texture.color[..., 0]).ravel() * 255),
                               [0, 128, 200, 255], atol=1e-3)  # fmt: skip
    uv = store_of(path).paint("thing/a").uv
    np.testing.assert_allclose(np.ptp(uv, axis=1), 2)


def rewritten(data, change):
    """A GLB file whose JSON is changed."""
    end = 20 + struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20:end])
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack(
        "<4sIIII", b"glTF", 2, 20 + len(text) + len(data) - end, len(text), 0x4E4F534A
    )
    return head + text + data[end:]


def test_pictures_of_glb_files_are_moved_and_mirrored_as_they_tell(tmp_path):
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(np.array(COLORS, np.uint8)), metallicFactor=1.0,
        metallicRoughnessTexture=Image.new("RGB", (2, 2), (0, 51, 0)),
    )  # fmt: skip
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    visual = trimesh.visual.TextureVisuals(corners[:, :2], material)
    square = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)
    data = trimesh.Scene(square).export(file_type="glb")

    def lower_left(change):
        (tmp_path / "a.glb").write_bytes(rewritten(data, change))
        store = store_of(tmp_path / "a.glb")
        paint, mesh = store.paint("thing/a"), store.shape("thing/a").mesh
        corners = mesh.vertices[mesh.faces].astype(float)
        assert paint.textures[0][1:3] == pytest.approx((0.2, 0.0))
        color = shown(paint, corners, [-corners.max() / 2] * 2)
        return np.rint(encoded(color) * 255).astype(int).tolist()

    def moved(**told):
        def change(document):
            texture = document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
            texture["extensions"] = {"KHR_texture_transform": told}

        return change

    def mirrored(document):
        node = next(node for node in document["nodes"] if "mesh" in node)
        node["matrix"] = np.diag([-1.0, 1, 1, 1]).ravel().tolist()

    (upper_left, upper_right), (own, lower_right) = COLORS
    assert lower_left(lambda document: None) == own
    assert lower_left(mirrored) == lower_right
    assert lower_left(moved(offset=[0.5, 0])) == lower_right
    assert lower_left(moved(offset=[0, 0.5])) == upper_left
    assert lower_left(moved(rotation=np.pi / 2)) == lower_right
    assert lower_left(moved(scale=[-1, 1])) == lower_right
    assert lower_left(moved(scale=[-1, -1])) == upper_right


def test_vertex_colours_beside_a_material_count(tmp_path):
    box = trimesh.creation.box((1, 2, 1))
    box.visual.vertex_colors = [[255, 0, 0, 255]] * len(box.vertices)

    def change(document):
        document["materials"] = [{}]
        document["meshes"][0]["primitives"][0]["material"] = 0

    data = trimesh.Scene(box).export(file_type="glb")
    (tmp_path / "a.glb").write_bytes(rewritten(data, change))
    assert store_of(tmp_path / "a.glb").paint("thing/a").textures[0].color.tolist() == [[[1, 0, 0]]]


RED, GOLD = (200, 100, 50), (255, 200, 60)
GLOSS = "KHR_materials_pbrSpecularGlossiness"


def base(document):
    return document["materials"][0]["pbrMetallicRoughness"].pop("baseColorTexture")


def glossy(**told):
    def change(document):
        extension = {"diffuseTexture": base(document), **told}
        document["materials"][0] = {
            "extensions": {GLOSS: {k: v for k, v in extension.items() if v}}
        }

    return change


def source(name, number, **fallback):
    """Picture 1 is of a format that nobody reads."""

    def change(document):
        document["images"].append({"uri": "data:image/ktx2;base64,q0tUWCAyMLs="})
        document["textures"] = [{"extensions": {name: {"source": number}}, **fallback}]

    return change


def uri(name):
    return lambda document: document.update(images=[{"uri": name}])


def with_extension(name):
    return lambda document: document["materials"][0].update(extensions={name: {}})


def factor(document):
    document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 1, 1, 1]


PNG = io.BytesIO()
Image.new("RGB", (2, 2), RED).save(PNG, "PNG")
INSIDE = "data:image/png;base64," + base64.b64encode(PNG.getvalue()).decode()
HALF = np.rint(encoded(np.array(0.5) * decoded(200 / 255)) * 255)


@pytest.mark.parametrize(
    ("change", "color", "unread"),
    [
        (lambda document: None, RED, set()),
        (factor, (HALF, *RED[1:]), set()),
        (glossy(), RED, set()),
        (glossy(specularFactor=[0.2, 0.2, 0.2], glossinessFactor=0.3), RED, set()),
        (glossy(diffuseFactor=[0.0, 0.0, 0.0, 1.0], specularFactor=decoded(np.array(GOLD) / 255)
                .tolist()), GOLD, set()),
        (source("EXT_texture_webp", 0), RED, set()),
        (source("EXT_texture_avif", 0), RED, set()),
        (source("KHR_texture_basisu", 1, source=0), RED, set()),
        (source("KHR_texture_basisu", 1), None, {"picture"}),
        (uri("wood%20%C3%A9.png"), GOLD, set()),
        (uri("wood é.png"), GOLD, set()),
        (uri(INSIDE), RED, set()),
        (uri("none.png"), None, {"picture"}),
        (uri("data:image/ktx2;base64,q0tUWCAyMLs="), None, {"picture"}),
        (uri("../../secret.png"), None, {"picture"}),
        (uri("..%2F..%2Fsecret.png"), None, {"picture"}),
        (with_extension("KHR_materials_sheen"), RED, {"KHR_materials_sheen"}),
        (with_extension("KHR_materials_unlit"), RED, set()),
        (lambda document: document["materials"][0].update(emissiveFactor=[1, 1, 1]), RED,
         {"emission"}),
    ],
)  # fmt: skip
def test_materials_of_glb_files_are_read_or_told(tmp_path, change, color, unread):
    """By `paint_of` in rooms, and by `corner_colors` as own colours."""
    box, folder = trimesh.creation.box(), tmp_path / "root" / "models"
    folder.mkdir(parents=True)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (2, 2), RED))
    box.visual = trimesh.visual.TextureVisuals(np.full((8, 2), 0.5), material)
    (folder / "a.glb").write_bytes(rewritten(box.export(file_type="glb"), change))
    for place in (folder / "wood é.png", tmp_path / "secret.png"):
        Image.new("RGB", (2, 2), GOLD).save(place)
    mesh = store_of(folder / "a.glb").shape("thing/a").mesh
    told = {}
    paint = textures.paint_of(folder / "a.glb", "y", mesh.vertices, mesh.faces, told)
    assert told.keys() == unread
    if color is None:
        assert paint is None
        return
    assert encoded(paint.textures[0].color[0, 0]) * 255 == pytest.approx(color, abs=0.6)
    data = (folder / "a.glb").read_bytes()
    colors = corner_colors(data, ".glb", "y", mesh.vertices, mesh.faces, {})
    if color is RED:  # pictures beside a file are no part of its own colours
        assert encoded(colors[0, 0]) * 255 == pytest.approx(RED, abs=0.6)


@pytest.mark.parametrize(("diffuse", "seen"), [(RED, (RED, 0.0)), ((0, 0, 0), (GOLD, 1.0))])
def test_glossy_materials_that_are_dark_and_shine_are_metal(tmp_path, diffuse, seen):
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.new("RGB", (2, 2), diffuse),
        metallicRoughnessTexture=Image.new("RGBA", (2, 2), (*GOLD, 51)),
    )
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(np.full((8, 2), 0.5), material)

    def change(document):
        shiny = document["materials"][0]["pbrMetallicRoughness"].pop("metallicRoughnessTexture")
        glossy(specularGlossinessTexture=shiny)(document)

    (tmp_path / "a.glb").write_bytes(rewritten(box.export(file_type="glb"), change))
    (texture,) = store_of(tmp_path / "a.glb").paint("thing/a").textures
    assert encoded(texture.color[0, 0]) * 255 == pytest.approx(seen[0], abs=0.6)
    assert texture[1:3] == pytest.approx((1 - 51 / 255, seen[1]))


@pytest.mark.parametrize(
    ("told", "wrap", "seen"),
    [
        ({}, (REPEAT, REPEAT), 0.2),
        ({"wrapS": 33071}, (CLAMP, REPEAT), 1.0),
        ({"wrapS": 33648, "wrapT": 33071}, (MIRROR, CLAMP), 0.8),
    ],
)
def test_pictures_of_glb_files_go_on_as_their_samplers_tell(tmp_path, told, wrap, seen):
    """Coordinates of 3.2 along u: what is shown there as own colour, and what rooms get."""
    ramp = np.zeros((2, 256, 3), np.uint8)
    ramp[..., 1] = np.arange(256)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(ramp))
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(np.full((8, 2), (3.2, 0.5)), material)

    def change(document):
        document["samplers"], document["textures"][0]["sampler"] = [told], 0

    (tmp_path / "a.glb").write_bytes(rewritten(box.export(file_type="glb"), change))
    store = store_of(tmp_path / "a.glb")
    paint = store.paint("thing/a")
    assert paint.textures[0].wrap == wrap
    kept = {REPEAT: 0.2, CLAMP: 3.2, MIRROR: 1.2}[wrap[0]]
    period = 2 if wrap[0] == MIRROR else 4
    np.testing.assert_allclose(paint.uv[..., 0] % period, kept, atol=1e-5)
    colors = store.shape("thing/a").make_colors()
    np.testing.assert_allclose(encoded(colors[..., 1]), seen, atol=0.01)


@pytest.mark.parametrize(
    ("head", "color"),
    [
        ("", decoded(np.array([128, 64, 0]) / 255)),
        ("# Blender 3.6.0 MTL File: 'a.blend'\n", [128 / 255, 64 / 255, 0]),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_colours_of_mtl_files_are_srgb_but_those_of_blender(tmp_path, head, color, encoding):
    path = quad(tmp_path / "models", material="")
    text = f"{head}newmtl m\nKd {128 / 255} {64 / 255} 0\n"
    path.with_name("a.mtl").write_text(text, encoding=encoding)
    path.write_text(path.read_text(), encoding=encoding)
    (texture,) = store_of(path).paint("thing/a").textures
    np.testing.assert_allclose(texture.color[0, 0], color, atol=5e-3)


def test_options_and_percents_of_pictures_of_mtl_files(tmp_path):
    path = quad(tmp_path / "models", "a b.png", "map_Kd -clamp on")
    mtl = path.with_name("a.mtl")
    mtl.write_text(mtl.read_text().replace("a b.png", "a%20b.png"))
    assert store_of(path).paint("thing/a").textures[0].wrap == (CLAMP, CLAMP)


@pytest.mark.parametrize(("most", "told"), [(1, set()), (255, {"colours"})])
def test_colours_of_vertices_up_to_255_are_told(tmp_path, most, told):
    path = quad(tmp_path / "models", material="")
    text = "".join(f"v {x} {y} 0 {most} {0.5 * most:g} 0\n" for x, y in ((0, 0), (1, 0), (1, 1)))
    path.write_text(f"{text}f 1 2 3\n")
    mesh, unread = store_of(path).shape("thing/a").mesh, {}
    textures.paint_of(path, "y", mesh.vertices, mesh.faces, unread)
    assert unread.keys() == told
