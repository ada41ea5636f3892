"""URLs as targets: in memory, and of a local S3 server; the bytes are those of local files."""

import gc
import importlib
import os
import tempfile
from contextlib import closing

import pytest

from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.files.places import as_place, files_below, is_remote
from scenegen.files.sets.making import complete_parts, parts_folder

pytest.importorskip("upath")
SPLIT = SplitSpec(
    seed=5, train=2, labeled=1, val=1, test=1, cubes=(6, 7), height=24, width=24, min_cube_pixels=1
)  # fmt: skip


@pytest.fixture(scope="module")
def bucket():
    """Return the URL of a bucket of a local S3 server."""
    moto = pytest.importorskip("moto.server")
    boto3 = pytest.importorskip("boto3")
    server = moto.ThreadedMotoServer(port=0, verbose=False)
    server.start()
    endpoint = "http://{}:{}".format(*server.get_host_and_port())
    own = {
        "AWS_ENDPOINT_URL": endpoint, "AWS_ACCESS_KEY_ID": "a", "AWS_SECRET_ACCESS_KEY": "b",
        "AWS_DEFAULT_REGION": "us-east-1",
    }  # fmt: skip
    before = dict(os.environ)
    os.environ.update(own)
    with closing(boto3.client("s3")) as client:
        client.create_bucket(Bucket="bucket")
    yield "s3://bucket"
    importlib.import_module("s3fs").S3FileSystem.clear_instance_cache()
    gc.collect()  # sessions of the store end here, while it still answers
    os.environ.clear()
    os.environ.update(before)
    server.stop()
    server._server.server_close()


@pytest.fixture(params=["s3", pytest.param("memory", marks=pytest.mark.slow)])
def home(request):
    """Return the URL of an empty folder in a store."""
    name = f"{os.urandom(4).hex()}"
    if request.param == "memory":
        return f"memory://{name}"
    return f"{request.getfixturevalue('bucket')}/{name}"


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Return the folder for temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.h5")}


def test_files_behind_urls_have_the_bytes_of_local_ones(home, temporary, make_rooms, tmp_path):
    local = tmp_path / "local"
    local.mkdir()
    for place in (local, home):
        make_rooms(f"{place}/one.h5", 1)
        make_rooms(f"{place}/rooms.h5", 3, {"shard_size": 2})
        make_split(f"{place}/split", SPLIT, shard_size=100)
    for name in ("", "split"):
        assert contents(as_place(f"{home}/{name}")) == contents(local / name)
    assert not list(temporary.iterdir())


def test_a_run_goes_on_behind_a_url(home, temporary, make_rooms, tmp_path):
    path, done = f"{home}/rooms.h5", []

    def stop(rows):
        done.append(rows)
        if sum(done) > 4:
            raise KeyboardInterrupt

    options = {"shard_size": 2, "batch": 2}
    with pytest.raises(KeyboardInterrupt):
        make_rooms(path, 7, {**options, "progress": stop})
    kept = complete_parts(parts_folder(as_place(path)))
    assert kept
    assert not contents(as_place(home))
    min(kept.values()).write_bytes(b"damaged")
    with pytest.raises(SpecError):
        make_rooms(path, 7, options, seed=99)
    make_rooms(path, 7, options)
    make_rooms(tmp_path / "rooms.h5", 7, options)
    assert contents(as_place(home)) == contents(tmp_path)
    with pytest.raises(FileExistsError):
        make_rooms(path, 7, options)
    make_rooms(path, 3, {**options, "overwrite": True})
    names = ["rooms-00000-of-00002.h5", "rooms-00001-of-00002.h5", "rooms.h5"]
    assert sorted(contents(as_place(home))) == names
    assert not list(temporary.iterdir())


@pytest.mark.parametrize("url", ["s3://no-such-bucket-of-ours/rooms.h5", "nothing://x/rooms.h5"])
def test_a_store_that_refuses_is_told_before_the_run(bucket, make_rooms, url, temporary):
    with pytest.raises((OSError, SceneGenError)) as refused:
        make_rooms(url, 5, {"shard_size": 2, "progress": pytest.fail})
    assert url.removesuffix("rooms.h5") in str(refused.value)
    assert not list(temporary.iterdir())


def test_a_path_of_this_machine_is_no_url(tmp_path):
    assert not is_remote(as_place(str(tmp_path)))
    assert not is_remote(as_place(f"file://{tmp_path}"))
    assert is_remote(as_place("memory://x/rooms.h5"))


def test_files_below_follow_links_that_end(tmp_path):
    """A folder that links to one above it, or that two links lead to, is entered once."""
    for name in ("a/b/2.png", "a/1.png", "a/no.txt", "beside/3.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "a/b/above").symlink_to(tmp_path / "a")
    (tmp_path / "a/b/linked").symlink_to(tmp_path / "beside")
    (tmp_path / "a/dead.png").symlink_to(tmp_path / "nothing.png")
    names = [path.relative_to(tmp_path).as_posix() for path in files_below(tmp_path / "a", "*.png")]
    assert names == ["a/1.png", "a/b/2.png", "a/b/linked/3.png"]
    assert [path.name for path in files_below(tmp_path, "*/b/*.png")] == ["2.png", "3.png"]
    (tmp_path / "0").symlink_to(tmp_path / "a")  # of two paths the one without a link counts
    for name in ("again", "once more"):
        (tmp_path / "a/b" / name).symlink_to(tmp_path)
    names = [path.relative_to(tmp_path).as_posix() for path in files_below(tmp_path, "*.png")]
    assert names == ["a/1.png", "a/b/2.png", "beside/3.png"]
