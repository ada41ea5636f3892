"""Score files of methods that leave different things open, brought under one alignment.

A method that is fitted to the truth of each image by scale and shift must not stand beside one that
is not: the fit alone would decide. So a comparison scores all methods after the loosest alignment
that one of them declares. The scores of depth and points after each alignment stand in every score
file; what does not depend on scale is the same under all that fit a scale alone.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from metrics.measures.alignment import Alignment
from metrics.scoring.metric_names import OF_TRUTH, TABLE
from metrics.scoring.records import ID_COLUMNS, OPTIONAL_COLUMNS, ScoreFile
from scenegen.common.errors import SceneGenError

# How much of the depth is fitted to the truth: nothing, a scale, or a scale and a shift.
FITTED: dict[Alignment, int] = {
    "none": 0,
    "median_scale": 1,
    "scale": 1,
    "scale_l1": 1,
    "scale_shift": 2,
    "scale_shift_l1": 2,
    "disparity_scale_shift": 2,
}


class AlignmentError(SceneGenError):
    """Scores that no single alignment brings together."""


def common_alignment(
    declared: Sequence[tuple[str, Alignment]], chosen: Alignment | None = None
) -> Alignment:
    """Return the alignment for all methods: the loosest one that a method declares, or `chosen`.

    Raises AlignmentError where the chosen one is tighter than that, or where two methods leave the
    same open in different ways: a shift of depth and one of disparity.
    """
    most = max(FITTED[alignment] for _, alignment in declared)
    loosest = sorted({alignment for _, alignment in declared if FITTED[alignment] == most})
    if chosen is not None:
        if FITTED[chosen] < most:
            who = next(method for method, alignment in declared if alignment == loosest[0])
            found = f"{chosen}, but {who} is scored after {loosest[0]}"
            raise AlignmentError("alignment", found, f"{loosest[0]}, or a looser one")
        return chosen
    if len(loosest) == 1:
        return loosest[0]
    if most == 1:
        return "scale"
    found = f"{' and '.join(loosest)}, of {' and '.join(method for method, _ in declared)}"
    hint = "compare methods that predict disparity apart from those that predict depth"
    raise AlignmentError("alignment", found, "one that all methods can be scored after", hint)


def aligned(files: Sequence[ScoreFile], chosen: Alignment | None = None) -> list[ScoreFile]:
    """Return the files of one test set under `common_alignment`. Raises AlignmentError.

    A file that was scored under another one keeps the scores that it has after the common one,
    under their plain names, and those that such a fit does not change. Baselines that are fitted as
    methods are come from a file that was scored under the common alignment.
    """
    alignment = common_alignment(_declared(files), chosen)
    like = next((file for file in files if file.alignment == alignment), None)
    return [_under(file, alignment, like) for file in files]


def _declared(files: Sequence[ScoreFile]) -> list[tuple[str, Alignment]]:
    return [(file.method, file.alignment) for file in files]


def _under(file: ScoreFile, alignment: Alignment, like: ScoreFile | None) -> ScoreFile:
    if file.alignment == alignment:
        return file
    kept = (*ID_COLUMNS[file.task], *OPTIONAL_COLUMNS[file.task])
    columns = {name: values for name, values in file.columns.items() if name in kept}
    for row in TABLE:
        fits = {"": 0, "scale": 1, "scale_shift": 2}[row.unchanged_by]
        stored = row.name if FITTED[alignment] <= fits else f"{row.name}_after_{alignment}"
        if stored not in file.columns:
            continue
        columns[row.name] = file.columns[stored]
        source = file if stored == row.name else like
        if source is not None and np.array_equal(source.ids, file.ids):
            of_truth = [begins + row.name for begins in row.baselines if begins in OF_TRUTH]
            columns |= {name: source.columns[name] for name in of_truth if name in source.columns}
    if columns.keys() <= set(kept):
        found, hint = f"no score after {alignment}", again(alignment)
        raise AlignmentError(file.place, found, "one that all methods can be scored after", hint)
    return replace(
        file, alignment=alignment, declared=file.alignment, columns=columns, object_columns={}
    )


def again(alignment: Alignment) -> str:
    """Return how to get all scores after an alignment, for people."""
    return f"score it again with `bench score --align {alignment}`"


def left_out(files: Sequence[ScoreFile], shown: Sequence[str]) -> list[str]:
    """Return which main metrics of files, as scored, `aligned` cannot compare."""
    lost = [n for n in files[0].headline if n not in shown and any(n in f.items for f in files)]
    if not lost or len({file.alignment for file in files}) < 2:
        return []
    advice = again(common_alignment(_declared(files)))
    return [f"not compared: {', '.join(lost)}, because the declared alignments differ; {advice}"]
