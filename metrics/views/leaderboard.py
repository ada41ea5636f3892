"""Score files side by side: one table for each test set, with the paper's figures below.

Scores of different test sets never share a table. Scores that are not comparable stand below the
ranking, and so do baselines and the paper's figures, which were measured on the authors' data; none
has a rank.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from metrics.measures.alignment import Alignment
from metrics.score_file import SCORE_AGAIN
from metrics.scoring.aligned import aligned, left_out
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import (
    BASELINES,
    BEHIND,
    EMPTY_ROOM,
    HEADLINE,
    OBJECT_SCORES,
    SKILLED,
    metric,
)
from metrics.scoring.records import ID_COLUMNS, Score, ScoreFile, Skill, Task
from metrics.submissions.layout import Shown
from metrics.views.compare.compare import difference_interval
from metrics.views.page import Section, html_page
from metrics.views.paper import REPORTED, SOURCE, Figure, figures_of
from metrics.views.score_tables import (
    INTERVAL,
    baseline_name,
    few_clusters,
    labels_of,
    score_cell,
    skill_notes,
    too_few_warning,
)
from metrics.views.table import Cell, Row, Table, make_row
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import number, plain

SKILL_OF = "skill of "  # begins the keys of columns of skills
BASELINE, CHANCE = "baseline: ", "baseline: chance"
AGREEMENT = 1e-9  # of baselines, relative: other releases of libraries add differently
REPORTED_MARK, INCOMPARABLE_MARK = "†", "‡"
NOT_COMPARABLE = (
    f"{INCOMPARABLE_MARK} not ranked: part of the test set is missing, or values are not finite, or"
    " the file was scored without --truth"
)
BELOW = (
    "Methods below the baseline row are not significantly better than the baseline, so they have no"
    " rank. They are ordered by the next column."
)
SHARED = (
    "Methods share a rank if the 95% CI of their paired difference contains 0. Bold scores are"
    " significantly better than the next best."
)
VIEWS_SEEN = {
    "scored_view": "the scored view",
    "first_view": "the first view of the scene",
    "no_view": "none",
}
GIVEN: Mapping[str, str] = {
    "median_scale": "scale, by the median",
    "scale": "scale",
    "scale_l1": "scale",
    "scale_shift": "scale and shift",
    "scale_shift_l1": "scale and shift",
    "disparity_scale_shift": "scale and shift of disparity",
}
Cells = Mapping[str, Mapping[str, Cell]]  # by the label of the row, then by the key of the column


class LeaderboardError(SceneGenError):
    """Score files that do not fit in one table."""


class FloorError(SceneGenError):
    """Score files of one test set that state different baselines."""


@dataclass(frozen=True)
class Ranking:
    """What is shown of one test set.

    Attributes:
        files: the methods, best first; those that are not comparable come last.
        ranks: their places, which methods that are not told apart share; empty without one.
        mute: why the test set cannot tell methods apart, so that none has a rank; or empty.
    """

    files: tuple[ScoreFile, ...]
    ranks: tuple[str, ...]
    table: Table
    mute: str = ""


def to_html(tables: Sequence[Table]) -> str:
    """Return the tables of a leaderboard as one page, whose columns are sorted at a click."""
    sections = [Section(table.title, tables=[table]) for table in tables]
    return html_page("Leaderboard", sections, sortable=True)


def leaderboard(
    files: Sequence[ScoreFile],
    metrics: Sequence[str] | None = None,
    *,
    paper: bool = True,
    align: Alignment | None = None,
) -> tuple[Table, ...]:
    """Return the table of each test set; see `rankings`."""
    return tuple(ranking.table for ranking in rankings(files, metrics, paper=paper, align=align))


def rankings(
    files: Sequence[ScoreFile],
    metrics: Sequence[str] | None = None,
    *,
    paper: bool = True,
    align: Alignment | None = None,
) -> list[Ranking]:
    """Return what is shown of each test set, in the order of the files, under one alignment each.

    The digest of its truth tells a test set, wherever its file lay and whatever made it. Methods
    that were shown different views of a scene have rankings of their own.

    Args:
        files: any number, of any test sets.
        metrics: the scores to show; the first one ranks. A task that has none of them, or any task
            if they are None, shows `metric_names.HEADLINE`, skills before the scores themselves.
        paper: whether the paper's figures of the shown scores stand below each ranking.
        align: the alignment of all; None for the loosest one that a method of a test set declares.

    Raises LeaderboardError where a file is given twice or files that claim to score all of one test
    set score different rows of it, FloorError where they state different baselines of it,
    ComparisonError where they disagree about its scenes, AlignmentError and UnknownMetricError.
    """
    _require_once(files)
    wanted = {name: metric(name) for name in metrics or ()}
    for name, score in wanted.items():
        if score.signed:
            found = f"{name}, a bias, of which neither direction is better"
            raise LeaderboardError("metric", found, "a metric with a better direction")
    groups: dict[tuple[tuple[Task, str, str, str], Shown | None, bool], list[ScoreFile]] = {}
    for file in files:
        key = ((*file.truth, file.protocol, file.kind), file.shown_of_several, file.older)
        groups.setdefault(key, []).append(file)
    ranked = []
    for (truth, seen, older), group in groups.items():
        task, members = truth[0], aligned(group, align if truth[0] != "iqtt" else None)
        together = [f for f in files if (*f.truth, f.protocol, f.kind, f.older) == (*truth, older)]
        _require_same_rows(together)
        _require_same_baselines(together)
        names = [name for name, score in wanted.items() if task in score.tasks]
        # Methods that see a scene's first view alone are ranked by what is behind; those that see
        # none are not, as the mean relief of other rooms beats the baseline that knows as little.
        behind_first = sorted(HEADLINE[members[0].kind], key=lambda name: name != BEHIND)
        headline = [n for n in behind_first if n != BEHIND or seen == "first_view"]
        there = [n for n in headline if any(n in file.metrics for file in members)]
        if any(file.declared is not None for file in members):
            there = [n for n in there if all(n in file.metrics for file in members)]
        keys = _keys(members, names or there or HEADLINE[members[0].kind][:1], headline=not names)
        ranking = _ranking(members, files, keys, paper)
        notes = (*ranking.table.notes, *(left_out(group, there) if not names else ()))
        ranked.append(replace(ranking, table=replace(ranking.table, notes=notes)))
    return ranked


def _require_once(files: Sequence[ScoreFile]) -> None:
    """Raise LeaderboardError where two files hold scores of the same submissions."""
    for first, second in itertools.combinations(files, 2):
        runs, others = ({run.sha256 for run in file.meta.submissions} for file in (first, second))
        same = (first.truth, first.protocol) == (second.truth, second.protocol)
        if runs == others and same:
            found = f"scores of the same submissions as {first.place}"
            raise LeaderboardError(second.place, found, "each submission once")


def _require_same_rows(files: Sequence[ScoreFile]) -> None:
    """Raise LeaderboardError where files that claim to score all rows score different ones."""
    whole = [file for file in files if file.comparable]
    for file in whole[1:]:
        if not np.array_equal(np.sort(file.ids), np.sort(whole[0].ids)):
            items = ID_COLUMNS[file.task][0]
            raise LeaderboardError(
                file.place,
                f"{len(file.ids)} {items}s",
                f"the {len(whole[0].ids)} of {whole[0].place}",
                "both files claim to score the whole test set",
            )


def _require_same_baselines(files: Sequence[ScoreFile]) -> None:
    """Raise FloorError where comparable files of one test set state different baselines.

    Baselines follow from the test set alone, so that one of the files must be wrong.
    """
    whole = [file for file in files if file.comparable]
    stated = [
        {
            f"skills.{name}.floor ({skill.floor_name})": skill.floor
            for name, skill in file.skills.items()
            if _is_shared(name)
        }
        for file in whole
    ]
    for file, theirs in zip(whole[1:], stated[1:], strict=True):
        for name in stated[0].keys() & theirs.keys():
            if not math.isclose(theirs[name], stated[0][name], rel_tol=AGREEMENT):
                expected = f"{stated[0][name]!r}, as in {whole[0].place}"
                raise FloorError(f"{file.place}: {name}", theirs[name], expected, SCORE_AGAIN)


def _is_shared(name: str) -> bool:
    """Return whether all files of one test set have the same baseline of this score."""
    return all(BASELINES[begins].of_truth for begins in SKILLED.get(name, ()))


def _keys(files: Sequence[ScoreFile], names: Sequence[str], headline: bool) -> list[str]:
    """Return the keys of columns: scores, and skills where any file has them.

    In the headline the skills stand before all scores that they are made of; else after each. The
    first name, or its skill, is the first key, which ranks.
    """
    skilled = [name for name in names if any(name in file.skills for file in files)]
    if headline:
        others = [name for name in names if name not in skilled]
        with_skills = [*(SKILL_OF + name for name in skilled), *skilled]
        return [*with_skills, *others] if names[0] in skilled else [*others, *with_skills]
    return [k for n in names for k in ((n, SKILL_OF + n) if n in skilled else (n,))]


def _ranking(
    members: Sequence[ScoreFile], files: Sequence[ScoreFile], keys: Sequence[str], paper: bool
) -> Ranking:
    """Return what is shown of a test set that these members of the files score."""
    labels = labels_of(members)
    order = _order(members, keys)
    ranked = [members[i] for i in order]
    key, first = keys[0], ranked[0]  # comparable, if any is
    mute = _why_none_is_told_apart(first, key)
    ranks = [""] * len(order) if mute else _ranks(ranked, key)
    best = {k: None if mute else _best(ranked, k) for k in keys}
    rows = [
        make_row(
            [rank, _label(members[i], labels[i]), *_cells(members[i], keys, best)],
            "" if members[i].comparable else "incomparable",
        )
        for i, rank in zip(order, ranks, strict=True)
    ]
    baselines = _baselines(first, [k for k in keys if not k.startswith(SKILL_OF)])
    baselines = {label: row for label, row in baselines.items() if row.keys() & set(keys)}
    skill = SKILL_OF + key.removeprefix(SKILL_OF)
    lines = (label for label, row in baselines.items() if skill in row or label == CHANCE)
    line = "" if mute else next(lines, "")
    above = sum(map(bool, ranks))
    rows[above:above] = _unranked("baseline", [(line, baselines[line])] if line else [], keys)
    rows += _unranked("baseline", ((k, v) for k, v in baselines.items() if k != line), keys)
    reported = _reported(members, keys) if paper else {}
    rows += _unranked("reported", reported.items(), keys)
    below = [BELOW] * bool(line and any(file.comparable for file in ranked[above:]))
    notes = [*filter(None, [mute]), *_notes(ranked, key, below)]
    notes += _same_request_notes(members, files)
    if not all(file.comparable for file in members):
        notes.append(NOT_COMPARABLE)
    if reported:
        unit = "; unit of length unknown" if first.task == "rooms" else ""
        notes.append(f"{REPORTED_MARK} not ranked: {SOURCE}, {REPORTED}{unit}")
    head = ("#", "method", *(_head(k, first) for k in keys))
    table = Table(_title(first), head, tuple(rows), tuple(notes), named_by=1)
    return Ranking(tuple(ranked), tuple(ranks), table, mute)


def _head(key: str, file: ScoreFile) -> str:
    """Return the head of a column: title, an arrow that tells which way is better, and unit."""
    name = key.removeprefix(SKILL_OF)
    if name != key:
        return f"{metric(name).title}: skill ↑"
    arrow = "↑" if metric(name).higher_is_better else "↓"
    return f"{metric(name).title} {arrow} ({file.unit_of(name)})"


def _cells(
    file: ScoreFile, keys: Sequence[str], best: Mapping[str, ScoreFile | None]
) -> Iterator[Cell]:
    """Yield the scores of a method, beside which a baseline stands that is its own."""
    scores = _by_key(file)
    for key in keys:
        own = file.skills[key].floor if key in file.skills and not _is_shared(key) else None
        yield score_cell(scores.get(key), best[key] is file, own)


def _baselines(file: ScoreFile, names: Sequence[str]) -> Cells:
    """Return what the baselines of a file's test set score.

    That of a relief differs from file to file: its skill has one, 0, the score itself none.
    """
    rows: dict[str, dict[str, Cell]] = {}
    for name in names:
        if name in file.skills:
            shared = _is_shared(name)
            text = baseline_name(file, name) if shared else BASELINES[EMPTY_ROOM].name
            row = rows.setdefault(BASELINE + text, {})
            row[SKILL_OF + name] = Cell(number(0.0))
            row |= {name: Cell(number(file.skills[name].floor))} if shared else {}
    if file.task == "iqtt" and not any(label.startswith(CHANCE) for label in rows):
        rows[CHANCE] = {"iqtt_accuracy": Cell(number(1.0 / file.meta.counts["answers"]))}
    return rows


def _reported(files: Sequence[ScoreFile], keys: Sequence[str]) -> Cells:
    """Return figures of the paper as printed, by method, data and table, then by score."""
    figures: list[Figure] = [f for f in figures_of(files[0]) if f.view_angle is None]
    if not all(map(figures_of, files)):
        return {}
    rows: dict[str, dict[str, Cell]] = {}
    for f in (f for f in figures if f.metric in keys):
        labels = "" if f.labels is None else f", {f.labels} labels"
        label = f"{f.method}, {f.data}{labels} (Table {f.table}) {REPORTED_MARK}"
        rows.setdefault(label, {})[f.metric] = Cell(f.text, f"± {f.spread}" if f.spread else "")
    return rows


def _unranked(
    kind: str, rows: Iterable[tuple[str, Mapping[str, Cell]]], keys: Sequence[str]
) -> list[Row]:
    """Return a row without a rank for each label."""
    return [
        make_row(["", label, *(row.get(key, Cell()) for key in keys)], kind) for label, row in rows
    ]


def _sign(key: str) -> float:
    """Return the factor that makes lower values of a column better."""
    is_skill = key.startswith(SKILL_OF)
    return -1.0 if is_skill or metric(key).higher_is_better else 1.0


def _order(files: Sequence[ScoreFile], keys: Sequence[str]) -> list[int]:
    """Indices of the files: comparable ones from best to worst, those without a score, others.

    The first column decides; where it is equal, the second one does, and so on. Among files that
    are not better than the baseline, the second one begins: how much worse they are tells nothing.
    """

    def place(i: int) -> tuple[bool, bool, bool, list[tuple[bool, float]]]:
        scores = _by_key(files[i])
        values = [(k not in scores, _sign(k) * scores[k].value if k in scores else 0) for k in keys]
        above = _beats_the_baseline(files[i], keys[0])
        return not files[i].comparable, keys[0] not in scores, not above, values[not above :]

    return sorted(range(len(files)), key=place)


def _best(files: Sequence[ScoreFile], key: str) -> ScoreFile | None:
    """Return the method that is better in a column than all others; None without one.

    There must be another one, and the next best must differ from it. A skill of 0 or less is the
    best of nothing.
    """
    there = [file for file in files if file.comparable and key in _by_key(file)]
    there.sort(key=lambda file: _sign(key) * _by_key(file)[key].value)
    if len(there) < 2:
        return None
    score = _by_key(there[0])[key]
    is_better = isinstance(score, Score) or score.value > 0.0
    return there[0] if is_better and _differ(there[0], there[1], key) else None


def _beats_the_baseline(file: ScoreFile, key: str) -> bool:
    """Return whether the interval of a score's skill is above 0, or there is no baseline.

    The baseline of questions is chance where no 2D-only baseline is known.
    """
    name, level = key.removeprefix(SKILL_OF), 0.0
    score: Score | Skill | None = file.skills.get(name)
    if score is None and name == "iqtt_accuracy":
        score, level = file.metrics.get(name), 1.0 / file.meta.counts["answers"]
    return score is None or (score.value if score.low is None else score.low) > level


def _ranks(files: Sequence[ScoreFile], key: str) -> list[str]:
    """Return the ranks of files, best first, by a column; empty for those that have none."""
    ranks, place, first = list[str](), "", None
    for count, file in enumerate(files, 1):
        is_ranked = file.comparable and key in _by_key(file) and _beats_the_baseline(file, key)
        if is_ranked and (first is None or _told_apart(file, first, key)):
            first, place = file, str(count)
        ranks.append(place if is_ranked else "")
    return ranks


def _told_apart(file: ScoreFile, first: ScoreFile, key: str) -> bool:
    """Return whether two files differ in a column; without intervals, whether they are not equal.

    See `_differ`.
    """
    differ = _differ(first, file, key)
    return _by_key(first)[key].value != _by_key(file)[key].value if differ is None else differ


def _differ(first: ScoreFile, file: ScoreFile, key: str) -> bool | None:
    """Return whether the interval of a paired difference does not hold 0; None without intervals.

    Skills over a baseline that the files do not share are told apart where their own intervals do
    not meet.
    """
    name = key.removeprefix(SKILL_OF)
    if name == key or _is_shared(name):
        low, high = difference_interval(file, first, name)
        return None if low is None or high is None else not low <= 0 <= high
    a, b = (_by_key(f)[key] for f in (first, file))
    if a.low is None or a.high is None or b.low is None or b.high is None:
        return None
    return a.low > b.high or b.low > a.high


def _by_key(file: ScoreFile) -> dict[str, Score | Skill]:
    """Return the scores of a file, and their skills, by the keys of their columns."""
    return {**file.metrics, **{SKILL_OF + name: skill for name, skill in file.skills.items()}}


def _why_none_is_told_apart(file: ScoreFile, key: str) -> str:
    """Return in a sentence why a test set cannot tell methods apart by a column; or nothing."""
    name = key.removeprefix(SKILL_OF)
    if file.task == "iqtt" or name not in file.metrics:
        return ""
    of_objects = [name for name in OBJECT_SCORES if name in file.items]
    scenes, scored = len(np.unique(file.clusters)), file.metrics[name].n
    if of_objects and not file.metrics.keys() & set(of_objects):
        why = "no image shows an object, so the empty room is the ground truth"
    elif name == BEHIND and file.shown == "no_view":
        why = "without an input image, the mean over other rooms beats the baseline"
    elif scored < 2:
        why = f"only {scored} of {scenes} {file.unit} has a value of {metric(name).title}"
    else:
        return ""
    return f"no ranks: {why}"


def _title(file: ScoreFile) -> str:
    """Return the test set in words: how much of what, its name, and what was fitted."""
    fitted = f", all after {file.alignment}" if file.alignment != "none" else ""
    test = known_test(file.meta.truth_digest)
    name = plain(test.name if test else Path(file.meta.truth_path).name)
    if file.task == "iqtt":
        types = file.by_distractor
        kind = f", distractor type {plain(*types)}" if len(types) == 1 else ""
        return f"Mental rotation: {len(file.ids):,} questions{kind}, {name}"
    if file.task == "measured":
        groups = f" of {len(np.unique(file.clusters)):,} groups" if file.grouped else ""
        size = f"{len(file.ids):,} images{groups}"
        return f"Measured depth: {size}, {name}, protocol {file.protocol}{fitted}"
    task = {"first_view": "Rooms from the first view", "no_view": "Rooms without an image"}.get(
        file.shown_of_several or "", "Rooms"
    )
    scenes, views = (len(np.unique(c)) for c in (file.clusters, file.columns["view_index"]))
    angles = file.columns.get("view_angle_degrees", np.zeros(0))
    widest = np.abs(angles[np.isfinite(angles)]).max(initial=0)
    span = f" from 0° to {widest:g}°" if widest > 0 else ""
    each = f" in {views} views{span}" if views > 1 else ""
    return f"{task}: {scenes:,} scenes{each}, {name}{fitted}"


def _label(file: ScoreFile, name: str) -> str:
    """Return a method's name with what has to be known about it."""
    texts = [f"{file.runs} runs"] * (file.runs > 1)
    if file.task != "iqtt" and (file.declared or file.alignment) != "none":
        texts.append(f"fitted {GIVEN[file.declared or file.alignment]}")
    if file.unread is not None:
        texts.append(f"{file.unread:.0%} of replies without a letter")
    mark = "" if file.comparable else f" {INCOMPARABLE_MARK}"
    return name + (f" ({'; '.join(texts)})" if texts else "") + mark


