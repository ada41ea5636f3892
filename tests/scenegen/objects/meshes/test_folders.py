"""Listings of ShapeNet (both versions) and of plain folders, their splits, and refusals."""

import hashlib
import json
import pickle
from unittest.mock import Mock

import pytest

from scenegen.objects.meshes.errors import MeshFolderError
from scenegen.objects.meshes.folders import open_models, open_objects
from scenegen.objects.meshes.listing import ModelFile, object_split
from scenegen.objects.meshes.shapenet import open_shapenet
from scenegen.objects.sources import folder_notes

INSIDE = {1: "model.obj", 2: "models/model_normalized.obj"}
MUG, BOWL, PLANE = "03797390", "02880940", "02691156"


@pytest.fixture
def make(tmp_path):
    """Write empty files of the given names below a folder."""

    def files(*names, root="root"):
        for name in names:
            path = tmp_path / root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        return tmp_path / root

    return files


@pytest.fixture
def shapenet(make):
    """Lay out empty models: three mugs, two bowls and a plane."""

    def lay(version, root="root"):
        ids = [(MUG, "b"), (MUG, "a"), (MUG, "c"), (BOWL, "x"), (BOWL, "a"), (PLANE, "p")]
        extra = f"{MUG}/a/models/model_normalized.mtl", f"{MUG}/a/images/t.jpg", "README.txt"
        return make(*(f"{s}/{i}/{INSIDE[version]}" for s, i in ids), *extra, root=root)

    return lay


def names_of(folder):
    return [file.name for name in folder.classes for file in folder.models[name]]


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("opened", [open_shapenet, open_models])
def test_shapenet_of_both_versions(shapenet, version, opened):
    root = shapenet(version)
    found = opened(root)
    assert (found.kind, found.up) == (f"shapenet-v{version}", "y")
    assert found.classes == (PLANE, "bowl", "mug"), "the plane's name is not known without a file"
    assert names_of(found) == [f"{PLANE}/p", "bowl/a", "bowl/x", "mug/a", "mug/b", "mug/c"]
    assert all(file.path.is_file() for files in found.models.values() for file in files)
    assert opened(str(root), ["mug", BOWL]).classes == ("mug", "bowl"), "in the order asked for"
    assert opened(root, ["mug", MUG]).classes == ("mug",), "twice the same"
    assert pickle.loads(pickle.dumps(found)) == found


FLAT = [
    {"synsetId": PLANE, "name": "airplane,aeroplane,plane", "children": ["1"], "numInstances": 9},
    {"synsetId": MUG, "name": "drinking mug,mug", "children": []},
    {"synsetId": BOWL, "name": "", "children": []},
]
TREE = {
    "text": "root",
    "children": [
        {"metadata": {"name": PLANE, "label": "airplane,aeroplane,plane"}, "children": [{}, None]},
        {"text": "things", "children": [{"synsetId": "01234567", "name": "odd,airplane"}]},
    ],
}


@pytest.mark.parametrize("taxonomy", [FLAT, TREE], ids=["flat", "tree"])
def test_names_from_the_taxonomy(shapenet, taxonomy):
    root = shapenet(2)
    (root / "taxonomy.json").write_text(json.dumps(taxonomy), encoding="utf-8-sig")
    found = open_shapenet(root)
    assert found.classes == ("airplane", "bowl", "mug"), "built-in names go first"
    assert open_shapenet(root, ["aeroplane", PLANE]).classes == ("airplane",)
    (root / "taxonomy.json").write_text('[{"synsetId": ')
    with pytest.raises(MeshFolderError) as refused:
        open_shapenet(root)
    assert refused.value.where.endswith("taxonomy.json")
    assert refused.value.expected == "JSON"


def test_splits_by_hash():
    """70, 10 and 20 percent, by a rule that must never change."""
    for model_id in ("a", "caf\u00e9", "1a2b3c", ""):
        tenth = int(hashlib.sha256(model_id.encode()).hexdigest()[:16], 16) % 10
        assert object_split(model_id) == (["train"] * 7 + ["val"] + ["test"] * 2)[tenth]


