"""Proofs about furnished rooms, from the scenes that files tell; no code of the generator.

A scene is compared by where each object is in the frame of the first one, so the motion of a camera
or of a whole room makes no difference.
"""

import itertools
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iqtt.audit.proofs.verdict import Proof, judge
from iqtt.audit.table import AuditTable
from iqtt.perspective.columns import RoomTruth
from iqtt.perspective.specs import PerspectiveSpec
from iqtt.questions.kinds import question_kind
from scenegen.common.errors import BackendError, SceneGenError
from scenegen.description.scenes import PlacedObject, SceneSpec
from scenegen.objects.meshes.listing import object_split
from scenegen.rendering.amodal import whole_pixels
from scenegen.rendering.packing import pack
from scenegen.rendering.pictures.development import redeveloped
from scenegen.rendering.renderer import launch_fields, trace

Array = NDArray[Any]
SAME = 1e-6  # metres, or elements of rotations, within which poses are equal
ON_FLOOR, ON_TOP = 0.5, 0.2  # metres between places of a moved object
LEAST_TURN = 60.0  # degrees between directions of a turned object
SHOWN, SHARE, CHANGED = 0.005, 0.5, 0.005  # of an image's pixels; of an object's; of an image's
TRACED = 16  # questions whose images are traced again
NEAR, MOST_OFF = 8, 0.01  # difference of a value of 255, and the share that may differ by more


@dataclass(frozen=True, eq=False)
class Question:
    """What a row tells; `truth` is None where it is no description of rooms."""

    truth: RoomTruth | None
    answer: int | None
    kinds: list[int]

    @cached_property
    def right(self) -> int | None:
        """The answer, or else what the answer key says."""
        told = self.kinds.index(-1) if self.kinds.count(-1) == 1 else None
        return told if self.answer is None else self.answer


def read_questions(table: AuditTable) -> list[Question]:
    """Return all rows of a table of rooms."""
    found = []
    for row in range(len(table)):
        try:
            truth = table.questions.truth(row)
        except SceneGenError:
            truth = None
        answer = None if table.answers is None else int(table.answers[row])
        kinds = table.truth["distractor_kind"][row].tolist()
        found.append(Question(truth if isinstance(truth, RoomTruth) else None, answer, kinds))
    return found


def prove_rooms(tables: Sequence[AuditTable], sample: Sequence[Array]) -> list[Proof]:
    """Run all proofs.

    Args:
        sample: for each table the rows whose scenes are rendered again.
    """
    questions = [read_questions(table) for table in tables]
    specs = [table.spec for table in tables]

    def each(name: str, rule: str, test: Callable[[PerspectiveSpec, Question], str]) -> Proof:
        """Judge a test, which returns what is wrong with a question, empty for nothing."""
        found: list[list[str]] = []
        for spec, rows in zip(specs, questions, strict=True):
            assert isinstance(spec, PerspectiveSpec)
            found.append([test(spec, row) if row.truth else "no scenes" for row in rows])
        wrong = [[bool(text) for text in texts] for texts in found]
        return judge(name, rule, tables, wrong, lambda t, row: found[t][row])

    proofs = [
        each("rooms", "scenes of one room, light and set of objects, as specified", _same_room),
        each(
            "one correct option",
            "the reference's arrangement in one option, that of the answer key",
            _one_right,
        ),
        each("labels", "answers differ only as their kind says", _labels),
        each("views", "cameras look at one place, as many degrees apart as stored", _views),
        _apart(tables, questions),
    ]
    looked = [[(table, row, questions[t][row]) for row in sample[t].tolist()]
              for t, table in enumerate(tables)]  # fmt: skip
    cast = {
        (t, row): _cast_again(table, q) for t, rows in enumerate(looked) for table, row, q in rows
    }
    proofs.append(_sampled(tables, "visibility", _VISIBLE, cast))
    pairs = list(cast)
    some = {pairs[i] for i in np.linspace(0, len(pairs) - 1, min(TRACED, len(pairs))).astype(int)}
    try:
        traced = {
            (t, row): _traced_again(tables[t], row, questions[t][row]) for t, row in sorted(some)
        }
    except BackendError as error:
        return [*proofs, Proof("traced again", "skipped", f"cannot be rendered here: {error}")]
    return [*proofs, _sampled(tables, "traced again", "images show their scenes", traced)]


_VISIBLE = (
    f"objects in play show {SHOWN:.1%} of the pixels and half of themselves; answers differ in"
    f" {CHANGED:.1%}; numbers are those of the scenes"
)


def _sampled(
    tables: Sequence[AuditTable], name: str, rule: str, found: dict[tuple[int, int], str]
) -> Proof:
    wrong = [np.zeros(len(table), bool) for table in tables]
    for (t, row), text in found.items():
        wrong[t][row] = bool(text)
    return judge(name, rule, tables, wrong, lambda t, row: found[t, row], len(found))


