"""Shell completion: what the page says to do, and what the Tab key then offers."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import cli

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "completion.md").read_text()
NAMES = ("scenegen", "iqtt", "bench", "pix2shape")
ENVIRONMENT = {
    **os.environ,
    "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    "PYTHONPATH": str(ROOT),
}
OFFERED = """
source "$1"
COMP_WORDS=("${@:2}")
COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
compopt() { COMPREPLY+=("compopt -o $2"); }
_$2_completion "$2"
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """Return a home folder in which bash was set up as the page says."""
    folder = tmp_path_factory.mktemp("home")
    (block,) = re.findall("```bash\n(.*?)```", PAGE, re.DOTALL)
    environment = {**ENVIRONMENT, "HOME": str(folder)}
    subprocess.run(["bash", "-ec", block], check=True, env=environment)
    return folder


@pytest.fixture
def tab(home):
    """Return what bash offers after a line, the words of which are given."""

    def press(*words):
        script = home / ".local/share/bash-completion/completions" / words[0]
        command = ["bash", "-c", OFFERED, "tab", script, *words]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=ENVIRONMENT)
        assert done.stderr == ""
        return done.stdout.split("\n")[:-1]

    return press


@pytest.mark.parametrize("name", NAMES)
def test_commands_are_completed(tab, name):
    assert tab(name, "") == getattr(cli, name).list_commands(None)
    first = getattr(cli, name).list_commands(None)[0]
    assert first in tab(name, first[:-1])


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (("scenegen", "pre"), ["presets", "preview"]),
        (("scenegen", "render", "--pre"), ["--preset"]),
        (("scenegen", "render", "--preset", "shapes"), ["shapes", "shapes-single"]),
        (
            ("scenegen", "preview", "no-such-file.h5", "--show", ""),
            ["auto", "kitty", "sixel", "no"],
        ),
        (("iqtt", "make-split", "--preset", ""), ["small", "v2", "paper", "suite"]),
        (("bench", "baseline", "m"), ["mean-depth"]),
        (("pix2shape", "train", "--config", "comp"), ["compact"]),
    ],
    ids=" ".join,
)
def test_options_and_their_values_are_completed(tab, words, offered):
    assert tab(*words) == offered


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        (("scenegen", "preview", ""), "default"),
        (("scenegen", "preview", "--out", "x"), "default"),
        (("bench", "score", "predictions.h5", "--truth", ""), "default"),
        (("iqtt", "make-split", "--out", ""), "dirnames"),
    ],
    ids=" ".join,
)
def test_names_of_files_are_left_to_the_shell(tab, words, kind):
    assert tab(*words) == [f"compopt -o {kind}"]


def test_a_tab_opens_no_file_and_loads_nothing_heavy(rooms_path):
    code = """
import os, sys
os.environ.update(COMP_WORDS=f"scenegen preview {path} --sh", COMP_CWORD="3",
                  _SCENEGEN_COMPLETE="bash_complete")
import cli
try:
    cli.scenegen(prog_name="scenegen")
finally:
    print(*{"numpy", "h5py", "scenegen.files.trial", "PIL"} & set(sys.modules))
"""
    command = [sys.executable, "-c", code.replace("{path}", str(rooms_path))]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=ENVIRONMENT)
    assert done.stdout == "plain,--show\n\n", done.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
@pytest.mark.parametrize("name", NAMES)
def test_every_shell_gets_its_script(shell, name):
    environment = {**ENVIRONMENT, f"_{name.upper()}_COMPLETE": f"{shell}_source"}
    done = subprocess.run([name], capture_output=True, text=True, check=True, env=environment)
    assert f"_{name.upper()}_COMPLETE={shell}_complete" in done.stdout
    assert (done.stderr, "\\x" in done.stdout) == ("", False)


@pytest.mark.parametrize(
    ("shell", "environment", "offered"),
    [
        ("zsh", {"COMP_WORDS": "scenegen render --preset tw", "COMP_CWORD": "3"},
         "plain\ntwo-tone\n_\n"),
        ("fish", {"COMP_WORDS": "scenegen render --preset tw", "COMP_CWORD": "tw"},
         "plain\ntwo-tone\n"),
    ],
)  # fmt: skip
def test_other_shells_are_offered_the_same(shell, environment, offered):
    told = {**ENVIRONMENT, **environment, "_SCENEGEN_COMPLETE": f"{shell}_complete"}
    done = subprocess.run(["scenegen"], capture_output=True, text=True, check=True, env=told)
    assert done.stdout.replace(",", "\n") == offered
