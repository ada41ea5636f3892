"""What a recording of Rerun holds, read back by Rerun."""

import numpy as np
from rerun.chunk import RrdReader


def recorded(path, timeline):
    """Return the values of the components of each entity by the step of a timeline.

    `recorded(...)["/pixels/view_0/depth"][3]["DepthImage:buffer"]` are bytes. A step of a cleared
    entity has none.
    """
    steps = {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        if timeline in batch.schema.names:
            times = batch.column(timeline).to_pylist()
            for i, time in enumerate(times):
                values = {n: batch.column(n)[i].as_py() for n in batch.schema.names if ":" in n}
                steps.setdefault(chunk.entity_path, {}).setdefault(time, {}).update(values)
    return steps


def points_of(values):
    """Return the points, (N, 3), and their colours, (N, 4) uint8, of a step of a cloud."""
    packed = np.array(values["Points3D:colors"], np.uint32)
    colors = np.stack([packed >> shift & 255 for shift in (24, 16, 8, 0)], axis=-1)
    return np.array(values["Points3D:positions"]), colors


def pixels_of(values, kind, dtype, shape):
    """Return the pixels of a step of a picture of this kind, such as DepthImage."""
    return np.array(values[f"{kind}:buffer"][0], np.uint8).view(dtype).reshape(shape)
