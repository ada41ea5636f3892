"""Questions -> views that show every cube -> images -> the files of a split."""

import hashlib
import os
import shutil
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from iqtt.layout import (
    question_columns,
    root_attributes,
    truth_attributes,
    truth_columns,
    truth_row,
)
from iqtt.polycube import symmetries
from iqtt.questions import (
    Drawn,
    Pools,
    Shapes,
    answer_positions,
    arrange,
    draw_lights,
    draw_rotation,
    draw_shapes,
    make_pools,
    question_key,
    rotation_angle_degrees,
)
from iqtt.specs import SplitSpec
from iqtt.views import Question, View, pack_views
from scenegen.backend import select_variant
from scenegen.errors import PlacementError
from scenegen.new_file import check_writable
from scenegen.renderer import launch, render
from scenegen.row_file import Table, new_file
from scenegen.seeding import Purpose, item_rng
from scenegen.truth import GroundTruth, visible_pixels

Array = NDArray[Any]
DEFAULT_BATCH = 64  # questions in one wavefront
SHRINK = 4  # of the images that visibility is first judged by
MARGIN = 1.25  # pixels asked for in them, so that the full image seldom falls short
PROPOSED = 3  # views of one image judged at once, at least
PROPOSALS_AT_ONCE = 128  # views judged at once, about
VIEW_ATTEMPTS = 60  # views of one image, before the question gets other shapes
QUESTION_ATTEMPTS = 50  # shapes of one question
TURNS = 200  # rotations drawn until one is far enough from the reference's


@dataclass
class Tally:
    """How many views were proposed, and how many refused for hiding a cube."""

    proposed: int = 0
    refused: int = 0


@dataclass(eq=False)
class _Draft:
    index: int
    attempt: int
    shapes: Shapes
    symmetries: Array
    views: dict[int, View] = field(default_factory=dict)


def settle(
    spec: SplitSpec,
    pools: Pools,
    split: str,
    requests: Sequence[tuple[int, int, int]],
    tally: Tally,
    device: str = "auto",
) -> list[Question]:
    """Find shapes and views of questions; each depends on itself alone.

    Args:
        requests: (index, place of the right answer, attempt to begin with).

    Raises PlacementError where the bounded search finds none.
    """
    done: dict[int, Question] = {}
    waiting = list(requests)
    while waiting:
        drawn = draw_shapes(spec, pools, split, [(i, attempt) for i, _, attempt in waiting])
        drafts = _drafts(spec, split, waiting, drawn)
        _find_views(spec, split, drafts, (0,), tally, device)
        seen = [draft for draft in drafts if draft.views]
        _find_views(spec, split, seen, (1, 2, 3), tally, device)
        again = []
        for (index, place, attempt), draft in zip(waiting, drafts, strict=True):
            if len(draft.views) == 4:
                done[index] = _question(spec, split, draft)
            elif attempt + 1 < QUESTION_ATTEMPTS:
                again.append((index, place, attempt + 1))
            else:
                raise PlacementError(
                    f"{split} question {index}: no view of {QUESTION_ATTEMPTS} choices of shapes"
                    f" shows {spec.min_cube_pixels} pixels of every cube; try a smaller"
                    f" --min-cube-pixels, or fewer --cubes"
                )
        waiting = again
    return [done[index] for index, _, _ in requests]


def _drafts(
    spec: SplitSpec, split: str, requests: Sequence[tuple[int, int, int]], drawn: Sequence[Drawn]
) -> list[_Draft]:
    """Put the answers in order, and find the shapes' symmetries, all of one size at once."""
    drafts: list[_Draft] = []
    by_size: dict[int, list[int]] = {}
    for i, ((index, place, attempt), one) in enumerate(zip(requests, drawn, strict=True)):
        rng = item_rng(spec.seed or 0, question_key(split, index), Purpose.ANSWERS, attempt)
        drafts.append(_Draft(index, attempt, arrange(one, place, rng), np.empty(0)))
        by_size.setdefault(one[0].shape[1], []).append(i)
    for rows in by_size.values():
        found = symmetries(np.concatenate([drafts[i].shapes.cubes for i in rows]))
        for i, four in zip(rows, found.reshape(len(rows), 4, -1), strict=True):
            drafts[i].symmetries = four
    return drafts


