"""Seconds from a move of the slider of a 3D page to the new scene.

    OMP_NUM_THREADS=1 python -m benchmarks.viewing [rooms.h5] [--scenes 12] [--browser]

Without a file, rooms of 128 x 128 pixels are rendered first: 5 views of each scene, three basic
shapes, and three everyday objects. `server` is the time to read the views, make surfels, meshes and
cameras of them and queue these for the browser. `browser` ends when Chromium has drawn a frame
with them. It draws without a GPU, which is the worst case; `frame` is the time of a frame when
nothing changes, and nothing new can show sooner. Each scene is shown for the first time. The
medians and the slowest are printed, with the load of the machine, which says whether other programs
took part of it.
"""

import argparse
import os
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from scenegen.description.specs import DatasetSpec
from scenegen.rooms.make import make_dataset
from scenegen.rooms.reader import RoomsFile
from scenegen.viewing.contents import about_scene, rooms_contents
from scenegen.viewing.geometry import shapes_of
from scenegen.viewing.page import ScenePage
from scenegen.viewing.server import address, started

VIEWS = (0, 5, 35, 55, 80)
MADE = {
    "basic shapes": {},
    "everyday objects": {"source": "families", "shapes": ("chair", "lamp", "mug", "bag", "cap")},
}
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
FRAME = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
DRAWN = """text => new Promise(done => {
    const look = () => document.body.innerText.includes(text)
        ? requestAnimationFrame(() => requestAnimationFrame(done)) : requestAnimationFrame(look);
    look();
})"""


@contextmanager
def chromium(url: str) -> Iterator[Callable[[str], Any]]:
    """Open a page; give the function that waits until it says a text and has drawn.

    Without a text it waits for two frames.
    """
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=list(FLAGS)
        )
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.set_default_timeout(120_000)
        page.goto(url)
        yield lambda text: page.evaluate(DRAWN, text) if text else page.evaluate(FRAME)
        browser.close()


def measure(path: Path, scenes: int, in_browser: bool) -> dict[str, list[float]]:
    """Return the seconds that each of some scenes took, by what was waited for."""
    found: dict[str, list[float]] = {"server": [], "browser": [], "frame": []}
    with RoomsFile(path) as rooms, started("benchmark", "127.0.0.1", 0) as server:
        contents = rooms_contents(rooms)
        rows = contents.scenes()[: scenes + 1]
        page = ScenePage(server, rooms, shapes_of(rooms.spec), contents)
        page.show()

        def move(wait: Callable[[str], Any]) -> None:
            wait("Scene 0:")
            for k in range(1, len(rows)):
                before = time.perf_counter()
                page.controls["scene"].value = k
                found["server"].append(time.perf_counter() - before)
                if in_browser:
                    wait(about_scene([rooms[rows[k][0]]]).partition(">")[2].partition(" views")[0])
                    found["browser"].append(time.perf_counter() - before)
                    before = time.perf_counter()
                    wait("")
                    found["frame"].append((time.perf_counter() - before) / 2)

        if in_browser:
            with chromium(address(server)) as wait:
                move(wait)
        else:
            move(lambda text: None)
    return found


def main() -> None:
    """Print a line for each file and each thing that was waited for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, help="rooms to show [some are rendered]")
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--browser", action="store_true", help="measure in Chromium, too")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        files = {str(arguments.file): arguments.file}
        if arguments.file is None:
            files = {name: Path(folder) / f"{name}.h5" for name in MADE}
            for name, path in files.items():
                spec = DatasetSpec(**{"views": VIEWS, "objects": (3, 3), **MADE[name]})
                make_dataset(path, spec, arguments.scenes + 1, command="benchmark")
        for name, path in files.items():
            for what, times in measure(path, arguments.scenes, arguments.browser).items():
                if times:
                    middle, most = statistics.median(times), max(times)
                    load = os.getloadavg()[0] / (os.cpu_count() or 1)
                    print(f"{name}: {what} {middle:.2f} s, slowest {most:.2f} s of {len(times)};"
                          f" load {load:.1f} a core")  # fmt: skip


if __name__ == "__main__":
    main()