def test_a_split_is_a_part(make):
    root = make(*(f"{c}/{i}.obj" for c in ("one", "two") for i in range(99)))
    parts = [open_objects(root, split=name) for name in ("train", "val", "test")]
    together = sorted(name for part in parts for name in names_of(part))
    assert together == sorted(names_of(open_objects(root)))
    assert all(object_split(n.partition("/")[2]) == "val" for n in names_of(parts[1]))
    assert len({part.digest() for part in parts}) == 3


def test_the_official_splits_go_before_the_hash(shapenet):
    """A model missing from the list is in no split; synsets may have lost leading zeros."""
    root = shapenet(1)
    rows = ["id,synsetId,subSynsetId,modelId,split", f"1,{MUG},{MUG},a,test", f"2,{MUG[1:]},,b,VAL"]
    rows += [f"3,{BOWL},0,a,train", f"4,{PLANE},0,p,", "5,,,,", "short"]
    (root / "all.csv").write_text("\r\n".join(rows))
    for split, name in (("test", "mug/a"), ("val", "mug/b"), ("train", "bowl/a")):
        assert names_of(open_shapenet(root, split=split)) == [name]
    assert len(names_of(open_shapenet(root))) == 6
    (root / "all.csv").write_text("id,synsetId,modelId\n")
    with pytest.raises(MeshFolderError) as refused:
        open_shapenet(root, split="val")
    assert refused.value.where.endswith("all.csv")
    assert "split" in refused.value.expected


def test_plain_folders(make):
    """Files of any depth; files that differ in suffix are one object; no hidden files."""
    root = make(
        "mug/b.obj", "mug/a.PLY", "mug/deep/er/c.stl", "mug/twin.glb", "mug/twin.off", "mug/t.mtl",
        "mug/v1.2.obj", "mug/.hidden.obj", ".git/x.obj", "caf\u00e9 \u6f22/z z.obj", "none/x.txt",
        "top.obj",
    )  # fmt: skip
    found = open_objects(root, up="z")
    assert (found.kind, found.up, found.classes) == ("folder", "z", ("caf\u00e9 \u6f22", "mug"))
    assert names_of(found) == [
        "caf\u00e9 \u6f22/z z", "mug/a", "mug/b", "mug/deep/er/c", "mug/twin", "mug/v1.2",
    ]  # fmt: skip
    assert found.models["mug"][3].path.name == "twin.glb"
    assert [path.name for path in found.unused] == ["twin.off"]
    assert [path.name for path in found.astray] == ["top.obj"]
    assert found.models["mug"][0] == ModelFile("mug/a", root / "mug" / "a.PLY")
    assert open_models(root).kind == "folder"


def test_links_are_followed_to_classes_and_files_but_not_in_circles(make):
    root = make("mug/a.obj", "mug/in/b.obj")
    (root / "mug" / "in" / "up").symlink_to(root)
    (root / "mug" / "self").symlink_to(root / "mug" / "self")
    (root / "loop").symlink_to(root / "loop")
    (root / "mug" / "c.obj").symlink_to(root / "mug" / "a.obj")
    (root / "same").symlink_to(root / "mug", target_is_directory=True)
    (root / "mug" / "linked").symlink_to(make("deep/x.obj", root="elsewhere"))
    names = ["a", "c", "in/b", "linked/deep/x"]
    assert names_of(open_objects(root)) == [f"{c}/{n}" for c in ("mug", "same") for n in names]
    (root / "03797390").symlink_to(root)
    assert open_models(root).kind == "folder"


def test_names_that_are_not_utf8_can_be_stored(make):
    root = make("mug/a.obj")
    (root / "mug").joinpath("caf\udce9.obj").touch()
    found = open_objects(root)
    assert names_of(found) == ["mug/a", "mug/caf\\xe9"]
    assert found.models["mug"][1].path.exists()
    assert found.digest()
    assert open_objects(root, split=object_split("caf\\xe9")).models["mug"]


