"""What pictures of interiors are like, beside photographs and the preset `shapes`.

    python -m benchmarks.rendering.interiors interiors.h5 [shapes.h5]

It prints, over all images: shares of saturated and black values; the slope of the power spectrum
and the kurtosis of gradients, which are about -2 and 10 or more in photographs (D. Ruderman and
W. Bialek, "Statistics of natural images", 1994); objects, classes and depths of a picture; the
share of scenes that were drawn again, since there was no room or too little was seen. The
photographs are those that scikit-learn ships, and those of scikit-image where it is installed.
"""

import sys
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tabulate import tabulate

from scenegen.objects.catalogue import objects_of
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import RoomsFile
from scenegen.sampling.scenes import sample_scene

Array = NDArray[Any]
SIDE = 128  # pixels to which pictures are reduced
WAVES = (4, 40)  # per picture, between which the slope is measured
SKIMAGE = ("astronaut", "chelsea", "coffee", "rocket", "cat")


def photographs() -> Iterator[Array]:
    """Yield photographs, (H, W, 3) uint8."""
    from sklearn.datasets import load_sample_images

    yield from load_sample_images().images
    with suppress(ImportError):
        from skimage import data

        for name in SKIMAGE:
            with suppress(Exception):  # what is not shipped is downloaded
                yield getattr(data, name)()[..., :3]


def reduced(picture: Array) -> Array:
    """Return the luminance of the middle square, (SIDE, SIDE), 0 to 1."""
    side = min(picture.shape[:2])
    top, left = ((n - side) // 2 for n in picture.shape[:2])
    step = side // SIDE
    grey = picture[top : top + step * SIDE, left : left + step * SIDE].mean(axis=-1) / 255
    return np.asarray(grey.reshape(SIDE, step, SIDE, step).mean(axis=(1, 3)))


def statistics(picture: Array) -> tuple[float, float]:
    """Return the slope of the power spectrum in log-log axes, and the kurtosis of gradients."""
    grey = reduced(picture)
    window = np.hanning(SIDE)[:, None] * np.hanning(SIDE)
    power = np.abs(np.fft.fft2((grey - grey.mean()) * window)) ** 2
    waves = np.hypot(*np.meshgrid(*[np.fft.fftfreq(SIDE, 1 / SIDE)] * 2))
    rings = np.arange(*WAVES)
    means = [power[(waves >= w - 0.5) & (waves < w + 0.5)].mean() for w in rings]
    slope = float(np.polyfit(np.log(rings), np.log(np.array(means) + 1e-12), 1)[0])
    steps = np.concatenate([np.diff(grey, axis=k).ravel() for k in (0, 1)])
    steps = steps - steps.mean()
    return slope, float((steps**4).mean() / np.maximum((steps**2).mean() ** 2, 1e-12))


def row(name: str, pictures: list[Array], more: list[str]) -> list[str]:
    """Return a row of the table."""
    clipped = [((p == 255).mean(), (p == 0).mean()) for p in pictures]
    fine = np.mean([saturated < 0.02 and black < 0.02 for saturated, black in clipped])
    found = np.array([statistics(p) for p in pictures])
    slope, kurtosis = (
        f"{m:.2f} ({s:.2f})" for m, s in zip(found.mean(0), found.std(0), strict=True)
    )
    return [name, str(len(pictures)), f"{fine:.0%}", slope, kurtosis, *more]


def of_rooms(path: str) -> list[str]:
    """Return the row of a file of rooms."""
    pictures, counts, classes, depths = [], [], [], []
    again = []
    with RoomsFile(path) as rooms:
        objects = objects_of(rooms.spec)
        for room in rooms:
            again.append(sample_scene(rooms.spec, room.scene.index, 0, objects) != room.scene)
            pictures.append(srgb_bytes(room.radiance))
            shown = np.unique(room.object_id[room.object_id > 0])
            counts.append(len(shown))
            classes.append(len({room.scene.objects[k - 1].name for k in shown.tolist()}))
            depths.append(np.nanpercentile(room.depth, (5, 95)))
    near, far = np.mean(depths, axis=0)
    more = [f"{np.mean(counts):.1f}", f"{np.mean(classes):.1f}", f"{near:.2f} to {far:.2f}"]
    more.append(f"{np.mean(again):.0%}")
    return row(path, pictures, more)


if __name__ == "__main__":
    rows = [of_rooms(path) for path in sys.argv[1:]]
    rows.append(row("photographs", list(photographs()), ["-"] * 4))
    titles = [
        "",
        "pictures",
        "below 2% clipped",
        "slope",
        "kurtosis",
        "objects",
        "classes",
        "depths",
        "drawn again",
    ]
    print(tabulate(rows, titles, "pipe", disable_numparse=True))
