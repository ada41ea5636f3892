"""Rooms in 3D: recordings for the viewer Rerun, as `scenegen view` and `bench view` write them.

A recording has a step for each scene, and its timelines are orders of the scenes. The viewer tells
the values of pixels and points under the mouse.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import intrinsics, pixel_directions, transform_points, transform_vectors
from scenegen.common.errors import FileFormatError
from scenegen.common.records import check
from scenegen.common.text_table import markdown, printable
from scenegen.files.new_file import written_beside
from scenegen.rooms.preview import LAYERS, NOTHING, id_colors, normal_bytes, srgb_bytes
from scenegen.rooms.reader import Room, RoomsFile

if TYPE_CHECKING:
    from rerun import Image, RecordingStream
    from rerun.blueprint import Blueprint

Array = NDArray[Any]
SCENE = "scene"  # the timeline of the indices of scenes
MOST_ROWS = 100  # that are recorded unless others are asked for
FARTHEST = 1000.0  # units of length; points beyond are left out
GAP = 1.1  # between true and predicted points, in widths of what the first view shows
FRUSTUM = 0.12  # units of length, from a camera to the picture that it takes
FULL_ERROR = 0.05  # units of length: errors of depth from here on have the full colour
HIDDEN = (150, 150, 150)  # colour of points of hidden surfaces
NO_OBJECT = 65535  # the object id -1 in 16 bits without sign, as ids of pictures have none


@dataclass(frozen=True, eq=False)
class Surfaces:
    """True or predicted points (H, W, 3) of an image, camera frame (y up, looks along -z).

    NaN stands for no point. `normal` are their normals, in the same frame, or None. `hidden` are
    points (N, 3) behind them, from layers.
    """

    points: Array
    normal: Array | None
    hidden: Array | None = None

    @property
    def depth(self) -> Array:
        """Planar depth, (H, W)."""
        return np.asarray(-self.points[..., 2], np.float32)

    @property
    def in_view(self) -> Array:
        """Which points are finite, before the camera and not too far: (H, W) bool."""
        near = np.abs(np.nan_to_num(self.points, nan=np.inf)).max(axis=-1) <= FARTHEST
        return np.asarray(near & (self.depth > 0))


@dataclass(frozen=True, eq=False)
class View:
    """An image with its truth, and what was predicted of it.

    Attributes:
        name: of the view, in its scene.
        row: of the file.
        image: (H, W, 3) uint8, sRGB.
        object_id: (H, W); None where it is not known.
        world_from_camera: (4, 4).
        matrix: pinhole matrix, (3, 3), pixels; the first centre is at (0.5, 0.5).
    """

    name: str
    row: int
    image: Array
    object_id: Array | None
    world_from_camera: Array
    matrix: Array
    truth: Surfaces
    prediction: Surfaces | None = None


@dataclass(frozen=True, eq=False)
class RecordedScene:
    """A scene that is recorded.

    Attributes:
        steps: its places on timelines, by their names.
        objects: names of its objects.
        text: in Markdown.
        absent: names of views that other scenes of the recording may have.
    """

    steps: Mapping[str, int]
    views: Sequence[View]
    objects: Sequence[str]
    text: str
    absent: Sequence[str] = ()


def scene_rows(rooms: RoomsFile, items: Sequence[int] | None = None) -> list[list[int]]:
    """Return the rows of each scene, of the first MOST_ROWS rows or of `items`.

    Raises SpecError for rows that the file does not have.
    """
    rows = range(min(len(rooms), MOST_ROWS)) if items is None else sorted(set(items))
    check(rows[-1] < len(rooms), "items", rows[-1], f"rows from 0 to {len(rooms) - 1}")
    scene_index, scenes = rooms.read("scene_index", slice(None)), dict[int, list[int]]()
    for row in rows:
        scenes.setdefault(int(scene_index[row]), []).append(row)
    return list(scenes.values())


def room_scenes(rooms: RoomsFile, scenes: Iterable[Sequence[int]]) -> Iterator[RecordedScene]:
    """Yield the scenes that these rows show. Raises FileFormatError for damaged rows."""
    for rows in scenes:
        of_scene = [rooms[row] for row in rows]
        scene = of_scene[0].scene
        names = [item.shape for item in scene.objects]
        listed = markdown(printable(", ".join(names) or "none"))
        text = f"# Scene {scene.index}\n\nObjects: {listed}"
        views, steps = [room_view(room) for room in of_scene], {SCENE: scene.index}
        every = {f"view_{k}" for k in range(len(scene.cameras))}
        absent = sorted(every - {view.name for view in views})
        yield RecordedScene(steps, views, names, text, absent)


def room_view(room: Room) -> View:
    """Return a row of a file of rooms.

    Raises FileFormatError for an impossible camera, and SpecError for a panorama.
    """
    pose, fov = room.world_from_camera, room.fov_y_degrees
    check(room.lens.is_flat, f"row {room.index}", "a panorama", "a perspective camera")
    if not (0 < fov < 180 and np.isfinite(pose).all()):
        wrong, expected = f"{fov} degrees or {pose.tolist()}", "a finite pose, 0 to 180 degrees"
        raise FileFormatError(f"row {room.index}: camera", wrong, expected)
    height, width = room.depth.shape
    matrix = intrinsics(height, width, room.lens, pixel_centers="half")
    name, image = f"view_{room.view_index}", srgb_bytes(room.radiance)
    truth = Surfaces(room.points, room.normal)
    if LAYERS in room.truth:
        rays = pixel_directions(height, width, room.lens)
        truth = replace(truth, hidden=hidden_points(rays, room.truth[LAYERS]))
    return View(name, room.index, image, room.object_id, pose, matrix, truth)


def hidden_points(rays: Array, layers: Array) -> Array:
    """Return the points (N, 3) of the second and further layers (H, W, L) of rays (H, W, 3)."""
    row, column, layer = np.nonzero(np.isfinite(layers[..., 1:]))
    return np.asarray(rays[row, column] * layers[row, column, layer + 1, None])


def write_recording(
    path: str | Path, title: str, scenes: Iterable[RecordedScene], overwrite: bool = False
) -> int:
    """Write a recording, complete or not at all; return how many images it has.

    The viewer begins with the first timeline. Recordings of the same scenes differ in bytes,
    because Rerun numbers what it records at random.

    Raises OSError as `written_beside`.
    """
    import rerun as rr

    panels, timeline, count = dict[str, list[str]](), SCENE, 0
    first: View | None = None
    with written_beside(path, overwrite) as temporary:
        recording = rr.RecordingStream("pix2shape-bench", send_properties=False)
        try:
            recording.save(temporary)
            recording.send_recording_name(printable(title))
            recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
            for scene in scenes:
                _start_scene(recording, scene)
                timeline = next(iter(scene.steps))
                panels |= {view.name: _record_view(recording, view) for view in scene.views}
                first, count = first or scene.views[0], count + len(scene.views)
            if first is not None:
                recording.send_blueprint(_layout(panels, timeline, first))
        finally:
            recording.disconnect()
    return count


def _start_scene(recording: "RecordingStream", scene: RecordedScene) -> None:
    """Go to the steps of a scene, and record all but its views.

    What it records takes the place of what is there. Views that it lacks are cleared by name: where
    all is cleared first, the viewer shows no cameras.
    """
    import rerun as rr

    for timeline, step in scene.steps.items():
        recording.set_time(timeline, sequence=step)
    for name in scene.absent:
        for place in ("pixels", "world/cameras", "world/truth", "world/prediction"):
            recording.log(f"{place}/{name}", rr.Clear(recursive=True))
    recording.log("about", rr.TextDocument(scene.text, media_type="text/markdown"))
    recording.log("world/prediction", rr.Transform3D(translation=_beside(scene.views[0])))
    ids = np.arange(len(scene.objects) + 1)
    labels = ["the room", *map(printable, scene.objects)]
    classes = list(zip(ids.tolist(), labels, id_colors(ids).tolist(), strict=True))
    recording.log("pixels", rr.AnnotationContext([*classes, (NO_OBJECT, "nothing", NOTHING)]))


def _record_view(recording: "RecordingStream", view: View) -> list[str]:
    """Record a camera with its picture, points and pictures; return the names of the pictures."""
    import rerun as rr

    height, width = view.image.shape[:2]
    camera, pose = f"world/cameras/{view.name}", view.world_from_camera
    recording.log(camera, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
    pinhole = rr.Pinhole(
        image_from_camera=view.matrix, width=width, height=height,
        camera_xyz=rr.ViewCoordinates.RUB, image_plane_distance=FRUSTUM,
    )  # fmt: skip
    recording.log(camera, pinhole)
    pictures: dict[str, Any] = {"image": rr.Image(view.image)}
    recording.log(f"{camera}/image", pictures["image"])
    sides = {"truth": (view.truth, view.image)}
    if view.object_id is not None:
        pictures["object_id"] = rr.SegmentationImage(view.object_id.astype(np.uint16))
    if view.prediction is not None:
        error = error_colors(view.prediction.depth - view.truth.depth)
        pictures["depth_error"] = rr.Image(error)
        sides["prediction"] = view.prediction, error
    for side, (surfaces, colors) in sides.items():
        pictures[f"{side}_depth"] = rr.DepthImage(surfaces.depth, meter=1.0)
        if surfaces.normal is not None:
            pictures[f"{side}_normal"] = _normal_picture(surfaces.normal, pose)
        seen = surfaces.in_view
        points = transform_points(pose, surfaces.points[seen])
        radii = surfaces.depth[seen] / view.matrix[1, 1]  # a point is as wide as two pixels
        cloud = rr.Points3D(points, colors=colors[seen], radii=radii)
        recording.log(f"world/{side}/{view.name}", cloud)
        if surfaces.hidden is not None:
            behind = transform_points(pose, surfaces.hidden)
            wide = -surfaces.hidden[:, 2] / view.matrix[1, 1] / 2
            cloud = rr.Points3D(behind, colors=HIDDEN, radii=wide)
            recording.log(f"world/{side}/{view.name}/hidden", cloud)
    for name, picture in pictures.items():
        recording.log(f"pixels/{view.name}/{name}", picture)
    return list(pictures)


def _beside(view: View) -> Array:
    """Return by how much predictions are moved to the right of a view, to be beside the truth."""
    across = np.ptp([0.0, *view.truth.points[view.truth.in_view][:, 0]])
    return np.asarray(GAP * across * view.world_from_camera[:3, 0])


def _normal_picture(normal: Array, pose: Array) -> "Image":
    """Return normals in the world frame, so that a surface has one colour in all views."""
    from rerun import Image

    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    unit = np.nan_to_num(normal / np.where(length > 0, length, 1.0))
    return Image(normal_bytes(transform_vectors(pose, unit)))


def error_colors(error: Array) -> Array:
    """Return colours of errors of depth: blue is too near, red too far, black not known (NaN)."""
    from matplotlib import colormaps

    colors = colormaps["coolwarm"](0.5 + 0.5 * np.clip(error / FULL_ERROR, -1, 1), bytes=True)
    return np.asarray(colors[..., :3])


def _layout(panels: Mapping[str, Sequence[str]], timeline: str, first: View) -> "Blueprint":
    """Return what the viewer shows where: 3D, the pictures of each view, and the text.

    The eye is behind the camera of the first view, and sees a prediction beside the truth.
    """
    import rerun.blueprint as rrb

    place, back = first.world_from_camera[:3, 3], first.world_from_camera[:3, 2]
    distance = float(np.median([1.0, *first.truth.depth[first.truth.in_view]]))
    aside = 0.5 * _beside(first) if first.prediction is not None else np.zeros(3)
    eye = rrb.EyeControls3D(
        position=place + aside + distance * back,
        look_target=place + aside - distance * back,
        eye_up=(0.0, 1.0, 0.0),
    )
    tabs = [
        rrb.Grid(*(rrb.Spatial2DView(origin=f"pixels/{v}/{p}", name=p) for p in pictures), name=v)
        for v, pictures in sorted(panels.items(), key=lambda panel: (len(panel[0]), panel[0]))
    ]
    about = rrb.TextDocumentView(origin="about")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(origin="world", name="points and cameras", eye_controls=eye),
            rrb.Vertical(rrb.Tabs(*tabs), about, row_shares=[3, 1]),
        ),
        rrb.TimePanel(timeline=timeline, state="collapsed", play_state="paused"),
        collapse_panels=True,
        auto_views=False,
    )
