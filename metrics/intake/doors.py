"""Depth models of public libraries, loaded by their names: `bench run hf:NAME`, `moge:NAME`.

This file runs in the model's process, by `model_runner`, where transformers or MoGe are installed,
beside NumPy and PyTorch of any version that they take. It imports nothing of this project, and
nothing of it imports this file.
"""

from __future__ import annotations

import hashlib
import platform
import re
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import torch

DISPARITY, METRES, UP_TO_SCALE = "disparity_affine_invariant", "depth_metric", "scale_invariant"
# What the classes of transformers predict, by the `model_type` of their configuration; `key_of` has
# those that depend on more. Sources: the papers of the models, and the library's own documents.
# CHMv2 is not here: it predicts heights of trees.
KEYS = {"depth_pro": METRES, "glpn": METRES, "tipsv2_dpt": METRES, "zoedepth": METRES}


def load(
    name: str, device: str = "cpu", dtype: str = "float32", key: str | None = None
) -> HuggingFace | MoGe:
    """Return the model of a name such as `hf:depth-anything/Depth-Anything-V2-Small-hf`."""
    library, _, named = name.partition(":")
    kind = getattr(torch, dtype, None)
    if not isinstance(kind, torch.dtype) or not kind.is_floating_point:
        raise ValueError(f"--dtype: found {dtype!r}, expected float32, bfloat16 or float16")
    return HuggingFace(named, device, kind, key) if library == "hf" else MoGe(named, device, kind)


class HuggingFace:
    """A network of `AutoModelForDepthEstimation`, with its own processor before and after it."""

    metres = True

    def __init__(self, name: str, device: str, dtype: torch.dtype, key: str | None) -> None:
        from transformers import AutoImageProcessor, AutoModelForDepthEstimation

        self.network, told = AutoModelForDepthEstimation.from_pretrained(
            name, dtype=dtype, output_loading_info=True
        )
        lost = sorted({*told["missing_keys"], *(one[0] for one in told["mismatched_keys"])})
        refuse_lost(lost)
        self.key = key or key_of(self.network.config)
        if self.key is None:
            what = f"the output of {type(self.network).__name__} is unknown"
            raise ValueError(f"{what}; use --key {DISPARITY}, or the key that describes the output")
        self.processor = AutoImageProcessor.from_pretrained(name)
        self.network.to(device).eval()
        self.device, self.dtype = device, dtype
        revision = getattr(self.network.config, "_commit_hash", None)
        self._told = provenance_of(self.network, name, revision, device, dtype, "transformers")

    def provenance(self) -> dict[str, str]:
        """Return what made a submission, in texts; the input's size after the first image."""
        return self._told

    def infer(self, image: Any) -> Any:
        """Image (H, W, 3), sRGB bytes, to a dict with depth or disparity (H, W)."""
        return self.infer_batch(image[None])[0]

    @torch.inference_mode()
    def infer_batch(self, images: Any) -> Any:
        """Images (B, H, W, 3), sRGB bytes, to a dict for each."""
        height, width = images.shape[1:3]
        inputs = self.processor(images=list(images), return_tensors="pt")
        pixels = inputs["pixel_values"].to(self.device, self.dtype)
        self._told["input"] = "x".join(map(str, pixels.shape[-2:]))
        outputs = self.network(pixels)
        sizes = [(height, width)] * len(images)
        after: Callable[..., Any] = self.processor.post_process_depth_estimation
        if "source_sizes" in signature(after).parameters:  # ZoeDepth, which takes its padding off
            results = after(outputs, source_sizes=sizes, target_sizes=sizes)
        else:
            results = after(outputs, target_sizes=sizes)
        given = []
        for one in results:
            geometry: dict[str, Any] = {str(self.key): one["predicted_depth"].float()}
            if one.get("field_of_view") is not None:  # Depth Pro: of the width
                half = np.radians(float(one["field_of_view"])) / 2.0
                focal = width / 2.0 / np.tan(half)
                matrix = [[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]]
                geometry["intrinsics"] = np.array(matrix)
            given.append(geometry)
        return given


def key_of(config: Any) -> str | None:
    """Return what a network of transformers of this configuration predicts; None if unknown."""
    if config.model_type in ("depth_anything", "prompt_depth_anything"):
        return METRES if config.depth_estimation_type == "metric" else DISPARITY
    if config.model_type == "dpt":  # those of DINOv2, for NYU and KITTI, have one; MiDaS has none
        return METRES if config.add_projection else DISPARITY
    return KEYS.get(config.model_type)


OFF_CENTRE = (
    0.1  # of half the width or height of an image; those of cameras for photographs are less
)
NOT_CENTRED = (
    "--intrinsics: the principal point is far from the centre of the image, but MoGe takes only a"
    " field of view; run without --intrinsics"
)


