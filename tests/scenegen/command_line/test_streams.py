"""Real processes whose streams are closed, full, a terminal, or read by someone who goes away."""

import subprocess
import sys

import pytest

# A command that writes its file and then prints much, as `bench score --json` does.
COMMAND = """
import pathlib, sys, time
import click
from scenegen.command_line.groups import PackageCommands
from scenegen.command_line.output import progress_bar

@click.command()
@click.pass_context
def score(ctx):
    with progress_bar(2, "image") as bar:
        bar.update(1)
        time.sleep(0.2)
        bar.update(1)
    click.echo("a note", err=True)
    with open("mine.json", "w") as file:
        file.write(str(file.fileno()))
    for i in range(20_000):
        click.echo(f"line {i} \\x1b[2J \\u202e")
    ctx.exit(3)

@click.group(cls=PackageCommands, modules=())
def group(): pass
group.get_command = lambda ctx, name: score
group()
"""
OF_SHELL = {
    "a reader that goes": ("| true", 3),
    "a reader of one line": ("| head -1 > /dev/null", 3),
    "closed": (">&-", 3),
    "all closed": ("<&- >&- 2>&-", 3),
    "no place for errors": ("> /dev/null 2>/dev/full", 3),
    "full": ("> /dev/full", 2),
}


def run(shell, folder):
    # In development mode Python also tells what goes wrong when streams are closed at exit.
    script = f'set -o pipefail; "$0" -X dev -c "$1" score {shell}'
    command = ["bash", "-c", script, sys.executable, COMMAND]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(("shell", "code"), OF_SHELL.values(), ids=OF_SHELL)
def test_no_stream_keeps_a_command_from_its_file_and_its_exit_code(tmp_path, shell, code):
    done = run(shell, tmp_path)
    assert done.returncode == code
    errors = [line for line in done.stderr.splitlines() if line != "a note"]
    assert len(errors) == (code == 2), done.stderr
    assert all(line.startswith("Error: standard output: ") for line in errors)
    assert int((tmp_path / "mine.json").read_text()) > 2, "a data file behind a standard stream"


def test_ctrl_c_prints_nothing_twice():
    """A signal comes a little later in each print than in the one before."""
    program = """
import signal
from scenegen.command_line.streams import robust_streams

def interrupt(*_):
    raise KeyboardInterrupt

signal.signal(signal.SIGALRM, interrupt)
with robust_streams():
    for i in range(3000):
        try:
            signal.setitimer(signal.ITIMER_REAL, 1e-6 * (1 + i % 100))
            print(f"{i}.", end="", flush=True)
            signal.setitimer(signal.ITIMER_REAL, 0)
        except KeyboardInterrupt:
            pass
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    told = done.stdout.split(b".")
    assert len(told) > 1000
    assert len(set(told)) == len(told)
