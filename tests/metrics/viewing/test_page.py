"""The page of predictions: where its surfels are, and what a click tells of them."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser")

from views_in_3d import click_pixel, eventually, picture, switch, visited

from metrics.prediction_writer import RoomPredictionWriter
from metrics.submissions.reader import open_predictions
from metrics.viewing.order import shown_scores
from metrics.viewing.page import (
    ALONE,
    BESIDE,
    RIGHT,
    SAME,
    TOO_FAR,
    TOO_NEAR,
    UNKNOWN,
    PredictionPage,
    aside,
    error_colors,
)
from scenegen import open_rooms
from scenegen.common.web_hosts import Hosts
from scenegen.viewing.geometry import shapes_of
from scenegen.viewing.server import started

SIZE = 32  # of the truths' images
WORST = 5
FACTORS = {3: 1.001, WORST: 1.1, 6: 1.02}  # of the true depth, by row


@pytest.fixture
def served(truths, tmp_path):
    """A page of three rows, of one of which the left half is too near and three pixels are none."""
    path = tmp_path / "predictions.h5"
    with open_rooms(truths.rooms) as rooms:
        with RoomPredictionWriter(path, truths.rooms, method="m", allow_partial=True) as out:
            for row, factor in FACTORS.items():
                depth = rooms[row].depth * factor
                if row == WORST:
                    depth[:, : SIZE // 2] *= 0.8
                out.add(row, depth, rooms[row].normal)
        import h5py

        with h5py.File(path, "r+") as file:
            file["depth"][1, 0, :3] = np.nan, np.inf, -1
        with open_predictions(path) as found, started("test", Hosts(), 0) as server:
            scores = shown_scores(found, rooms)
            page = PredictionPage(server, rooms, found, scores, shapes_of(rooms.spec))
            yield rooms, page, server


def clouds(page):
    return {cloud.name: cloud for cloud in page.clouds}


def test_colours_of_errors_tell_sign_and_size():
    colors = error_colors(np.array([-9.0, -0.1, 0.0, 0.05, 0.1, np.inf, np.nan]), 0.1)
    half = np.rint(np.add(RIGHT, TOO_FAR) / 2 + 1e-9)
    assert np.abs(colors[3] - half).max() <= 1
    others = [TOO_NEAR, TOO_NEAR, RIGHT, TOO_FAR, UNKNOWN, UNKNOWN]
    assert colors[[0, 1, 2, 4, 5, 6]].tolist() == [list(color) for color in others]


def test_surfels_are_beside_the_truth(served):
    rooms, page, server = served
    switch(page, sort="AbsRel", place=BESIDE)
    assert f"row {WORST}" in page.text
    assert "3 pixels" in page.text
    made = clouds(page)
    truth, predicted = made[f"/truth/{WORST}"], made[f"/prediction/{WORST}"]
    assert len(predicted.surfels.points) == SIZE**2 - 3
    room = rooms[WORST]
    right = room.world_from_camera[:3, 0]
    gap = (predicted.surfels.points @ right).min() - (truth.surfels.points @ right).max()
    assert gap > -0.1, "hardly any overlap"
    eye = room.world_from_camera[:3, 3]
    for i, marks in ((0, 1), (40, 2)):  # the first pixels have no prediction
        way = truth.surfels.points[i] - eye
        camera = SimpleNamespace(fov=1.0, image_height=10_000)
        client = SimpleNamespace(camera=camera)
        ray = {"ray_origin": eye, "ray_direction": way / np.linalg.norm(way)}
        page._click(SimpleNamespace(client=client, **ray))
        names = [f"/mark/{k}" for k in range(3)]
        handles = [server.scene.get_handle_by_name(name) for name in names]
        assert sum(handle is not None for handle in handles) == marks
        assert np.allclose(handles[0].position, truth.surfels.points[i])
    switch(page, place=SAME)
    moved = predicted.surfels.points - clouds(page)[f"/prediction/{WORST}"].surfels.points
    np.testing.assert_allclose(moved, np.broadcast_to(aside(room), moved.shape), atol=1e-5)
    switch(page, place=ALONE)
    assert list(clouds(page)) == [f"/prediction/{WORST}"]
    colors = predicted.colors[predicted.surfels.pixels[:, 1] >= SIZE // 2]
    assert {tuple(color) for color in colors.tolist()} == {TOO_FAR}
    switch(page, scene=2)
    assert "row 3" in page.text
    assert np.abs(clouds(page)["/prediction/3"].colors - np.array(RIGHT, float)).max() < 12
    switch(page, sort="delta 1")
    assert page.controls["scene"].value == 0


@pytest.mark.slow
def test_both_depths_in_a_browser(visit, served):
    rooms, page, server = served
    switch(page, sort="AbsRel", place=ALONE, meshes=False, lights=False)
    seen = visited(visit, server)

    def share_of_blue():
        return (np.abs(picture(seen) - TOO_NEAR).max(axis=-1) < 12).mean()

    assert eventually(share_of_blue, 0.4) < 0.6, "the left half"
    click_pixel(seen, 20, 25, SIZE)
    true = float(rooms[WORST].depth[20, 25])
    for text in ("row 20, column 25", f"{true:.5f}", f"{np.float32(true * 1.1):.5f}"):
        seen.page.get_by_text(text, exact=True).wait_for(state="attached")
    assert seen.page.get_by_text(re.compile(r"^\+0\.1")).count() == 1
    seen.page.get_by_role("slider").first.press("ArrowRight")
    seen.page.get_by_text("View 0, row 6", exact=True).first.wait_for(state="attached")
