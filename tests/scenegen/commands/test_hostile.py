"""Whatever a user asks of `scenegen render` or names as a file: one clear line, and exit code 2."""

import shutil
import subprocess
import sys
import time

import pytest

RENDER = ("render", "--n", "2", "--size", "32", "--min-visible-pixels", "3", "--out", "o.h5")
FORMAT = "pix2shape-bench/rooms"
# Option, value, and what the line must say: the option's name, what was found, what was expected.
OPTIONS = [
    ("--n", "0", "n: found 0", "from 1 to"),
    ("--n", "-1", "n: found -1", "from 1 to"),
    ("--n", "abc", "--n", "'abc'", "integer"),
    ("--n", "1.5", "--n", "'1.5'", "integer"),
    ("--n", "", "--n", "''", "integer"),
    ("--n", 2**70, f"found {2**70}", "expected"),
    ("--size", "0", "size: found 0", "at least 8"),
    ("--size", "4x4", "size: found 4x4", "at least 8"),
    ("--size", "999999", "size: found 999999", "at most"),
    ("--size", "4096x4097", "size: found 4096x4097", "at most"),
    ("--size", "4096", "batch: found 64", "at most 16 images of this size"),
    ("--size", "12xx", "--size", "'12xx'", "HxW"),
    ("--size", "1x2x3", "--size", "'1x2x3'", "HxW"),
    ("--size", "-5", "--size", "'-5'", "HxW"),
    ("--size", "", "--size", "''", "HxW"),
    ("--size", "\N{SUPERSCRIPT TWO}", "--size", "HxW"),
    ("--objects", "3-1", "objects: found 3-1", "rising range", "0-100"),
    ("--objects", "200", "objects: found 200,", "0-100"),
    ("--objects", "-1", "--objects", "'-1'", "number or a range"),
    ("--objects", "a-b", "--objects", "'a-b'", "number or a range"),
    ("--objects", "1-2-3", "--objects", "'1-2-3'", "number or a range"),
    ("--objects", "1.5", "--objects", "'1.5'", "number or a range"),
    ("--objects", "1-", "--objects", "'1-'", "number or a range"),
    ("--shapes", "", "shapes: found", "box, sphere, cone"),
    ("--shapes", "box,", "shapes: found", "box, sphere, cone"),
    ("--shapes", "ball", "shapes: found 'ball'", "box, sphere, cone"),
    ("--shapes", "box;sphere", "shapes: found 'box;sphere'", "box, sphere, cone"),
    ("--shapes", "box,box", "shapes: found", "box", "each name once"),
    ("--lights", "-1", "--lights", "'-1'", "number or a range"),
    ("--lights", "99", "lights: found 99,", "0-16"),
    ("--lights", "2-1", "lights: found 2-1", "rising range"),
    ("--spp", "0", "spp: found 0", "1 to 1024"),
    ("--spp", "1025", "spp: found 1025", "1 to 1024"),
    ("--spp", "1e9", "--spp", "'1e9'", "integer"),
    ("--batch", "0", "batch: found 0", "1 to 4096"),
    ("--batch", 10**9, f"batch: found {10**9}", "1 to 4096"),
    ("--batch", "x", "--batch", "'x'", "integer"),
    ("--seed", "-1", "seed: found -1", "2**63 - 1"),
    ("--seed", 2**70, f"seed: found {2**70}", "2**63 - 1"),
    ("--seed", "x", "--seed", "'x'", "integer"),
    ("--object-radius", "0", "object radius: found 0", "0.005-0.5"),
    ("--object-radius", "5", "object radius: found 5", "0.005-0.5"),
    ("--object-radius", "nan", "--object-radius", "found 'nan'"),
    ("--object-radius", "0.2-0.1", "object radius: found 0.2-0.1", "rising range"),
    ("--object-radius", "big", "--object-radius", "'big'", "number or a range"),
    ("--object-radius", "0.5", "item 0", "objects", "smaller --object-radius"),
    ("--min-visible-pixels", "-1", "min visible pixels: found -1", "1024 pixels"),
    ("--min-visible-pixels", "1025", "min visible pixels: found 1025", "1024 pixels"),
    ("--min-visible-pixels", "1024", "item ", "1024 pixels", "--min-visible-pixels"),
    ("--pose", "flying", "--pose", "'flying'", "'resting', 'any'"),
    ("--image-dtype", "uint16", "--image-dtype", "'uint16'", "'uint8', 'float16', 'float32'"),
    ("--compression", "zip", "--compression", "'zip'", "'gzip', 'lzf', 'none'"),
    ("--device", "tpu", "--device", "'tpu'", "'auto', 'cpu', 'cuda'"),
    ("--out", ".", "is a folder"),
    ("--out", "", "is a folder"),
    ("--out", "none/x.h5", "none: ", "does not exist"),
    ("--out", "text/x.h5", "text: ", "not a folder"),
    ("--out", "/proc/x.h5", "/proc"),
    ("--out", "a" * 300 + ".h5", "too long"),
    ("--bogus", "1", "--bogus"),
]


@pytest.mark.parametrize("case", OPTIONS, ids=lambda case: f"{case[0]} {case[1]!s:.20}")
def test_render_options(refuses, tmp_path, case):
    (tmp_path / "text").write_text("mine")
    option, value, *words = case
    line = refuses(*RENDER, option, value, words=tuple(words))
    assert ".partial" not in line, "the user's name for it, not ours"


def test_the_longest_name_that_a_disk_takes(run, tmp_path):
    """Where the final name is possible, no hidden longer one may get in the way."""
    name = "b" * 252 + ".h5"
    assert run(*RENDER[:-1], name).exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_no_gpu_here(refuses, monkeypatch):
    monkeypatch.setattr("scenegen.rendering.backend._cuda_driver", lambda: False)
    refuses(*RENDER, "--device", "cuda", words=("cuda", "--device cpu"))


def test_missing_and_surplus_arguments(refuses):
    refuses("render", words=("--n",))
    refuses(*RENDER, "extra", words=("extra",))
    refuses("nosuch", words=("nosuch",))
    for command in ("info", "preview", "verify", "export"):
        refuses(command, words=("FILE",))


def test_what_cannot_be_placed_ends_within_a_minute(refuses):
    start = time.monotonic()
    words = ("item 0", "of its", "objects", "try", "--objects", "--object-radius")
    refuses("render", "--n", 5, "--objects", "1-40", "--out", "o.h5", words=words)
    assert time.monotonic() - start < 60


@pytest.mark.skipif(sys.platform != "linux", reason="sets Linux's limit of memory")
@pytest.mark.parametrize(
    "options",
    [
        ("render", "--n", "1000000000000", "--size", "32"),
        ("preview", "x", "--items", "0-9999999999"),
    ],
)
def test_huge_numbers_do_not_eat_the_memory(tmp_path, check_refusal, rooms_path, options):
    """With 4 GB of address space, so that a failing test harms nobody."""
    shutil.copy(rooms_path, tmp_path / "x")
    code = "import resource as r; r.setrlimit(r.RLIMIT_AS, (2**32, 2**32)); import cli; "
    done = subprocess.run(
        [sys.executable, "-c", code + "cli.scenegen()", *options],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    check_refusal(done.returncode, done.stdout, done.stderr)
    assert [path.name for path in tmp_path.iterdir()] == ["x"]
