"""Digests of every array of small files of all kinds, compiled for a number of lanes.

    python tests/support/exact_bits.py LANES THREADS > tests/exact_bits.json

This writes the digests again where a change of bits is meant; CHANGELOG then has a line about it.
"""

import ctypes
import itertools
import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import h5py

from scenegen.description.presets import PRESETS, preset_spec
from scenegen.files.content import datasets
from scenegen.objects.catalogue import mesh_objects
from scenegen.objects.meshes.folders import open_objects
from scenegen.objects.meshes.store import MeshStore
from scenegen.rendering.backend import select_variant
from scenegen.rendering.renderer import PICTURE

LANES, THREADS = map(int, sys.argv[1:3] or (8, 2))
TARGETS = {4: b"haswell", 8: b"haswell", 16: b"skylake-avx512"}
TINY = {"height": 20, "width": 24, "min_visible_pixels": 0, "image_dtype": "float32", "seed": 11}
CORNERS = tuple(itertools.product((-1, 1), repeat=3))
SIDES = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))


def compile_for(lanes: int, threads: int) -> None:
    """Let Dr.Jit compile for so many lanes, and use so many threads."""
    variant = select_variant("cpu")
    import drjit
    import mitsuba

    mitsuba.set_variant(variant)
    core = ctypes.CDLL(str(next(Path(drjit.__file__).parent.glob("libdrjit-core.*"))))
    set_target = core._Z19jit_llvm_set_targetPKcS0_j
    set_target.argtypes = ctypes.c_char_p, ctypes.c_char_p, ctypes.c_uint32
    set_target(TARGETS[lanes], None, lanes)
    drjit.set_thread_count(threads)


def colored_meshes(root: Path) -> Path:
    """Write two boxes, of which one has colours at its corners."""
    for name, scale, rgb in (("plain", (1, 0.6, 0.8), False), ("painted", (0.5, 1, 0.7), True)):
        (root / name).mkdir(parents=True)
        lines = [
            " ".join(map(str, ("v", *(x * s for x, s in zip(c, scale, strict=True)),
                               *((x + 1) / 2 for x in c if rgb))))
            for c in CORNERS
        ]  # fmt: skip
        lines += [" ".join(map(str, ("f", *side))) for side in SIDES]
        (root / name / "box.obj").write_text("\n".join(lines))
    return root


def digests_of(path: Path, without: Sequence[str] = ()) -> dict[str, str]:
    """Return the beginning of each dataset's digest, but of those `without`."""
    with h5py.File(path) as file:
        found = {name: str(data.attrs["sha256"])[:12] for name, data in datasets(file)}
    return {name: digest for name, digest in found.items() if name not in without}


def all_digests(folder: Path) -> dict[str, dict[str, str]]:
    """Make the files, and return their digests by kind."""
    from iqtt.files.make import make_split
    from iqtt.questions.specs import SplitSpec
    from scenegen.rooms.make import make_dataset

    kinds = {name: preset_spec(name, **TINY) for name in PRESETS}
    every = ("amodal", "coordinates", "flow", "albedo")
    kinds["truth"] = preset_spec("shapes", **TINY, views=(0.0, 35.0), truth=every)
    kinds["samples"] = preset_spec("specular", **TINY, shadows=True, spp=3, fov_degrees=40.0)
    for name in ("shapes", "shapenet", "specular"):
        kinds[f"{name}, shadows"] = preset_spec(name, **TINY, shadows=True)
    kinds["paths"] = preset_spec("specular", **TINY, shading="path", spp=4)
    kinds["teapots"] = replace(kinds["shapes, shadows"], shapes=("teapot",), seed=3)
    found = {}
    for name, spec in kinds.items():
        make_dataset(folder / "rooms.h5", spec, 2, overwrite=True)
        # Pictures of closed rooms differ between processors by rounding.
        found[name] = digests_of(folder / "rooms.h5", PICTURE if spec.interior else ())
    listing = open_objects(colored_meshes(folder / "meshes"))
    spec = preset_spec(
        "shapes", **TINY, source="folder", shapes=listing.classes, listing=listing.digest(),
        own_reflectance=True, shadows=True,
    )  # fmt: skip
    objects = mesh_objects(MeshStore(listing, None))
    make_dataset(folder / "rooms.h5", spec, 2, objects=objects, overwrite=True)
    found["folder, own reflectance"] = digests_of(folder / "rooms.h5")
    questions = SplitSpec(
        seed=11, train=0, labeled=0, val=0, test=2, height=48, width=48, min_cube_pixels=1
    )
    make_split(folder / "suite", questions, suite=True)
    for path in sorted((folder / "suite").glob("*/iqtt-test*.h5")):
        found[f"{path.parent.name}/{path.stem}"] = digests_of(path)
    return found


if __name__ == "__main__":
    compile_for(LANES, THREADS)
    with tempfile.TemporaryDirectory() as folder:
        json.dump(all_digests(Path(folder)), sys.stdout, indent=1)
