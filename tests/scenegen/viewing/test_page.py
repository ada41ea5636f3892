"""The 3D page in a real browser: what it shows is what the file says that its cameras see."""

import re

import pytest

pytest.importorskip("viser")

from views_in_3d import (
    SAME,
    click_pixel,
    drawn,
    enlarged,
    eventually,
    overlap,
    picture,
    saturated,
    served,
    switch,
    visited,
)

from scenegen import open_rooms

SIZE = 64


@pytest.fixture(scope="module")
def rooms(make_rooms, tmp_path_factory):
    path = tmp_path_factory.mktemp("viewing") / "rooms.h5"
    settings = {"height": SIZE, "width": SIZE, "min_visible_pixels": 80, "views": (0, 60)}
    made = make_rooms(path, 2, shapes=("box", "pyramid"), objects=(2, 2), **settings)
    with open_rooms(made) as file:
        yield file


def objects(room):
    return enlarged(room.object_id > 0)


def test_coverage_clicks_and_the_slider(visit, rooms):
    """Surfels and meshes, each by themselves, cover the pixels that the file gives to objects."""
    first, turned, other = (objects(rooms[row]) for row in (0, 1, 2))
    with served(rooms) as (page, server):
        seen = visited(visit, server)
        switch(page, meshes=False, cameras=False, size=1.2, colour="Object id")
        eventually(lambda: overlap(saturated(picture(seen)), first), SAME)
        shown = saturated(picture(seen))
        # A wrong pose, or a mirrored axis, would not pass.
        assert max(overlap(shown, wrong) for wrong in (turned, first[:, ::-1], first[::-1])) < 0.7
        y, x = (int(axis[len(axis) // 2]) for axis in (rooms[0].object_id > 0).nonzero())
        click_pixel(seen, y, x, SIZE)
        told = seen.page.get_by_text(f"row {y}, column {x}", exact=True)
        told.wait_for(state="attached")
        assert seen.page.get_by_text(f"{rooms[0].depth[y, x]:.5f}", exact=True).count() == 1

        switch(page, truth=False, meshes=True)
        eventually(lambda: overlap(drawn(picture(seen)), first), SAME)
        switch(page, view="View 1, row 1")
        eventually(lambda: overlap(drawn(picture(seen)), turned), SAME)

        seen.page.get_by_role("slider").first.press("ArrowRight")
        text = seen.page.get_by_text(re.compile("^Scene 1: 2 views of 64 x 64 pixels"))
        text.wait_for(state="attached")
        eventually(lambda: overlap(drawn(picture(seen)), other), SAME)


def test_a_scene_that_cannot_be_read(damaged):
    """It is said on the page, and the next scene is shown all the same."""

    def no_angle(file):
        file["camera/fov_y_degrees"][0] = 0

    with open_rooms(damaged(no_angle)) as file, served(file) as (page, _):
        assert "row 0: fov_y_degrees" in page.text
        switch(page, scene=1)
        assert "Scene 1:" in page.text
        switch(page, scene=0)
        assert "cannot be shown" in page.text
