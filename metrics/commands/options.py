"""Options that commands on submissions and on score files have alike."""

import click

from scenegen.command_line.options import LARGEST

MARKDOWN = click.option("--markdown", is_flag=True, help="Print Markdown instead of aligned text.")
SEED = click.option(
    "--seed",
    type=click.IntRange(0, LARGEST),
    default=0,
    show_default=True,
    help="Random seed of the bootstrap.",
)
# Of `measures.alignment`, which loads numpy: what may be fitted to the truth of each image.
FITS = (
    *("median_scale", "scale", "scale_l1", "scale_shift", "scale_shift_l1"),
    "disparity_scale_shift",
)
