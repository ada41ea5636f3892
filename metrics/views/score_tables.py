"""Tables of one score file, as text, Markdown and CSV: main metrics, all, and by group."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np

from iqtt.questions.specs import LETTERS
from metrics.measured.protocols import BY_NAME, DECLARED
from metrics.measures.alignment import Alignment
from metrics.measures.statistics import FEW_CLUSTERS
from metrics.scoring.estimates import CONFIDENCE, question_skill
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import (
    BASELINES,
    BEHIND,
    HEADLINE,
    OTHER_SCENE,
    PRINTED,
    in_order,
    metric,
)
from metrics.scoring.records import GROUPINGS, Meta, Score, ScoreFile, Skill
from metrics.submissions.hints.depth import UNITS
from metrics.views.table import Cell, Table, make_table, to_markdown, to_text
from scenegen.common.text_table import by_number, distinct, number, plain, with_interval
from scenegen.files.new_file import written_beside

INTERVAL = f"{CONFIDENCE:.0%} CI"
MAIN_HEAD = ("metric", "", "value", INTERVAL, "baseline", "skill", INTERVAL)
SKILL = "skill: 0 = baseline, 1 = perfect, negative = worse than the baseline"
ITSELF = "baseline itself"
NO_BASELINE = (
    "no skill: no 2D-only baseline is known for these settings; measure it with `iqtt floors {}`,"
    " then score with --baselines floors.json"
)
BY_KIND = "by distractor type"
GROUP_TITLES = {
    "by_view_angle": "by angle to the first view of the scene, degrees",
    "by_object_shape": "single objects, by shape",
    "by_object_size": "single objects, by area in percent of the image",
    "by_distractor": BY_KIND,
    "by_rotation_angle": "by rotation between reference and correct option, degrees",
    "by_position": "by position of the correct option",
    "by_answer": "by selected option",
    "by_outcome": "by outcome of reading the reply",
    "by_circle": "CircularEval: correct in every order of the options",
}
ALIGNMENT_SCORES = ("abs_rel", "rmse", "delta_1")
NOTED_ALIGNMENTS = ("none", "scale", "scale_shift", "disparity_scale_shift")
ONE_SCALE = 1.5  # factor on depth from which another unit is suspected, as hints do
ALIKE = 0.15  # log2 of factors by which the scales of images may differ then


def text_report(
    scores: ScoreFile, as_markdown: bool = False, whole: bool = False, width: int | None = None
) -> str:
    """Return the main metrics, as aligned text or Markdown, and accuracy by distractor type.

    Args:
        whole: whether all metrics, and the main metrics by group, are included.
        width: characters of a line, to which sentences are wrapped.
    """
    title = "\n".join([title_of(scores), *(f"WARNING  {text}" for text in warnings_of(scores))])
    tables, notes = [main_table(scores)], notes_of(scores)
    if whole:
        tables += [*alignment_tables(scores), all_scores(scores), *group_tables(scores)]
    else:
        kinds = scores.by_distractor if scores.task == "iqtt" else {}
        tables += [t for t in group_tables(scores) if t.title == BY_KIND and len(kinds) > 1]
        missing = _not_scored(scores)
        count = f"{len(scores.metrics)} metrics, " * (len(scores.metrics) > 1)
        notes.append(f"more: --all ({count}scores by group), --json, --html{missing}")
    return (to_markdown if as_markdown else to_text)(title, tables, notes, width)


def write_csv(scores: ScoreFile, path: str | Path, overwrite: bool = False) -> None:
    """Write a line with the scores of each item. Raises OSError as `new_file.written_beside`."""
    with (
        written_beside(path, overwrite) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        out = csv.writer(file)
        out.writerow(scores.items)
        columns = [np.asarray(column).tolist() for column in scores.items.values()]
        out.writerows(zip(*columns, strict=True))


def main_names(scores: ScoreFile) -> list[str]:
    """Return the metrics that are shown first: the main metrics, or others if there are none."""
    names = [name for name in PRINTED[scores.kind] if name in scores.metrics]
    names = [name for name in names if name != BEHIND or name in scores.headline]
    return names or in_order(scores.metrics)[:5]


def main_table(scores: ScoreFile) -> Table:
    """Return a row for each main metric: direction, value, baseline and skill.

    No skill is shown where depth seems to have another unit.
    """
    rows: list[Sequence[str]] = []
    head = MAIN_HEAD[:-2] if unit_warning(scores) else MAIN_HEAD
    for name in main_names(scores):
        score, skill = scores.metrics[name], scores.skills.get(name)
        value, interval = interval_cells(score)
        value += "" if score.std is None else f" ± {number(score.std, (score.low, score.high))}"
        up = "up" if metric(name).higher_is_better else "down"
        row = (name, up, value, interval, str(baseline_cell(scores, name)))
        if skill is None:
            rows.append((*row, "-", ""))
        else:
            rows.append((*row, *(("0", ITSELF) if skill.is_floor else interval_cells(skill))))
    return make_table("", head, [row[: len(head)] for row in rows])


def baseline_name(scores: ScoreFile, name: str) -> str:
    """Return the name of the baseline of a metric that has a skill."""
    if scores.task != "iqtt":
        return BASELINES[scores.skills[name].floor_name[: -len(name)]].name
    return " ".join(scores.skills[name].floor_name.split())


def baseline_cell(scores: ScoreFile, name: str) -> Cell:
    """Return the value and the name of the baseline of a metric."""
    if name not in scores.skills:
        return Cell()
    value = _beside(scores.skills[name].floor, scores.metrics[name])
    return Cell(value, baseline_name(scores, name))


def _beside(reference: float, score: Score) -> str:
    """Return a number with the digits of a score, but never a rounded 0."""
    text = number(reference, (score.low, score.high))
    return number(reference) if reference and float(text) == 0 else text


def alignment_tables(scores: ScoreFile) -> Iterator[Table]:
    """Yield depth metrics after each alignment side by side, the one that ranks first."""
    rows: list[Sequence[Cell | str]] = []
    for alignment, shown in _by_alignment(scores):
        ranks = alignment == scores.alignment
        label = f"{alignment} (ranks)" if ranks else alignment
        rows.insert(0 if ranks else len(rows), (label, *map(score_cell, shown)))
    if rows:
        yield make_table("depth metrics by alignment", ("alignment", *ALIGNMENT_SCORES), rows)


def _by_alignment(scores: ScoreFile) -> Iterator[tuple[str, list[Score | None]]]:
    """Yield each alignment as loose as the declared one or looser, and ALIGNMENT_SCORES."""
    ending = "" if scores.alignment == "none" else f"_after_{scores.alignment}"
    if not all(f"{name}{ending}" in scores.metrics for name in ALIGNMENT_SCORES):
        return
    for alignment in get_args(Alignment):
        ending = "" if alignment == "none" else f"_after_{alignment}"
        shown = [scores.metrics.get(f"{name}{ending}") for name in ALIGNMENT_SCORES]
        if shown[0] is not None and (ending or scores.alignment == "none"):
            yield alignment, shown


def all_scores(scores: ScoreFile) -> Table:
    """Return a row for each metric."""
    rows: list[Sequence[str]] = []
    for name in in_order(scores.metrics):
        score, skill = scores.metrics[name], scores.skills.get(name)
        std = "-" if score.std is None else number(score.std, (score.low, score.high))
        floor = "-" if skill is None else _beside(skill.floor, score)
        row = (name, *interval_cells(score), std, floor, score.unit, metric(name).better)
        rows.append(row)
    head = ("metric", "value", INTERVAL, "std of runs", "baseline", "unit", "better")
    return make_table("all metrics", head, rows)


def group_tables(scores: ScoreFile) -> Iterator[Table]:
    """Yield a table for each grouping that the scores have: a row for each group."""
    for grouping in GROUPINGS[scores.task]:
        groups = getattr(scores, grouping)
        if not groups:
            continue
        held = {name for group in groups.values() for name in group}
        names = [name for name in HEADLINE[scores.kind] if name in held] or in_order(held)
        with_skills = grouping == "by_distractor" and bool(scores.question_floors)
        rows: list[Sequence[Cell | str]] = []
        for key in by_number(groups):
            group = groups[key]
            cells = [_group_cell(group.get(name)) for name in names]
            n = str(max(score.n for score in group.values()))
            label = shown_key(grouping, key)
            rows.append((label, *cells, n, *(_kind_cells(scores, key) if with_skills else ())))
        head = ("", *names, "n", *(("skill", "baseline") if with_skills else ()))
        yield make_table(GROUP_TITLES[grouping], head, rows)


def shown_key(grouping: str, key: str) -> str:
    """Return the printed name of a group: options have letters."""
    numbered = grouping in ("by_position", "by_answer") and key.isdigit()
    return LETTERS[int(key)] if numbered else key


def _group_cell(score: Score | None) -> Cell:
    return Cell() if score is None else score_cell(replace(score, std=None))


def _kind_cells(scores: ScoreFile, kind: str) -> tuple[Cell, Cell]:
    """Return the skill for a distractor type, and the baseline of that type."""
    accuracy = scores.by_distractor[kind]["iqtt_accuracy"]
    skill = question_skill(accuracy, {kind: accuracy.n}, scores.question_floors)
    if skill is None:
        return Cell(), Cell()
    return score_cell(skill), Cell(number(skill.floor), skill.floor_name)


def interval_cells(score: Score | Skill) -> tuple[str, str]:
    """Return a value and its interval as text; "-" stands for no interval."""
    return with_interval(score.value, score.low, score.high)


def score_cell(score: Score | Skill | None, best: bool = False, floor: float | None = None) -> Cell:
    """Return a value, with standard deviation over runs, interval, and a baseline of its own.

    Args:
        best: whether it is the best value of its column.
    """
    if score is None:
        return Cell()
    if isinstance(score, Skill) and score.is_floor:
        return Cell("0", ITSELF)
    value, interval = interval_cells(score)
    std, ends = getattr(score, "std", None), (score.low, score.high)
    rest = [] if std is None else [f"± {number(std, ends)}"]
    rest += [] if interval == "-" else [interval]
    rest += [] if floor is None else [f"baseline {number(floor, ends)}"]
    return Cell(value, " ".join(rest), best)


def side_by_side(files: Sequence[ScoreFile]) -> Table:
    """Return a row for each main metric and distractor type, with a column for each method.

    Metrics that have a skill are shown by it.
    """
    rows: list[Sequence[Cell | str]] = []
    names = {name for file in files for name in file.headline}
    for name in (n for n in HEADLINE[files[0].kind] if n in names and n in files[0].metrics):
        has_skill = name in files[0].skills
        cells = [(file.skills if has_skill else file.metrics).get(name) for file in files]
        label = f"skill of {name}" if has_skill else name
        baseline = baseline_name(files[0], name) if has_skill else "-"
        rows.append((label, *map(score_cell, cells), baseline))
    for kind in by_number(files[0].by_distractor) if files[0].task == "iqtt" else ():
        shown = [file.by_distractor.get(kind, {}).get("iqtt_accuracy") for file in files]
        rows.append((f"accuracy, {kind}", *map(score_cell, shown), "-"))
    return make_table("side by side", ("", *labels_of(files), "baseline"), rows)


def labels_of(files: Sequence[ScoreFile]) -> list[str]:
    """Return names of the files' methods, all of them different."""
    return distinct([f.method for f in files], [f.path.stem if f.path else "" for f in files])


