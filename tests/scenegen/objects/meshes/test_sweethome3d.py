"""All 820 models of Debian's sweethome3d-furniture, laid out as ShapeNet, made by others.

They are CC0 and CC-BY, and are fetched, never kept: from the folder that SWEETHOME3D_FURNITURE
names (where `apt-get download sweethome3d-furniture; dpkg-deb -x *.deb DIR` put them), or else by
those commands.
"""

import json
import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh
from shape_checks import first_hits, unit_triangles
from verified import checks_of

from scenegen.description.presets import preset_spec
from scenegen.objects.meshes.check import check_models
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.read import parse_mesh, read_bytes
from scenegen.objects.meshes.readers import polygons
from scenegen.objects.meshes.readers.obj import obj_polygons
from scenegen.objects.meshes.shapenet import open_shapenet
from scenegen.objects.meshes.store import MeshStore
from scenegen.objects.sources import object_source
from scenegen.rooms.make import make_dataset

PACKAGE = "sweethome3d-furniture"
MODELS = 820
RAYS = 400


def fetched(folder):
    """Return the package's libraries, from where the user has them or from Debian's mirror."""
    known = os.environ.get("SWEETHOME3D_FURNITURE")
    if known:
        return sorted(Path(known).rglob("*.sh3f"))
    if not (shutil.which("apt-get") and shutil.which("dpkg-deb")):
        pytest.skip("no apt-get and dpkg-deb here; name an unpacked SWEETHOME3D_FURNITURE")
    got = subprocess.run(
        ["apt-get", "download", PACKAGE], cwd=folder, capture_output=True, text=True, check=False
    )
    packages = list(folder.glob("*.deb"))
    if not packages:
        reason = got.stderr.strip().splitlines()[-1:] or ["nothing came"]
        pytest.skip(f"apt-get cannot download {PACKAGE}: {reason[0]}; try apt-get update")
    subprocess.run(["dpkg-deb", "-x", packages[0], folder / "unpacked"], check=True)
    return sorted((folder / "unpacked").rglob("*.sh3f"))


@pytest.fixture(scope="module")
def roots(tmp_path_factory):
    """The models as ShapeNet v1, materials and textures beside them, and as v2, bare."""
    folder = tmp_path_factory.mktemp("furniture")
    one, two = folder / "v1", folder / "v2"
    synsets = {}
    for library in fetched(folder):
        with zipfile.ZipFile(library) as archive:
            archive.extractall(folder / library.stem)
            catalogue = archive.read("PluginFurnitureCatalog.properties").decode("latin-1")
        entries = dict(re.findall(r"^(\w+#\d+)=(.*?)\r?$", catalogue, re.MULTILINE))
        for key, path in entries.items():
            if not key.startswith("model#"):
                continue
            number = key.partition("#")[2]
            synset = synsets.setdefault(entries[f"category#{number}"], f"{len(synsets):08d}")
            model_id = f"{library.stem}-{number}-{entries[f'name#{number}'].replace('/', ' ')}"
            source = folder / library.stem / path.lstrip("/")
            shutil.copytree(source.parent, one / synset / model_id)
            (one / synset / model_id / source.name).rename(one / synset / model_id / "model.obj")
            (two / synset / model_id / "models").mkdir(parents=True)
            source.rename(two / synset / model_id / "models" / "model_normalized.obj")
    flat = [{"synsetId": synset, "name": name, "children": []} for name, synset in synsets.items()]
    nested = {"children": [{"metadata": {"name": s, "label": n}} for n, s in synsets.items()]}
    (one / "taxonomy.json").write_text(json.dumps(flat))
    (two / "taxonomy.json").write_text(json.dumps(nested))
    return one, two


def disagreement(path, triangles, rng):
    """Share of rays that see another surface in trimesh's reading of a file, by Embree."""
    scene = trimesh.load_scene(path, skip_materials=True, process=False)
    theirs = unit_triangles(scene.to_mesh())
    origins = rng.standard_normal((RAYS, 3))
    origins *= 2 / np.linalg.norm(origins, axis=1, keepdims=True)
    # At the middle of faces, each as likely as its area.
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(cross.astype(float), axis=1)
    chosen = rng.choice(len(triangles), RAYS, p=area / area.sum())
    directions = triangles[chosen].mean(axis=1) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    expected, found = (first_hits(mesh, origins, directions)[0] for mesh in (theirs, triangles))
    assert np.isfinite(found).mean() > 0.99
    return float((~np.isclose(found, expected, atol=1e-4, rtol=0)).mean())


