"""Charts of people's answers: what they write touches nothing, and counts are whole numbers."""

import re
from itertools import pairwise

import pytest

from metrics.people.charts import HEIGHT, bars

LETTER = 6.3  # pixels of a letter, at most


@pytest.mark.parametrize("count", [3, 21, 61])
def test_names_and_numbers_of_bars_do_not_touch(count):
    chart = bars({str(i): 1234 + i for i in range(count)}, "t", "right answers")
    assert chart.count("<rect") == count
    found = re.findall(r'<text x="([\d.]+)" y="([\d.]+)" text-anchor="middle">([^<]*)<', chart)
    names = [(float(x), word) for x, y, word in found if HEIGHT - 25 < float(y) < HEIGHT - 10]
    numbers = [(float(x), word) for x, y, word in found if float(y) < HEIGHT - 34]
    assert (names[0][1], names[-1][1]) == ("0", str(count - 1))
    assert numbers[0][1] == "1,234"
    for row in (names, numbers):
        assert all(
            x + LETTER * len(one) / 2 < next_x - LETTER * len(other) / 2
            for (x, one), (next_x, other) in pairwise(row)
        )
    assert "<title>1: 1,235</title>" in chart