def size_of(scores: ScoreFile) -> str:
    """Return how much was scored, in words."""
    if scores.task == "iqtt":
        size = f"{len(scores.ids)} questions"
    else:
        size = f"{len(scores.ids)} images"
        count = len(np.unique(scores.clusters))
        size += f", {count} {scores.unit}" if scores.task == "rooms" or scores.grouped else ""
    return size + (f", mean of {scores.runs} runs" if scores.runs > 1 else "")


def title_of(scores: ScoreFile) -> str:
    """Return method, ground truth and size; for images also alignment, protocol and unit."""
    texts = [f"{plain(scores.method)} on {plain(_truth_name(scores.meta))}: {size_of(scores)}"]
    if scores.task != "iqtt":
        how = "metric" if scores.alignment == "none" else "fitted to the ground truth per image"
        texts += [f"alignment: {scores.alignment} ({how})"]
        texts += [f"protocol: {scores.protocol}"] if scores.protocol else []
        unit = "metre" if scores.task == "measured" else scores.length
        texts += [f"unit: {unit}"]
    return "   ".join(texts)


def _truth_name(meta: Meta) -> str:
    return meta.truth_path.replace("\\", "/").rsplit("/", maxsplit=1)[-1]


def warnings_of(scores: ScoreFile) -> list[str]:
    """Return what a reader must know before any number."""
    return [
        *unit_warning(scores),
        *scores.warnings,
        *few_clusters(scores),
        *partner_sentences(scores),
        *confidence_warnings(scores),
    ]


