"""Where the lights of a scene are, and their colours."""

from scenegen.common.seeding import Purpose, item_rng
from scenegen.description.scenes import Light
from scenegen.description.specs import DatasetSpec
from scenegen.sampling.octant import around, octant_direction


def sample_lights(spec: DatasetSpec, index: int) -> tuple[Light, ...]:
    """Draw the lights of item `index`: their number, positions and colours L_j.

    Positions are uniform by area on the octant. Each light has a random hue. Together the lights
    give a white surface at the target that faces them all the radiance `light_level`, each an
    equal part, measured in the light's largest channel.
    """
    rng = item_rng(spec.seed, index, Purpose.LIGHTS)
    count = int(rng.integers(spec.lights[0], spec.lights[1] + 1))
    distance = spec.light_radius
    falloff = spec.attenuation[0] * distance + spec.attenuation[1] * distance**2
    lights = []
    for _ in range(count):
        position = around(spec.camera_target, distance, octant_direction(rng))
        color = rng.uniform(1.0 - spec.light_saturation, 1.0, 3)
        red, green, blue = (color * (spec.light_level * falloff / count / color.max())).tolist()
        lights.append(Light(position, (red, green, blue)))
    return tuple(lights)
