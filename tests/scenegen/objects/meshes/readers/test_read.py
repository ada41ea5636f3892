"""The readers against trimesh's readers and against meshes written by hand."""

import struct

import numpy as np
import pytest
from known_meshes import OBJ, PYRAMID, SPHERE

from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.read import parse_mesh, read_bytes


def faces_of(vertices, faces):
    """Return triangles as sets of corner coordinates, independent of numbering and order."""
    return {tuple(sorted(map(tuple, np.round(vertices[face], 6).tolist()))) for face in faces}


def pyramid_of(vertices, faces):
    """Check that a mesh is the pyramid, its base cut along either diagonal."""
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)], float)
    found = faces_of(vertices, faces)
    sides = faces_of(points, np.array([face for face in PYRAMID if len(face) == 3]))
    bases = [[(0, 1, 2), (0, 2, 3)], [(0, 1, 3), (1, 2, 3)]]
    assert found in [sides | faces_of(points, np.array(base)) for base in bases]
    assert len(faces) == 6


def area_of(vertices, faces):
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("text", OBJ.values(), ids=OBJ.keys())
def test_obj_in_many_hands(text):
    """Line ends of Unix, Windows and old Macs, byte order marks, UTF-16 and Latin-1."""
    ends = [text.replace("\n", end).encode() for end in ("\n", "\r\n", "\r")]
    latin = b"o caf\xe9 \xff\xfe\n" + text.encode() + b"\ng \xf0\x9f\x8d\xb5\x00\n"
    for data in (*ends, text.encode("utf-8-sig"), text.encode("utf-16"), latin):
        pyramid_of(*parse_mesh(data, ".obj"))


def test_broken_lines_do_not_lose_a_model():
    """They become vertices that are not finite and faces that are out of range."""
    text = OBJ["plain"] + (
        "v 1 2\nv a b c\nv nan inf 1e999\nv 1,5 2,5 3,5\nv\nv -1.#IND 0 0\n"
        "f 1 2 x\nf 0 1 2\nf 1 2 99\nf -99 1 2\nf 1 2 99999999999999999999999\nf\nf 1\nf 1 2\n"
        "f 1 2 6\n"
    )
    vertices, faces = parse_mesh(text.encode(), ".obj")
    assert len(vertices) == 11
    assert not np.isfinite(vertices[5:]).all(axis=1).any()
    mesh = clean_mesh(vertices, faces)
    pyramid_of((mesh.vertices - mesh.vertices.min(axis=0)) * 0.75**0.5, mesh.faces)
    assert mesh.mended["faces_out_of_range"] == 6
    assert mesh.mended["degenerate_faces"] == 2
    assert mesh.mended["faces_not_finite"] == 1


def obj_of(points, face):
    """Return an OBJ file of one polygon."""
    lines = ["v " + " ".join(map(repr, map(float, point))) for point in points]
    return "\n".join([*lines, "f " + " ".join(map(str, face))]).encode()


def star(corners, tilt=0.0):
    """A star with `corners` / 2 deep points, tilted about x."""
    angle = np.arange(corners) * 2 * np.pi / corners
    radius = np.where(np.arange(corners) % 2, 0.2, 1.0)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([x, y * np.cos(tilt), y * np.sin(tilt)], axis=1)


def area_inside(polygon):
    """The area of a flat polygon, by the sum over its edges."""
    return float(np.linalg.norm(np.cross(polygon, np.roll(polygon, -1, axis=0)).sum(axis=0)) / 2)


