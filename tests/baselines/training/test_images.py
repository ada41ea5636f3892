"""Images as networks take them, the order of rows, and files that forked processes read."""

import os
import pickle
import time
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

from baselines.training.data import Opened
from baselines.training.images import Draws, channels_first, read_ahead, reduced
from scenegen import open_rooms
from scenegen.common.errors import FileFormatError


def test_images_are_means_of_blocks_channels_first():
    image = np.random.default_rng(0).random((6, 6, 3)).astype(np.float32)
    parts = [image[i::3, j::3] for i in range(3) for j in range(3)]
    np.testing.assert_allclose(reduced(image, 2), sum(parts) / 9, rtol=1e-6)
    found = channels_first(image, 2)
    assert (found.shape, found.dtype, found.flags.c_contiguous) == ((3, 2, 2), np.float32, True)
    np.testing.assert_array_equal(found, np.moveaxis(reduced(image, 2), -1, 0))


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30, -1e30])
def test_radiance_that_networks_cannot_take_is_refused(value):
    image = np.zeros((4, 4, 3), np.float32)
    image[1, 2, 0] = value
    with refused(FileFormatError, "row 7"):
        channels_first(image, 4, "row 7")


def test_every_process_opens_the_file_for_itself(rooms_path):
    opened = Opened(partial(open_rooms, rooms_path))
    assert opened.file is opened.file
    child = os.fork()
    if not child:
        os._exit(0 if opened.file.read("image", 7).shape == (32, 32, 3) else 1)
    assert os.waitpid(child, 0)[1] == 0
    again = pickle.loads(pickle.dumps(opened))
    assert again.file is not opened.file
    assert (again.file.read("image", 3) == opened.file.read("image", 3)).all()


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 20), st.integers(1, 7), st.integers(0, 2**32), st.integers(0, 30))
def test_a_batch_depends_on_its_number_alone(rows, batch, seed, first):
    through = list(islice(Draws(rows, batch, seed), first + 3))
    assert list(islice(Draws(rows, batch, seed, first), 3)) == through[first:]
    drawn = [row for batch_rows in through for row in batch_rows]
    assert len(drawn) == batch * (first + 3)
    for epoch in range(len(drawn) // rows):
        assert sorted(drawn[epoch * rows : (epoch + 1) * rows]) == list(range(rows))


@dataclass(frozen=True, eq=False)
class Batch:
    image: torch.Tensor


@pytest.mark.parametrize(("device", "ahead"), [("cpu", 0), ("meta", 3)])
def test_batches_for_a_gpu_are_read_ahead_in_their_order(device, ahead):
    read: list[int] = []

    def batches():
        for number in range(6):
            read.append(number)
            yield Batch(torch.zeros(number))

    found = read_ahead(batches(), torch.device(device))
    assert (len(next(found).image), read[:1]) == (0, [0])
    for _ in range(100):
        if len(read) == 1 + ahead:
            break
        time.sleep(0.01)
    assert read == list(range(1 + ahead))
    rest = list(found)
    assert [len(batch.image) for batch in rest] == [1, 2, 3, 4, 5]
    assert {batch.image.device.type for batch in rest} == {device}