def _find_views(
    spec: SplitSpec,
    split: str,
    drafts: Sequence[_Draft],
    slots: tuple[int, ...],
    tally: Tally,
    device: str,
) -> None:
    """Propose views of these images until a small rendering shows every cube of each."""
    small = spec.render_spec(SHRINK)
    scale = (small.height * small.width) / (spec.height * spec.width)
    enough = np.ceil(MARGIN * spec.min_cube_pixels * scale)
    tried = 0
    while tried < VIEW_ATTEMPTS:
        missing = [(d, s) for d in drafts for s in slots if s not in d.views]
        if not missing:
            return
        # The first view that will do is taken, so how many are judged at once changes nothing.
        number = min(VIEW_ATTEMPTS - tried, max(PROPOSED, PROPOSALS_AT_ONCE // len(missing)))
        proposals = [
            (draft, slot, _propose_view(spec, split, draft, slot, tried + k))
            for draft, slot in missing
            for k in range(number)
        ]
        tried += number
        batch = pack_views(spec, small, [view for _, _, view in proposals])
        shown = visible_pixels(render(batch, device).object_id, small.object_slots)
        for (draft, slot, view), pixels in zip(proposals, shown, strict=True):
            if slot in draft.views:
                continue
            tally.proposed += 1
            if (pixels[: len(view.cubes)] >= enough).all():
                draft.views[slot] = view
            else:
                tally.refused += 1


def _propose_view(spec: SplitSpec, split: str, draft: _Draft, slot: int, attempt: int) -> View:
    key = question_key(split, draft.index) * 4 + slot
    rng = item_rng(spec.seed or 0, key, Purpose.VIEW, draft.attempt * VIEW_ATTEMPTS + attempt)
    cubes = draft.shapes.cubes[slot]
    rotation = draw_rotation(rng)
    if slot:
        reference = draft.views[0].world_from_shape
        for _ in range(TURNS):
            angle = rotation_angle_degrees(reference, rotation, draft.symmetries[slot])
            if angle >= spec.min_angle_degrees:
                break
            rotation = draw_rotation(rng)
    dark = np.zeros((spec.lights[1], 3))  # visibility needs no light
    return View(cubes, rotation, dark, dark, 0)


def _lit(spec: SplitSpec, split: str, draft: _Draft, slot: int) -> View:
    """Return the view of an image with its lights, drawn apart from its rotation."""
    key = question_key(split, draft.index) * 4 + slot
    rng = item_rng(spec.seed or 0, key, Purpose.LIGHTS, draft.attempt)
    view = draft.views[slot]
    return View(view.cubes, view.world_from_shape, *draw_lights(spec, rng))


def _question(spec: SplitSpec, split: str, draft: _Draft) -> Question:
    views = tuple(_lit(spec, split, draft, slot) for slot in range(4))
    right = views[1 + draft.shapes.answer]
    angle = rotation_angle_degrees(
        views[0].world_from_shape, right.world_from_shape, draft.symmetries[0]
    )
    return Question(draft.index, draft.attempt, draft.shapes, views, angle)


def render_questions(
    spec: SplitSpec,
    pools: Pools,
    split: str,
    first: int,
    count: int,
    *,
    batch: int = DEFAULT_BATCH,
    device: str = "auto",
    tally: Tally | None = None,
) -> Iterator[list[tuple[Question, GroundTruth]]]:
    """Yield questions first .. first + count - 1 in order, with the pixels of their four images."""
    tally = tally or Tally()
    places = answer_positions(spec, split, first, count)
    pending: tuple[list[Question], Callable[[], GroundTruth]] | None = None
    for start in [*range(0, count, batch), None]:
        following = None
        if start is not None:
            rows = range(start, min(start + batch, count))
            requests = [(first + i, int(places[i]), 0) for i in rows]
            questions = settle(spec, pools, split, requests, tally, device)
            following = questions, launch(_pack(spec, questions), device)
        if pending is not None:
            yield _checked(spec, pools, split, *pending, tally, device)
        pending = following


def _pack(spec: SplitSpec, questions: Sequence[Question]) -> Any:
    return pack_views(spec, spec.render_spec(), [v for q in questions for v in q.views])


def _checked(
    spec: SplitSpec,
    pools: Pools,
    split: str,
    questions: list[Question],
    fetch: Callable[[], GroundTruth],
    tally: Tally,
    device: str,
) -> list[tuple[Question, GroundTruth]]:
    """Wait for the images; questions whose full images hide a cube after all are made anew."""
    truth = fetch()
    shown = visible_pixels(truth.object_id, max(spec.cubes))
    result = []
    for i, first_try in enumerate(questions):
        question = first_try
        four = slice(4 * i, 4 * i + 4)
        pixels = GroundTruth(
            truth.image[four], truth.depth[four], truth.normal[four], truth.object_id[four]
        )
        cubes = question.shapes.cubes.shape[1]
        while (shown[four][:, :cubes] < spec.min_cube_pixels).any():
            request = (question.index, question.shapes.answer, question.attempt + 1)
            (question,) = settle(spec, pools, split, [request], tally, device)
            pixels = render(_pack(spec, [question]), device)
            cubes = question.shapes.cubes.shape[1]
            shown[four] = visible_pixels(pixels.object_id, max(spec.cubes))
        result.append((question, pixels))
    return result


def make_split(
    folder: str | Path,
    spec: SplitSpec,
    *,
    batch: int = DEFAULT_BATCH,
    device: str = "auto",
    overwrite: bool = False,
    compression: str = "gzip",
    command: str = "",
    progress: Callable[[int], Any] = lambda done: None,
) -> Tally:
    """Write the files of a split to a folder, which appears when all of them are complete.

    Returns how many views were proposed and refused.

    Raises:
        SpecError, TooFewShapesError: the request; before anything is rendered.
        PlacementError: the bounded search found no question that meets it.
        OSError: the folder, or the disk.
    """
    folder = Path(folder)
    _check_folder(folder, overwrite)
    variant = select_variant(device)
    pools, tally = make_pools(spec), Tally()
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}.partial")
    temporary.mkdir()
    try:
        _write_files(
            temporary, spec, pools, tally, batch, device, compression, command, variant, progress
        )
        _check_folder(folder, overwrite)
        if folder.exists():
            shutil.rmtree(folder)
        os.replace(temporary, folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return tally


def _write_files(
    folder: Path,
    spec: SplitSpec,
    pools: Pools,
    tally: Tally,
    batch: int,
    device: str,
    compression: str,
    command: str,
    variant: str,
    progress: Callable[[int], Any],
) -> None:
    def fill(
        split: str, first: int, count: int, write: Callable[[Question, GroundTruth], None]
    ) -> None:
        with ThreadPoolExecutor(1) as pool:
            writing: deque[Future[int]] = deque()

            def write_all(rows: list[tuple[Question, GroundTruth]]) -> int:
                for question, pixels in rows:
                    write(question, pixels)
                return len(rows)

            for rows in render_questions(
                spec, pools, split, first, count, batch=batch, device=device, tally=tally
            ):
                writing.append(pool.submit(write_all, rows))
                if len(writing) > 2:
                    progress(writing.popleft().result())
            while writing:
                progress(writing.popleft().result())

    def tables(file: h5py.File, truth_file: h5py.File, group: str, count: int) -> tuple[Table, ...]:
        """The questions, and beside them what is known of them."""
        columns = question_columns(spec)
        known = truth_file.require_group("truth" + group)
        known.attrs.update(truth_attributes(spec))
        return (
            Table(file.require_group(group or "/"), columns, count, compression),
            Table(known, truth_columns(spec), count, compression),
        )

    def write_table(
        file: h5py.File,
        truth_file: h5py.File,
        split: str,
        group: str,
        first: int,
        count: int,
        answers: bool,
    ) -> None:
        images, known = tables(file, truth_file, group, count)
        answer_group = truth_file.require_group(group or "/")
        digest = hashlib.sha256(f"{spec.public().to_json()} {split} {group}".encode())
        right = np.zeros(count, np.uint8)

        def write(question: Question, pixels: GroundTruth) -> None:
            row = truth_row(spec, question, pixels)
            right[images.rows] = question.shapes.answer
            for name in ("cubes", "world_from_shape", "light_position", "light_color"):
                digest.update(np.ascontiguousarray(row[name]).tobytes())
            digest.update(bytes([question.shapes.answer]))
            images.append({"questions": pixels.image})
            known.append(row)

        fill(split, first, count, write)
        if answers:
            dataset = answer_group.create_dataset("answers", data=right)
            dataset.attrs["meaning"] = "which of images 1 to 3 shows the reference's shape, from 0"
        for one in {file, truth_file}:
            one.attrs["fingerprint" + group.replace("/", "_")] = digest.hexdigest()

    public = root_attributes(spec.public(), variant, "")
    whole = root_attributes(spec, variant, command)
    with new_file(folder / "iqtt-train.h5") as train:
        train.attrs.update({**public, "split": "train"})
        write_table(train, train, "train", "/labeled", 0, spec.labeled, True)
        write_table(
            train, train, "train", "/unlabeled", spec.labeled, spec.train - spec.labeled, False
        )
    with new_file(folder / "iqtt-val.h5") as val:
        val.attrs.update({**public, "split": "val"})
        write_table(val, val, "val", "", 0, spec.val, True)
    with (
        new_file(folder / "iqtt-test.h5") as test,
        new_file(folder / "iqtt-test-answers.h5") as answers,
    ):
        test.attrs.update({**public, "split": "test"})
        answers.attrs.update({**whole, "split": "test"})
        write_table(test, answers, "test", "", 0, spec.test, True)


def _check_folder(folder: Path, overwrite: bool) -> None:
    if folder.is_dir() and overwrite:
        strangers = [p.name for p in folder.iterdir() if not p.name.startswith("iqtt-")]
        if strangers:
            raise FileExistsError(17, f"holds other files too ({strangers[0]})", str(folder))
        return
    check_writable(folder, overwrite) if not folder.exists() else None
    if folder.exists():
        raise FileExistsError(17, "exists already; say --overwrite to replace it", str(folder))