def unit_warning(scores: ScoreFile) -> list[str]:
    """Return a warning where one factor on depth explains most of the error; else none."""
    if scores.alignment != "none" or "abs_rel_after_scale" not in scores.items:
        return []
    errors, scaled = scores.items["abs_rel"], scores.items["abs_rel_after_scale"]
    scales = scores.items.get("scale_log2", np.zeros(1))
    middle = float(np.nanmedian(scales)) if np.isfinite(scales).any() else 0.0
    alike = np.mean(np.abs(scales - middle) <= ALIKE) > 0.5
    if abs(middle) < np.log2(ONE_SCALE) or not alike or np.nanmedian(scaled / errors) > 0.5:
        return []
    times = 2.0**middle
    unit = next((text for factor, text in UNITS.items() if 0.5 < times / factor < 2.0), "")
    guess = f", possibly {unit}" if unit else ""
    found = f"depth is {float(f'{times:.3g}'):,g} times the ground truth{guess}"
    return [f"unit mismatch suspected, so no skill is shown: {found}"]


def confidence_warnings(scores: ScoreFile) -> list[str]:
    """Return a warning where confidence is constant, or larger where errors are larger."""
    gain = scores.metrics.get("aurg_abs_rel")
    if gain is None:
        return []
    if (np.abs(scores.items["aurg_abs_rel"]) < 1e-12).all():
        return ["confidence is constant in every image, so it ranks no pixels"]
    inverted = gain.value < 0.0 and (gain.high is None or gain.high < 0.0)
    hint = "if the values are uncertainties, use `bench import --confidence-is error`"
    return [f"confidence is larger where errors are larger: {hint}"] * inverted


