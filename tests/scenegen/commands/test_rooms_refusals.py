"""Whatever a user asks for wrongly: one clear line, exit code 2, and the disk as it was.

Which values a setting may have is tested with `DatasetSpec`, what a text may look like with the
types of options; here are the mistakes that only a command can meet.
"""

import shlex
import subprocess
import sys

import pytest

RENDER = ("render", "--n", "2", "--size", "32", "--min-visible-pixels", "3", "--out", "o.h5")
# Options, and what the line must say: the option's name, what was found, what was expected.
RENDER_MISTAKES = [
    (f"--n {2**70}", f"found {2**70}", "expected"),
    ("--size 4096", "batch: found 64", "at most 16 images of this size"),
    ("--shapes box,", "shapes: found ''", "box, sphere, cone"),
    ("--object-radius 0.5", "item 0", "objects", "smaller --object-radius"),
    ("--min-visible-pixels 1024", "item ", "1024 pixels", "--min-visible-pixels"),
    ("--preset nosuch", "preset: found 'nosuch'", "shapes-single", "views"),
    ("--shapes box --classes mug", "--shapes with --classes", "one of them"),
    ("--object-split train", "--object-split: found train", "'all' for shapes"),
    ("--shapenet-root . --objects-root .", "--shapenet-root and --objects-root", "one of them"),
    ("--shapenet-root . --up z", "up: found 'z'", "expected 'y' with --shapenet-root"),
    ("--objects-root nosuch", "nosuch: no such folder"),
    ("--out /proc/x.h5", "/proc"),
    (f"--out {'a' * 300}.h5", "too long"),
]
PREVIEW_MISTAKES = [
    ("--items 0-500", "items: found 8", "0 to 7"),
    ("--items 0 --random 2", "items", "random", "one of them"),
    ("--out s.xyz", "'s.xyz'", "sheet.png"),
]
EXPORT_MISTAKES = [
    ("--items 8", "items: found 8", "0 to 7"),
    ("--out text", "text: ", "not a folder"),
    ("--out /proc", "/proc"),
    ("--objects-root .", "objects: found the folder .", "built in"),
]
MISTAKES = [
    *((RENDER, *case) for case in RENDER_MISTAKES),
    *((("preview", "FILE"), *case) for case in PREVIEW_MISTAKES),
    *((("export", "FILE", "--items", "0", "--format", "obj"), *case) for case in EXPORT_MISTAKES),
]


@pytest.mark.parametrize("case", MISTAKES, ids=lambda case: f"{case[0][0]} {case[1]:.30}")
def test_a_mistake_is_told_in_one_line(refuses, tmp_path, rooms_path, case):
    (tmp_path / "text").write_text("mine")
    command, options, *words = case
    given = [rooms_path if part == "FILE" else part for part in command]
    line = refuses(*given, *shlex.split(options), words=tuple(words))
    assert ".partial" not in line, "the user's name for it, not that of a temporary file"


@pytest.mark.skipif(sys.platform != "linux", reason="sets Linux's limit of memory")
@pytest.mark.parametrize(
    "options", ["render --n 1000000000000 --size 32", "preview FILE --items 0-9999999999"]
)
def test_huge_numbers_do_not_fill_the_memory(tmp_path, check_refusal, rooms_path, options):
    """With 4 GB of address space, so that a failing test harms nobody."""
    code = "import resource as r; r.setrlimit(r.RLIMIT_AS, (2**32, 2**32)); import cli; "
    done = subprocess.run(
        [sys.executable, "-c", code + "cli.scenegen()",
         *options.replace("FILE", str(rooms_path)).split()],
        cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    check_refusal(done.returncode, done.stdout, done.stderr)
    assert list(tmp_path.iterdir()) == []
