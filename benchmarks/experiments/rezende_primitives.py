"""Where `rezende` works and where it fails: four sets of single shapes, one training run each.

    python -m benchmarks.experiments.rezende_primitives --runs runs --picture pictures.png

prints a table of errors on images that no run saw, and draws inputs, reconstructions, and the
meshes from the side. A run that was stopped goes on.
"""

from pathlib import Path

import click
import numpy as np
import torch
from PIL import Image

from baselines.rezende.network import METHOD, Card, Settings
from baselines.rezende.primitives import PRIMITIVE_SETS, render_primitives
from baselines.rezende.reconstruct import errors, reconstruct, sheet, untrained
from baselines.rezende.training import train_pictures
from baselines.training.checkpoint import CHECKPOINT, load_checkpoint, new_state

TRAINED, TESTED, SHOWN = 4_000, 400, 10  # images of each set
TRAIN_SEED, TEST_SEED = 1, 2


@click.command()
@click.option("--runs", type=click.Path(path_type=Path), required=True, help="Folder of the runs.")
@click.option("--picture", type=click.Path(path_type=Path), required=True)
@click.option("--iterations", default=2_000, show_default=True)
@click.option("--only", type=click.Choice(list(PRIMITIVE_SETS)), multiple=True)
def main(runs: Path, picture: Path, iterations: int, only: tuple[str, ...]) -> None:
    """Train, measure and draw."""
    torch.set_num_threads(1)
    settings = Settings(iterations=iterations)
    sheets = []
    print(f"{'set':12} {'':9} {'radiance':>8} {'silhouette IoU':>14} {'depth':>6} {'CPU s':>6}")
    for name in only or PRIMITIVE_SETS:
        folder = runs / name
        train = render_primitives(name, TRAINED, settings.size, TRAIN_SEED)
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / CHECKPOINT).exists():
            state = load_checkpoint(folder, METHOD)
        else:
            state = new_state(METHOD, Card("rezende", settings, fingerprint=train.fingerprint))
        train_pictures(train, folder, state)
        model = state.network.eval()
        test = render_primitives(name, TESTED, settings.size, TEST_SEED)
        found = reconstruct(model, test)
        for what, one in (("sphere", untrained(test)), ("trained", found)):
            e = errors(one, test)
            numbers = f"{e['radiance']:8.3f} {e['silhouette_iou']:14.3f} {e['depth']:6.3f}"
            print(f"{name:12} {what:9} {numbers} {state.card.seconds:6.0f}", flush=True)
        sheets.append(sheet(found, test, range(SHOWN)))
    rows = np.concatenate([np.pad(np.asarray(one), ((0, 12), (0, 0), (0, 0))) for one in sheets])
    Image.fromarray(rows).save(picture)


if __name__ == "__main__":
    main()
