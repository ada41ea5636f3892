"""`bench figure`: figures for papers, of score files and of predictions."""

from pathlib import Path

import click

from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import OVERWRITE, Items, Renamed
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath, OutputPath


@click.command(
    epilog=f"{EXAMPLE}bench figure mine.json other.json --out scores.pdf\n"
    "  bench figure mine.json other.json --by angle --metric chamfer --out angles.svg\n"
    "  bench figure mine.h5 other.h5 --truth rooms.h5 --items 0,5 --out grid.pdf"
)
@click.argument("files", nargs=-1, required=True, type=InputPath(), metavar="FILES...")
@click.option("--out", type=OutputPath(), required=True, help="Output file: .pdf, .svg or .png.")
@click.option(
    "--metric",
    "score",
    cls=Renamed,
    former="--score",
    default="",
    help="Metric to draw [default: the first main metric].",
)
@click.option(
    "--by",
    type=click.Choice(["angle", "kind", "size"]),
    help="Draw one value per group of images or questions. angle: by view or rotation angle; size:"
    " by size of the object; kind: by distractor type, or by category of the object.",
)
@click.option(
    "--truth", type=InputPath(), help="File of rooms. With --truth, FILES are predictions."
)
@click.option(
    "--items", type=Items(), help="Images to show in the grid. Needs --truth [default: 0-3]."
)
@click.option(
    "--width",
    type=click.Choice(["column", "page"]),
    help="Width of the figure in a two-column paper [default: column; page with --truth].",
)
@OVERWRITE
def figure(
    files: tuple[str, ...],
    out: str,
    score: str,
    by: str | None,
    truth: str | None,
    items: list[int] | None,
    width: str | None,
    overwrite: bool,
) -> None:
    """Draw a figure for a paper, with embedded fonts, at the width of a column or a page.

    Without --truth, FILES are score files. The figure shows their scores, with confidence intervals
    and baselines. With --truth, FILES are predictions. The figure is then a grid of images with
    depth and error.
    """
    from metrics.score_file import read_scores
    from metrics.scoring.aligned import aligned
    from metrics.views import figures
    from scenegen.files.new_file import check_writable

    check_writable(Path(out), overwrite)
    wide = figures.PAGE if width == "page" or (truth and not width) else figures.COLUMN
    if truth:
        if by or score:
            raise click.UsageError("--by and --metric are for score files, not for --truth")
        rows = [0, 1, 2, 3] if items is None else items
        figures.draw_grid(out, truth, files, rows, wide, overwrite)
    elif items is not None:
        raise click.UsageError("--items needs --truth")
    else:
        scores = aligned([read_scores(path) for path in files])
        if by:
            figures.draw_groups(out, scores, by, score, wide, overwrite)
        else:
            figures.draw_scores(out, scores, score, wide, overwrite)
    print_line(f"{out}: written")


COMMANDS = (figure,)
