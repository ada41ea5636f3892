"""Options of the commands that ask models: the images and texts that models get."""

import click

from iqtt.vlm.prompt import LARGEST, SIZE, SMALLEST
from scenegen.command_line.options import Items, Renamed, together
from scenegen.command_line.paths import InputPath

# fmt: off
model_options = together(  # those of `iqtt.vlm.rows.Asked`
    click.option("--answer-key", "answers", cls=Renamed, former="--answers", type=InputPath(),
                 help="Answer key of a test file, which also has the cubes that the images show"
                 " [default: the answer key next to FILE]."),
    click.option("--with-answer-key", "with_answers", cls=Renamed, former="--with-answers",
                 is_flag=True,
                 help="Include the answer key of test questions in the output. Inspect needs it to"
                 " score."),
    click.option("--layout", type=click.Choice(["composed", "separate"]), default="composed",
                 show_default=True, help="composed: one image per question; separate: one image"
                                         " per reference and"
                 " option."),
    click.option("--rotations", type=click.IntRange(1, 3), default=1, show_default=True,
                 help="Number of times that each question is asked, each time with the options in"
                 " another order: 1, or the number of options (CircularEval)."),
    click.option("--size", type=click.IntRange(SMALLEST, LARGEST), default=SIZE, show_default=True,
                 help="Shorter side of each image, in pixels."),
    click.option("--items", type=Items(), help="Questions to use [default: all]."),
)
# fmt: on
