"""What the measurements say: the machine, the table, the ratios."""

import os
import platform
import statistics
from dataclasses import dataclass
from pathlib import Path
from typing import Any

GOALS = (
    ("end to end / fastest (a)", "b", "a", 8.0),
    ("end to end / (c)", "b", "c", 0.5),
    ("rendering stage / (c)", "stage", "c", 0.75),
)


@dataclass(frozen=True)
class Row:
    """A line of the table. `result` holds seconds of each repeat, images, note and peak_mib."""

    what: str
    result: dict[str, Any]

    @property
    def rate(self) -> float:
        """Images a second, median of the repeats; 0 where the job failed."""
        return self._rate(statistics.median)

    @property
    def best(self) -> float:
        """Images a second, fastest repeat; 0 where the job failed."""
        return self._rate(min)

    def _rate(self, choose: Any) -> float:
        if "error" in self.result:
            return 0.0
        return float(self.result["images"] / choose(self.result["seconds"]))

    def cells(self) -> list[str]:
        """Return the line's cells."""
        if "error" in self.result:
            return [self.what, "-", "-", "-", "-", "-", self.result["error"].replace("|", "/")]
        repeats = len(self.result["seconds"])
        return [
            self.what,
            f"{self.rate:,.0f}",
            f"{self.best:,.0f}",
            f"{1e3 / self.rate:.2f}",
            f"{self.result['images']:,} x {repeats}",
            f"{self.result['peak_mib']:,.0f}",
            self.result["note"],
        ]


def print_machine(machine: dict[str, Any]) -> None:
    """Print what the figures depend on."""
    versions = ", ".join(f"{name} {text}" for name, text in machine.get("versions", {}).items())
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    load = os.getloadavg()[0]
    print(f"{cpu_model()}, {cores} cores (load before: {load:.1f}), {platform.system()}")
    print(f"Python {platform.python_version()}, {versions}; variant {machine.get('variant')}\n")


def cpu_model() -> str:
    """Return the processor's name."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def print_table(rows: dict[str, Row], what: str, notes: str) -> None:
    """Print the rows as Markdown; `what` heads the first column, `notes` follow the table."""
    head = [what, "images/s, median", "best", "ms/image", "images", "MiB", "remarks"]
    print("| " + " | ".join(head) + " |")
    print("| --- |" + " ---: |" * (len(head) - 2) + " --- |")
    for row in rows.values():
        print("| " + " | ".join(row.cells()) + " |")
    print(f"\n{notes}")


def print_ratios(rows: dict[str, Row]) -> None:
    """Print what the rows say of each other, by their best repeats: noise only ever adds time."""
    best = {key: row.best for key, row in rows.items()}
    for meshes in ("same", "coarse"):
        rates = [rate for key, rate in best.items() if key.startswith("a ") and meshes in key]
        best[f"a, {meshes} meshes"] = max(rates)
    best["c, unit scene"], best["c, lattice"] = best["c1"], best["c2"]
    print("\nRatios of the best repeats:\n")
    for what, over, under, goal in GOALS:
        for key in [key for key in best if key.startswith(f"{under}, ")]:
            if best[over] and best[key]:
                _, which = key.split(", ")
                print(f"- {what}, {which}: {best[over] / best[key]:.2f}; goal {goal}")