def _notes(files: Sequence[ScoreFile], key: str, below: Sequence[str]) -> Iterator[str]:
    """Yield warnings, then what was scored, and how to read the table."""
    first, name = files[0], key.removeprefix(SKILL_OF)
    scored = first.metrics[name].n if first.task != "iqtt" and name in first.metrics else 0
    few = too_few_warning(scored, f"{first.unit} with a value of {metric(name).title}")
    yield from (f"warning: {text}" for text in few_clusters(first) or few)
    if first.older:
        yield f"warning: files of format 1.0 define some metrics differently; {SCORE_AGAIN}"
    truth = f", ground truth {first.meta.truth_digest[:12]}"
    if first.task != "iqtt":
        clusters = f"{len(np.unique(first.clusters)):,} {first.unit}"
        seen = first.shown_of_several
        view = f"; input view: {VIEWS_SEEN[seen]}" if seen else ""
        yield f"{len(first.ids):,} images of {clusters}{truth}{view}"
    else:
        chance = 1.0 / first.meta.counts["answers"]
        yield f"{len(first.ids):,} questions{truth}; chance is {chance:.4f}"
    skilled = next((file for file in files if file.skills), None)
    yield from () if skilled is None else skill_notes(skilled)
    yield f"[low, high]: {INTERVAL} over {first.unit}; ±: standard deviation over training runs"
    yield " ".join([SHARED, *below])


def _same_request_notes(members: Sequence[ScoreFile], files: Sequence[ScoreFile]) -> Iterator[str]:
    """Yield a note on each other test set with the same recipe hash."""
    requests = {file.meta.truth_fingerprint for file in members}
    digests = {f.meta.truth_digest for f in files if f.meta.truth_fingerprint in requests}
    for digest in sorted(digests - {members[0].meta.truth_digest}):
        yield (
            f"scores on ground truth {digest[:12]} are ranked separately: the same request made it,"
            " but its content differs"
        )
