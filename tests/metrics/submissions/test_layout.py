"""The description of the format, as `bench describe-format` prints it."""

import re

from metrics.prediction_writer import describe_format
from metrics.submissions.layout import ATTRIBUTES, DATASETS


def test_the_description_names_everything():
    text = describe_format()
    lines = text.splitlines()
    for thing in (*ATTRIBUTES, *DATASETS):
        assert any(re.match(rf"  {thing.name} ", line) for line in lines), thing.name
        assert thing.meaning in text
    for dataset in DATASETS:
        assert dataset.shown_shape in text
    assert "pix2shape-bench/predictions" in text
    assert all("none, median_scale, scale, scale_shift" not in line or "alignment" in line
               for line in lines)  # fmt: skip
