"""Run one job in this process: `python -m benchmarks.jobs MODULE:FUNCTION ARGUMENTS-AS-JSON`.

Each job has a process of its own, as Mitsuba's variant, Dr.Jit's thread pool and the peak of the
memory are global. The last line of the output is the job's result as JSON.
"""

import importlib
import json
import sys

from benchmarks.jobs.timing import peak_mib
from scenegen.rendering.backend import select_variant

if __name__ == "__main__":  # not in worker processes, which import this module again
    select_variant("auto")  # first: a job's module may import Dr.Jit, which then looks for LLVM
    module, function = sys.argv[1].split(":")
    job = getattr(importlib.import_module(f"benchmarks.jobs.{module}"), function)
    result = job(**json.loads(sys.argv[2]))
    print(json.dumps({**result, "peak_mib": peak_mib(result.get("workers", 1))}))
