"""Install each file of a folder in fresh environments, and run the four commands there.

    python tests/smoke.py dist [python3.12 ...]

Without names of interpreters, those of 3.11 to 3.13 that are on the path are taken.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

COMMANDS = """
scenegen render --n 2 --size 32 --out rooms.h5
scenegen verify rooms.h5
iqtt make-split --train 4 --val 4 --test 4 --out questions
iqtt audit questions
bench baseline empty-room --data rooms.h5 --out empty-room.h5
bench score empty-room.h5 --truth rooms.h5
"""


def smoke(python: str, package: Path) -> None:
    """Install a wheel or sdist for an interpreter, away from the sources, and run COMMANDS."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([python, "-m", "venv", folder / "venv"], check=True)
        programs = folder / "venv" / "bin"
        constraints = Path("constraints.txt").absolute()
        subprocess.run(
            [programs / "python", "-m", "pip", "install", "-q", "--disable-pip-version-check",
             "-c", constraints, package.absolute()],
            check=True,
        )  # fmt: skip
        for line in COMMANDS.strip().splitlines():
            command, *arguments = line.split()
            done = subprocess.run(
                [programs / command, *arguments],
                cwd=folder, capture_output=True, text=True, check=False,
            )  # fmt: skip
            if done.returncode != 0:
                sys.exit(f"{package.name}, {python}: {line}\n{done.stdout}{done.stderr}")
    print(f"{package.name}, {python}: {len(COMMANDS.strip().splitlines())} commands work")


if __name__ == "__main__":
    packages = sorted(Path(sys.argv[1]).iterdir())
    pythons = sys.argv[2:] or [
        path for minor in (11, 12, 13) if (path := shutil.which(f"python3.{minor}"))
    ]
    for python in pythons:
        for package in packages:
            smoke(python, package)
