"""Materials that others made: folders of maps as ambientCG and Poly Haven deliver them."""

import re
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.recent import recent
from scenegen.common.srgb import decoded
from scenegen.files.images.exr import exr_picture
from scenegen.files.images.pictures import opened_picture, picture_size, shares_of
from scenegen.files.places import files_below
from scenegen.rendering.materials.material import Array, Material, slopes_of

MOST_PIXELS = 8192  # of a map's side
KEPT_PIXELS = 1024  # to which larger maps are reduced
# What a map is, by the end of its file's name; ambientCG writes Color, Poly Haven diff.
_ENDS = {
    "color": "color", "albedo": "color", "basecolor": "color", "diff": "color",
    "diffuse": "color", "col": "color", "roughness": "roughness", "rough": "roughness",
    "normalgl": "normal", "nor_gl": "normal", "metalness": "metallic", "metal": "metallic",
}  # fmt: skip
_NAME = re.compile(
    rf"(?P<name>.+?)[_-](?P<end>{'|'.join(_ENDS)})([_-][0-9]+k)?\.(jpe?g|png|exr)", re.IGNORECASE
)
# The kinds that a material serves, and the length of a repeat in metres, by words in its name. The
# first word that is in the name counts.
_WORDS: tuple[tuple[str, tuple[str, ...], float], ...] = (
    ("floor|planks|parquet|laminate", ("floor",), 1.6),
    ("tile|terrazzo", ("floor",), 1.2),
    ("carpet|rug", ("floor", "felt"), 1.0),
    ("leather", ("leather",), 0.5),
    ("fabric|cloth|linen|wool|denim|cotton|velour|jersey", ("fabric", "linen", "printed"), 0.4),
    ("wicker|rattan|basket", ("wicker",), 0.3),
    ("cardboard", ("cardboard",), 0.6),
    ("plastic|rubber", ("plastic",), 0.3),
    ("porcelain|ceramic", ("ceramic",), 0.4),
    ("terracotta|clay", ("terracotta",), 0.6),
    ("marble|granite|stone|onyx|travertine", ("stone", "sill"), 1.0),
    ("metal|steel|brass|copper|iron|aluminium|chrome|gold", ("metal",), 0.4),
    ("wallpaper|plaster|paint|stucco|brick|concrete|wall", ("wall", "accent"), 2.0),
    ("wood|bark|veneer|plywood|oak|walnut", ("wood", "door"), 0.8),
    ("ground|soil|dirt", ("soil",), 1.0),
)


@dataclass(frozen=True)
class MapFiles:
    """The files of one material.

    Attributes:
        files: paths by "color", "roughness", "normal" (OpenGL's sign), "metallic"; only the first
            is always there.
        metres: length of one repeat.
    """

    files: tuple[tuple[str, Path], ...]
    metres: float


def from_folder(folder: str | Path) -> Mapping[str, tuple[MapFiles, ...]]:
    """Return the materials in a folder and the folders below it, by the kinds that they serve.

    Names tell the kinds: "Wood051" serves as wood. Only the sizes of the maps are read here.

    Raises:
        SpecError: there is no such folder; a material has no colour map, or maps of several sizes;
            no name tells a kind.
        FileFormatError: a map is not a picture, or too large.
    """
    root = Path(folder)
    if not root.is_dir():
        raise SpecError(root, "no folder", "a folder of materials", "see --materials")
    sets: dict[tuple[Path, str], list[tuple[str, Path]]] = {}
    for path in files_below(root):
        match = _NAME.fullmatch(path.name)
        if match:
            kind = _ENDS[match["end"].lower()]
            sets.setdefault((path.parent, match["name"]), []).append((kind, path))
    if not any(kind == "color" for files in sets.values() for kind, _ in files):
        hint = "names end in _Color (ambientCG) or _diff_1k (Poly Haven)"
        raise SpecError(root, "no colour maps", "one for each material", hint)
    served: dict[str, list[MapFiles]] = {}
    for (place, name), files in sets.items():
        _check(place / name, files)
        for words, kinds, metres in _WORDS:
            if re.search(words, name, re.IGNORECASE):
                for kind in kinds:
                    served.setdefault(kind, []).append(MapFiles(tuple(files), metres))
                break
    if not served:
        words = ", ".join(words.split("|")[0] for words, *_ in _WORDS)
        raise SpecError(root, "no file name of a known type of map", f"names with one of {words}")
    return {kind: tuple(maps) for kind, maps in served.items()}