def _poses(scene: SceneSpec) -> Array:
    """Return rotation and place of each object, and those of the room, (N + 1, 3, 4)."""
    poses = [np.c_[_rotation(item), item.position] for item in scene.objects]
    return np.array([*poses, np.c_[np.eye(3), np.zeros(3)]])


def _rotation(item: PlacedObject) -> Array:
    return np.asarray(Rotation.from_quat(item.rotation, scalar_first=True).as_matrix())


def same_arrangement(a: SceneSpec, b: SceneSpec) -> bool:
    """Return whether a motion takes all objects and the room of one scene to those of another."""
    if [x.shape for x in a.objects] != [x.shape for x in b.objects] or _shell(a) != _shell(b):
        return False
    frames = []
    for poses in (_poses(a), _poses(b)):
        turn, place = poses[0, :, :3], poses[0, :, 3]
        moved = np.einsum("ji,njk->nik", turn, poses[:, :, :3])
        frames.append(np.concatenate([moved, ((poses[:, :, 3] - place) @ turn)[..., None]], 2))
    return bool(np.abs(frames[0] - frames[1]).max() <= SAME)


def _shell(scene: SceneSpec) -> Any:
    """Return what a room is without its objects."""
    inside = scene.interior
    return inside and (inside.size, inside.openings, inside.hour, inside.facing_degrees, inside.lit)


def _same_room(spec: PerspectiveSpec, q: Question) -> str:
    assert q.truth
    scenes, allowed = q.truth.scenes, spec.interior()
    names = {tuple((x.shape, x.scale, x.mesh) for x in scene.objects) for scene in scenes}
    inside = [s.interior for s in scenes if s.interior]
    lights = {(one.size, one.hour, one.lit) for one in inside}
    if len(scenes) != 1 + spec.answers or len(names) != 1 or len(lights) != 1:
        return "scenes of other rooms or objects"
    if any(len(s.cameras) != 1 or s.interior is None or s.index != scenes[0].index for s in scenes):
        return "scenes without one camera in a closed room"
    models, split = [name for name, _, _ in names.pop()], spec.object_split
    if not spec.objects[0] <= len(models) <= spec.objects[1]:
        return f"{len(models)} objects"
    other = [m for m in models if split not in ("all", object_split(m))]
    unknown = [m for m in models if m.partition("/")[0] not in allowed.shapes]
    return f"objects of another split or class: {other or unknown}" if other or unknown else ""


def _one_right(_spec: PerspectiveSpec, q: Question) -> str:
    assert q.truth
    reference, *options = q.truth.scenes
    same = [k for k, scene in enumerate(options) if same_arrangement(reference, scene)]
    if same != [q.right] or q.kinds.index(-1) != q.right:
        return f"the reference's arrangement in {same or 'none'}, answer {q.right}, kinds {q.kinds}"
    twice = [p for p in itertools.combinations(options, 2) if same_arrangement(*p)]
    return "two answers show one arrangement" if twice else ""


def _labels(_spec: PerspectiveSpec, q: Question) -> str:
    assert q.truth
    options, kind = q.truth.scenes[1:], question_kind(q.kinds)
    number, count = q.truth.in_play - 1, len(options[0].objects)
    if not 0 <= number < count:
        return f"object in play {q.truth.in_play} of {count}"
    poses = np.stack([_poses(scene) for scene in options])
    assert options[0].interior
    rides = with_carried(options[0].interior.stands_on, q.truth.in_play)
    rest = [n for n in range(count + 1) if n + 1 not in rides]
    if np.ptp(poses[:, rest], axis=0).max() > SAME or len({_shell(s) for s in options}) > 1:
        return "what is not in play differs"
    below = {s.interior.stands_on[number] for s in options if s.interior}
    floor = all(on == 0 or options[0].objects[on - 1].name == "rug" for on in below)
    test, least = _IN_PLAY.get(kind), ON_FLOOR if floor else ON_TOP
    return test(poses[:, number], least) if test else f"kind {kind}"


def with_carried(stands_on: Sequence[int], number: int) -> set[int]:
    """Return an object and what stands on it, which has larger numbers."""
    found = {number}
    for n, on in enumerate(stands_on, start=1):
        if on in found:
            found.add(n)
    return found


def _moved(poses: Array, least: float) -> str:
    places = poses[:, [0, 2], 3]
    near = min(math.dist(a, b) for a, b in itertools.combinations(places, 2))
    if np.ptp(poses[..., :3], axis=0).max() > SAME:
        return "the object turned, too"
    return f"places {near:.3f} m apart" if near < least - SAME else ""


def _turned(poses: Array, _least: float) -> str:
    if np.ptp(poses[:, [0, 2], 3], axis=0).max() > SAME:
        return "an object that is moved, too"
    fronts = poses[..., 2]
    cosines = [a @ b for a, b in itertools.combinations(fronts, 2)]
    angle = math.degrees(math.acos(min(1.0, max(cosines))))
    return "" if angle >= LEAST_TURN - 1e-3 else f"directions {angle:.1f} degrees apart"


