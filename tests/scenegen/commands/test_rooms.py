"""The commands with the very options of the product's description, as a user types them."""

import contextlib
import json
import os
import re
import shlex
import struct
import subprocess
import sys
import time

import h5py
import pytest
from click.testing import CliRunner

import cli

EVERYTHING = (
    "render --n 4 --out x.h5 --seed 3 --size 64x96 --objects 1-2 --shapes box,teapot --lights 2"
    " --shadows --spp 4 --image-dtype float16 --compression lzf --batch 2 --device cpu --overwrite"
)
TINY = ("--size", "32", "--min-visible-pixels", "3")
OPTIONS = {
    "render": "n out seed size objects shapes object-radius pose lights shadows no-shadows spp"
    " min-visible-pixels allow-cropped image-dtype compression batch device overwrite",
    "preview": "out items random seed",
    "info": "",
    "verify": "items device",
    "export": "items format out overwrite",
}


def test_every_option_is_recorded(run, monkeypatch, tmp_path):
    (tmp_path / "x.h5").write_text("to be replaced")
    monkeypatch.setattr(sys, "argv", ["/somewhere/scenegen", *EVERYTHING.split()])
    result = run(*EVERYTHING.split())
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("x.h5: 4 images, ")
    with h5py.File("x.h5") as file:
        root = dict(file.attrs)
        assert file["image"].shape == (4, 64, 96, 3)
        assert file["image"].dtype == "float16"
        assert file["image"].compression == "lzf"
        assert set(file["object/count"][:]) <= {1, 2}
        assert list(file["object/shape"].attrs["names"]) == ["box", "teapot"]
        assert set(file["light/count"][:]) == {2}
    assert root["creation_command"] == f"scenegen {EVERYTHING}"
    assert root["variant"] == "llvm_ad_rgb"
    assert root["compression"] == "lzf"
    spec = json.loads(root["spec"])
    expected = {
        "seed": 3,
        "height": 64,
        "width": 96,
        "objects": [1, 2],
        "shapes": ["box", "teapot"],
        "lights": [2, 2],
        "shadows": True,
        "spp": 4,
        "image_dtype": "float16",
    }
    assert {name: spec[name] for name in expected} == expected


def test_defaults_are_those_of_the_description(run, monkeypatch):
    assert run("render", "--n", "1").exit_code == 0
    with h5py.File("rooms.h5") as file:
        spec = json.loads(file.attrs["spec"])
        assert file.attrs["compression"] == "gzip"
    expected = {
        "seed": 0,
        "height": 128,
        "width": 128,
        "objects": [1, 3],
        "lights": [1, 3],
        "shadows": False,
        "spp": 1,
        "image_dtype": "uint8",
        "allow_cropped": False,
        "pose": "resting",
    }
    assert {name: spec[name] for name in expected} == expected
    assert {"box", "sphere", "cone", "torus", "cylinder", "teapot"} <= set(spec["shapes"])
    assert 1 <= spec["min_visible_pixels"] < 128


@pytest.mark.parametrize(
    ("option", "setting"),
    [
        ("--no-shadows", ("shadows", False)),
        ("--size 24", ("height", 24)),
        ("--size 16X24", ("width", 24)),
        ("--objects 2", ("objects", [2, 2])),
        ("--objects 0", ("objects", [0, 0])),
        ("--lights 0-2", ("lights", [0, 2])),
        ("--shapes 'box, cone'", ("shapes", ["box", "cone"])),
        ("--object-radius 0.08-0.1", ("object_radius", [0.08, 0.1])),
        ("--object-radius 1e-1", ("object_radius", [0.1, 0.1])),
        ("--pose any", ("pose", "any")),
        ("--allow-cropped", ("allow_cropped", True)),
        ("--min-visible-pixels 0", ("min_visible_pixels", 0)),
        (f"--seed {2**63 - 1}", ("seed", 2**63 - 1)),
    ],
)
def test_single_options(run, option, setting):
    result = run("render", "--n", 2, *TINY, "--object-radius", "0.06-0.1", *shlex.split(option))
    assert result.exit_code == 0, result.output
    with h5py.File("rooms.h5") as file:
        assert json.loads(file.attrs["spec"])[setting[0]] == setting[1]


def test_without_overwrite_a_file_is_kept(run, refuses, tmp_path):
    assert run("render", "--n", 1, *TINY).exit_code == 0
    before = (tmp_path / "rooms.h5").read_bytes()
    refuses("render", "--n", 1, *TINY, "--seed", 1, words=("rooms.h5", "exists", "--overwrite"))
    assert (tmp_path / "rooms.h5").read_bytes() == before
    assert run("render", "--n", 1, *TINY, "--seed", 1, "--overwrite").exit_code == 0
    assert (tmp_path / "rooms.h5").read_bytes() != before


@pytest.mark.parametrize("command", OPTIONS)
def test_help_names_every_option(command):
    result = CliRunner().invoke(cli.scenegen, [command, "--help"])
    assert result.exit_code == 0
    for option in OPTIONS[command].split():
        assert f"--{option}" in result.output
    assert max(len(line) for line in result.output.splitlines()) <= 80


@pytest.mark.parametrize("group", [cli.scenegen, cli.iqtt, cli.bench])
def test_groups(group):
    result = CliRunner().invoke(group, ["--help"])
    assert result.exit_code == 0
    if group is cli.scenegen:
        listed = {line.split()[0] for line in result.output.split("Commands:")[1].splitlines()[1:]}
        assert set(OPTIONS) <= listed
    version = CliRunner().invoke(group, ["--version"])
    assert version.exit_code == 0
    assert "0." in version.output


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo terminal")
def test_progress_shows_rate_and_time_left_on_a_terminal_alone(tmp_path):
    import fcntl
    import pty
    import termios

    render = [sys.executable, "-c", "import cli; cli.scenegen()", "render", "--n", "400", *TINY]
    terminal, other_end = pty.openpty()
    fcntl.ioctl(other_end, termios.TIOCSWINSZ, struct.pack("4H", 24, 80, 0, 0))
    process = subprocess.Popen(render, cwd=tmp_path, stderr=other_end, stdout=subprocess.DEVNULL)
    os.close(other_end)
    shown = b""
    with contextlib.suppress(OSError):  # what the end of a terminal is on Linux
        while part := os.read(terminal, 4096):
            shown += part
    os.close(terminal)
    assert process.wait() == 0
    assert re.search(rb"\d+/400 \[\d\d:\d\d<\S+, +\S+img/s\]", shown), "elapsed<left, rate"
    piped = subprocess.run(
        [*render, "--overwrite"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert piped.stderr == "", "a log stays readable"
    assert piped.stdout.startswith("rooms.h5: 400 images, ")
    assert len(piped.stdout.splitlines()) == 1


def test_help_is_quick():
    """0.3 s is the promise; the fastest of a few, as other work goes on beside the tests."""
    command = [sys.executable, "-c", "import cli; cli.scenegen()", "--help"]
    times = []
    for _ in range(5):
        start = time.perf_counter()
        subprocess.run(command, capture_output=True, check=True)
        times.append(time.perf_counter() - start)
    assert min(times) < 0.3
