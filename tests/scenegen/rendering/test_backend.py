"""The choice of LLVM: one that would abort is never used, and a missing one costs one warning."""

import ctypes
import ctypes.util
import importlib.metadata
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NoReturn

import pytest

from scenegen.common.errors import BackendError
from scenegen.rendering import backend
from scenegen.rendering.backend import (
    LLVM_VARIABLE,
    LLVM_WHEEL,
    OLDEST_LLVM,
    SlowFallbackWarning,
    find_llvm,
    llvm_version,
    select_variant,
)

OLD = sorted(
    str(path)
    for pattern in ("libLLVM-14.so", "libLLVM-15.so")
    for path in Path("/usr/lib").glob(f"*-linux-gnu/{pattern}")
)  # Debian 12's, where installed: the real thing
NO_LLVM = ["/nowhere/libLLVM.so", ctypes.util.find_library("c") or "libc.so.6", *OLD]
WITH_WHEEL = sys.platform == "linux" and platform.machine() == "x86_64"

TINY_RENDER = """
import sys, warnings
warnings.simplefilter("error")
from scenegen.rendering.backend import SlowFallbackWarning, select_variant
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render
from scenegen.sampling.scenes import sample_scene
from scenegen.description.specs import DatasetSpec
spec = DatasetSpec(height=8, width=8, objects=(1, 1), shapes=("teapot",), min_visible_pixels=0)
scene = next(s for i in range(9) if (s := sample_scene(spec, i)))
with warnings.catch_warnings(record=True) as found:
    warnings.simplefilter("always", SlowFallbackWarning)
    truth = render(pack(spec, [scene]))
    again = render(pack(spec, [scene]))
    select_variant("auto")
assert truth.depth.tobytes() == again.depth.tobytes()
assert (truth.object_id >= 0).all() and truth.depth.min() > 0.3, truth
import mitsuba
print(mitsuba.variant(), *(f"{w.category.__name__}: {w.message}" for w in found), sep="\\n")
"""


