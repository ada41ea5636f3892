"""Places of right answers by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from iqtt.audit.proofs.images import balance


@pytest.mark.parametrize(
    ("counts", "status"), [((3, 2, 2), "ok"), ((3, 1, 2), "FAIL"), ((0, 0, 0), "skipped")]
)
def test_places_come_equally_often_up_to_one(counts, status):
    table = SimpleNamespace(name="x", images=4)
    right = np.repeat([0, 1, 2, -1], [*counts, 2])
    assert balance([table], [right]).status == status
