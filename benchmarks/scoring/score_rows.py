"""Milliseconds that `bench score` takes for one row, in test sets of more and more rows.

    python -m benchmarks.scoring.score_rows [--rows 1000 10000 50000]

The cost of a row should not depend on how many other rows the test set has. Images are as small as
the format allows, so that the work around the measures shows beside the measures themselves. The
predictions are the truth with noise.

One process scores 1,000 rows of each test set, spread evenly. Opening the files is so divided among
fewer rows than in real use: for large test sets the figures are rather too high. Processor time
leaves out what other programs take of a busy machine.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from metrics.prediction_writer import RoomPredictionWriter
from metrics.scoring.images.rows import score_rows
from metrics.scoring.runs import Settings
from metrics.submissions.reader import open_predictions
from scenegen.description.specs import DatasetSpec
from scenegen.rooms.make import make_dataset
from scenegen.rooms.reader import RoomsFile

SPEC = DatasetSpec(height=8, width=8, min_visible_pixels=1)
SCORED = 1000  # rows of each test set


def write_predictions(path: Path, truth: Path) -> None:
    """Write the truth with 1% of noise, and its normals, as a submission."""
    rng = np.random.default_rng(0)
    with RoomsFile(truth) as rooms, RoomPredictionWriter(path, truth, method="noise") as out:
        for row in range(len(rooms)):
            depth = rooms.read("depth", row)
            out.add(row, depth * rng.uniform(0.99, 1.01, depth.shape), rooms.read("normal", row))


def main() -> None:
    """Print a line for each number of rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, nargs="+", default=[1_000, 10_000, 50_000])
    options = parser.parse_args()
    print(f"{'rows':>8}  {'ms a row':>8}  {'of processor time':>17}")
    for count in options.rows:
        with tempfile.TemporaryDirectory() as folder:
            truth, predictions = Path(folder) / "rooms.h5", Path(folder) / "predictions.h5"
            make_dataset(truth, SPEC, count, command="benchmark")
            write_predictions(predictions, truth)
            rows = np.unique(np.linspace(0, count - 1, SCORED).astype(np.int64))
            with open_predictions(predictions) as file, RoomsFile(truth) as rooms:
                start, cpu = time.perf_counter(), time.process_time()
                score_rows([file], rooms, rows, Settings(processes=1))
            spent = (time.perf_counter() - start, time.process_time() - cpu)
            clock, processor = (1e3 * seconds / len(rows) for seconds in spent)
            print(f"{count:8d}  {clock:8.2f}  {processor:17.2f}", flush=True)


if __name__ == "__main__":
    main()
