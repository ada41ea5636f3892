"""Seconds, processor time and memory that `bench score` takes on measured truth.

    python -m benchmarks.scoring.measured_truth [--images 654]

Images are of 640x480 pixels, of which 90% or 5% have a depth. The predictions are the truth with
5% of noise. Each is scored by the command itself, in a process of its own, by two processes, with
the protocol `declared`, which fits every alignment, and with all that suit.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np

from metrics.measured.writer import Measured, Source, write_measured
from metrics.submissions.writer import RoomPredictionWriter
from scenegen.camera import intrinsics

SIZE = 480, 640


def depth_of(row: int) -> np.ndarray:
    """Return the depth of a floor, a wall and boxes, (480, 640), metres."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    depth = np.minimum(6.0, 600.0 / (y + 80.0)) + 0.3 * np.sin(x / 60 + row)
    return np.asarray(np.where((x // 120 + y // 100 + row) % 3 == 0, 0.7 * depth, depth))


def measured(share: float, row: int) -> Measured:
    """Return an image of which a share of the pixels has a depth."""
    rng = np.random.default_rng([row, 1])
    depth = np.where(rng.random(SIZE) < share, depth_of(row), np.nan)
    image = rng.integers(0, 256, (*SIZE, 3), np.uint8)
    return Measured(image, depth, intrinsics(*SIZE, 60.0, pixel_centers="half"))


def write_files(folder: Path, share: float, images: int) -> list[str]:
    """Write truth and predictions; return their paths."""
    truth, predictions = folder / "truth.h5", folder / "predictions.h5"
    rows = [
        Source(f"{row}.png", f"{row // 4}", SIZE, partial(measured, share, row))
        for row in range(images)
    ]
    write_measured(truth, rows, source="benchmark", licence="")
    with RoomPredictionWriter(predictions, truth, method="noise") as out:
        for row in range(images):
            noise = 0.05 * np.random.default_rng([row, 2]).standard_normal(SIZE)
            out.add(row, depth_of(row) * (1.0 + noise))
    return [str(predictions), "--truth", str(truth)]


def main() -> None:
    """Print a line for each share of pixels and protocol."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=654)
    images = parser.parse_args().images
    head = ("measured", "protocol", "seconds", "CPU-ms an image", "largest MB")
    print("  ".join(f"{text:>15}" for text in head))
    for share in (0.9, 0.05):
        with tempfile.TemporaryDirectory() as folder:
            files = write_files(Path(folder), share, images)
            for protocol in ("declared", "all"):
                options = ["--protocol", protocol, "--processes", "2"]
                command = [sys.executable, "-c", "import cli; cli.bench()", "score"]
                start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
                subprocess.run([*command, *files, *options], check=True, capture_output=True)
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
                spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
                seconds, each = time.perf_counter() - start, 1e3 * spent / images
                largest = f"{after.ru_maxrss / 1024:.0f}"
                cells = (f"{share:.0%}", protocol, f"{seconds:.1f}", f"{each:.0f}", largest)
                print("  ".join(f"{text:>15}" for text in cells), flush=True)


if __name__ == "__main__":
    main()
