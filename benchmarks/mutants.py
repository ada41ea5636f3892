"""Do the tests see small faults? Each mutant is a change of one line that some test must fail on.

    python -m benchmarks.mutants                 all of `mutants.toml`, two at a time
    python -m benchmarks.mutants --only relief   those whose file or name has this text

A row of the table has the file, the text that is replaced (it stands there once), what replaces it,
and the tests that are run, which stop at the first failure. A mutant survives if they pass. Those
of which no test can tell, as they are equal, are not in the table.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import click

ROOT = Path(__file__).parents[1]
TABLE = Path(__file__).with_suffix(".toml")
COPIED = ("scenegen", "iqtt", "metrics", "baselines", "cli.py", "pyproject.toml", "tests")
LONGEST = 600  # seconds of the tests of one mutant; one that hangs is killed, too


def rows() -> list[dict[str, Any]]:
    """Return the table."""
    table: list[dict[str, Any]] = tomllib.loads(TABLE.read_text())["mutant"]
    return table


def copy_tree(folder: Path) -> Path:
    """Copy what the tests need to a folder, and return it."""
    skipped = shutil.ignore_patterns("__pycache__", "*.pyc")
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=skipped)
        else:
            shutil.copy(ROOT / name, folder / name)
    return folder


def survives(mutant: dict[str, Any], tree: Path) -> bool:
    """Return whether the tests of a mutant pass in a copy of the tree, which is as before then."""
    path = tree / mutant["file"]
    text = path.read_text()
    if text.count(mutant["old"]) != 1:
        raise click.ClickException(
            f"{mutant['file']}: {text.count(mutant['old'])} places have {mutant['old']!r}, not 1;"
            f" mend the row in {TABLE.name}"
        )
    path.write_text(text.replace(mutant["old"], mutant["new"]))
    command = f"{sys.executable} -B -m pytest -q -x -n 0 -p no:cacheprovider".split()
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    try:
        ended = subprocess.run(
            [*command, "-m", "not slow", *mutant["tests"]], cwd=tree, env=environment, check=False,
            timeout=LONGEST, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return False
    finally:
        path.write_text(text)
    if ended.returncode not in (0, 1, 2):  # 2: a module that can no longer be imported
        raise click.ClickException(f"{mutant['file']}: pytest ended with\n{ended.stdout}")
    return ended.returncode == 0


@click.command()
@click.option("--only", default="", help="Text in the file or the tests of mutants to run.")
@click.option("--jobs", default=2, help="Mutants at a time.")
def main(only: str, jobs: int) -> None:
    """Run the mutants; exit with 1 if more than one in twenty survives."""
    chosen = [r for r in rows() if only in " ".join([r["file"], r["new"], *r["tests"]])]
    started, survivors = time.perf_counter(), []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(jobs) as pool:
        trees: SimpleQueue[Path] = SimpleQueue()
        for number in range(jobs):
            (Path(folder) / str(number)).mkdir()
            trees.put(copy_tree(Path(folder) / str(number)))

        def run(row: dict[str, Any]) -> bool:
            tree = trees.get()
            try:
                return survives(row, tree)
            finally:
                trees.put(tree)

        for row, alive in zip(chosen, pool.map(run, chosen), strict=True):
            print("survives" if alive else "killed  ", row["file"], "|", row["old"].strip(), "->",
                  row["new"].strip(), flush=True)  # fmt: skip
            survivors += [row] * alive
    killed = len(chosen) - len(survivors)
    print(f"{killed} of {len(chosen)} killed in {time.perf_counter() - started:.0f} s")
    sys.exit(20 * len(survivors) > len(chosen))


if __name__ == "__main__":
    main()
