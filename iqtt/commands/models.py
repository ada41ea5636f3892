"""Options of the commands that ask models: which pictures and texts they get."""

import click

from iqtt.vlm.prompt import LARGEST, SIZE, SMALLEST
from scenegen.command_line.options import Items, together
from scenegen.command_line.paths import InputPath

# fmt: off
model_options = together(  # those of `iqtt.vlm.rows.Asked`
    click.option("--answers", type=InputPath(),
                 help="File with the answers of a test file: it tells the cubes to draw"
                 " [default: the one beside FILE]."),
    click.option("--with-answers", is_flag=True,
                 help="Tell the answers of test questions: exports hold them, and Inspect scores."),
    click.option("--layout", type=click.Choice(["composed", "separate"]), default="composed",
                 show_default=True, help="One picture of all, or one picture each."),
    click.option("--rotations", type=click.IntRange(1, 3), default=1, show_default=True,
                 help="In how many orders of the answers each question is asked: 1, or as many as"
                 " it has answers."),
    click.option("--size", type=click.IntRange(SMALLEST, LARGEST), default=SIZE, show_default=True,
                 help="Shorter side of each picture, pixels."),
    click.option("--items", type=Items(), help="Questions to take [default: all]."),
)
# fmt: on
