"""Read one array of numbers from a file: NPY, NPZ, PNG, TIFF, EXR or PFM.

Sizes are taken from headers before anything is unpacked. Values come as stored: no curve, no scale.
"""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError, SceneGenError
from scenegen.description.specs import MAX_PIXELS
from scenegen.files.images.exr import exr_channels, layers_of
from scenegen.files.images.pictures import ORIENTATION, opened_picture, upright

Array = NDArray[Any]
MOST_CHANNELS = 4
MOST_BYTES_A_NUMBER = 8
DEPTH_CHANNELS = ("Z", "depth", "Depth", "D", "Y", "V")  # of EXR files with several
ANY_NUMBER = ("Y", "V")  # of them, those that other numbers have, too
VECTOR_CHANNELS = (("X", "Y", "Z"), ("R", "G", "B"), ("N.X", "N.Y", "N.Z"))


class ArrayFileError(SceneGenError):
    """A file that holds no array of numbers as it should."""


def read_array(path: Path, name: str | None = None, vectors: bool = False) -> Array:
    """Return an image (h, w), or (h, w, 3) of vectors, as it is stored.

    Of NPY and NPZ files any other shape, too; integers from 0 of PNG and TIFF, and floats.

    Args:
        name: of the array in an NPZ file, or of the channel in an EXR file, with that of its
            part before it where there are several; needed where names do not tell which it is.
        vectors: whether three channels are wanted.

    Raises ArrayFileError, and OSError for the path.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise ArrayFileError(path, f"the ending {path.suffix!r:.20}", ", ".join(READERS))
    if path.exists() and not path.is_file():  # a pipe would be waited for
        raise ArrayFileError(path, "no regular file", "an array of numbers")
    with path.open("rb") as file:
        if not file.read(1):
            raise ArrayFileError(path, "an empty file", "an array of numbers")
    try:
        return reader(path, name, vectors)
    except ArrayFileError:
        raise
    except FileFormatError as error:
        hint = error.hint or (_AS_NUMBERS if reader is _picture else "")
        raise ArrayFileError(error.where, error.found, error.expected, hint) from error
    except Exception as error:  # of five libraries, which share no class of errors
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ArrayFileError(path, f"cannot be read ({reason:.120})") from error


def _check_size(path: Path, shape: tuple[int, ...], most: int = MAX_PIXELS * MOST_CHANNELS) -> None:
    count = 1
    for size in shape:
        count *= size
    if count > most:
        raise ArrayFileError(path, f"shape {shape}", f"at most {most:,} numbers")


def _npy(path: Path, _name: str | None, _vectors: bool) -> Array:
    """Map a file of one or more images; pages are read when they are used."""
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    per_image = array.shape[1:] if array.ndim > 3 else array.shape[-2:]
    _check_size(path, per_image)
    return np.asarray(array)


def _npz(path: Path, name: str | None, vectors: bool) -> Array:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
        names = arrays.files
        usual = ("points", "normal") if vectors else ("depth", "disparity", "pred", "arr_0")
        only = names[0] if len(names) == 1 else next(filter(names.__contains__, usual), "")
        chosen = name or only
        if chosen not in names:
            found = f"the arrays {', '.join(map(repr, names[:8]))}"
            hint = "" if name else "select one with --array"
            raise ArrayFileError(path, found, repr(name) if name else "one", hint)
        member = f"{chosen}.npy"
        if member in arrays.zip.namelist():  # whose size, inflated, is known before it is read
            _check_size(path, (arrays.zip.getinfo(member).file_size // MOST_BYTES_A_NUMBER,))
        return np.asarray(arrays[chosen])


def _picture(path: Path, _name: str | None, vectors: bool) -> Array:
    with opened_picture(path, MAX_PIXELS) as picture:
        pictures = getattr(picture, "n_frames", 1)
        if pictures > 1:
            raise ArrayFileError(path, f"{pictures} pictures", "one")
        if picture.mode in ("P", "PA"):
            raise ArrayFileError(path, "colours of a palette", "numbers", _AS_NUMBERS)
        is_colour_png = picture.format == "PNG" and picture.mode not in ("L", "I", "I;16", "F", "1")
        if is_colour_png and picture.getexif().get(ORIENTATION, 1) != 1:
            raise ArrayFileError(path, "EXIF data that turn it", "none", "save it without them")
        values = _colour_png(path) if is_colour_png else np.asarray(upright(picture))
        return _channels(path, values, vectors)


def _colour_png(path: Path) -> Array:
    """Read a PNG file of several channels; Pillow would cut 16 bits to 8."""
    import png

    with path.open("rb") as file:
        width, height, rows, about = png.Reader(file=file).asDirect()
        kind = np.uint16 if about["bitdepth"] > 8 else np.uint8
        values = np.array([np.asarray(row, kind) for row in rows])
    return values.reshape(height, width, about["planes"])


def _pfm(path: Path, _name: str | None, vectors: bool) -> Array:
    """Read a PFM file of one or three channels; Pillow reads those of one."""
    data = path.read_bytes()
    head = re.match(rb"P([Ff])\s+(\d{1,6})\s+(\d{1,6})\s+([-+.\deE]{1,20})\s", data)
    if head is None:
        raise ArrayFileError(path, "no header of a PFM file", "Pf or PF, width, height and scale")
    shape = (int(head[3]), int(head[2]), *((3,) if head[1] == b"F" else ()))
    values = np.frombuffer(data[head.end() :], "<f4" if float(head[4]) < 0 else ">f4")
    if values.size != np.prod(shape):
        raise ArrayFileError(
            path, f"{values.size:,} numbers", f"{np.prod(shape):,}, as its header states"
        )
    return _channels(path, values.reshape(shape)[::-1], vectors)


_AS_NUMBERS = "save the values as .npy, or as a 16-bit PNG with one channel"


def _channels(path: Path, values: Array, vectors: bool) -> Array:
    """Return (h, w) of pictures of one channel, or of equal ones; (h, w, 3) of vectors."""
    if values.ndim == 3 and values.shape[-1] in (2, 4):
        values = values[..., :-1]  # without alpha
    if vectors:
        if values.ndim != 3 or values.shape[-1] != 3:
            raise ArrayFileError(path, "one channel", "three: x, y, z as R, G, B")
        return values
    if values.ndim == 3:
        if not (values == values[..., :1]).all():
            raise ArrayFileError(path, "a colour image", "one channel", _AS_NUMBERS)
        values = values[..., 0]
    return values


def _exr(path: Path, name: str | None, vectors: bool) -> Array:
    channels = exr_channels(path, MAX_PIXELS)
    if vectors:
        return np.dstack([channels[channel] for channel in _three_of(channels, name, path)])
    if name is None and set(channels) in ({"R", "G", "B"}, {"R", "G", "B", "A"}):
        return _channels(path, np.dstack([channels[c] for c in "RGB"]), vectors)
    chosen = [name] if name else _depths_of(channels)
    if len(chosen) != 1 or chosen[0] not in channels:
        expected = repr(name) if name else f"one that ends in {', '.join(DEPTH_CHANNELS)}"
        raise ArrayFileError(path, _listed(channels), expected, "select one with --array")
    return channels[chosen[0]]


def _depths_of(channels: Mapping[str, Array]) -> list[str]:
    """Return the channels that hold depth, by their names: those of the best kind of name.

    The last word of a name is that of a channel, those before it are of part and layer. Y and V are
    any number; they are depth if there is nothing else, or a word before them says so.
    """
    if len(channels) == 1:
        return list(channels)
    for wanted in DEPTH_CHANNELS:
        found = []
        for name in channels:
            before, _, last = name.rpartition(".")
            if last == wanted and (wanted not in ANY_NUMBER or "depth" in before.lower()):
                found.append(name)
        if found:
            return found
    return []


def _three_of(channels: Mapping[str, Array], name: str | None, path: Path) -> list[str]:
    """Return the names of three channels that are a vector. Raises ArrayFileError."""
    triples = [tuple(name.split(","))] if name else VECTOR_CHANNELS
    for triple in triples:
        found = layers_of(channels, triple)
        if "" in found or len(found) == 1:
            return found.get("") or next(iter(found.values()))
    expected = " or ".join(",".join(triple) for triple in triples)
    raise ArrayFileError(path, _listed(channels), expected, "name three with --array X,Y,Z")


def _listed(channels: Mapping[str, Array]) -> str:
    return f"the channels {', '.join(list(channels)[:12])}"


Reader = Callable[[Path, str | None, bool], Array]
READERS: dict[str, Reader] = {
    ".npy": _npy, ".npz": _npz, ".png": _picture, ".tif": _picture, ".tiff": _picture,
    ".exr": _exr, ".pfm": _pfm,
}  # fmt: skip
