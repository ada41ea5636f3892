"""Score files side by side: one ranking for each test set, with the paper's figures beside it.

Scores of different test sets never share a ranking. Scores that are not comparable stand below it,
and so do floors and the paper's figures, which were measured on the authors' data; none has a rank.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from metrics.score_file import SCORE_AGAIN
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import HEADLINE, OBJECT_SCORES, metric
from metrics.scoring.records import ID_COLUMNS, Score, ScoreFile, Skill, Task
from metrics.submissions.layout import Shown
from metrics.views.compare.compare import difference_interval
from metrics.views.leaderboard.cards import VIEWS_SEEN, Card, card_cells
from metrics.views.leaderboard.floors import (
    SKILL_OF,
    floor_cells,
    is_shared,
    own_floors,
    require_same_floors,
)
from metrics.views.leaderboard.rows import (
    INCOMPARABLE_MARK,
    Column,
    Entry,
    build_table,
    figure_cells,
    score_column,
    skill_column,
)
from metrics.views.page import Section, html_page
from metrics.views.paper import PAPER_KIND, Figure, tables_beside
from metrics.views.score_tables import (
    INTERVAL,
    SKILL,
    few_clusters,
    floor_sentences,
    labels_of,
    too_few_warning,
    what_the_floor_is,
)
from metrics.views.table import Table
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import plain

WIDEST = 6  # columns of scores in one table
AS_RANKED = "Rows as in the ranking."
# Ranks methods that see a scene's first view alone. Others look at what it asks for.
BEHIND = "behind_depth_error"
SHARED = (
    "Methods share a rank where the 95% interval of their paired difference from the first method"
    " of that rank holds 0."
)


class LeaderboardError(SceneGenError):
    """Score files that cannot stand in one table."""


@dataclass(frozen=True)
class Ranking:
    """What is shown of one test set.

    Attributes:
        entries: the methods, best first; those that are not comparable come last.
        tables: the ranking; where it would be too wide, that of skills, then the scores.
        mute: why the test set cannot tell methods apart, so that none has a rank; or empty.
    """

    entries: tuple[Entry, ...]
    tables: tuple[Table, ...]
    mute: str = ""


def leaderboard(
    files: Sequence[ScoreFile],
    metrics: Sequence[str] | None = None,
    *,
    paper: bool = True,
    headline: bool = False,
    cards: Mapping[str, Card] | None = None,
) -> tuple[Table, ...]:
    """Return the tables of all test sets; see `rankings`.

    With `headline` it is the ranking of each test set alone.
    """
    ranked = rankings(files, metrics, paper=paper, cards=cards)
    most = 1 if headline else None
    return tuple(table for ranking in ranked for table in ranking.tables[:most])


def to_html(tables: Sequence[Table]) -> str:
    """Return the tables of a leaderboard as one page, whose columns are sorted at a click."""
    sections = [Section(table.title, tables=[table]) for table in tables]
    return html_page("Leaderboard", sections, sortable=True)


def rankings(
    files: Sequence[ScoreFile],
    metrics: Sequence[str] | None = None,
    *,
    paper: bool = True,
    cards: Mapping[str, Card] | None = None,
) -> list[Ranking]:
    """Return what is shown of each test set, in the order of the files.

    The digest of its truth tells a test set, wherever its file lay and whatever made it. Methods
    that were shown different views of a scene have rankings of their own.

    Args:
        files: any number, of any test sets.
        metrics: the scores to show; the first one ranks. A task that has none of them, or any task
            if they are None, shows `metric_names.HEADLINE`, skills before the scores themselves.
        paper: whether the paper's figures of the shown scores stand below each ranking.
        cards: what is known of methods, by their names.

    Raises LeaderboardError where a file is given twice or files that claim to score all of one test
    set score different rows of it, FloorError where they state different floors of it,
    ComparisonError where they disagree about its scenes, and UnknownMetricError.
    """
    _require_once(files)
    wanted = {name: metric(name) for name in metrics or ()}
    groups: dict[tuple[tuple[Task, str, str], Shown | None, bool], list[ScoreFile]] = {}
    for file in files:
        key = ((*file.truth, file.protocol), file.shown_of_several, file.older)
        groups.setdefault(key, []).append(file)
    ranked = []
    for (truth, seen, older), members in groups.items():
        task = truth[0]
        together = [f for f in files if (*f.truth, f.protocol, f.older) == (*truth, older)]
        _require_same_rows(together)
        require_same_floors(together)
        names = [name for name, score in wanted.items() if task in score.tasks]
        behind_first = sorted(HEADLINE[task], key=lambda name: name != BEHIND)
        headline = [n for n in behind_first if n != BEHIND or seen in ("first_view", "no_view")]
        there = [n for n in headline if any(n in file.metrics for file in members)]
        columns = _columns(members, names or there or HEADLINE[task][:1], headline=not names)
        figures = _figures(members, columns) if paper else []
        ranked.append(_ranking(members, files, columns, figures, cards or {}))
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
                "both claim to score the whole of one test set",
            )


def _columns(files: Sequence[ScoreFile], names: Sequence[str], headline: bool) -> dict[str, Column]:
    """Return the columns by key: scores, and skills where any file has them.

    In the headline the skills stand before all scores that they are made of; else after each.
    """
    skilled = [name for name in names if any(name in file.skills for file in files)]
    if headline:
        others = [name for name in names if name not in skilled]
        keys = [*others, *(SKILL_OF + name for name in skilled), *skilled]
    else:
        keys = [k for n in names for k in ((n, SKILL_OF + n) if n in skilled else (n,))]
    return {
        key: score_column(key, files[0].unit_of(key))
        if key in names
        else skill_column(key.removeprefix(SKILL_OF))
        for key in keys
    }


def _figures(files: Sequence[ScoreFile], columns: Mapping[str, Column]) -> list[Figure]:
    """Return the paper's figures of the shown scores; none beside other kinds of questions."""
    if any(set(file.by_distractor) - {PAPER_KIND} for file in files):
        return []
    figures = [f for table in tables_beside(files[0]) if not table.ablation for f in table.figures]
    return [f for f in figures if f.metric in columns and f.view_angle is None]


