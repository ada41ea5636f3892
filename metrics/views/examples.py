"""Examples on pages: scenes and questions that were predicted well and badly, with pictures."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.specs import LETTERS
from metrics.measured.reader import Images, MeasuredFile
from metrics.measures.answers import ABSTAINED
from metrics.scoring.images.layers import fitted_layers, read_true_layers
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.scoring.records import ScoreFile
from metrics.submissions.reader import Predictions, QuestionPredictions, RoomPredictions
from metrics.submissions.truths import read_true_view
from metrics.views.figures import shown_row
from metrics.views.pictures import Picture, data_url, depth_pictures, normal_pictures
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import number
from scenegen.rooms.preview import cut_places, cuts, srgb_bytes
from scenegen.rooms.reader import RoomsFile

if TYPE_CHECKING:
    from iqtt.files.reader import AnswersFile

Array = NDArray[Any]
SHOWN = 6  # examples in a list, where there are enough
# Orders scenes. An object that is not predicted at all scores 0, while its errors of depth, which
# the headline has, may be small. Others follow where no image has a number for it.
AS_SEEN = "relief_correlation"
ANSWERS_ENDING = "-answers"  # of the name of the file of answers, beside that of the questions


@dataclass(frozen=True)
class Example:
    """An image or a question, and pictures of it.

    Attributes:
        name: scene, view and row, or the number of the question.
        text: its scores, or what was answered, in words.
    """

    name: str
    text: str
    pictures: Sequence[Picture]


Lists = list[tuple[str, list[Example]]]  # titles and examples


def examples_of(scores: ScoreFile, truth: "Images | AnswersFile", submission: Predictions) -> Lists:
    """Return titles and examples: the best, median and worst scenes, or answers right and wrong.

    Raises OSError and FileFormatError where a file, all of which are open, cannot be read.
    """
    if isinstance(truth, Images):
        assert isinstance(submission, RoomPredictions)
        name = _ordering_score(scores)
        return _scenes(scores, truth, submission, name) if name else []
    assert isinstance(submission, QuestionPredictions)
    return _questions(scores, truth.path, submission)


def _ordering_score(scores: ScoreFile) -> str:
    """Return the score that orders scenes: the first that any image has a number for; else ""."""
    for name in (AS_SEEN, *HEADLINE[scores.kind], *scores.metrics):
        if name in scores.items and np.isfinite(np.asarray(scores.items[name], float)).any():
            return name
    return ""


def chosen_scenes(
    scenes: Array, values: Array, higher_is_better: bool, most: int = SHOWN
) -> dict[str, list[int]]:
    """Return entries to show by "best", "median" and "worst", one of each scene, none twice.

    Scenes stand in the order of their mean value, equal ones by their number. Of each scene it is
    the view whose value is nearest to that mean, of equal ones the first. Where there are fewer
    than three times `most` scenes, each list gets a third; a single scene is the best one.

    Args:
        scenes, values: of each entry, (N,); entries whose value is not finite are left out.
        most: scenes in each list.
    """
    kept = np.flatnonzero(np.isfinite(values))
    if not len(kept):
        return {}
    labels, place = np.unique(scenes[kept], return_inverse=True)
    means = np.bincount(place, values[kept]) / np.bincount(place)
    off = np.abs(values[kept] - means[place])
    first = np.lexsort((kept, off, place))  # by scene, the nearest view first
    entry = kept[first[np.searchsorted(place[first], np.arange(len(labels)))]]
    order = entry[np.argsort(-means if higher_is_better else means, kind="stable")]
    shown = min(most, max(1, len(order) // 3))
    rest = order[shown : max(shown, len(order) - shown)]
    middle = max((len(rest) - shown) // 2, 0)
    lists = {
        "best": order[:shown],
        "median": rest[middle:][:shown],
        "worst": order[::-1][: min(shown, len(order) - shown)],
    }
    return {title: entries.tolist() for title, entries in lists.items() if len(entries)}


def _scenes(scores: ScoreFile, truth: Images, submission: RoomPredictions, name: str) -> Lists:
    values = np.asarray(scores.items[name], float)
    chosen = chosen_scenes(scores.clusters, values, metric(name).higher_is_better)
    count = len(np.unique(scores.clusters[np.isfinite(values)]))
    places = {row: place for place, row in enumerate(submission.rows.tolist())}

    def example(entry: int) -> Example:
        row = int(scores.ids[entry])
        pictures = _pictures(truth, submission, row, places[row])
        return Example(_name(scores, entry), _entry_scores(scores, entry), pictures)

    lists: Lists = []
    for place, entries in chosen.items():
        of_all = f"{len(entries)} of {count} {scores.unit} by {metric(name).title}"
        title = f"{place.capitalize()} {of_all}" if count > 1 else "The only scene"
        lists.append((title, [example(entry) for entry in entries]))
    return lists


def _pictures(rooms: Images, predictions: RoomPredictions, row: int, place: int) -> list[Picture]:
    """Return the pictures of a row; `place` is that of its prediction."""
    shown, true, (depth,) = shown_row(rooms, row, [predictions.view(place)])
    pictures = depth_pictures(shown, true, depth)
    if isinstance(rooms, MeasuredFile):
        return pictures
    normal = predictions.normal(place) if predictions.has_normals else None
    if predictions.kind == "layers":
        return [*pictures, *_cut_pictures(rooms, predictions, row, place)]
    true_normal = rooms.read("normal", row)
    return [*pictures, *normal_pictures(true, depth, true_normal, rooms.lens(row), normal)]


def _cut_pictures(
    rooms: RoomsFile, predictions: RoomPredictions, row: int, place: int
) -> list[Picture]:
    """Return cuts through true and predicted layers, along the row and column of most objects."""
    truth = read_true_layers(rooms, row, read_true_view(rooms, row))
    true = [rooms.read(f"layers/{x}", row) for x in ("depth", "object_id", "entering")]
    fitted = fitted_layers(predictions.view(place), truth)
    there, odd = np.isfinite(fitted), np.arange(fitted.shape[-1]) % 2 == 1
    alone = there & ~odd  # a last one without a partner is background
    alone[..., :-1] &= ~there[..., 1:]
    kind = np.where(odd, -1, 1)
    said = [fitted, np.where(there & ~alone, 1, np.where(alone, 0, -1)), np.where(alone, 0, kind)]
    at, known = cut_places(true[2]), true[0][np.isfinite(true[0])]
    ends = float(known.min()), float(known.max())
    captions = ("cut from above", "cut from the side")
    return [
        Picture(f"{which} {caption}", data_url(image))
        for which, layers in (("true", true), ("predicted", said))
        for caption, image in zip(captions, cuts(layers, *at, ends), strict=True)
    ]


def _name(scores: ScoreFile, entry: int) -> str:
    """Return scene, view and row of an entry, in words."""
    if scores.task == "measured":
        return f"row {int(scores.ids[entry])}"
    row, scene, view = (int(scores.items[n][entry]) for n in ("row", "scene_index", "view_index"))
    angles = scores.items.get("view_angle_degrees")
    known = angles is not None and np.isfinite(angles[entry])
    angle = f" ({int(angles[entry])}°)" if angles is not None and known else ""
    return f"scene {scene}, view {view}{angle}, row {row}"


def _entry_scores(scores: ScoreFile, entry: int) -> str:
    return ", ".join(
        f"{metric(name).title} {number(float(scores.items[name][entry]))}"
        for name in (AS_SEEN, *HEADLINE[scores.kind])
        if name in scores.items and np.isfinite(scores.items[name][entry])
    )


def chosen_questions(right: NDArray[np.bool_], most: int = SHOWN) -> dict[str, list[int]]:
    """Return entries to show that are "correct" and "wrong", (Q,), spread evenly over the file."""
    lists = {}
    for title, entries in (("correct", np.flatnonzero(right)), ("wrong", np.flatnonzero(~right))):
        places = np.rint(np.linspace(0, len(entries) - 1, min(most, len(entries)))).astype(int)
        if len(entries):
            lists[title] = entries[places].tolist()
    return lists


def _questions(scores: ScoreFile, truth: Path, predictions: QuestionPredictions) -> Lists:
    """Return questions answered rightly and wrongly; none where their pictures are not there."""
    from iqtt.files.reader import QuestionsFile

    images = _questions_beside(truth)
    if images is None:
        return []
    joined = None if images.samefile(truth) else truth
    try:
        questions = QuestionsFile(images, answers=joined)
    except SceneGenError:  # a file of answers by itself, or the questions of another split
        return []
    with questions:
        answer = dict(zip(predictions.rows.tolist(), predictions.answers.tolist(), strict=True))
        ids = scores.ids.tolist()
        answers = np.array([answer.get(i, ABSTAINED) for i in ids])
        true = np.asarray(questions.read("answers", slice(None)), np.int64)[scores.ids]
        right = answers == true
        totals = {"correct": int(right.sum()), "wrong": int((~right).sum())}
        return [
            (
                f"{len(entries)} of {totals[title]:,} {title} responses",
                [_question(questions[ids[i]], int(true[i]), int(answers[i])) for i in entries],
            )
            for title, entries in chosen_questions(right).items()
        ]


def _questions_beside(truth: Path) -> Path | None:
    """Return the file with the questions whose answers are in `truth`; None where there is none.

    It lies beside the truth and has the same name without "-answers", or is the truth itself.
    """
    beside = truth.with_name(truth.stem.removesuffix(ANSWERS_ENDING) + truth.suffix)
    return next((path for path in (beside, truth) if os.path.isfile(path)), None)


def _question(record: Any, right: int, answer: int) -> Example:
    """Return the pictures of a question; each answer tells whether it is right and was chosen."""
    urls = [data_url(srgb_bytes(np.nan_to_num(image))) for image in record.radiance]
    pictures = [Picture("reference", urls[0])]
    for k, url in enumerate(urls[1:]):
        marks = ["correct"] * (k == right) + ["selected"] * (k == answer)
        pictures.append(Picture(f"option {LETTERS[k]}", url, ", ".join(marks), k == right))
    text = f"correct: {LETTERS[right]}, selected: "
    text += "none" if answer == ABSTAINED else LETTERS[answer]
    kinds: Sequence[str | None] = record.truth.distractor_kind if record.truth else ()
    wrong = sorted({kind for kind in kinds if kind})
    text += f"; distractor types: {', '.join(wrong)}" if wrong else ""
    return Example(f"question {record.index}", text, pictures)
