"""Fine-tune a public depth network on rooms; score it before training and after each epoch.

    python examples/finetune.py NAME train.h5 validation.h5 --epochs 5 --out tuned

NAME is what `AutoModelForDepthEstimation` loads: a name on the hub or a folder. The network learns
disparity, known up to scale and shift. `bench run hf:tuned` runs the result.
"""

import argparse

import torch
from torch.nn.functional import interpolate
from torch.utils.data import DataLoader
from transformers import AutoImageProcessor, AutoModelForDepthEstimation

import metrics
from scenegen import RoomsDataset, open_rooms


def loss_of(predicted, disparity, seen):
    """Mean absolute error after scale and shift of each image (Ranftl et al. 2020, section 5)."""

    def fitted(values):
        values = values - values.median()
        return values / values.abs().mean().clamp(min=1e-6)

    images = zip(predicted, disparity, seen, strict=True)
    return torch.stack([(fitted(p[m]) - fitted(d[m])).abs().mean() for p, d, m in images]).mean()


parser = argparse.ArgumentParser()
for name in ("name", "train", "validation"):
    parser.add_argument(name)
parser.add_argument("--epochs", type=int, default=5)
parser.add_argument("--rate", type=float, default=1e-4)
parser.add_argument("--device", default="cpu")
parser.add_argument("--out", default="tuned")
given = parser.parse_args()
torch.manual_seed(0)
processor = AutoImageProcessor.from_pretrained(given.name)
network = AutoModelForDepthEstimation.from_pretrained(given.name).to(given.device)
optimizer = torch.optim.AdamW(network.parameters(), lr=given.rate)
validation = open_rooms(given.validation)


def predicted(radiance):
    """Radiance (B, H, W, 3) to what the network says, (B, H, W)."""
    pictures = [(255 * image.clip(0, 1) ** (1 / 2.2)).astype("uint8") for image in radiance]
    pixels = processor(images=pictures, return_tensors="pt")["pixel_values"].to(given.device)
    said = network(pixels).predicted_depth[:, None]
    return interpolate(said, radiance.shape[1:3], mode="bilinear", align_corners=False)[:, 0]


rooms = DataLoader(RoomsDataset(given.train, ["image", "depth"]), 8, shuffle=True)
for epoch in range(1 + given.epochs):  # the first scores are those before training
    network.train()
    for batch in rooms if epoch else ():
        depth = batch["depth"].to(given.device)
        seen = depth.isfinite()
        loss = loss_of(predicted(batch["image"].numpy()), 1 / depth, seen)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    network.eval()
    with torch.inference_mode():
        said = (predicted(room.radiance[None])[0].cpu().numpy() for room in validation)
        scores = metrics.evaluate(said, validation, kind="disparity")
    network.save_pretrained(given.out)
    processor.save_pretrained(given.out)
    values = {name: scores.skills[name].value for name in ("mse_depth", "relief_iou")}
    print(epoch, *(f"skill of {name} {value:.3f}" for name, value in values.items()), flush=True)