def notes_of(scores: ScoreFile) -> list[str]:
    """Return at most six notes: how to read the main table, and where the numbers come from."""
    meta = scores.meta
    bootstrap = f"{meta.resamples} resamples, seed {meta.seed}"
    notes = [] if unit_warning(scores) else skill_notes(scores, main_names(scores))
    if scores.task != "iqtt":
        notes += _alignment_note(scores)
        over = f"{scores.unit}, {bootstrap}"
        if scores.task == "measured" and not scores.grouped:
            over += "; images count as independent, because the file has no groups"
        notes.append(f"CIs: bootstrap over {over}")
    else:
        how = "Wilson" if scores.runs == 1 else f"bootstrap, {bootstrap}"
        over = "questions"
        if "shape" in scores.items:
            over = f"{len(np.unique(scores.items['shape']))} reference shapes"
        notes.append(f"CIs: {how}, over {over}; missing responses and ties count as wrong")
        notes += unread_notes([scores])
    runs = ", ".join(run.sha256[:12] for run in meta.submissions)
    return [
        *notes,
        f"hash of the ground truth: {meta.truth_digest[:12]} ({source_text(meta)});"
        f" hash of the predictions: {plain(runs)}",
    ]


def skill_notes(scores: ScoreFile, shown: Sequence[str] = ()) -> list[str]:
    """Return what skill means and which baselines it uses, or why there is no skill."""
    if scores.task == "iqtt":
        if not scores.skills:
            known = bool(scores.by_distractor)
            missing = "no skill: the answer key has no settings, so no baseline is known"
            return [NO_BASELINE.format(plain(scores.meta.truth_path)) if known else missing]
        chance = f"chance is {1.0 / scores.meta.counts['answers']:.2f}"
        return [SKILL, f"baseline: best 2D-only method for each distractor type; {chance}"]
    if not scores.skills:
        return []
    first = shown or HEADLINE[scores.kind]
    names = [name for name in first if name in scores.skills] or [*scores.skills]
    begins = dict.fromkeys(scores.skills[name].floor_name[: -len(name)] for name in names)
    used = [BASELINES[begin] for begin in BASELINES if begin in begins]
    return [SKILL, f"baselines: {'; '.join(f'{base.name} = {base.gloss}' for base in used)}"]


