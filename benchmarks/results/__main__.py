"""Run what is not there yet, and write the tables: python -m benchmarks.results [--help]"""

import argparse
import sys
from pathlib import Path

from benchmarks.results import questions, rooms, studies
from benchmarks.results.markdown import put
from benchmarks.results.steps import ROOT

PAGE = ROOT / "docs" / "results.md"
TABLES = ("questions", "rooms", "studies")


def main() -> None:
    """Read the options, run, and write; exit with 1 where something failed."""
    known = [method.name for method in (*questions.METHODS, *rooms.METHODS)]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.results", description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("results"), help="where all is kept")
    parser.add_argument("--only", choices=TABLES, help="one part of the page")
    parser.add_argument("--methods", nargs="+", choices=known, default=[], metavar="NAME")
    parser.add_argument(
        "--studies", nargs="+", choices=studies.STUDIES, default=[], metavar="NAME",
        help="which of the ablations  [all]",
    )  # fmt: skip
    parser.add_argument("--seeds", type=int, default=3, help="training runs of each method [3]")
    parser.add_argument("--page", type=Path, default=PAGE, help="the page to write to")
    parser.add_argument("--print", action="store_true", help="print what is there; run nothing")
    given = parser.parse_args()
    if given.seeds < 1:
        parser.error("--seeds: at least 1")
    given.folder.mkdir(parents=True, exist_ok=True)
    failed = []
    for name in [given.only] if given.only else TABLES:
        if not given.print:
            if name == "questions":
                failed += questions.run(given.folder, given.methods, given.seeds)
            elif name == "rooms":
                failed += rooms.run(given.folder, given.methods)
            else:
                failed += studies.run(given.folder, given.studies, given.seeds)
        text = {"questions": questions, "rooms": rooms, "studies": studies}[name].page(given.folder)
        if given.print:
            print(text, end="\n\n")
        else:
            put(given.page, name, text)
    if failed:
        sys.exit(f"{len(failed)} failed: {'; '.join(failed)}")


if __name__ == "__main__":
    main()
