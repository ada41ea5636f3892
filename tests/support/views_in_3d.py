"""What a browser shows of a 3D page: the pixels of a view in a screenshot, and where they are.

The page is as high as SIDE, and a square image fills the middle of what the controls
leave when one looks from its camera.
"""

import io
import time
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image

SIDE = 400
WIDTH = 1400  # a warning of viser about WebGL in software is left of the view
CONTROLS = 324  # pixels beside the drawing
LEFT = (WIDTH - CONTROLS - SIDE) // 2
WHITE = 245  # all channels of the background are above it
SECONDS = 120  # that a drawing without a GPU may take on a busy machine
SAME = 0.9  # intersection over union of two drawings of one view, at least


@contextmanager
def served(rooms):
    """Serve a page of a file of rooms; give it and its server."""
    from scenegen.common.web_hosts import Hosts
    from scenegen.viewing.geometry import shapes_of
    from scenegen.viewing.page import RoomsPage, scene_rows
    from scenegen.viewing.server import started

    with started("test", Hosts(), 0) as server:
        yield RoomsPage(server, rooms, shapes_of(rooms.spec), scene_rows(rooms)), server


def visited(visit, server):
    """Open a server's page, wait until it has its controls, and return its `browser.Seen`."""
    seen = visit(f"http://127.0.0.1:{server.get_port()}/", width=WIDTH, height=SIDE)
    seen.page.set_default_timeout(SECONDS * 1000)
    seen.page.wait_for_selector("canvas", state="attached")
    seen.page.get_by_text("Look from this view").wait_for(state="attached")
    return seen


def switch(page, **values):
    """Give controls of a page new values, as its browsers do."""
    for name, value in values.items():
        page.controls[name].value = value


def click_pixel(seen, row, column, size):
    """Click where a page that looks from a view shows a pixel of its image."""
    seen.page.mouse.click(LEFT + (column + 0.5) * SIDE / size, (row + 0.5) * SIDE / size)


def picture(seen):
    """Return the part of the page that a view fills, (SIDE, SIDE, 3)."""
    clip = {"x": LEFT, "y": 0, "width": SIDE, "height": SIDE}
    with Image.open(io.BytesIO(seen.page.screenshot(clip=clip))) as found:
        return np.asarray(found.convert("RGB")).astype(int)


def saturated(pixels):
    """Return where the colour is that of an object's id, not the room's grey or nothing's white."""
    return np.ptp(pixels, axis=-1) > 40


def drawn(pixels):
    """Return where anything is drawn."""
    return (pixels < WHITE).any(axis=-1)


def enlarged(mask):
    """Return a mask of an image's pixels in the size of a picture."""
    place = (np.arange(SIDE) + 0.5) * len(mask) / SIDE
    return mask[np.ix_(place.astype(int), place.astype(int))]


def overlap(first, second):
    """Return intersection over union of two masks."""
    return (first & second).sum() / max((first | second).sum(), 1)


def eventually(measure, least, seconds=SECONDS):
    """Measure again and again until it is at least that; return the value. A page draws late."""
    end = time.monotonic() + seconds
    while (found := measure()) < least:
        if time.monotonic() > end:
            pytest.fail(f"{found} after {seconds} s, expected {least} at least")
        time.sleep(0.1)
    return found