def check_maps(served: Mapping[str, tuple[MapFiles, ...]]) -> None:
    """Decode the maps of `from_folder`, in threads.

    Raises FileFormatError where one is cut short or damaged.
    """
    paths = dict.fromkeys(
        path for some in served.values() for maps in some for _, path in maps.files
    )
    pictures = [path for path in paths if path.suffix.lower() != ".exr"]  # which were decoded
    with ThreadPoolExecutor() as threads:
        for _ in threads.map(_decoded, pictures):
            pass


def _decoded(path: Path) -> None:
    with opened_picture(path, MOST_PIXELS**2) as picture:
        picture.draft(None, (64, 64))  # JPEG files are decoded at an eighth of their size
        picture.load()


def _check(where: Path, files: list[tuple[str, Path]]) -> None:
    kinds = [kind for kind, _ in files]
    if "color" not in kinds:
        raise SpecError(where, f"no colour map next to {files[0][1].name}", "one")
    sizes = sorted({_size(path) for _, path in files})
    if len(sizes) > 1:
        listed = " and ".join(f"{w} x {h}" for w, h in sizes[:3])
        raise SpecError(where, f"maps of {listed} pixels", "one size", "keep one resolution")
    if len(set(kinds)) < len(kinds):
        twice = next(kind for kind in kinds if kinds.count(kind) > 1)
        raise SpecError(where, f"several maps of {twice}", "one", "keep one format")


def _size(path: Path) -> tuple[int, int]:
    is_exr, most = path.suffix.lower() == ".exr", MOST_PIXELS**2
    height, width = exr_picture(path, most).shape[:2] if is_exr else picture_size(path, most)
    if max(width, height) > MOST_PIXELS:
        raise FileFormatError(path, f"{width} x {height} pixels", f"at most {MOST_PIXELS} a side")
    return width, height


@recent(400_000_000)
def read_maps(maps: MapFiles) -> Material:
    """Return a material from its files. Raises FileFormatError where one cannot be read."""
    fields = {kind: _pixels(path) for kind, path in maps.files}
    color = fields["color"]
    rough = fields["roughness"].mean(axis=2) if "roughness" in fields else 0.6
    height = _height(fields["normal"], maps.metres) if "normal" in fields else None
    metallic = float(fields["metallic"].mean()) if "metallic" in fields else 0.0
    return Material(
        decoded(color).astype(np.float32), rough, None,
        None if height is None else slopes_of(height),
        metallic=round(metallic), metres=maps.metres,
    )  # fmt: skip


def _pixels(path: Path) -> Array:
    """Return a picture's values, (H, W, 3) float32, 0 to 1; row 0 is its lower edge."""
    if path.suffix.lower() == ".exr":
        values = exr_picture(path, MOST_PIXELS**2)
        step = -(-max(values.shape) // KEPT_PIXELS)
        return np.ascontiguousarray(values[::-step, ::step])
    with opened_picture(path, MOST_PIXELS**2) as picture:
        return np.ascontiguousarray(shares_of(picture, KEPT_PIXELS)[::-1])


def _height(normal: Array, metres: float) -> Array:
    """Return heights in metres whose slopes are those of a normal map, (H, W, 3), 0 to 1.

    The map repeats, so the least-squares solution is exact in Fourier space (Frankot and
    Chellappa, "A method for enforcing integrability in shape from shading algorithms", 1988).
    """
    x, y, z = (2.0 * normal - 1.0).transpose(2, 0, 1)
    z = np.maximum(z, 0.1)
    rows, columns = z.shape
    v = 2j * np.pi * np.fft.fftfreq(rows, metres / rows)[:, None]
    u = 2j * np.pi * np.fft.rfftfreq(columns, metres / columns)[None]
    slopes = np.fft.rfft2(-x / z) * np.conj(u) + np.fft.rfft2(-y / z) * np.conj(v)
    square = np.abs(u) ** 2 + np.abs(v) ** 2
    square[0, 0] = 1.0
    slopes[0, 0] = 0.0
    return np.fft.irfft2(slopes / square, z.shape)
