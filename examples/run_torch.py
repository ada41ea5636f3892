"""A model for `bench run`, in PyTorch: a small network gives a map of points.

    bench run examples/run_torch.py --data rooms.h5 --out predictions.h5 --device cpu --batch 16

`bench run` makes the class once, hands --device to it, and calls `infer_batch` with as many images
as --batch says. Without `infer_batch` it would call `infer` for each image.
"""

import torch


class Model:
    """An untrained network; load your weights in `__init__`."""

    def __init__(self, device="cpu"):
        torch.manual_seed(0)
        layers = [torch.nn.Conv2d(3, 8, 3, padding=1), torch.nn.ReLU(), torch.nn.Conv2d(8, 1, 1)]
        self.network = torch.nn.Sequential(*layers).to(device).eval()
        self.device = device

    def infer(self, image):
        """Image (H, W, 3), sRGB bytes, to points (H, W, 3) of unknown scale."""
        return self.infer_batch(image[None])[0]

    @torch.inference_mode()
    def infer_batch(self, images):
        """Images (B, H, W, 3), sRGB bytes, to a dict for each image."""
        batch = torch.from_numpy(images).to(self.device).permute(0, 3, 1, 2).float() / 255
        depth = 2.0 + 0.1 * self.network(batch)[:, 0]
        height, width = depth.shape[1:]
        # x right, y down, z forward, as OpenCV has them; a focal length of 1.2 image heights.
        focal = 1.2 * height
        y, x = torch.meshgrid(
            torch.arange(height, device=self.device) + 0.5 - height / 2,
            torch.arange(width, device=self.device) + 0.5 - width / 2,
            indexing="ij",
        )
        points = torch.stack([x / focal * depth, y / focal * depth, depth], dim=-1)
        return [{"points_scale_invariant": one} for one in points]
