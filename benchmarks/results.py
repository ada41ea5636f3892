"""The tables of docs/results.md, from score files: python -m benchmarks.results SCORES.json ...

Files that answer to one truth make one table; its rows are methods, at each angle of view.
"""

import json
import sys
from pathlib import Path
from typing import Any

METRICS = {
    "chamfer": "CD",
    "hausdorff": "HD",
    "hausdorff_forward": "HD-F",
    "hausdorff_reverse": "HD-R",
    "mse_depth": "MSE-depth",
}
ANGLES = ("0", "5", "35", "55", "80")


def shown(score: dict[str, Any]) -> str:
    """Return a value and its interval, four digits of each."""
    return f"{score['value']:.4f} [{score['low']:.4f}, {score['high']:.4f}]"


def table(scores: list[dict[str, Any]]) -> str:
    """Return the Markdown table of the methods that predicted one file, best Chamfer first."""
    lines = ["| degrees | method | " + " | ".join(METRICS.values()) + " |"]
    lines.append("| ---: | --- | " + " | ".join("---:" for _ in METRICS) + " |")
    for angle in ANGLES:
        rows = [(s["method"], s["by_view_angle"][angle]) for s in scores]
        for method, row in sorted(rows, key=lambda pair: pair[1]["chamfer"]["value"]):
            cells = " | ".join(shown(row[name]) for name in METRICS)
            lines.append(f"| {angle} | `{method}` | {cells} |")
    return "\n".join(lines)


def main() -> None:
    """Print a table for each truth."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for name in sys.argv[1:]:
        score = json.loads(Path(name).read_text())
        groups.setdefault(score["meta"]["truth_path"], []).append(score)
    for truth, scores in groups.items():
        print(f"{Path(truth).name}\n\n{table(scores)}\n")


if __name__ == "__main__":
    main()
