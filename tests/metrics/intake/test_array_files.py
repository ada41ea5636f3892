"""Every format gives back the numbers that another program stored; broken files say so."""

import struct
import zipfile

import numpy as np
import OpenEXR
import png
import pytest
from PIL import Image

from metrics.intake.array_files import ArrayFileError, read_array

DEPTH = (np.arange(6 * 8).reshape(6, 8) * 1000 + 7).astype("u2")
FLOATS = DEPTH.astype("f4") / 8
VECTORS = np.random.default_rng(1).random((6, 8, 3)).astype("f4")
GREY = np.repeat(FLOATS[..., None], 3, axis=2) / 3
BYTES = (VECTORS * 255).astype("u1")
WORDS = (VECTORS * 65535).astype("u2")


def exr(path, channels):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {k: np.ascontiguousarray(v) for k, v in channels.items()}).write(str(path))


def parts(path, **named):
    """Parts of an EXR file, by name; "A_B" stands for the channel "A.B"."""
    made = []
    for name, values in named.items():
        channels = {c.replace("_", "."): np.ascontiguousarray(v) for c, v in values.items()}
        made.append(OpenEXR.Part({}, channels, name))
    OpenEXR.File(made).write(str(path))


def pfm(path, values, order="<"):
    kind = "Pf" if values.ndim == 2 else "PF"
    head = f"{kind}\n{values.shape[1]} {values.shape[0]}\n{-1.0 if order == '<' else 1.0}\n"
    path.write_bytes(head.encode() + values[::-1].astype(f"{order}f4").tobytes())


def words_png(path, values):
    with path.open("wb") as file:
        png.Writer(8, 6, greyscale=False, bitdepth=16).write(file, values.reshape(6, -1).tolist())


SCALARS = {
    "npy": (lambda p: np.save(p, FLOATS), FLOATS),
    "npz": (lambda p: np.savez_compressed(p, depth=FLOATS, other=1), FLOATS),
    "png": (lambda p: Image.fromarray(DEPTH).save(p), DEPTH),
    "8.png": (lambda p: Image.fromarray(BYTES[..., 0]).save(p), BYTES[..., 0]),
    "grey-rgb.png": (lambda p: Image.fromarray(BYTES[..., [0, 0, 0]]).save(p), BYTES[..., 0]),
    "tiff": (lambda p: Image.fromarray(FLOATS).save(p), FLOATS),
    "lzw.tif": (lambda p: Image.fromarray(DEPTH).save(p, compression="tiff_lzw"), DEPTH),
    "exr": (lambda p: exr(p, {"R": VECTORS[..., 0], "G": VECTORS[..., 1], "Z": FLOATS}), FLOATS),
    "parts.exr": (lambda p: parts(p, rgb={"RGB": GREY}, d={"Z": FLOATS}), FLOATS),
    "three.exr": (
        lambda p: parts(p, rgb={"RGB": GREY}, n={"N_X": GREY[..., 0]}, Depth={"V": FLOATS}), FLOATS
    ),
    "layers.exr": (
        lambda p: exr(p, {"View.Combined.R": FLOATS + 1, "View.Depth.Z": FLOATS}), FLOATS
    ),
    "one.exr": (lambda p: exr(p, {"any": FLOATS}), FLOATS),
    "half.exr": (lambda p: exr(p, {"Z": FLOATS.astype("f2")}), FLOATS.astype("f2")),
    "pfm": (lambda p: pfm(p, FLOATS), FLOATS),
    "big.pfm": (lambda p: pfm(p, FLOATS, ">"), FLOATS),
}  # fmt: skip
AXES = np.moveaxis(VECTORS, -1, 0)
IMAGES = {
    "x.npy": (lambda p: np.save(p, VECTORS), VECTORS),
    "x.png": (lambda p: Image.fromarray(BYTES).save(p), BYTES),
    "w.png": (lambda p: words_png(p, WORDS), WORDS),
    "x.exr": (lambda p: exr(p, dict(zip("XYZ", AXES))), VECTORS),
    "x.pfm": (lambda p: pfm(p, VECTORS), VECTORS),
    "n.exr": (lambda p: exr(p, {"RGB": VECTORS}), VECTORS),
    "p.exr": (
        lambda p: parts(p, rgb={"RGB": GREY}, n=dict(zip(("N_X", "N_Y", "N_Z"), AXES))), VECTORS
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SCALARS)
def test_an_image_of_numbers(name, tmp_path):
    write, expected = SCALARS[name]
    path = tmp_path / f"x.{name}"
    write(path)
    got = read_array(path)
    assert got.dtype.kind == expected.dtype.kind
    assert np.array_equal(got, expected)


@pytest.mark.parametrize("name", IMAGES)
def test_an_image_of_vectors(name, tmp_path):
    write, expected = IMAGES[name]
    write(tmp_path / name)
    assert np.array_equal(read_array(tmp_path / name, vectors=True), expected)


def bomb(path):
    """An NPZ of a few bytes whose header promises much."""
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (900000, 900000), }"
    head = head.ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("depth.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head)


BROKEN = {
    "empty.png": lambda p: p.write_bytes(b""),
    "text.png": lambda p: p.write_text("not a picture"),
    "text.npy": lambda p: p.write_text("not an array"),
    "text.npz": lambda p: p.write_text("PK not an archive"),
    "text.exr": lambda p: p.write_text("not an image"),
    "text.tiff": lambda p: p.write_text("not an image"),
    "text.pfm": lambda p: p.write_text("Pf\nx y\n"),
    "short.pfm": lambda p: p.write_bytes(b"Pf\n8 6\n-1.0\n1234"),
    "cut.png": lambda p: (Image.fromarray(DEPTH).save(p), p.write_bytes(p.read_bytes()[:60])),
    "pickled.npy": lambda p: np.save(p, np.array([{}], object), allow_pickle=True),
    "colours.png": lambda p: Image.fromarray(BYTES).save(p),
    "palette.png": lambda p: Image.fromarray(BYTES).quantize(16).save(p),
    "pages.tiff": lambda p: Image.fromarray(DEPTH).save(
        p, save_all=True, append_images=[Image.fromarray(DEPTH)]
    ),
    "bomb.npz": bomb,
    "two.npz": lambda p: np.savez(p, a=FLOATS, b=FLOATS),
    "picture.jpg": lambda p: Image.fromarray(BYTES).save(p),
    "channels.exr": lambda p: exr(p, {"a": FLOATS, "b": FLOATS}),
    "luminance.exr": lambda p: exr(p, {"Y": FLOATS, "RY": FLOATS, "BY": FLOATS}),
    "grey.exr": lambda p: parts(p, rgb={"RGB": GREY}, more={"A": FLOATS}),
    "depths.exr": lambda p: parts(p, left={"Z": FLOATS}, right={"Z": FLOATS}),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_named(name, tmp_path):
    BROKEN[name](tmp_path / name)
    with pytest.raises(ArrayFileError) as caught:
        read_array(tmp_path / name)
    assert caught.value.where == str(tmp_path / name)
    assert len(str(caught.value).splitlines()) == 1


def test_an_array_or_channel_by_name(tmp_path):
    BROKEN["two.npz"](tmp_path / "x.npz")
    BROKEN["channels.exr"](tmp_path / "x.exr")
    for name in ("x.npz", "x.exr"):
        assert np.array_equal(read_array(tmp_path / name, "b"), FLOATS)
        with pytest.raises(ArrayFileError):
            read_array(tmp_path / name, "c")
