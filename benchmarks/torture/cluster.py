"""A case of `benchmarks.torture`: a cluster of three workers, of which two are killed."""

import os
import signal
import time
from collections.abc import Iterator

from distributed import LocalCluster

from benchmarks.torture.runs import Torture, contents

ANY = "127.0.0.1:0"


def cluster(torture: Torture, count: int) -> Iterator[tuple[str, str]]:
    """Kill two of three workers in the midst of runs; nobody does anything about it."""
    for number in range(count // 3):
        with LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=ANY) as workers:
            where = torture.fresh("cluster")
            more = ("--scheduler", workers.scheduler_address)
            process = torture.command(where, more=more)
            while len(list(where.glob("rooms-*"))) <= 2 * number and process.poll() is None:
                time.sleep(0.02)
            running = process.poll() is None
            for nanny in list(workers.workers.values())[:2]:
                os.kill(nanny.pid, signal.SIGKILL)
            problem = torture.ended(process, process.communicate()[1].strip(), code=0)
            if contents(where) != torture.expected:
                problem = problem or "other bytes"
            name = "a cluster of 3 workers, 2 of them killed"
            yield name, problem or ("" if running else "it was done before")
