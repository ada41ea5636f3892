"""Images of single basic shapes, rendered by scenegen: what the method can learn, and what not.

The Pix2Shape paper's appendix "Implementation of Rezende et al." says that the method worked for
one centred object without background, and failed for objects that are not centred or too complex,
and before a background. Each set here is one of these cases.
"""

import hashlib
import math
from dataclasses import dataclass

import numpy as np

from baselines.rezende.images import Pictures
from baselines.rezende.rasteriser import Views
from baselines.training.images import Array, channels_first
from scenegen.camera import Camera
from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import Vector3
from scenegen.description.scenes import Light, PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.ground_truth import decode_image
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render
from scenegen.sampling.scenes import sample_scene

SIMPLE = ("box", "sphere", "cone", "cylinder", "pyramid", "capsule")
COMPLEX = ("torus", "teapot")
FINER = 3  # images are rendered so many times larger, then reduced; odd: a pixel has a centre
BATCH = 64  # images rendered at a time
FOV_DEGREES, LIGHT_LEVEL, AMBIENT = 28.0, 0.75, 0.25  # as in question files
DISTANCE = 1.02 / math.sin(math.radians(FOV_DEGREES) / 2)  # frames the unit sphere


@dataclass(frozen=True)
class PrimitiveSet:
    """One case: which shapes, how large (bounding radius), how far from the centre, in a room?

    Lengths are in bounding radii of a centred object, but of a room in its own unit.
    """

    shapes: tuple[str, ...] = SIMPLE
    radius: float = 1.0
    offset: float = 0.0
    room: bool = False


PRIMITIVE_SETS = {
    "centred": PrimitiveSet(),
    "off-centre": PrimitiveSet(radius=0.5, offset=0.7),
    "complex": PrimitiveSet(shapes=COMPLEX),
    "background": PrimitiveSet(room=True),
}


def render_primitives(name: str, count: int, size: int, seed: int = 0, first: int = 0) -> Pictures:
    """Render images first .. first + count - 1 of a set, `size` x `size`, with true depth.

    Every shape is turned uniformly on SO(3); one light is within 60 degrees of the camera, as in
    question files. In a set with a room, rooms are those of scenegen's presets with one object.

    Raises SpecError for an unknown set.
    """
    check_choice("set of primitives", name, PRIMITIVE_SETS)
    case = PRIMITIVE_SETS[name]
    large = FINER * size
    spec = DatasetSpec(
        seed=seed, height=large, width=large, objects=(1, 1), shapes=case.shapes, lights=(1, 1),
        light_saturation=0.0, pose="any", image_dtype="float32",
    )  # fmt: skip
    rows = range(first, first + count)
    scenes = [_room(spec, i) if case.room else _alone(case, spec, i) for i in rows]
    images, depths = [], []
    for start in range(0, count, BATCH):
        truth = render(pack(spec, scenes[start : start + BATCH]))
        images += [channels_first(decode_image(image), size) for image in truth.image.clip(0, 1)]
        depth = np.where(truth.object_id > 0, truth.depth, np.inf)
        depths.append(depth[:, FINER // 2 :: FINER, FINER // 2 :: FINER])
    return Pictures(
        np.stack(images),
        spec.object_radius[1] if case.room else 0.6,
        _views(scenes, size),
        hashlib.sha256("\n".join(scene.to_json() for scene in scenes).encode()).hexdigest(),
        np.concatenate(depths),
    )


def _alone(case: PrimitiveSet, spec: DatasetSpec, index: int) -> SceneSpec:
    """Return a shape before a white background, seen by a camera on +z."""
    rng = item_rng(spec.seed, index, Purpose.POSES)
    turn = rng.standard_normal(4)
    w, x, y, z = (turn / np.linalg.norm(turn)).tolist()
    angle = rng.uniform(0, 2 * math.pi)
    place = (case.offset * math.cos(angle), case.offset * math.sin(angle), 0.0)
    cosine, around = rng.uniform(0.5, 1.0), rng.uniform(0, 2 * math.pi)  # uniform on the cap
    sine, far = math.sqrt(1 - cosine**2), 2 * DISTANCE
    light = (far * sine * math.cos(around), far * sine * math.sin(around), far * cosine)
    shape = case.shapes[int(rng.integers(len(case.shapes)))]
    white = LIGHT_LEVEL * far**2
    return SceneSpec(
        index=index,
        cameras=(Camera((0.0, 0.0, DISTANCE), (0.0, 0.0, 0.0), FOV_DEGREES),),
        objects=(PlacedObject(shape, place, (w, x, y, z), case.radius, spec.reflectance),),
        lights=(Light(light, (white, white, white)),),
        ambient=(AMBIENT, AMBIENT, AMBIENT),
        attenuation=(0.0, 1.0),
        room_reflectance=None,
        background=(1.0, 1.0, 1.0),
    )


def _room(spec: DatasetSpec, index: int) -> SceneSpec:
    """Return a room with one shape, of the first attempt at which it finds a place."""
    attempts = (sample_scene(spec, index, attempt) for attempt in range(100))
    scene = next((scene for scene in attempts if scene is not None), None)
    if scene is None:
        raise SpecError(f"room {index}", "no place for its object", "one within 100 attempts")
    return scene


def _views(scenes: list[SceneSpec], size: int) -> Views:
    """Return cameras and lights in the frame of the rasteriser: the camera's axes, its target."""
    first = scenes[0]
    camera = first.cameras[0]

    def seen(scene: SceneSpec, point: Vector3) -> Array:
        view = scene.cameras[0]
        return np.subtract(point, view.target) @ view.world_from_camera[:3, :3]

    return Views(
        size=size,
        fov_y_degrees=camera.fov_y_degrees,
        distance=math.dist(camera.position, camera.target),
        reflectance=np.array(first.objects[0].reflectance),
        ambient=np.array(first.ambient),
        background=np.array(first.background if first.room_reflectance is None else (0.5,) * 3),
        attenuation=first.attenuation,
        light_position=np.array([[seen(s, light.position) for light in s.lights] for s in scenes]),
        light_color=np.array([[light.color for light in s.lights] for s in scenes]),
    )
