"""Run what is not there yet, and print the tables: python -m benchmarks.results [--help]"""

import argparse
import sys
from pathlib import Path

from benchmarks.results import questions, rooms, studies
from benchmarks.results.steps import make_all

TABLES = {"questions": questions, "rooms": rooms, "studies": studies}


def main() -> None:
    """Read the options, run, and print; exit with 1 where something failed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.results", description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("results"), help="of all products")
    parser.add_argument("--only", choices=TABLES, help="one part")
    parser.add_argument(
        "--rows", nargs="+", default=[], metavar="NAME", help="methods or studies of --only  [all]"
    )
    parser.add_argument("--seeds", type=int, default=3, help="training runs of each method  [3]")
    parser.add_argument("--print", action="store_true", help="print the tables; run nothing")
    options = parser.parse_args()
    if options.seeds < 1 or (options.rows and not options.only):
        parser.error("--seeds is at least 1, and --rows needs --only")
    options.folder.mkdir(parents=True, exist_ok=True)
    failed = []
    for name, part in TABLES.items():
        if options.only in (None, name):
            if not options.print:
                failed += make_all(options.folder, part.plan(options.rows, options.seeds))
            print(part.page(options.folder), end="\n\n")
    if failed:
        sys.exit(f"{len(failed)} failed: {'; '.join(failed)}")


if __name__ == "__main__":
    main()
