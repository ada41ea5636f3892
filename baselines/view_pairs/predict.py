"""Submissions of `view-pairs`: those of a relief network, which sees one image at a time."""

from functools import partial
from pathlib import Path

from baselines.depth_supervised.predict import submit

METHOD = "view-pairs"
WEIGHTS = Path(__file__).with_name("files") / "unet.safetensors"
write_submission = partial(submit, METHOD, WEIGHTS)
