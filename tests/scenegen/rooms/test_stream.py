"""Streams of rooms have the bits of files of rooms."""

import itertools
import os
import subprocess
import sys

import numpy as np
import pytest
from streamed import check_equal, stored

from scenegen import DatasetSpec, RoomStream, preset_spec
from scenegen.common.errors import BackendError, SpecError
from scenegen.description.presets import PRESETS
from scenegen.rooms.make import make_dataset

TINY = {"height": 32, "width": 32, "min_visible_pixels": 3, "seed": 3}
VIEWS = {**TINY, "views": (0.0, 35.0), "truth": ("amodal", "coordinates", "flow", "albedo")}
IN_PLAIN_LOADER = """
import sys, scenegen, warnings
warnings.simplefilter("ignore", DeprecationWarning)  # 3.12 on: forking a process with threads
from torch.utils.data import DataLoader
stream = scenegen.RoomStream(scenegen.DatasetSpec(height=16, width=16), batch=8, stop=40,
                             fields=["scene_index"])
here = [batch["scene_index"].tolist() for batch in stream]  # the renderer is loaded, with threads
loader = DataLoader(stream, batch_size=None, num_workers=2, multiprocessing_context="fork")
assert [batch["scene_index"].tolist() for batch in loader] == here == [
    list(range(i, i + 8)) for i in range(0, 40, 8)]
print("rendered")
"""


@pytest.fixture(scope="module")
def rooms(make_rooms, tmp_path_factory):
    return stored(make_rooms(tmp_path_factory.mktemp("stream") / "rooms.h5", 9, **VIEWS))


def test_rows_are_those_of_the_file(rooms):
    """With rows of one scene in two batches, and two ranks."""
    spec = DatasetSpec(**VIEWS)
    check_equal(RoomStream(spec, fields=[*rooms], batch=7, stop=18), rooms)
    second = {name: values[[3, 4, 5, 9, 10, 11, 15, 16, 17]] for name, values in rooms.items()}
    stream = RoomStream(spec, fields=[*rooms], batch=3, stop=18, rank=1, world_size=2)
    check_equal(stream, second)
    for name in ("image", "depth", "flow", "camera/fov_y_degrees"):  # nothing else is computed
        alone = RoomStream(spec, fields=[name], batch=64, start=5, stop=18)
        check_equal(alone, {name: rooms[name][5:]})
    assert stream.columns["depth"].unit == "scene unit"


def test_rows_come_from_processes_too(rooms):
    check_equal(RoomStream(DatasetSpec(**VIEWS), fields=["image"], batch=7, stop=18, workers=1),
                {"image": rooms["image"]})  # fmt: skip


def test_mixed_rows_are_those_of_their_request():
    specs = [DatasetSpec(**TINY), DatasetSpec(**{**TINY, "seed": 4, "objects": (2, 2)})]
    fields = ("image", "scene_index")
    alone = [next(iter(RoomStream(spec, fields=fields, stop=24, batch=24))) for spec in specs]
    (both,) = RoomStream(dict(zip(specs, (1, 2), strict=True)), fields=fields, stop=24, batch=24)
    assert abs(np.count_nonzero(both["spec"]) - 16) <= 1
    for row, which in enumerate(both["spec"]):
        assert both["scene_index"][row] == row
        np.testing.assert_array_equal(both["image"][row], alone[which]["image"][row])


def test_pixels_stay_on_the_device_and_reach_torch_without_a_copy(rooms):
    torch = pytest.importorskip("torch")
    spec = DatasetSpec(**{**VIEWS, "truth": ()})
    fields = ("image", "depth", "normal", "object_id", "scene_index")
    stream = RoomStream(spec, fields=fields, batch=7, stop=18, device="cpu", on_device=True)
    batches = list(stream)
    for name in fields:
        tensors = [torch.from_dlpack(batch[name]) for batch in batches]
        np.testing.assert_array_equal(torch.cat(tensors).numpy(), rooms[name], err_msg=name)
        assert len({tensor.data_ptr() for tensor in tensors}) == 3
    again = torch.from_dlpack(batches[0]["depth"])
    assert again.data_ptr() == torch.from_dlpack(batches[0]["depth"]).data_ptr()


@pytest.mark.parametrize(
    ("spec", "how", "error", "told"),
    [
        (DatasetSpec(height=4096, width=4096), {"batch": 17}, SpecError, "16 images"),
        ({"shapes": 1, "furniture-256": 1}, {"fields": ["image"]}, SpecError, None),
        ("shapes", {"fields": ["image", "dept"]}, SpecError, "camera/fov_y_degrees.* depth"),
        ("shapes", {"fields": ["flow"]}, SpecError, None),  # of one view
        ("shapes", {"on_device": True, "workers": 1}, SpecError, None),
        (3, {}, SpecError, None),
        ("shapes", {"device": "gpu"}, BackendError, None),
    ],
)
def test_settings_that_no_stream_has(spec, how, error, told):
    with pytest.raises(error, match=told):
        RoomStream(spec, **how)
    assert list(RoomStream("shapes", start=9, stop=3, workers=2)) == []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="forks")
def test_a_fork_of_a_process_that_has_rendered_renders():
    pytest.importorskip("torch")
    path = os.pathsep.join(sys.path)
    line = [sys.executable, "-c", IN_PLAIN_LOADER]
    done = subprocess.run(
        line, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    assert done.stdout == "rendered\n", done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_all_presets_have_the_bits_of_files(preset, tmp_path):
    small = {"spp": 2} if PRESETS[preset].kind.interior else {}
    spec = preset_spec(preset, height=32, width=32, **small)
    views = len(spec.views)
    count = 3 if small else 75 // views
    make_dataset(tmp_path / "rooms.h5", spec, count)
    expected = stored(tmp_path / "rooms.h5")
    ways = [(7, 1)] if small else itertools.product((1, 7, 64), (0, 1, 2))
    for batch, workers in ways:
        stream = RoomStream(
            spec, fields=[*expected], batch=batch, stop=count * views, workers=workers
        )
        check_equal(stream, expected)