def _alignment_note(scores: ScoreFile) -> list[str]:
    by_alignment = list(_by_alignment(scores))
    firsts = [(name, shown[0]) for name, shown in by_alignment if name in NOTED_ALIGNMENTS]
    values = " | ".join(f"{name} {interval_cells(first)[0]}" for name, first in firsts if first)
    return [f"abs_rel by alignment: {values}"] * (len(by_alignment) > 1)


def _not_scored(scores: ScoreFile) -> str:
    """Return what cannot be scored on measured ground truth."""
    if scores.task != "measured":
        return ""
    texts = ["objects (not annotated)"]
    if scores.protocol == DECLARED.name and "boundary_f1" not in scores.items:
        texts.append("boundaries (depth is too sparse)")
    if scores.protocol == DECLARED.name and "normal_mean_degrees" not in scores.items:
        texts.append("normals (not in both files)")
    source = BY_NAME[scores.protocol].source
    return f"; not scored: {'; '.join(texts)}; protocol: {source}"


def unread_notes(files: Sequence[ScoreFile]) -> list[str]:
    """Return the share of replies without a letter, for each method that has replies."""
    return [
        f"replies of {label} without a letter: {file.unread:.0%}; they count as wrong"
        for file, label in zip(files, labels_of(files), strict=True)
        if file.unread is not None
    ]


def partner_sentences(scores: ScoreFile) -> list[str]:
    """Return a sentence where the skill of relief_iou leaves out images without another scene."""
    name = "relief_iou"
    if name not in scores.skills:
        return []
    has_score, has_floor = (
        int(np.isfinite(scores.items[column]).sum()) for column in (name, OTHER_SCENE + name)
    )
    why = "no other scene has the view of the other images"
    text = f"skill of relief_iou covers {has_floor} of {has_score} images: {why}"
    return [text] * (has_floor < has_score)


def few_clusters(scores: ScoreFile) -> list[str]:
    """Return a warning where bootstrap intervals use too few scenes or shapes; else none."""
    labels = scores.items.get("shape", scores.clusters)
    units = "shapes" if scores.task == "iqtt" else scores.unit
    return too_few_warning(len(np.unique(labels)), units) if scores.meta.resamples else []


def too_few_warning(count: int, units: str) -> list[str]:
    """Return a warning where a number of scenes or shapes is too small for intervals."""
    text = f"{count} {units}: with fewer than {FEW_CLUSTERS}, {CONFIDENCE:.0%} CIs are too narrow"
    return [text] * (1 < count < FEW_CLUSTERS)


def source_text(meta: Meta) -> str:
    """Return the source of the ground truth, and the name of its benchmark."""
    test = known_test(meta.truth_digest)
    source = "from --truth" if meta.truth_source == "given" else "path stored in the predictions"
    return f"{source}, {f'benchmark {test.name}' if test else 'not a named benchmark'}"
