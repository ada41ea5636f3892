"""The same bytes with any lanes, numpy, BLAS, LLVM and threads: those that are committed.

`tests/support/exact_bits.py` says how a change of bits that is meant is written down.
"""

import glob
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

TESTS = Path(__file__).parents[2]
EXPECTED = json.loads((TESTS / "exact_bits.json").read_text())


def changed(lanes, threads, python=sys.executable, **variables):
    """Return kinds and arrays whose digests are not those committed, in a process of its own."""
    done = subprocess.run(
        [python, TESTS / "support" / "exact_bits.py", str(lanes), str(threads)],
        env={**os.environ, "PYTHONPATH": str(TESTS.parent), **variables},
        stdout=subprocess.PIPE,
        check=True,
    )
    found = json.loads(done.stdout)
    assert found.keys() == EXPECTED.keys()
    return [
        (kind, name)
        for kind, digests in EXPECTED.items()
        for name in digests.keys() | found[kind].keys()
        if digests.get(name) != found[kind].get(name)
    ]


def without_dispatch():
    """Return what lets numpy use no instructions beyond those that every processor has."""
    names = [name for name in __cpu_dispatch__ if __cpu_features__[name]]
    return {"NPY_DISABLE_CPU_FEATURES": " ".join(names)} if names else {}


@pytest.mark.parametrize(
    ("lanes", "threads", "plain", "blas"),
    [
        (4, 1, True, "Nehalem"),  # as on the least processor, and so unlike the one at hand
        pytest.param(8, 2, False, "Haswell", marks=pytest.mark.slow),
        pytest.param(16, 2, False, "", marks=pytest.mark.slow),
    ],
)
def test_every_array_has_the_committed_bits(lanes, threads, plain, blas):
    if lanes == 16 and not __cpu_features__["AVX512_SKX"]:
        pytest.skip("the processor has no AVX-512")
    variables = {**(without_dispatch() if plain else {})}
    if blas:
        variables["OPENBLAS_CORETYPE"] = blas
    assert changed(lanes, threads, **variables) == []


@pytest.mark.slow
@pytest.mark.parametrize("version", range(18, 24))
def test_every_llvm_gives_these_bits(version):
    found = glob.glob(f"/usr/lib/llvm-{version}/lib/libLLVM*.so*")
    if not found:
        pytest.skip(f"no LLVM {version} here")
    assert changed(8, 2, DRJIT_LIBLLVM_PATH=found[0]) == []


@pytest.mark.slow
def test_the_oldest_numpy_gives_these_bits():
    """In an environment that PIX2SHAPE_OLD_PYTHON names, where numpy 2.1 is installed."""
    python = os.environ.get("PIX2SHAPE_OLD_PYTHON")
    if not python:
        pytest.skip(f"PIX2SHAPE_OLD_PYTHON names no python; numpy here is {np.__version__}")
    assert changed(8, 2, python) == []
