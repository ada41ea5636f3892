"""Start measuring processes and collect what they say."""

import json
import os
import site
import subprocess
import sys
import time
from pathlib import Path
from typing import Any


class Session:
    """Runs jobs one after another, with `folder` for all that they write."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        # Dr.Jit keeps compiled kernels in the home folder: start from none, and leave none behind.
        self._environment = {
            **os.environ,
            "HOME": str(folder),
            "PYTHONUSERBASE": site.getuserbase(),
        }

    def run(self, job: str, **arguments: Any) -> dict[str, Any]:
        """Return a job's result (see `worker`); {"error": text} where it fails."""
        shown = " ".join(str(v) for k, v in arguments.items() if k not in ("rooms", "folder"))
        print(f"{job} {shown} ...", end=" ", file=sys.stderr, flush=True)
        start = time.perf_counter()
        command = [sys.executable, "-m", "benchmarks.worker", job, json.dumps(arguments)]
        done = subprocess.run(
            command, env=self._environment, capture_output=True, text=True, check=False
        )
        print(f"{time.perf_counter() - start:.0f} s", file=sys.stderr)
        if done.returncode:
            lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            print(done.stderr, file=sys.stderr)
            return {"error": lines[-1]}
        result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        return result

    def seconds(self, command: list[str]) -> float | None:
        """Return how long a command takes; None where it fails."""
        start = time.perf_counter()
        done = subprocess.run(command, env=self._environment, capture_output=True, check=False)
        return None if done.returncode else time.perf_counter() - start