def _ranking(
    members: Sequence[ScoreFile],
    files: Sequence[ScoreFile],
    columns: Mapping[str, Column],
    figures: Sequence[Figure],
    cards: Mapping[str, Card],
) -> Ranking:
    """Return what is shown of a test set that these members of the files score."""
    labels = labels_of(members)
    order = _order(members, columns)
    ranked = [members[i] for i in order]
    key, first = next(iter(columns)), ranked[0]  # comparable, if any is
    mute = _why_none_is_told_apart(first, key)
    ranks = [""] * len(order) if mute else _ranks(ranked, key)
    entries = []
    for i, rank in zip(order, ranks, strict=True):
        file, card = members[i], cards.get(members[i].method, Card())
        label = _label(file, labels[i], card.supervised)
        cells = card_cells(card, file) if cards else {}
        entries.append(Entry(label, file, _by_key(file), own_floors(file), rank, cells))
    title = _title(first)
    notes = [*filter(None, [mute]), *_notes(ranked, key), *_same_request_notes(members, files)]
    floors = floor_cells(first, [key for key in columns if not key.startswith(SKILL_OF)])
    skill = SKILL_OF + key.removeprefix(SKILL_OF)
    line = next((label for label, row in floors.items() if skill in row and not mute), "")
    tables = [
        build_table(
            f"{title}: scores" if i else title,
            part,
            entries,
            {k: row for k, row in floors.items() if row.keys() & part.keys()},
            figure_cells([f for f in figures if f.metric in part]),
            [AS_RANKED] if i else notes,
            lambda a, b, k: not mute and bool(_differ(a.file, b.file, k)),
            line,
            ranked=not i,
        )
        for i, part in enumerate(_parts(columns))
    ]
    return Ranking(tuple(entries), tuple(tables), mute)


def _order(files: Sequence[ScoreFile], columns: Mapping[str, Column]) -> list[int]:
    """Indices of the files: comparable ones from best to worst, those without a score, others.

    The first column decides; where it is equal, the second one does, and so on. Among files that
    are not better than the floor, the second one begins: how much worse they are tells nothing.
    """
    first = next(iter(columns))

    def place(i: int) -> tuple[bool, bool, bool, list[tuple[bool, float]]]:
        scores, values = _by_key(files[i]), []
        for key, column in columns.items():
            sign = -1.0 if column.higher_is_better else 1.0
            values.append((key not in scores, sign * scores[key].value if key in scores else 0.0))
        above = _beats_the_floor(files[i], first)
        return not files[i].comparable, first not in scores, not above, values[not above :]

    return sorted(range(len(files)), key=place)


def _beats_the_floor(file: ScoreFile, key: str) -> bool:
    """Return whether the interval of a score's skill lies above 0, or there is no floor to beat."""
    skill = file.skills.get(key.removeprefix(SKILL_OF))
    return skill is None or (skill.value if skill.low is None else skill.low) > 0.0


