"""Questions drawn, rendered and packed, all at the same time; any process can do it."""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.files.layout import ID_BYTES, NO_CUBE
from iqtt.perspective.rooms import RenderedRooms, Rooms, room_rows
from iqtt.questions.specs import QuestionSpec, SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import Rendered, Source, groups, render_questions
from iqtt.shapes.polycube import canonical, canonical_class, set_ids
from scenegen.files.sets.plan import Block
from scenegen.files.sets.sets import Packed
from scenegen.files.sets.workers import in_threads
from scenegen.files.table import pack_rows, packing_threads
from scenegen.rendering.renderer import WORTHWHILE, share_processors

BLOCK = 128  # questions that a worker process makes in one go
ROOMS = 8  # of those about rooms, which take seconds; neighbours share their furniture
PACKED = 8  # questions that a thread packs in one go
OF_QUESTION = (
    *("world_from_shape", "light_count", "light_position", "light_color"),
    *("angle_degrees", "camera_distance"),
)


@dataclass(frozen=True, eq=False)
class QuestionsWork:
    """What is done to questions; a `making.Work`.

    Attributes:
        pools: what they show, by the folder of the split that they are for.
        batch: questions rendered at once.
        device, compression: as in `backend.DEVICES` and `table.COMPRESSIONS`.
    """

    pools: Mapping[str, Source]
    batch: int
    device: str
    compression: str

    @property
    def block(self) -> int:
        """Questions that a worker process makes in one go."""
        return ROOMS if any(isinstance(x, Rooms) for x in self.pools.values()) else BLOCK

    @property
    def worthwhile(self) -> int:
        """Images for which another worker process is worth while."""
        return 4 * ROOMS if self.block == ROOMS else WORTHWHILE

    def packed_rows(self, block: Block, workers: int) -> Generator[Packed, None, Tally]:
        """Render questions in order, and meanwhile pack them in threads; return their tally."""
        share_processors(workers, self.device)
        folder, _, split = block.part.of.rpartition("/")
        pools, tally = self.pools[folder], Tally()
        spec = pools.spec
        first, count = groups(spec, split)[block.part.name]
        rendered = render_questions(
            pools, split, first, count,
            rows=block.items, batch=self.batch, device=self.device, tally=tally,
        )  # fmt: skip
        pieces = (some[i : i + PACKED] for some in rendered for i in range(0, len(some), PACKED))

        def packed(questions: list[Rendered] | list[RenderedRooms]) -> Packed:
            values = question_rows(spec, questions)
            sheets = block.part.sheets
            return [pack_rows(values, sheet.columns, self.compression) for sheet in sheets]

        ahead = 2 * self.batch // PACKED
        yield from in_threads(packed, pieces, packing_threads(workers), ahead)
        return tally


def question_rows(
    spec: QuestionSpec, rendered: list[Rendered] | list[RenderedRooms]
) -> dict[str, Any]:
    """Return the values of each question, by column: images, answer, and `truth_columns`."""
    if isinstance(spec, SplitSpec):
        return _cube_rows(spec, rendered)  # type: ignore[arg-type]
    return room_rows(rendered)  # type: ignore[arg-type]


def _cube_rows(spec: SplitSpec, rendered: Sequence[Rendered]) -> dict[str, Any]:
    most, images = spec.cubes[1], 1 + spec.answers
    cubes = np.full((len(rendered), images, most, 3), NO_CUBE, np.int8)
    shape_ids, class_ids = np.zeros((2, len(rendered), images, ID_BYTES), np.uint8)
    counts = np.array([one.question.shapes.cubes.shape[1] for one in rendered])
    for count in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == count)
        cubes[rows, :, :count] = [rendered[i].question.shapes.cubes for i in rows.tolist()]
        flat = cubes[rows, :, :count].reshape(-1, count, 3)
        for ids, form in ((shape_ids, canonical), (class_ids, canonical_class)):
            ids[rows] = set_ids(form(flat)).view(np.uint8).reshape(-1, images, ID_BYTES)
    questions = [one.question for one in rendered]

    def each(name: str) -> NDArray[Any]:
        return np.array([getattr(question, name) for question in questions])

    return {
        "questions": [one.images for one in rendered],
        "answers": np.array([question.shapes.answer for question in questions], np.uint8),
        "cube_count": counts,
        "cubes": cubes,
        "shape_id": shape_ids,
        "class_id": class_ids,
        **{name: each(name) for name in OF_QUESTION},
        "distractor_kind": np.array([question.shapes.kinds for question in questions]),
        "visible_pixels": np.array([one.visible_pixels for one in rendered]),
        "depth": [one.depth for one in rendered],
    }
