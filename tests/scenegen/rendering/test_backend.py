"""The choice of LLVM: one that would abort is never used, and a missing one costs one warning."""

import ctypes
import ctypes.util
import importlib.metadata
import os
import platform
import sys
from pathlib import Path
from types import SimpleNamespace

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


@pytest.fixture(autouse=True)
def forgetful(monkeypatch):
    """Clear what is cached for the process before and after each test."""
    monkeypatch.setenv(LLVM_VARIABLE, "")  # so that it is restored, whatever is written to it
    monkeypatch.delenv(LLVM_VARIABLE)
    monkeypatch.delitem(sys.modules, "drjit", raising=False)  # other tests may have imported it
    backend.point_to_llvm.cache_clear()
    backend.warn_of_slow_rendering.cache_clear()
    yield
    backend.point_to_llvm.cache_clear()
    backend.warn_of_slow_rendering.cache_clear()


def no_package(name):
    raise importlib.metadata.PackageNotFoundError(name)


def no_library(name):
    raise OSError(name)


@pytest.mark.parametrize("library", NO_LLVM)
def test_a_library_without_a_version_is_no_llvm(library, monkeypatch):
    assert llvm_version(library) == (0, 0, 0)
    monkeypatch.setenv(LLVM_VARIABLE, library)
    assert find_llvm() is None
    assert os.environ[LLVM_VARIABLE] == library, "the user's setting is left alone"


@pytest.mark.skipif(not WITH_WHEEL, reason="the wheel is for Linux x86-64")
def test_the_wheel_comes_with_the_package_and_works():
    library = find_llvm()
    files = importlib.metadata.files(LLVM_WHEEL) or []
    assert library in {str(Path(str(file.locate())).resolve()) for file in files}
    assert llvm_version(library)[0] >= OLDEST_LLVM
    assert select_variant("auto") == select_variant("cpu") == "llvm_ad_rgb"
    assert os.environ[LLVM_VARIABLE] == library, "Dr.Jit is told"


def test_the_order_is_own_choice_then_wheel_then_system(monkeypatch):
    versions = {"own": 18, "wheel": 23, "system": 16, "old": 15}
    monkeypatch.setattr(backend, "llvm_version", lambda library: (versions[library],))
    monkeypatch.setattr(backend, "system_libraries", lambda: ["system"])
    for own, wheel, chosen in (
        (None, "wheel", "wheel"),
        (None, "old", "system"),
        ("own", "wheel", "own"),
        ("old", "wheel", None),  # a choice that cannot be met is not replaced silently
    ):
        monkeypatch.setattr(backend, "wheel_libraries", lambda wheel=wheel: [wheel])
        if own:
            monkeypatch.setenv(LLVM_VARIABLE, own)
        assert find_llvm() == chosen


def test_without_the_wheel_and_without_llvm(monkeypatch):
    monkeypatch.setattr(importlib.metadata, "files", no_package)
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None)
    with pytest.warns(SlowFallbackWarning):
        assert select_variant("auto") == "scalar_rgb"
    assert select_variant("auto") == "scalar_rgb", "no second warning: it would be an error"
    with pytest.raises(BackendError) as caught:
        select_variant("cpu")
    assert caught.value.where == "device cpu"
    assert LLVM_WHEEL in caught.value.hint
    assert LLVM_VARIABLE not in os.environ


def test_devices(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", no_library)
    for device, where in (("cuda", "device cuda"), ("gpu", "device"), ("", "device")):
        with pytest.raises(BackendError) as caught:
            select_variant(device)
        assert caught.value.where == where
    monkeypatch.setattr(ctypes, "CDLL", lambda name: None)
    assert select_variant("cuda") == "cuda_ad_rgb"


@pytest.mark.parametrize(("version", "good"), [((15, 0, 7), False), ((23, 1, 4), True)])
def test_a_drjit_imported_first_keeps_its_llvm(version, good, monkeypatch):
    """It binds its LLVM at import; to point it elsewhere afterwards would end in an abort."""
    imported = SimpleNamespace(detail=SimpleNamespace(llvm_version=lambda: version))
    monkeypatch.setitem(sys.modules, "drjit", imported)
    if good:
        assert select_variant("cpu") == "llvm_ad_rgb"
    else:
        with pytest.raises(BackendError):
            select_variant("cpu")
