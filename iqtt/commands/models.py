"""Options of the commands that ask models: the images and texts that models get."""

import click

from iqtt.vlm.prompt import LARGEST, SIZE, SMALLEST
from scenegen.command_line.options import Items, Renamed, together
from scenegen.command_line.paths import InputPath

# fmt: off
model_options = together(  # those of `iqtt.vlm.rows.Asked`
    click.option("--answer-key", "answers", cls=Renamed, former="--answers", type=InputPath(),
                 help="Answer key of a test file. It also has the cubes of each question; the"
                 " images are rendered from these cubes [default: the answer key next to FILE]."),
    click.option("--with-answer-key", "with_answers", cls=Renamed, former="--with-answers",
                 is_flag=True,
                 help="Include the answer key of test questions in the output. Inspect needs the"
                 " answer key to compute scores."),
    click.option("--layout", type=click.Choice(["composed", "separate"]), default="composed",
                 show_default=True, help="Images of a question. composed: one image with the"
                 " reference and all options; separate: one image each for the reference and every"
                 " option."),
    click.option("--rotations", type=click.IntRange(1, 3), default=1, show_default=True,
                 help="Ask each question this many times, each time with the options in another"
                 " order. For CircularEval accuracy, use the number of options."),
    click.option("--size", type=click.IntRange(SMALLEST, LARGEST), default=SIZE, show_default=True,
                 help="Size, in pixels, of the shorter side of each reference or option image."),
    click.option("--items", type=Items(), help="Questions to use [default: all]."),
)
# fmt: on
