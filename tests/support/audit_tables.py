"""Tables of questions as the audit reads them, made from cubes and views without any file."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from iqtt.audit.audit import audit
from iqtt.audit.proofs.shapes import Shapes, compare_shapes
from iqtt.audit.table import AuditTable, lacking, open_paths
from iqtt.questions.specs import SplitSpec


def audited(paths: Any, **how: Any) -> Any:
    """Return the audit of files and folders."""
    with open_paths(paths) as opened:
        return audit(opened, lacking=lacking(paths), **how)


def audit_table(
    cubes: Any,
    kinds: Any,
    views: Any = None,
    spec: SplitSpec | None = SplitSpec(),
    split: str = "test",
) -> tuple[AuditTable, Shapes]:
    """Return a table of questions without images, and what its cubes say.

    Args:
        cubes: (Q, 1 + K, n, 3).
        kinds: `distractor_kind` of the answers, (Q, K).
        views: world_from_shape, (Q, 1 + K, 3, 3); the identity by default.
    """
    cubes = np.asarray(cubes, np.int8)
    count, images = cubes.shape[:2]
    distance = (spec or SplitSpec()).camera_distance
    truth = {
        "cubes": cubes,
        "distractor_kind": np.asarray(kinds),
        "world_from_shape": np.tile(np.eye(3), (count, images, 1, 1)) if views is None else views,
        "camera_distance": np.full(count, distance),
    }
    none = np.zeros((count, images))
    table = AuditTable(
        name=split,
        questions=SimpleNamespace(spec=spec, split=split, answers=images - 1),
        answers=None,
        truth=truth,
        contents={},
        truth_changed=False,
        background=np.full(3, 255),
        measured=np.zeros(0, np.int64),
        digests=none,
        silhouette=none,
        on_border=none,
        unfit=none,
        statistics=none,
    )
    return table, compare_shapes([table])[0]