def covers_once(polygon, vertices, faces):
    """Check that triangles tile a simple flat polygon: its area, in its plane, none twice."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    turned = np.linalg.norm(np.cross(b - a, c - a).sum(axis=0)) / 2
    for area in (area_of(vertices, faces), turned):
        assert area == pytest.approx(area_inside(polygon), rel=1e-9)


@pytest.mark.parametrize("corners", [16, 272, 2000])
@pytest.mark.parametrize("tilt", [0.0, 0.7, np.pi / 2])
@pytest.mark.parametrize("turn", [1, -1])
def test_huge_faces_that_are_not_convex(corners, tilt, turn):
    """The face is one line of thousands of characters; a fan would cover more than the polygon."""
    polygon = star(corners, tilt)[::turn]
    face = [f"{i + 1}/{i + 1}/{i + 1}" for i in range(corners)]
    vertices, faces = parse_mesh(obj_of(polygon.tolist(), face), ".obj")
    assert len(faces) == corners - 2
    covers_once(polygon, vertices, faces)
    fan = np.stack([0 * faces[:, 0], np.arange(1, corners - 1), np.arange(2, corners)], axis=1)
    assert area_of(vertices, fan) > 1.2 * area_inside(polygon), "the star is too tame a test"


@pytest.mark.parametrize("first", range(4))
@pytest.mark.parametrize("turn", [1, -1])
def test_a_dart_is_cut_at_its_notch(first, turn):
    dart = np.roll([(0, 0, 0), (2, 1, 0), (0, 2, 0), (0.5, 1, 0)], first, axis=0)[::turn]
    covers_once(dart, *parse_mesh(obj_of(dart, range(1, 5)), ".obj"))


def test_a_hole_joined_to_the_rim_by_a_slit_stays_open():
    rim = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)]
    hole = [(1, 1, 0), (1, 3, 0), (3, 3, 0), (3, 1, 0)]
    read = parse_mesh(obj_of(rim + hole, (1, 2, 3, 4, 1, 5, 6, 7, 8, 5)), ".obj")
    assert area_of(*read) == pytest.approx(12.0)


def test_sides_that_cross_and_sides_on_a_line():
    """There is no right answer, or no area, but the result lies in the polygon's plane."""
    eight = [(0, 0, 0), (2, 2, 1), (2, 0, 1), (0, 2, 0), (-1, 1, -0.5)]
    bow = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    line = [(0, 0, 0), (3, 3, 3), (1, 1, 1), (2, 2, 2), (2.5, 2.5, 2.5)]
    for points, area in ((eight, 1.0), (bow, 0.1), (line, 0.0)):
        vertices, faces = parse_mesh(obj_of(points, range(1, len(points) + 1)), ".obj")
        assert len(faces)
        assert area_of(vertices, faces) >= area
        a, b, c = vertices[faces].transpose(1, 0, 2)
        plane = (-0.5, 0, 1) if points is eight else (0, 0, 1)
        if area:
            np.testing.assert_allclose(np.cross(np.cross(b - a, c - a), plane), 0, atol=1e-9)


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb", "ascii ply", "ascii stl"])
def test_each_format_gives_what_was_written(suffix, tmp_path):
    kind = suffix[-3:]
    how = {"ascii ply": {"encoding": "ascii"}, "ascii stl": {"file_type": "stl_ascii"}}
    path = tmp_path / f"caf\u00e9 \u6f22\u5b57.{kind.upper()}"
    data = SPHERE.export(**{"file_type": kind, **how.get(suffix, {})})
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    vertices, faces = parse_mesh(read_bytes(path), path.suffix)
    np.testing.assert_allclose(
        np.sort(vertices[faces], axis=None), np.sort(SPHERE.triangles, axis=None), atol=1e-6
    )
    assert faces_of(vertices.round(4), faces) == faces_of(SPHERE.vertices.round(4), SPHERE.faces)


PLY_HEAD = "ply\nformat {} 1.0\ncomment made by hand\nobj_info x\nelement vertex 5\n"
POINTS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("name", ["vertex_index", "vertex_indices"])
@pytest.mark.parametrize("columns", ["f", "d", "B"])
def test_binary_ply_with_all_sorts_of_columns(order, name, columns):
    """Polygons of several sizes, a second list, colours, and an unknown table."""
    kind = {"f": "float", "d": "double", "B": "uchar"}[columns]
    long = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = PLY_HEAD.format(long) + f"property {kind} x\nproperty uchar red\nproperty {kind} y\n"
    head += f"property {kind} z\nelement other 2\nproperty list uchar short what\n"
    head += f"element face 5\nproperty list uint8 int32 {name}\n"
    head += "property list uchar float texcoord\nproperty uchar flags\nend_header\n"
    body = b"".join(struct.pack(f"{order}{columns}B2{columns}", x, 7, y, z) for x, y, z in POINTS)
    body += struct.pack(f"{order}BhBhh", 1, 5, 2, 6, 7)
    for face in sorted(PYRAMID):
        body += struct.pack(f"{order}B{len(face)}iBffB", len(face), *face, 2, 0.5, 0.5, 1)
    data = head.encode() + body
    pyramid_of(*parse_mesh(data, ".ply"))
    for length in range(0, len(data), 7):
        with pytest.raises(BadMeshError):
            parse_mesh(data[:length], ".ply")


