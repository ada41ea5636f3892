"""Curves of training runs as one SVG, from the logs that `pix2shape train` writes.

python -m benchmarks.curves curves.svg shapes=runs/shapes shapenet=runs/shapenet
"""

import argparse
from pathlib import Path

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 640, 300, 48, 130, 28, 36
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # Okabe and Ito's
MEAN_OF = 10  # logged values
Curve = list[tuple[int, float]]  # iteration, loss


def curve(folder: str, name: str) -> Curve:
    """Read a loss, means of `MEAN_OF` values."""
    events = EventAccumulator(str(Path(folder) / "logs"), size_guidance={"scalars": 0})
    events.Reload()
    points = events.Scalars(name)
    groups = (points[i : i + MEAN_OF] for i in range(0, len(points) - MEAN_OF + 1, MEAN_OF))
    return [(group[-1].step, sum(p.value for p in group) / MEAN_OF) for group in groups]


def drawn(curves: dict[str, Curve], title: str, top: float) -> str:
    """Return the curves as SVG; what is above `top` is cut."""
    longest = max(step for points in curves.values() for step, _ in points)
    last = -(-longest // 1000) * 1000

    def x(step: float) -> float:
        return LEFT + step / last * (WIDTH - LEFT - RIGHT)

    def y(loss: float) -> float:
        return HEIGHT - BOTTOM - min(loss, top) / top * (HEIGHT - TOP - BOTTOM)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}"'
        f' height="{HEIGHT}" font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        f'<text x="{LEFT}" y="16">{title}</text>',
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 4}" text-anchor="middle">'
        "iteration</text>",
    ]
    for k in range(6):
        loss, step = top * k / 5, last * k / 5
        parts += [
            f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(loss):.1f}" y2="{y(loss):.1f}"'
            ' stroke="#ddd"/>',
            f'<text x="{LEFT - 6}" y="{y(loss) + 4:.1f}" text-anchor="end">{loss:.3g}</text>',
            f'<text x="{x(step):.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">'
            f"{step:,.0f}</text>",
        ]
    for color, (name, points) in zip(COLORS, curves.items(), strict=False):
        line = " ".join(f"{x(step):.1f},{y(loss):.1f}" for step, loss in points)
        end = x(points[-1][0]) + 6, y(points[-1][1]) + 4
        parts += [
            f'<polyline points="{line}" fill="none" stroke="{color}" stroke-width="1.5"/>',
            f'<text x="{end[0]:.1f}" y="{end[1]:.1f}" fill="{color}">{name}</text>',
        ]
    return "\n".join([*parts, "</svg>\n"])


def main() -> None:
    """Draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("runs", nargs="+", metavar="NAME=FOLDER")
    parser.add_argument("--loss", default="reconstruction")
    parser.add_argument("--top", type=float, default=12.0)
    arguments = parser.parse_args()
    pairs = (run.split("=", 1) for run in arguments.runs)
    curves = {name: curve(folder, arguments.loss) for name, folder in pairs}
    arguments.out.write_text(drawn(curves, f"{arguments.loss} loss", arguments.top))


if __name__ == "__main__":
    main()
