"""Choose the Mitsuba variant that renders, and find an LLVM library for it.

Dr.Jit needs LLVM to compile its kernels for CPUs. Versions 14 and 15 abort the process at some
instructions, so a library's version is checked before Dr.Jit gets its path. The wheel
`karellen-llvm-core`, a dependency on Linux x86-64, brings a version that works.
"""

import ctypes
import ctypes.util
import glob
import importlib.metadata
import os
import platform
import re
import sys
import warnings
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from scenegen.common.errors import BackendError
from scenegen.common.names import check_choice
from scenegen.files.row_file import writer_name

EXACT_VARIANT = "llvm_ad_rgb"  # whose bits depend on no processor
LLVM_VARIABLE = "DRJIT_LIBLLVM_PATH"
LLVM_WHEEL = "karellen-llvm-core"
OLDEST_LLVM = 16
DEVICES = ("auto", "cpu", "cuda")
HOW_TO_GET_LLVM = (
    f"install LLVM {OLDEST_LLVM} or newer (on Linux x86-64: pip install {LLVM_WHEEL}) and, where it"
    f" is not found by itself, set {LLVM_VARIABLE} to its libLLVM before drjit is imported"
)
# Root attributes of files that name the releases which rendered them; see `versions`.
VERSION_ATTRIBUTES = ("mitsuba_version", "drjit_version", "llvm_version")
UNKNOWN = "unknown"


class SlowFallbackWarning(UserWarning):
    """Rendering goes on, but without the fast path."""


def select_variant(device: str) -> str:
    """Return the Mitsuba variant for a device and make its LLVM known to Dr.Jit.

    "auto": llvm_ad_rgb, else scalar_rgb with a warning. "cpu": llvm_ad_rgb. "cuda": cuda_ad_rgb.
    "auto" never picks the GPU: its bits differ from the CPU's. Raises BackendError for a device
    that is unknown or cannot be used here.
    """
    check_choice("device", device, DEVICES, BackendError)
    if device == "cuda":
        if not _has_cuda_driver():
            raise BackendError("device cuda", "no NVIDIA driver", hint="use --device cpu")
        return "cuda_ad_rgb"
    if point_to_llvm():
        return "llvm_ad_rgb"
    if device == "cpu":
        raise BackendError("device cpu", "no usable LLVM", hint=HOW_TO_GET_LLVM)
    warn_of_slow_rendering()
    return "scalar_rgb"


def llvm_version(library: str) -> tuple[int, ...]:
    """Return an LLVM library's version, three numbers: zeros where it does not load or tell.

    LLVMGetVersion came with LLVM 16, so whatever lacks it is too old.
    """
    numbers = [ctypes.c_uint() for _ in range(3)]
    try:
        ctypes.CDLL(library).LLVMGetVersion(*map(ctypes.byref, numbers))
    except (OSError, AttributeError):
        return (0, 0, 0)
    return tuple(number.value for number in numbers)


def find_llvm() -> str | None:
    """Return the first LLVM that works: the user's own choice, the wheel's, the system's."""
    chosen = os.environ.get(LLVM_VARIABLE)
    candidates = [chosen] if chosen else [*wheel_libraries(), *system_libraries()]
    return next((path for path in candidates if llvm_version(path)[0] >= OLDEST_LLVM), None)


def versions() -> dict[str, str]:
    """Return the versions of what renders here, by the names in `VERSION_ATTRIBUTES`.

    A version is "unknown" where nothing is installed that
    tells it. Nothing is imported for this. For the LLVM that Dr.Jit uses, call it after
    `select_variant`.
    """
    drjit = sys.modules.get("drjit")
    library = None if drjit else find_llvm()
    numbers = drjit.detail.llvm_version() if drjit else llvm_version(library) if library else (0,)
    llvm = ".".join(map(str, numbers)) if numbers[0] > 0 else UNKNOWN
    releases = (_release("mitsuba"), _release("drjit"), llvm)
    return dict(zip(VERSION_ATTRIBUTES, releases, strict=True))


def exact_kind(variant: str) -> dict[str, str]:
    """Return by which attributes a file has the bits that this variant computes here.

    The LLVM variant has the same bits with every LLVM and on every x86-64 processor. No file has
    the key `machine`, so none is of the kind of another processor.
    """
    kind = {"variant": variant, "writer": writer_name(), **versions()}
    del kind["llvm_version"]
    if platform.machine().lower() not in ("x86_64", "amd64"):
        kind["machine"] = platform.machine()
    return kind


def _release(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return UNKNOWN


@lru_cache(maxsize=1)
def point_to_llvm() -> str | None:
    """Tell Dr.Jit which LLVM to use, and return it; None where none is usable."""
    if "drjit" in sys.modules:  # it looked for its LLVM when it was imported, and keeps to that
        version = sys.modules["drjit"].detail.llvm_version()
        return f"LLVM {version[0]}" if version[0] >= OLDEST_LLVM else None
    library = find_llvm()
    if library:
        os.environ[LLVM_VARIABLE] = library
    return library


def wheel_libraries() -> list[str]:
    """Return the LLVM that the wheel brings, if it is installed."""
    try:
        files = importlib.metadata.files(LLVM_WHEEL) or []
    except importlib.metadata.PackageNotFoundError:
        return []
    paths = [Path(str(f.locate())).resolve() for f in files if f.name.startswith("libLLVM.so")]
    return sorted(str(path) for path in paths if path.exists())


def system_libraries() -> list[str]:
    """Return what package managers installed (Debian, Fedora, Homebrew), the newest first."""
    named = ctypes.util.find_library("LLVM")
    patterns = (
        "/usr/lib/*/libLLVM*.so*",
        "/usr/lib64/libLLVM*.so*",
        "/usr/lib/llvm*/lib/libLLVM.so",
    )
    packaged = [path for pattern in patterns for path in glob.glob(pattern)]
    brew = glob.glob("/opt/homebrew/opt/llvm*/lib/libLLVM.dylib")
    newest = sorted(packaged + brew, key=lambda p: int((re.findall(r"[0-9]+", p) or ["0"])[-1]))
    return ([named] if named else []) + newest[::-1]


def _has_cuda_driver() -> bool:
    try:
        ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return False
    return True


@lru_cache(maxsize=1)
def warn_of_slow_rendering() -> None:
    """Warn, once a process, that rendering goes on without the fast path."""
    warnings.warn(
        f"no usable LLVM found: rendering with scalar_rgb, many times slower; {HOW_TO_GET_LLVM}",
        SlowFallbackWarning,
        stacklevel=4,
    )


def renderer_text(attributes: Mapping[str, str]) -> str:
    """Return the versions that rendered a file, from its root attributes."""
    names = zip(("Mitsuba", "Dr.Jit", "LLVM"), VERSION_ATTRIBUTES, strict=True)
    return ", ".join(f"{name} {attributes.get(key, UNKNOWN)}" for name, key in names)
