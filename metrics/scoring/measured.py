"""Scores of submissions on truth that others measured, one score file for each protocol."""

import numpy as np

from metrics.measured.protocols import BY_NAME, DECLARED, PROTOCOLS, ProtocolError
from metrics.scoring.geometry import scored_alignment
from metrics.scoring.measured_rows import PIXELS, require_suited, suits
from metrics.scoring.metric_names import OF_TRUTH, metric
from metrics.scoring.records import ScoreFile
from metrics.scoring.rooms import require_one_kind, require_scored
from metrics.scoring.rows import score_measured_rows
from metrics.scoring.runs import (
    MeasuredRuns,
    Progress,
    Settings,
    matched_rows,
    meta_of,
    refuse_copies,
)
from metrics.scoring.truth_digests import images_digest
from scenegen.common.names import check_choice


def score_measured(
    runs: MeasuredRuns,
    settings: Settings,
    progress: Progress,
    all_protocols: bool = False,
) -> list[ScoreFile]:
    """Score runs of one method under the protocol of the settings, or under all that suit.

    Raises as `evaluate.score`, and ProtocolError where the protocol does not suit the truth, or
    what the method predicts.
    """
    files, truth = runs.files, runs.truth
    rows = matched_rows(runs, settings.allow_partial)
    require_one_kind(files)
    kind, declared = files[0].kind, files[0].fitted
    if all_protocols:
        protocols = [protocol for protocol in PROTOCOLS if suits(protocol, kind, declared)]
    else:
        name = settings.protocol or DECLARED.name
        check_choice("protocol", name, BY_NAME, ProtocolError)
        protocols = [BY_NAME[name]]
        require_suited(protocols[0], kind, declared)
    names = tuple(protocol.name for protocol in protocols)
    scored = score_measured_rows(files, truth, rows, names, settings, progress)
    require_scored(scored.bad, settings)

    def alike(i: int, j: int) -> bool:
        values = scored.scores.values()
        return all(np.array_equal(x[i], x[j], equal_nan=True) for x in values)

    refuse_copies(files, alike)
    digest = images_digest(truth, scored.digests)
    counts = {"rows_in_truth": len(truth), "rows_penalised": len(scored.bad)}
    meta = meta_of(runs, truth.fingerprint, digest, settings, counts)
    found = []
    for protocol in protocols:
        ours = {
            key.removeprefix(f"{protocol.name} "): values
            for key, values in scored.scores.items()
            if key.startswith(f"{protocol.name} ")
        }
        pixels = ours.pop(PIXELS)[0].astype(np.int64)
        if not pixels.all():  # of all protocols; one alone is refused
            continue
        # A score that some image cannot have, as it shows no normals, is none of this set.
        scores = {
            name: values
            for name, values in ours.items()
            if name.startswith(OF_TRUTH) or metric(name).lacking or not np.isnan(values).any()
        }
        items = {"row": rows, "group": truth.groups[rows], "pixels": pixels, **scores}
        alignment = protocol.alignment or scored_alignment(kind, declared)
        found.append(
            ScoreFile("measured", files[0].method, alignment, items, meta, protocol=protocol.name)
        )
    return found
