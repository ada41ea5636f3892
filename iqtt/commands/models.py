"""Options of the commands that ask models: the images and texts that models get."""

import click

from iqtt.vlm.prompt import LARGEST, SIZE, SMALLEST
from scenegen.command_line.options import Items, Renamed, together
from scenegen.command_line.paths import InputPath

# fmt: off
model_options = together(  # those of `iqtt.vlm.rows.Asked`
    click.option("--answer-key", "answers", cls=Renamed, former="--answers", type=InputPath(),
                 help="Answer key of a test file. The answer key also contains the cubes, from"
                 " which the images are rendered [default: the answer key next to FILE]."),
    click.option("--with-answer-key", "with_answers", cls=Renamed, former="--with-answers",
                 is_flag=True,
                 help="Also write the answer key of test questions to the output. Inspect needs the"
                      " answer key to compute scores."),
    click.option("--layout", type=click.Choice(["composed", "separate"]), default="composed",
                 show_default=True, help="composed: one image shows the reference and all options;"
                 " separate: the reference and each option have separate images."),
    click.option("--rotations", type=click.IntRange(1, 3), default=1, show_default=True,
                 help="Number of orders of the options in which each question is asked. For"
                      " CircularEval accuracy, use as many orders as there are options."),
    click.option("--size", type=click.IntRange(SMALLEST, LARGEST), default=SIZE, show_default=True,
                 help="Shorter side of each image of the reference or of an option, in pixels."),
    click.option("--items", type=Items(), help="Questions to use [default: all]."),
)
# fmt: on