_IN_PLAY = {"moved": _moved, "turned": _turned}


def _views(spec: PerspectiveSpec, q: Question) -> str:
    assert q.truth
    reference, *options = [scene.cameras[0] for scene in q.truth.scenes]
    if q.right is None or len({camera.fov_y_degrees for camera in (reference, *options)}) > 1:
        return "more than one field of view"
    seen = options[q.right]
    a, b = (np.subtract(c.position, c.target) for c in (reference, seen))
    if math.dist(reference.target, seen.target) > SAME or abs(a[1] - b[1]) > SAME:
        return "cameras look at two places, or from two heights"
    cosine = a[[0, 2]] @ b[[0, 2]] / (np.linalg.norm(a[[0, 2]]) * np.linalg.norm(b[[0, 2]]))
    angle, told = math.degrees(math.acos(np.clip(cosine, -1, 1))), q.truth.angle_degrees
    if abs(angle - told) > 1e-3 or not spec.angle[0] <= told <= spec.angle[1]:
        return f"{angle:.3f} degrees, told {told:.3f}"
    apart = max(math.dist(seen.position, camera.position) for camera in options)
    return "answers are seen from two places" if apart > SAME else ""


def _apart(tables: Sequence[AuditTable], questions: Sequence[Sequence[Question]]) -> Proof:
    """Prove that no room is in two questions, and so in no two splits."""
    seen: dict[str, tuple[int, int]] = {}
    wrong, found = [np.zeros(len(table), bool) for table in tables], {}
    for t, rows in enumerate(questions):
        for row, q in enumerate(rows):
            inside = q.truth.scenes[0].interior if q.truth else None
            if inside is None:
                continue
            spans = sorted((h.kind, h.right - h.left, h.bottom, h.top) for h in inside.openings)
            key = json.dumps([inside.size, inside.hour, inside.lit, spans])
            if key in seen:
                wrong[t][row] = True
                other = seen[key]
                found[t, row] = f"the room of {tables[other[0]].name} row {other[1]}"
            seen.setdefault(key, (t, row))
    rule = "no room in two questions, nor in two splits"
    return judge("rooms apart", rule, tables, wrong, lambda t, row: found[t, row])


def _cast_again(table: AuditTable, q: Question) -> str:
    """Return what is wrong with the pixels that objects in play show, by rays cast again."""
    spec = table.spec
    assert isinstance(spec, PerspectiveSpec)
    if q.truth is None:
        return "no scenes"
    batch = pack(spec.interior(), q.truth.scenes)
    ids = launch_fields(batch, ["object_id"])()["object_id"]
    for a, b in itertools.combinations(ids[1:], 2):
        if (a != b).mean() < CHANGED:
            return f"answers differ in {(a != b).mean():.3%} of the pixels"
    number = q.truth.in_play
    if not 0 < number <= spec.objects[1]:
        return "no object in play"
    shown = np.count_nonzero(ids == number, axis=(1, 2))
    whole = whole_pixels(batch, np.arange(len(ids)), np.full(len(ids), number - 1))
    for name, mine, stored in (
        ("visible", shown, q.truth.visible_pixels), ("whole", whole, q.truth.whole_pixels)
    ):  # fmt: skip
        if np.abs(mine - stored).max() > 0.01 * ids[0].size * SHOWN + 1:
            return f"{name} pixels {mine.tolist()}, told {stored.tolist()}"
    if (shown < SHOWN * ids[0].size).any() or (shown < SHARE * whole).any():
        return (
            f"an object in play shows {shown.min()} pixels, of itself {(shown / whole).min():.2f}"
        )
    return ""


def _traced_again(table: AuditTable, row: int, q: Question) -> str:
    """Return which images do not show their scenes, as path tracing finds. Raises BackendError."""
    spec = table.spec
    assert isinstance(spec, PerspectiveSpec)
    if q.truth is None:
        return "no scenes"
    stored = table.questions.read("questions", row)
    how = replace(spec.interior(), image_dtype="float32", seed=q.truth.picture_seed)
    wrong = []
    for i, scene in enumerate(q.truth.scenes):  # apart, as images of one item share their surfaces
        batch = replace(pack(how, [scene]), view=np.array([min(i, 1)], np.int32))
        image = trace(batch, ["image"])["image"][0].astype(np.float64)
        off = np.abs(image - stored[i]) > 0.05 * np.maximum(image, 0.1)
        if spec.image_dtype == "uint8":
            image = 255 * redeveloped(image, q.truth.exposure[i])
            off = np.abs(image - stored[i]) > NEAR
        if off.mean() > MOST_OFF:
            wrong.append(f"image {i} differs in {off.mean():.0%} of its values")
    return "; ".join(wrong)
