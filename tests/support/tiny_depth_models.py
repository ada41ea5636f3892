"""Tiny networks of the depth classes of transformers, with random weights, in folders."""

from pathlib import Path

import torch
import transformers as t

SIDE, PATCH = 70, 14


def _backbone(**more):
    return t.Dinov2Config(
        hidden_size=32, num_hidden_layers=4, num_attention_heads=2, image_size=SIDE,
        patch_size=PATCH, out_features=[f"stage{i}" for i in (1, 2, 3, 4)],
        reshape_hidden_states=False, **more,
    )  # fmt: skip


def _depth_anything(kind, **more):
    return kind(
        backbone_config=_backbone(), reassemble_hidden_size=32, neck_hidden_sizes=[8, 8, 16, 16],
        fusion_hidden_size=16, head_hidden_size=8, patch_size=PATCH, **more,
    )  # fmt: skip


def _dpt():
    return t.DPTConfig(
        hidden_size=32, num_hidden_layers=4, num_attention_heads=2, intermediate_size=64,
        image_size=64, patch_size=16, backbone_out_indices=[0, 1, 2, 3],
        neck_hidden_sizes=[8, 8, 16, 16], fusion_hidden_size=16, is_hybrid=False,
    )  # fmt: skip


def _dinov2_dpt():
    return t.DPTConfig(
        backbone_config=_backbone(), neck_hidden_sizes=[8, 8, 16, 16], fusion_hidden_size=256,
        add_projection=True, use_bias_in_fusion_residual=False,
    )  # fmt: skip


def _glpn():
    return t.GLPNConfig(
        hidden_sizes=[8, 16, 16, 32], depths=[1] * 4, num_attention_heads=[1, 1, 2, 2],
        decoder_hidden_size=16,
    )  # fmt: skip


def _zoedepth():
    return t.ZoeDepthConfig(
        backbone_config=t.BeitConfig(
            hidden_size=32, num_hidden_layers=4, num_attention_heads=2, intermediate_size=64,
            image_size=64, out_features=[f"stage{i}" for i in (1, 2, 3, 4)],
            reshape_hidden_states=False, use_relative_position_bias=True,
        ),
        neck_hidden_sizes=[8, 8, 16, 16], fusion_hidden_size=16, bottleneck_features=16,
        num_relative_features=16, bin_embedding_dim=16,
        bin_configurations=[{"n_bins": 8, "min_depth": 0.1, "max_depth": 10.0, "name": "nyu"}],
        num_attractors=[4, 2, 2, 1],
    )  # fmt: skip


def _depth_pro():
    vit = t.Dinov2Config(
        hidden_size=32, num_hidden_layers=4, num_attention_heads=2, image_size=32, patch_size=16
    )
    return t.DepthProConfig(
        fusion_hidden_size=16, patch_size=32, intermediate_hook_ids=[2, 1],
        intermediate_feature_dims=[8, 8], scaled_images_ratios=[0.25, 0.5, 1.0],
        scaled_images_overlap_ratios=[0.0, 0.5, 0.25], scaled_images_feature_dims=[16, 16, 8],
        image_model_config=vit, patch_model_config=vit, fov_model_config=vit,
        num_fov_head_layers=1,
    )  # fmt: skip


def _tipsv2():
    vit = t.Tipsv2VisionConfig(
        hidden_size=32, num_hidden_layers=4, num_attention_heads=2, image_size=SIDE,
        patch_size=PATCH, out_features=[f"stage{i}" for i in (1, 2, 3, 4)],
        reshape_hidden_states=False,
    )  # fmt: skip
    return t.Tipsv2DptConfig(
        backbone_config=vit, neck_hidden_sizes=[8, 8, 16, 16], fusion_hidden_size=16,
        num_depth_bins=8,
    )  # fmt: skip


def _square(kind, side, **more):
    return kind(size={"height": side, "width": side}, **more)


# What each one predicts, its configuration, and its processor.
MODELS = {
    "depth-anything": (
        "disparity_affine_invariant",
        lambda: _depth_anything(t.DepthAnythingConfig),
        lambda: _square(
            t.DPTImageProcessor, SIDE, keep_aspect_ratio=True, ensure_multiple_of=PATCH
        ),
    ),
    "depth-anything-metric": (
        "depth_metric",
        lambda: _depth_anything(
            t.DepthAnythingConfig, depth_estimation_type="metric", max_depth=20
        ),
        lambda: _square(
            t.DPTImageProcessor, SIDE, keep_aspect_ratio=True, ensure_multiple_of=PATCH
        ),
    ),
    "prompt-depth-anything": (
        "depth_metric",
        lambda: _depth_anything(
            t.PromptDepthAnythingConfig, depth_estimation_type="metric", max_depth=20
        ),
        lambda: _square(t.PromptDepthAnythingImageProcessor, SIDE, ensure_multiple_of=PATCH),
    ),
    "dpt": ("disparity_affine_invariant", _dpt, lambda: _square(t.DPTImageProcessor, 64)),
    "dpt-dinov2": ("depth_metric", _dinov2_dpt, lambda: _square(t.DPTImageProcessor, SIDE)),
    "glpn": ("depth_metric", _glpn, lambda: t.GLPNImageProcessor(size_divisor=32)),
    "zoedepth": ("depth_metric", _zoedepth, lambda: _square(t.ZoeDepthImageProcessor, 64)),
    "depth-pro": ("depth_metric", _depth_pro, lambda: _square(t.DepthProImageProcessor, 128)),
    "tipsv2": ("depth_metric", _tipsv2, lambda: _square(t.DPTImageProcessor, SIDE)),
}


def save(name: str, folder: Path) -> str:
    """Save a network with its processor in a folder; return the folder as text."""
    torch.manual_seed(0)
    _, config, processor = MODELS[name]
    network = t.AutoModelForDepthEstimation.from_config(config())
    for weights in network.parameters():  # the library's are so small that all outputs are alike
        if weights.ndim > 1:
            torch.nn.init.kaiming_normal_(weights)
    network.save_pretrained(folder)
    processor().save_pretrained(folder)
    return str(folder)