@pytest.fixture(autouse=True)
def forgetful(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Clear what is cached for the process before and after each test."""
    monkeypatch.setenv(LLVM_VARIABLE, "")  # so that it is restored, whatever is written to it
    monkeypatch.delenv(LLVM_VARIABLE)
    monkeypatch.delitem(sys.modules, "drjit", raising=False)  # other tests may have imported it
    backend.point_to_llvm.cache_clear()
    backend.warn_of_slow_rendering.cache_clear()
    yield
    backend.point_to_llvm.cache_clear()
    backend.warn_of_slow_rendering.cache_clear()


def no_package(name: str) -> NoReturn:
    raise importlib.metadata.PackageNotFoundError(name)


def no_library(name: str) -> NoReturn:
    raise OSError(name)


class FakeLibrary:
    """A library that tells a version, as LLVM 16 and later do."""

    def __init__(self, major: int) -> None:
        self.major = major

    def LLVMGetVersion(self, major: Any, minor: Any, patch: Any) -> None:
        major._obj.value, minor._obj.value, patch._obj.value = self.major, 7, 9


@pytest.mark.parametrize("library", NO_LLVM)
def test_what_tells_no_version_is_no_llvm(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert llvm_version(library) == (0, 0, 0)
    monkeypatch.setenv(LLVM_VARIABLE, library)
    assert find_llvm() is None
    assert os.environ[LLVM_VARIABLE] == library, "the user's setting is left alone"


@pytest.mark.parametrize(("major", "good"), [(15, False), (16, True), (23, True)])
def test_the_version_told_decides(major: int, good: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda name: FakeLibrary(major))
    monkeypatch.setenv(LLVM_VARIABLE, "/some/libLLVM.so")
    assert OLDEST_LLVM == 16
    assert llvm_version("/some/libLLVM.so") == (major, 7, 9)
    assert find_llvm() == ("/some/libLLVM.so" if good else None)
    if good:
        assert select_variant("cpu") == "llvm_ad_rgb"
    else:
        with pytest.raises(BackendError, match="no usable LLVM"):
            select_variant("cpu")


@pytest.mark.skipif(not WITH_WHEEL, reason="the wheel is for Linux x86-64")
def test_the_wheel_comes_with_the_package_and_works() -> None:
    library = find_llvm()
    assert library is not None
    files = importlib.metadata.files(LLVM_WHEEL) or []
    assert Path(library) in {Path(str(file.locate())).resolve() for file in files}
    assert Path(library).is_absolute()
    assert llvm_version(library)[0] >= OLDEST_LLVM
    assert select_variant("auto") == select_variant("cpu") == "llvm_ad_rgb"
    assert os.environ[LLVM_VARIABLE] == library, "Dr.Jit is told"


def test_the_order_is_own_choice_then_wheel_then_system(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {"own": 18, "wheel": 23, "system": 17, "old": 14}
    monkeypatch.setattr(backend, "llvm_version", lambda library: (versions[library],))
    monkeypatch.setattr(backend, "wheel_libraries", lambda: ["wheel"])
    monkeypatch.setattr(backend, "system_libraries", lambda: ["system"])
    assert find_llvm() == "wheel"
    monkeypatch.setattr(backend, "wheel_libraries", lambda: ["old"])
    assert find_llvm() == "system"
    monkeypatch.setenv(LLVM_VARIABLE, "own")
    assert find_llvm() == "own"
    monkeypatch.setenv(LLVM_VARIABLE, "old")
    assert find_llvm() is None, "a choice that cannot be met is not replaced silently"


def test_without_the_wheel_and_without_llvm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.metadata, "files", no_package)
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None)
    with pytest.warns(SlowFallbackWarning, match=f"scalar_rgb.*pip install {LLVM_WHEEL}"):
        assert select_variant("auto") == "scalar_rgb"
    assert select_variant("auto") == "scalar_rgb", "no second warning: it would be an error"
    with pytest.raises(BackendError) as caught:
        select_variant("cpu")
    assert caught.value.where == "device cpu"
    assert LLVM_WHEEL in caught.value.hint
    assert LLVM_VARIABLE in caught.value.hint
    assert LLVM_VARIABLE not in os.environ


def test_cuda_needs_a_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", no_library)
    with pytest.raises(BackendError) as caught:
        select_variant("cuda")
    assert (caught.value.where, caught.value.hint) == ("device cuda", "use --device cpu")
    monkeypatch.setattr(ctypes, "CDLL", lambda name: None)
    assert select_variant("cuda") == "cuda_ad_rgb"


@pytest.mark.parametrize("device", ["gpu", "", "AUTO"])
def test_unknown_devices_are_refused(device: str) -> None:
    with pytest.raises(BackendError) as caught:
        select_variant(device)
    assert (caught.value.found, caught.value.expected) == (repr(device), "one of auto, cpu, cuda")


@pytest.mark.parametrize("library", [NO_LLVM[0], *OLD[:1]])
def test_rendering_goes_on_without_llvm_and_says_so_once(library: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", TINY_RENDER],
        env=os.environ | {LLVM_VARIABLE: library},
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(backend.__file__).parents[1],
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    variant, *messages = done.stdout.splitlines()
    assert variant == "scalar_rgb"
    assert len(messages) == 1
    assert messages[0].startswith("SlowFallbackWarning: no usable LLVM found")


@pytest.mark.parametrize(("version", "good"), [((15, 0, 7), False), ((23, 1, 4), True)])
def test_a_drjit_imported_first_keeps_its_llvm(
    version: tuple[int, int, int], good: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It binds its LLVM at import; to point it elsewhere afterwards would end in an abort."""
    imported = SimpleNamespace(detail=SimpleNamespace(llvm_version=lambda: version))
    monkeypatch.setitem(sys.modules, "drjit", imported)
    if good:
        assert select_variant("cpu") == "llvm_ad_rgb"
    else:
        with pytest.raises(BackendError, match="before drjit is imported"):
            select_variant("cpu")


def test_versions_are_told_before_and_after_drjit_is_imported() -> None:
    code = """
import sys
from scenegen.rendering.backend import VERSION_ATTRIBUTES, select_variant, versions
select_variant("auto")
before = versions()
assert "drjit" not in sys.modules and "mitsuba" not in sys.modules
import mitsuba, drjit
assert before["mitsuba_version"] == mitsuba.__version__
assert before["drjit_version"] == drjit.__version__
assert versions() == before and tuple(before) == VERSION_ATTRIBUTES
print(before["llvm_version"])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    library = find_llvm()
    assert done.stdout.strip() == (
        ".".join(map(str, llvm_version(library))) if library else "unknown"
    )


def test_a_version_that_nothing_tells_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.metadata, "version", no_package)
    monkeypatch.setenv(LLVM_VARIABLE, "/nowhere/libLLVM.so")
    assert set(backend.versions().values()) == {"unknown"}