def test_the_digest_is_of_names_not_of_paths(shapenet, make):
    one, two = open_shapenet(shapenet(1)), open_shapenet(shapenet(1, "elsewhere"))
    assert one.digest() == two.digest()
    assert len(one.digest()) == 64
    others = [
        open_shapenet(shapenet(2, "second")), open_shapenet(shapenet(1), ["mug"]),
        open_shapenet(shapenet(1), ["mug", "bowl"]), open_shapenet(shapenet(1), ["bowl", "mug"]),
    ]  # fmt: skip
    plain = make("mug/a.obj", root="plain")
    others += [open_objects(plain), open_objects(plain, up="z")]
    assert len({other.digest() for other in [one, *others]}) == 7


def test_refusals(shapenet, make):
    net, plain = shapenet(1), make("mug/a.obj", "bowl/x.txt", root="plain")
    gutted, empty = make(f"{MUG}/a/x.txt", root="gutted"), make("x.txt", root="empty")
    flat, textual = make("a.obj", "b.ply", root="flat"), make("mug/readme.txt", root="textual")
    other = next(s for s in ("train", "val", "test") if s != object_split("a"))
    cases = [
        (open_models, (net / "none",), "none: no such folder", ""),
        (open_models, ("~no_such_user/x",), "no home folder", ""),
        (open_objects, (empty / "x.txt",), "x.txt: is not a folder", ""),
        (open_shapenet, (net / "none",), "none: no such folder", ""),
        (open_shapenet, (plain,), "plain", "no ShapeNet"),
        (open_shapenet, (gutted,), "gutted", "no ShapeNet"),
        (open_shapenet, (net, ["cup"]), "root", "no class cup"),
        (open_shapenet, (net, ["can"]), "root", "no class can"),
        (open_shapenet, (net, []), "root", "no class named"),
        (open_objects, (plain, [".", ".."]), "plain", "no class ., .."),
        (open_objects, (empty,), "empty", "an empty folder"),
        (open_objects, (flat,), "flat", "2 meshes"),
        (open_objects, (textual,), "textual", "no models"),
        (open_objects, (plain, ["bowl"]), "class bowl", "no models"),
        (open_objects, (plain, ["mug"], "y", other), "class mug", "1 in other splits"),
        (open_objects, (plain, None, "y", "dev"), "object split", "'dev'"),
        (open_objects, (plain, None, "x"), "up", "'x'"),
    ]
    for opened, arguments, where, found in cases:
        with pytest.raises(MeshFolderError) as refused:
            opened(*arguments)
        assert refused.value.where.endswith(where), arguments
        assert found in refused.value.found, arguments
        assert refused.value.expected or refused.value.hint, arguments


def test_files_and_folders_that_cannot_be_read(shapenet, monkeypatch):
    root = shapenet(1)
    with pytest.raises(MeshFolderError):
        open_objects(root / ("x" * 5000))
    (root / "all.csv").mkdir()
    with pytest.raises(MeshFolderError) as refused:
        open_shapenet(root)
    assert refused.value.where.endswith("all.csv")

    monkeypatch.setattr("os.scandir", Mock(side_effect=PermissionError(13, "Permission denied")))
    with pytest.raises(MeshFolderError) as refused:
        open_objects(root)
    assert "Permission denied" in str(refused.value)


@pytest.mark.parametrize(
    ("name", "content", "up", "own", "count"),
    [
        ("a.stl", b"", "y", False, 1),
        ("a.stl", b"", "z", False, 0),
        ("a.glb", b"", "z", False, 1),
        ("a.glb", b'{"baseColorTexture": {}}', "y", False, 1),
        ("a.ply", b"property uchar red\n", "y", False, 1),
        ("a.ply", b"property uchar red\n", "y", True, 0),
        ("a.obj", b"v 0 0 1 0.5 0.5 1e-1\n", "y", False, 1),
        ("a.obj", b"mtllib a.mtl\nv 0 0 1\n", "y", False, 0),
    ],
)
def test_notes_tell_of_axes_and_colours_that_may_surprise(make, name, content, up, own, count):
    root = make(f"mug/{name}")
    (root / "mug" / name).write_bytes(content)
    notes = folder_notes(open_objects(root, up=up), own)
    assert len(notes) == count
    assert all(("--reflectance own" if content else "--up") in note for note in notes)
