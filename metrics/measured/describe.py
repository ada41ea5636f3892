"""Describe a file of measured truth as text."""

from pathlib import Path

import numpy as np

from metrics.measured.reader import MeasuredFile
from scenegen.common.text_table import printable
from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.info import column_lines, fact_lines, size_text
from scenegen.files.verify import spread_rows
from scenegen.layout import TRUTH_DIGEST

SAMPLED = 64  # rows that are read to tell the range of depth


def describe(path: str | Path) -> str:
    """Return counts, sizes, depths, source and digests, as one text. Raises as `MeasuredFile`."""
    with MeasuredFile(path) as truth:
        texts, rows = truth.attributes, spread_rows(len(truth), SAMPLED)
        sizes = [truth.size(row) for row in range(len(truth))]
        views = [truth.view(row) for row in rows]
        known = np.concatenate([view.depth[view.mask] for view in views])
        cameras = sum(view.rays is not None for view in views)
        low, middle, high = np.quantile(known, (0.0, 0.5, 1.0)).tolist()
        share = truth.read("valid_pixels", slice(None)) / np.prod(sizes, axis=1)
        facts = {
            "format": f"{texts['format']} {texts['format_version']}",
            "written by": texts["writer"],
            "source": texts["source"] or "-",
            "license": texts["license"] or "-",
            "groups": str(len(np.unique(truth.groups))),
            "sizes": ", ".join(f"{h}x{w}" for h, w in sorted(set(sizes))[:8]),
            "depth": f"{low:.3g} to {high:.3g} m, median {middle:.3g}, of {len(rows)} images",
            "measured": f"{share.min():.1%} to {share.max():.1%} of the pixels per image",
            "cameras": f"known for {cameras} of {len(rows)} images",
            "truth hash": texts[TRUTH_DIGEST],
            "content hash": texts[CONTENT_DIGEST],
            "conventions": texts["conventions"],
        }
        size = size_text(Path(path).stat().st_size)
        parts = [*fact_lines(facts), "", *column_lines(truth)]
    lines = [f"{path}: {len(sizes)} images with measured ground truth, {size}", ""]
    return "\n".join(map(printable, (*lines, *(f"  {line}" for line in parts))))
