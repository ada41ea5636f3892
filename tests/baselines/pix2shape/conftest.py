"""One thread a test process: the tests' own processes share the cores already."""

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)
