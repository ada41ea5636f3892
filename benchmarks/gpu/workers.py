"""Images a second of `scenegen render` on two devices, by the number of processes.

`python -m benchmarks.gpu.workers [--images 20000] [--device cuda]`
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tabulate import tabulate

from scenegen.common.cgroup import processors
from scenegen.common.errors import BackendError
from scenegen.description.presets import preset_spec
from scenegen.rendering.backend import select_variant
from scenegen.rooms.make import make_dataset

WORKERS = (1, 2, 4, 8, 16)


def images_a_second(device: str, workers: int, images: int) -> float:
    """Return the rate of one run of preset `shapes`, 128 pixels, start and closed file included."""
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        start = time.perf_counter()
        spec = preset_spec("shapes")
        make_dataset(Path(folder) / "rooms.h5", spec, images, workers=workers, device=device)
        return images / (time.perf_counter() - start)


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gpu.workers", description=__doc__)
    parser.add_argument("--images", type=int, default=20_000, help="images of one run  [20000]")
    parser.add_argument("--device", default="cuda", help="beside the CPU  [cuda]")
    parser.add_argument("--workers", type=int, nargs="+", default=WORKERS, help="processes")
    options = parser.parse_args()
    devices = list(dict.fromkeys((options.device, "cpu")))
    try:
        for device in devices:
            select_variant(device)
    except BackendError as error:
        sys.exit(f"benchmarks.gpu.workers: {error}")
    print(
        f"\nImages a second of `scenegen render --n {options.images}`, {processors()} processors:\n"
    )
    rows = []
    for workers in options.workers:
        rates = [images_a_second(device, workers, options.images) for device in devices]
        rows.append([str(workers), *(f"{rate:,.0f}" for rate in rates)])
    print(tabulate(rows, ("processes", *devices), "pipe", disable_numparse=True))


if __name__ == "__main__":
    main()