class MoGe:
    """A `MoGeModel`, version 1 or 2: points, depth, mask, the camera, and normals if it has them.

    Points of version 1 are known up to a scale. Those of version 2 are metres where it has a head
    for the scale.
    """

    metres = True

    def __init__(self, name: str, device: str, dtype: torch.dtype) -> None:
        self.network, revision = _moge(name)
        self.network.to(device).eval()
        self.half = dtype == torch.float16
        self.ending = "metric" if hasattr(self.network, "scale_head") else UP_TO_SCALE
        self._told = provenance_of(self.network, name, revision, device, dtype, "moge")

    def provenance(self) -> dict[str, str]:
        """Return what made a submission, in texts."""
        return self._told

    def infer(self, image: Any, intrinsics: Any = None) -> Any:
        """Image (H, W, 3), sRGB bytes, to a dict."""
        told = None if intrinsics is None else intrinsics[None]
        return self.infer_batch(image[None], told)[0]

    @torch.inference_mode()
    def infer_batch(self, images: Any, intrinsics: Any = None) -> Any:
        """Images (B, H, W, 3), sRGB bytes, and matrices in pixels, to a dict for each."""
        pixels = torch.from_numpy(images).permute(0, 3, 1, 2).float() / 255.0
        fov_x = None
        if intrinsics is not None:
            middle = intrinsics[:, :2, 2] * 2 / images.shape[2:0:-1]
            if np.abs(middle - 1).max() > OFF_CENTRE:
                raise ValueError(NOT_CENTRED)
            fov_x = np.degrees(2.0 * np.arctan(images.shape[2] / 2.0 / intrinsics[:, 0, 0]))
            fov_x = torch.from_numpy(fov_x).float().to(self.network.device)
        found = self.network.infer(pixels, fov_x=fov_x, use_fp16=self.half)
        names = {one: f"{one}_{self.ending}" for one in ("points", "depth")}
        return [
            {names.get(name, name): values[i] for name, values in found.items()}
            for i in range(len(images))
        ]


def _moge(name: str) -> tuple[Any, str]:
    """Return a MoGeModel and the revision of its weights; a path is taken before the hub's name."""
    from huggingface_hub import hf_hub_download
    from moge.model import import_model_class_by_version

    path, revision = Path(name), ""
    if path.is_dir():
        path /= "model.pt"
    elif not path.exists():
        path = Path(hf_hub_download(name, "model.pt"))
        revision = path.parent.name  # the cache has a folder for each revision
    stored = torch.load(path, map_location="cpu", weights_only=True)
    about = stored["model_config"]
    kind = "v2" if isinstance(about.get("encoder"), dict) else "v1"  # v1 names its encoder
    network = import_model_class_by_version(kind)(**about)
    refuse_lost(network.load_state_dict(stored["model"], strict=False).missing_keys)
    return network, revision


def refuse_lost(names: list[str]) -> None:
    """Raise ValueError where a network has weights that its file does not."""
    if names:
        raise ValueError(f"{len(names)} weights that do not match, such as {', '.join(names[:3])}")


def provenance_of(
    network: torch.nn.Module, name: str, revision: str | None, device: str, dtype: Any, library: str
) -> dict[str, str]:
    """Return what made a submission, in texts: weights, versions and the device."""
    digest = hashlib.sha256()
    for key, tensor in sorted(network.state_dict().items()):
        digest.update(f"{key} {tensor.dtype} {tuple(tensor.shape)}".encode())
        digest.update(tensor.detach().cpu().contiguous().view(-1).view(torch.uint8).numpy().data)
    cuda = device.startswith("cuda")
    return {
        "model": name,
        "revision": revision or "",
        "class": type(network).__name__,
        "weights_sha256": digest.hexdigest(),
        "dtype": str(dtype).removeprefix("torch."),
        "device": torch.cuda.get_device_name(device) if cuda else device,
        "cuda": str(torch.version.cuda) if cuda else "",
        "driver": driver_version() if cuda else "",
        "python": platform.python_version(),
        **{one: _version(one) for one in (library, "torch", "numpy")},
    }


def driver_version(told: str = "/proc/driver/nvidia/version") -> str:
    """Return the version of NVIDIA's driver, as the driver tells on Linux; "" elsewhere."""
    try:
        text = Path(told).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    found = re.search(r"\b\d+\.\d+(\.\d+)?\b", text)
    return found[0] if found else ""


def _version(package: str) -> str:
    """Return the version that is installed; MoGe comes under two names, or as a folder."""
    for name in {"moge": ("dlr-moge", "moge")}.get(package, (package,)):
        try:
            return version(name)
        except PackageNotFoundError:
            pass
    return ""
