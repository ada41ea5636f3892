"""The audit of questions about furnished rooms: what holds, and what is found in wrong files."""

import json
import shutil

import h5py
import numpy as np
import pytest
from audit_tables import audited

from iqtt.audit.proofs.rooms import same_arrangement
from iqtt.files.reader import QuestionsFile

VAL = "iqtt-val.h5"


@pytest.fixture
def failing(rooms_folder, tmp_path, monkeypatch):
    """Let `edit` at a copy of a file; return the proofs that fail when it is audited.

    Rays are cast, and images traced, only if `rendered`.
    """

    def fail(edit, *others, rendered=False):
        if not rendered:
            monkeypatch.setattr("iqtt.audit.audit.CAST", 0)
        for name in (VAL, *others):
            shutil.copy(rooms_folder / name, tmp_path)
        with h5py.File(tmp_path / VAL, "r+") as file:
            edit(file)
        found = audited([tmp_path], probed=0)
        failed = {proof.name for proof in found.proofs if proof.status == "FAIL"}
        assert "content" in failed  # as digests are those of before
        return failed - {"content"}

    return fail


def edit_scene(image, change, row=0):
    """Change the JSON of an image's scene."""

    def edit(file):
        scenes = file["truth/scene"]
        scene = json.loads(scenes[row, image].decode())
        change(scene)
        scenes[row, image] = json.dumps(scene, separators=(",", ":")).encode()

    return edit


def test_all_proofs_hold(rooms_folder):
    found = audited([rooms_folder], probed=0)
    assert found.passed, found.proofs
    assert {proof.status for proof in found.proofs} == {"ok"}


def test_a_wrong_key_is_found(failing):
    def wrong(file):
        right = int(file["answers"][0])
        file["answers"][0] = (right + 1) % 3
        kinds = file["truth/distractor_kind"][0]
        file["truth/distractor_kind"][0] = np.roll(kinds, 1)

    assert "one correct option" in failing(wrong)


def test_a_wrong_key_whose_scenes_agree_is_found_in_the_images(failing):
    def wrong(file):
        right, other = int(file["answers"][0]), (int(file["answers"][0]) + 1) % 3
        scenes = file["truth/scene"][0]
        scenes[[1 + right, 1 + other]] = scenes[[1 + other, 1 + right]]
        file["truth/scene"][0] = scenes
        file["answers"][0] = other
        file["truth/distractor_kind"][0] = np.roll(file["truth/distractor_kind"][0], other - right)

    assert "traced again" in failing(wrong, rendered=True)


def test_swapped_images_are_found(failing):
    def swap(file):
        images = file["questions"][0]
        file["questions"][0] = images[[0, 2, 1, 3]]

    assert failing(swap, rendered=True) == {"traced again"}


def test_a_room_of_another_split_is_found(failing, rooms_folder):
    def shared(file):
        with h5py.File(rooms_folder / "iqtt-test-answers.h5") as test:
            text = test["truth/scene"][0]
        scenes, attributes = file["truth/scene"][()], dict(file["truth/scene"].attrs)
        kind = h5py.string_dtype(length=max(scenes.dtype.itemsize, *map(len, text)))
        scenes = scenes.astype(kind)
        scenes[0] = text
        del file["truth/scene"]
        file["truth"].create_dataset("scene", data=scenes).attrs.update(attributes)

    assert "rooms apart" in failing(shared, "iqtt-test.h5", "iqtt-test-answers.h5")


def test_an_object_that_is_not_in_play_moves_in_one_answer(failing):
    def move(scene):
        scene["objects"][0]["position"][0] += 0.25

    assert "labels" in failing(edit_scene(2, move))


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda file: file["truth/angle_degrees"].write_direct(np.array([30.0, 31.0])), "views"),
        (lambda file: file["truth/visible_pixels"].write_direct(
            file["truth/visible_pixels"][()] + 9), "visibility"),
        (lambda file: file["truth/in_play"].write_direct(
            np.array([1] * 2, np.int8)), "labels"),
        (edit_scene(1, lambda s: s["interior"].update(hour=1.0)), "rooms"),
        (edit_scene(1, lambda s: s["cameras"][0]["position"].__setitem__(1, 1.0)), "views"),
        (edit_scene(1, lambda s: s.clear()), "rooms"),
    ],
)  # fmt: skip
def test_other_wrong_values_are_found(failing, change, name):
    assert name in failing(change, rendered=name == "visibility")


def test_arrangements_are_compared_up_to_motions_but_not_mirror_images(rooms_folder):
    with QuestionsFile(rooms_folder / VAL) as table:
        reference, *options = table.truth(0).scenes
        answer = int(table.read("answers", 0))
    same = [k for k, scene in enumerate(options) if same_arrangement(reference, scene)]
    assert same == [answer]
