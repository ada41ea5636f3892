"""Questions -> images -> the files of a split."""

import hashlib
import os
import shutil
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
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
from iqtt.questions import (
    Pools,
    answer_positions,
    make_pools,
)
from iqtt.settle import Tally, settle
from iqtt.specs import SplitSpec
from iqtt.views import Question, pack_views
from scenegen.backend import select_variant
from scenegen.new_file import check_writable
from scenegen.renderer import launch, render
from scenegen.row_file import Table, new_file
from scenegen.truth import GroundTruth, visible_pixels

Array = NDArray[Any]
DEFAULT_BATCH = 64  # questions in one wavefront


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
