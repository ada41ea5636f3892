"""`scenegen verify` on files of several views, of highlights, and of bright light."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from h5_edits import edit_scene, put, swap_rows

from scenegen.description.presets import preset_spec
from scenegen.rooms.make import make_dataset
from scenegen.rooms.verify import verify_file

Edit = Callable[[h5py.File], Any]
VIEWS = {"views": (0.0, 5.0, 35.0), "object_radius": (0.08, 0.15)}


@pytest.fixture(scope="module")
def views_path(make_rooms: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of three scenes from three sides, that no test changes."""
    return make_rooms(tmp_path_factory.mktemp("views") / "views.h5", 3, **VIEWS)


def failed(path: Path, items: int) -> set[str]:
    return {check.name for check in verify_file(path, items) if not check.ok}


DAMAGE: dict[str, tuple[Edit, set[str]]] = {
    "another background in one view's JSON": (
        edit_scene(4, lambda s: s.update(background=[0.5, 0.0, 0.0])), {"description"},
    ),
    "a camera too many in one view's JSON": (
        edit_scene(4, lambda s: s["cameras"].append(s["cameras"][0])), {"description"},
    ),
    "a view beyond the spec's": (put("view_index", 4, 7), {"description"}),
    "a view below 0": (put("view_index", 4, -2), {"description"}),
    "a view's number twice": (put("view_index", 4, 2), {"description"}),
    "a view said to be the first": (put("view_index", 4, 0), {"description", "fingerprint"}),
    "an angle": (put("view_angle_degrees", 4, 5.5), {"description"}),
    "two views' rows swapped": (swap_rows(4, 5), {"description"}),
    "two views' cameras swapped": (swap_rows(4, 5, "camera/world_from_camera"), {"description"}),
    "two scenes' views swapped": (swap_rows(4, 7), {"description"}),
    "two views' images swapped": (swap_rows(4, 5, "image"), {"image"}),
    "a material": (put("material/specular", 4, [0.0, 0.1, 0.1, 0.1]), {"description"}),
    "a model": (put("object/model", 4, ["box/1", "", ""]), {"description"}),
    "a class": (put("object/shape", 4, [-1, -1, -1]), {"description"}),
}  # fmt: skip


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_to_one_view_is_found_without_rendering(
    kind: str, views_path: Path, tmp_path: Path
) -> None:
    edit, expected = DAMAGE[kind]
    path = shutil.copy(views_path, tmp_path / "damaged.h5")
    with h5py.File(path, "r+") as file:
        edit(file)
    assert expected <= failed(path, 0)
    assert expected <= failed(path, 9), "nor does rendering end in a traceback"


@pytest.mark.parametrize(
    "settings",
    [
        {"specular": (1.0, 1.0), "shininess": (1000.0, 1000.0)},
        {"specular": (10.0, 10.0), "shininess": (10_000.0, 10_000.0), "light_level": 100.0},
        {"light_level": 100.0},
        {"fov_degrees": 70.0, "specular": (0.2, 0.6), "shininess": (2.0, 9.0)},
        {"shadows": True, "spp": 2, "specular": (0.2, 0.6)},
        {"lights": (0, 0), "specular": (0.2, 0.6)},
        {"light_saturation": 1.0, "lights": (5, 5)},
    ],
    ids=str,
)
@pytest.mark.parametrize("dtype", ["uint8", "float16", "float32"])
def test_no_honest_file_fails(
    settings: dict[str, Any], dtype: str, make_rooms: Callable[..., Path], tmp_path: Path
) -> None:
    path = make_rooms(tmp_path / "x.h5", 12, image_dtype=dtype, objects=(2, 3),
                      **{"lights": (2, 3), **settings})  # fmt: skip
    assert failed(path, 1) == set()


@pytest.mark.parametrize("name", ["material/specular", "material/shininess"])
def test_highlights_that_are_not_the_stored_materials_are_found(name: str, tmp_path: Path) -> None:
    """The image check by itself: the JSON says the same as the arrays."""
    spec = preset_spec("specular", height=32, width=32, objects=(2, 2), lights=(3, 3))
    make_dataset(tmp_path / "x.h5", spec, 3)
    key = name.split("/")[1]
    with h5py.File(tmp_path / "x.h5", "r+") as file:
        values = file[name][:]
        file[name][:, 1:] = 0.5 * values[:, 1:]
        for row in range(3):
            edit_scene(row, lambda s: [o.update({key: 0.5 * o[key]}) for o in s["objects"]])(file)
    found = {c.name: c.detail for c in verify_file(tmp_path / "x.h5", 0) if not c.ok}
    assert set(found) == {"content", "image", "fingerprint"}
    assert "not what the shading equation gives" in found["image"]
    assert np.isfinite(values).all()
