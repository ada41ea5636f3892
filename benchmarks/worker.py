"""Run one job in this process: `python -m benchmarks.worker MODULE:FUNCTION ARGUMENTS-AS-JSON`.

A process a job, because Mitsuba's variant, Dr.Jit's thread pool and the peak of the memory are all
global. The last line of the output is the job's result as JSON.
"""

import importlib
import json
import sys

from benchmarks.timing import peak_mib
from scenegen.rendering.backend import select_variant


def main() -> None:
    """Run the job that the command line names."""
    select_variant("auto")  # a job's module may import Dr.Jit, which takes the LLVM it finds then
    module, function = sys.argv[1].split(":")
    job = getattr(importlib.import_module(f"benchmarks.{module}"), function)
    result = job(**json.loads(sys.argv[2]))
    print(json.dumps({**result, "peak_mib": peak_mib()}))


if __name__ == "__main__":
    main()
