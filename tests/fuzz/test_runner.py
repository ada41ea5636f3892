"""The fuzzer finds what it looks for: commands with a planted fault, each of another kind."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# The commands are planted into `cli`, and run as cases are: in a process that may fork.
PLANTED = """
import json, os, sys, time
from pathlib import Path
import click
import cli
from fuzz import verdict
from fuzz.cases import Case
from fuzz.runner import run_case
from scenegen.command_line.groups import UserError

honest = Path(sys.argv[1])

@click.command()
@click.argument("how")
@click.option("--out")
def planted(how, out):
    if how == "good":
        Path(out).write_text("new")
    elif how == "refuses":
        raise UserError("no")
    elif how == "raises":
        raise KeyError("planted")
    elif how == "hangs":
        open("fifo").read()
    elif how == "computes":
        while True: pass
    elif how == "eats":
        bytearray(250 * 2**20)
    elif how == "eats too much":
        bytearray(2**36)
    elif how == "dies":
        os.abort()
    elif how == "fails":
        sys.exit(3)
    elif how == "forks" and os.fork() == 0:
        time.sleep(60)
    elif how == "colours":
        os.write(1, b"\\x1b[31mred")
    elif how == "talks":
        os.write(2, b"one\\nError: two\\n"); sys.exit(2)
    elif how == "leaves":
        Path(".1.partial.h5").touch()
    elif how == "eats inputs":
        Path("rooms.h5").write_bytes(b"mine")
    elif how == "writes and refuses":
        Path(out).write_text("half"); print("Error: no", file=sys.stderr); sys.exit(2)

cli.planted = planted
verdict.MOST_MEGABYTES = 100
found = {}
for how in sys.argv[2:]:
    case = Case("planted", ("planted", how, "--out", "new"))
    limit = 1.5 if how in ("hangs", "computes") else 30.0
    outcome = run_case(honest, 100.0, (how, case), limit)
    found[how] = sorted({kind for kind, _ in outcome.faults})
print(json.dumps(found))
"""
KINDS = {
    "good": [],
    "refuses": [],
    "raises": ["traceback"],
    "hangs": ["time"],
    "computes": ["time"],
    "eats": ["memory"],
    "eats too much": ["traceback"],
    "dies": ["signal"],
    "fails": ["exit code"],
    "forks": ["process"],
    "colours": ["control character"],
    "talks": ["not one line of error"],
    "leaves": ["leftover"],
    "eats inputs": ["input changed"],
    "writes and refuses": ["written though refused"],
}


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    honest = tmp_path_factory.mktemp("honest")
    (honest / "rooms.h5").write_bytes(b"rooms")
    command = [sys.executable, "-c", PLANTED, str(honest), *KINDS]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("how", KINDS)
def test_a_planted_fault_is_found(planted, how):
    assert planted[how] == KINDS[how]