def _ranks(files: Sequence[ScoreFile], key: str) -> list[str]:
    """Return the ranks of files, best first, by a column; empty for those that have none."""
    ranks, place, first = list[str](), "", None
    for count, file in enumerate(files, 1):
        is_ranked = file.comparable and key in _by_key(file) and _beats_the_floor(file, key)
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

    Skills over a floor that the files do not share are told apart where their own intervals do not
    meet.
    """
    name = key.removeprefix(SKILL_OF)
    if name == key or is_shared(name):
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
        why = "no image shows an object that counts, so the empty room is the truth"
    elif scored < 2:
        why = f"only {scored} of {scenes} {file.unit} has a score of {metric(name).title}"
    else:
        return ""
    return f"This test set cannot tell methods apart: {why}. No method has a rank."


def _parts(columns: Mapping[str, Column]) -> list[dict[str, Column]]:
    """Return the columns as one table; where it would be too wide, skills and scores apart."""
    skills = {key: column for key, column in columns.items() if key.startswith(SKILL_OF)}
    scores = {key: column for key, column in columns.items() if key not in skills}
    return [skills, scores] if skills and len(columns) > WIDEST else [dict(columns)]


def _title(file: ScoreFile) -> str:
    """Return the test set in words: how much of what, and its name."""
    test = known_test(file.meta.truth_digest)
    name = plain(test.name if test else Path(file.meta.truth_path).name)
    if file.task == "iqtt":
        kind = f" of the kind {plain(*file.by_distractor)}" if len(file.by_distractor) == 1 else ""
        return f"Mental rotation: {len(file.ids):,} questions{kind}, {name}"
    if file.task == "measured":
        groups = f" of {len(np.unique(file.clusters)):,} groups" if file.grouped else ""
        return f"Measured depth: {len(file.ids):,} images{groups}, {name}, protocol {file.protocol}"
    task = {"first_view": "Rooms from the first view", "no_view": "Rooms from no view"}.get(
        file.shown_of_several or "", "Rooms"
    )
    scenes, views = (len(np.unique(c)) for c in (file.clusters, file.columns["view_index"]))
    angles = file.columns.get("view_angle_degrees", np.zeros(0))
    widest = np.abs(angles[np.isfinite(angles)]).max(initial=0)
    span = f" from 0° to {widest:g}°" if widest > 0 else ""
    each = f" in {views} views{span}" if views > 1 else ""
    return f"{task}: {scenes:,} scenes{each}, {name}"


def _label(file: ScoreFile, name: str, supervised: bool) -> str:
    """Return a method's name with what has to be known about it."""
    texts = ["supervised"] * supervised + [f"{file.runs} runs"] * (file.runs > 1)
    if file.alignment != "none":
        claim = metric(f"rmse_after_{file.alignment}").title.partition(", ")[2]
        texts.append(f"scored {claim}")
    if file.unread is not None:
        texts.append(f"{file.unread:.0%} of replies unread")
    mark = "" if file.comparable else f" {INCOMPARABLE_MARK}"
    return name + (f" ({'; '.join(texts)})" if texts else "") + mark


def _notes(files: Sequence[ScoreFile], key: str) -> Iterator[str]:
    first, name = files[0], key.removeprefix(SKILL_OF)
    truth = f", truth {first.meta.truth_digest[:12]}"
    if first.task != "iqtt":
        clusters = f"{len(np.unique(first.clusters)):,} {first.unit}"
        yield f"{len(first.ids):,} images of {clusters}{truth}."
        if first.older:
            yield (
                "These are files of format 1.0, in which Chamfer, Hausdorff and others are defined"
                f" otherwise: {SCORE_AGAIN}."
            )
        if first.shown_of_several is not None:
            yield (
                f"These methods were shown {VIEWS_SEEN[first.shown]}; others have their own list."
            )
    else:
        chance = 1.0 / first.meta.counts["answers"]
        yield f"{len(first.ids):,} questions{truth}; chance is {chance:.4f}."
    if any(file.skills for file in files):
        yield f"{SKILL} {what_the_floor_is(first)}"
    yield (
        f"[low, high]: {INTERVAL} over {first.unit}."
        " ±: standard deviation over training runs. Bold: better than the next best method, and the"
        " 95% interval of their paired difference does not hold 0."
    )
    yield SHARED
    yield from (f"{file.method}: {text}." for file in files for text in floor_sentences(file))
    scored = first.metrics[name].n if first.task != "iqtt" and name in first.metrics else 0
    warnings = (
        too_few_warning(scored, f"{first.unit} with a score of {metric(name).title}")
        if scored
        else []
    )
    yield from (f"Warning: {text}." for text in few_clusters(first) or warnings)


def _same_request_notes(members: Sequence[ScoreFile], files: Sequence[ScoreFile]) -> Iterator[str]:
    """Yield a note on each other test set that the same request made."""
    requests = {file.meta.truth_fingerprint for file in members}
    digests = {f.meta.truth_digest for f in files if f.meta.truth_fingerprint in requests}
    for digest in sorted(digests - {members[0].meta.truth_digest}):
        yield (
            f"Not ranked with truth {digest[:12]}: it answers the same request, but its content"
            " differs, so its scores are ranked separately."
        )