def test_text_ply():
    head = PLY_HEAD.format("ascii") + "property float x\nproperty float y\nproperty float z\n"
    head += "element face 5\nproperty uchar flags\nproperty list uchar int vertex_indices\n"
    lines = [f"{x} {y} {z}" for x, y, z in POINTS]
    lines += [" ".join(map(str, (0, len(face), *face))) for face in sorted(PYRAMID)]
    text = head + "end_header\n" + "\n\n".join(lines)
    pyramid_of(*parse_mesh(text.encode(), ".ply"))
    pyramid_of(*parse_mesh(text.replace("\n", "\r\n").encode(), ".ply"))
    for broken in (text.replace("0 4 0", "0 5 0"), text.replace("0 4 0", "x"), text[:-12]):
        with pytest.raises(BadMeshError, match="PLY file"):
            parse_mesh(broken.encode(), ".ply")


@pytest.mark.parametrize(
    "head",
    ["OFF\n5 5 0\n", "OFF 5 5 0\n", "OFF5 5 0\n", "COFF\n5 5\n", "# x\n\nNOFF # y\n\n5 5 0 # z\n"],
)
def test_off_with_its_first_line_as_it_comes(head):
    rows = [f"{x} {y} {z} 9 9 9 1" for x, y, z in POINTS]
    rows += [" ".join(map(str, (len(face), *face, 255, 0, 0))) for face in sorted(PYRAMID)]
    pyramid_of(*parse_mesh((head + "\n# between\n".join(rows)).encode(), ".off"))
    for lines in (rows[:-1], [*rows, "3 0 1 2"]):
        with pytest.raises(BadMeshError, match="5 vertices and 5 faces"):
            parse_mesh((head + "\n".join(lines)).encode(), ".off")


@pytest.mark.parametrize("ends", [" ", "\n", " \n\t"])
def test_off_and_ply_as_streams_of_numbers(ends):
    """Lists go on in the next line, or all numbers stand in one."""
    rows = [" ".join(map(str, (len(face), *face))) for face in sorted(PYRAMID)]
    numbers = " ".join([*(f"{x} {y} {z}" for x, y, z in POINTS), *rows])
    pyramid_of(*parse_mesh(f"OFF 5 5 0 {numbers.replace(' ', ends)}".encode(), ".off"))
    head = PLY_HEAD.format("ascii") + "property float x\nproperty float y\nproperty float z\n"
    head += "element face 5\nproperty list uchar int vertex_indices\nend_header\n"
    lines = [f"{x} {y} {z}" for x, y, z in POINTS] + [row.replace(" ", ends) for row in rows]
    pyramid_of(*parse_mesh((head + "\n".join(lines)).encode(), ".ply"))


@pytest.mark.parametrize("count", [0, 1, 319, 321])
def test_binary_stl_whose_count_is_wrong_is_never_read_in_part(count):
    data = SPHERE.export(file_type="stl")
    with pytest.raises(BadMeshError) as refused:
        parse_mesh(data[:80] + count.to_bytes(4, "little") + data[84:], ".stl")
    assert "320" in refused.value.found
    assert str(count) in refused.value.expected


def test_a_binary_stl_may_start_like_a_text_and_have_more_at_its_end():
    data = SPHERE.export(file_type="stl")
    for changed in (b"solid facet" + data[11:], data + b"more"):
        vertices, faces = parse_mesh(changed, ".stl")
        np.testing.assert_allclose(vertices[faces], SPHERE.triangles, atol=1e-6)
    with pytest.raises(BadMeshError, match="319 triangles"):
        parse_mesh(data[:-1], ".stl")
    text = SPHERE.export(file_type="stl_ascii").replace("\n", "\r\n")
    vertices, faces = parse_mesh((text + text.replace("solid", "solid two")).encode(), ".stl")
    assert len(faces) == 2 * len(SPHERE.faces)
    with pytest.raises(BadMeshError, match="959 corners"):
        parse_mesh(text[: text.rindex("vertex")].encode(), ".stl")