def tilings(path):
    """Return, for flat polygons that a fan would not cover, triangle area over polygon area."""
    read = obj_polygons(read_bytes(path))
    ratios = []
    start = np.cumsum(read.sizes) - read.sizes
    for size, first in zip(read.sizes, start, strict=True):
        face = read.corners[first : first + size]
        points = read.vertices[face]
        if size < 5 or polygons.faces_one_way(points[None])[0]:
            continue
        centered = points - points.mean(axis=0)
        normal = np.cross(centered, np.roll(centered, -1, axis=0)).sum(axis=0) / 2
        area = np.linalg.norm(normal)
        if area < 1e-3 * (centered**2).sum() / size or np.abs(centered @ normal).max() > (
            1e-3 * area**1.5
        ):
            continue  # its sides cross, or it is not flat: no right answer
        numbered = polygons.clip_ears(points, np.arange(size))
        a, b, c = points[numbered].transpose(1, 0, 2)
        ratios.append(float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 / area))
    return ratios


@pytest.mark.slow
def test_furniture_made_by_others(roots, tmp_path, monkeypatch):
    """None crashes, under 1% are refused, with reasons; rays see what they see in trimesh's mesh.

    Trimesh cuts polygons into fans, right or wrong, so it is compared with fans; where the real cut
    is another, it must tile its polygon.
    """
    first, second = (open_shapenet(root) for root in roots)
    assert (first.kind, second.kind) == ("shapenet-v1", "shapenet-v2")
    for folder in (first, second):
        assert {"Kitchen", "Lights", "Office"} <= set(folder.classes)
        assert sum(map(len, folder.models.values())) == MODELS
    records = check_models(first, tmp_path / "cache", jobs=2)
    assert [(r.name, r.ok, r.reason) for r in check_models(second, tmp_path / "cache")] == [
        (r.name, r.ok, r.reason) for r in records
    ]
    refused = [r for r in records if not r.ok]
    assert len(refused) < 0.01 * MODELS, refused
    assert all(r.reason for r in refused)

    rng = np.random.default_rng(0)
    store = MeshStore(first, tmp_path / "cache")
    paths = {file.name: file.path for files in first.models.values() for file in files}
    worst = {}
    cuts = []
    for record in records:
        if not record.ok:
            continue
        triangles = store.shape(record.name).triangles
        path = paths[record.name]
        with monkeypatch.context() as patch:
            patch.setattr(polygons, "faces_one_way", lambda points: np.ones(len(points), bool))
            mesh = clean_mesh(*parse_mesh(read_bytes(path), path.suffix))
            fans = mesh.vertices[mesh.faces]
        worst[record.name] = disagreement(path, fans, rng)
        if not np.array_equal(fans, triangles):
            cuts.extend(tilings(path))
    off = {name: share for name, share in worst.items() if share > 0.01}
    assert off == {}
    assert np.mean(list(worst.values())) < 0.001
    assert len(cuts) > 100, "no polygon that is not convex: a weak test"
    assert np.mean(np.abs(np.array(cuts) - 1) < 1e-3) > 0.99


@pytest.mark.slow
def test_scenes_of_furniture_made_by_others(roots, tmp_path):
    """Scenes render and verify, and are the same from either layout."""
    depths = []
    for root in roots:
        source = object_source("shapes", shapenet_root=str(root), cache_dir=str(tmp_path / "cache"))
        spec = preset_spec("shapes", objects=(2, 3), **source.settings)
        path = tmp_path / f"{spec.source}.h5"
        make_dataset(path, spec, 60, objects=source.objects)
        failed = [c for c in checks_of(path, 6, objects=source.objects) if not c.ok]
        assert failed == []
        with h5py.File(path) as file:
            depths.append(file["depth"][()])
    np.testing.assert_array_equal(*depths)
