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

import numpy as np
import pytest
import trimesh
from shape_checks import first_hits, unit_triangles

from scenegen.objects.meshes.check import check_models
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.read import parse_mesh, read_bytes
from scenegen.objects.meshes.readers import polygons
from scenegen.objects.meshes.shapenet import open_shapenet

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
def root(tmp_path_factory):
    """The models as ShapeNet v1, materials and textures beside them."""
    folder = tmp_path_factory.mktemp("furniture")
    root = folder / "v1"
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
            shutil.copytree(source.parent, root / synset / model_id)
            (root / synset / model_id / source.name).rename(root / synset / model_id / "model.obj")
    flat = [{"synsetId": synset, "name": name, "children": []} for name, synset in synsets.items()]
    (root / "taxonomy.json").write_text(json.dumps(flat))
    return root


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


@pytest.mark.slow
def test_furniture_made_by_others(root, tmp_path, monkeypatch):
    """None crashes, under 1% are refused, with reasons; rays see what they see in trimesh's mesh.

    Trimesh cuts polygons into fans, right or wrong, so it is compared with fans.
    """
    models = open_shapenet(root)
    assert {"Kitchen", "Lights", "Office"} <= set(models.classes)
    assert sum(map(len, models.models.values())) == MODELS
    records = check_models(models, tmp_path / "cache", jobs=2)
    refused = [record for record in records if not record.ok]
    assert len(refused) < 0.01 * MODELS, refused
    assert all(record.reason for record in refused)

    monkeypatch.setattr(polygons, "faces_one_way", lambda points: np.ones(len(points), bool))
    rng = np.random.default_rng(0)
    paths = {file.name: file.path for files in models.models.values() for file in files}
    shares = {}
    for name in (record.name for record in records if record.ok):
        mesh = clean_mesh(*parse_mesh(read_bytes(paths[name]), paths[name].suffix))
        shares[name] = disagreement(paths[name], mesh.vertices[mesh.faces], rng)
    assert {name: share for name, share in shares.items() if share > 0.01} == {}
    assert np.mean(list(shares.values())) < 0.001
