"""Where the lights of a scene are, and their colours."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.random.seeding import Purpose, item_numbers
from scenegen.description.specs import DatasetSpec
from scenegen.sampling.octant import octant_points

Array = NDArray[Any]


def sample_lights(spec: DatasetSpec, index: Array) -> tuple[Array, Array, Array]:
    """Draw the lights of items `index`, (N,): their number, positions and colours L_j.

    Positions are uniform by area on the octant. Each light has a random hue. Together the lights
    give a white surface at the target that faces them all the radiance `light_level`, each an
    equal part, measured in the light's largest channel.

    Returns: (N,) int32, and (N, L, 3) twice, with zeros in unused slots.
    """
    slots, distance = spec.light_slots, spec.light_radius
    numbers = item_numbers(spec.seed, index, Purpose.LIGHTS, count=1 + 5 * slots)
    fewest, most = spec.lights
    count = (fewest + np.floor(numbers[:, 0] * (most - fewest + 1))).astype(np.int32)
    height, turn, *channels = np.moveaxis(numbers[:, 1:].reshape(-1, slots, 5), -1, 0)
    used = (np.arange(slots) < count[:, None])[..., None]
    position = octant_points(spec.camera_target, distance, height, turn / 4)
    falloff = spec.attenuation[0] * distance + spec.attenuation[1] * (distance * distance)
    color = 1.0 - spec.light_saturation * np.stack(channels, axis=-1)
    level = spec.light_level * falloff / np.maximum(count, 1)
    color *= level[:, None, None] / color.max(axis=-1, keepdims=True)
    return count, np.where(used, position, 0.0), np.where(used, color, 0.0)
