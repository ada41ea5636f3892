"""Score files side by side: one ranking for each test set, with the paper's figures beside it.

Scores of different test sets never share a ranking. Scores that are not comparable stand below it,
and so do floors and the paper's figures, which were measured on the authors' data; none has a rank.
"""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from metrics.leaderboard.floors import (
    FLOOR,
    SKILL_OF,
    FloorRows,
    floor_rows,
    floors_table,
    is_shared,
    kind_floor_rows,
    own_floors,
    require_same_floors,
    skill_key,
)
from metrics.leaderboard.table import (
    INCOMPARABLE_MARK,
    REPORTED_MARK,
    Column,
    Entry,
    Table,
    build_table,
    reported_rows,
    score_column,
    skill_column,
)
from metrics.report.curves import angle_floors
from metrics.report.paper_tables import REPORTED, SOURCE, TABLES, Figure, PaperTable
from metrics.report.text import FLOORS_OF_ROOMS, SKILL, what_the_floor_is
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import EMPTY_ROOM, HEADLINE, metric
from metrics.scoring.records import ID_COLUMNS, Score, ScoreFile, Skill
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import by_number, distinct, plain

Paper = Literal["all", "task", "none"]
WIDEST = 6  # columns of scores in one table
PAPER_KINDS = {"other"}  # of the paper's questions; its figures stand beside no other kind
ANGLES = "Angle between each view and its scene's first one."
KINDS = 'Kinds of wrong answers; "-2" ends those of questions with two answers.'


class LeaderboardError(SceneGenError):
    """Score files that cannot stand in one table."""


def leaderboard(
    files: Sequence[ScoreFile], metrics: Sequence[str] | None = None, *, paper: Paper = "task"
) -> tuple[Table, ...]:
    """Return tables of these scores, grouped by test set in the order of the files.

    A test set is what the digest of its truth says, wherever its file lay and whatever made it.

    Args:
        files: any number, of any test sets.
        metrics: the scores to show; the first one ranks. A task that has none of them, or any task
            if they are None, shows `metric_names.HEADLINE`, skills before the scores themselves.
        paper: which of the paper's figures to show: "none"; or those of the shown scores in each
            ranking, and below all rankings the paper's tables of which some figure found no place,
            "all" of them or those of the files' tasks.

    Raises LeaderboardError where a file is given twice or files that claim to score all of one test
    set score different rows of it, FloorError where they state different floors of it,
    and UnknownMetricError.
    """
    _require_once(files)
    chosen = {name: metric(name).task for name in metrics or ()}
    groups: dict[tuple[str, str], list[ScoreFile]] = {}
    for file in files:
        groups.setdefault((file.task, file.meta.truth_digest), []).append(file)
    tables: list[Table] = []
    shown: set[Figure] = set()
    for (task, digest), members in groups.items():
        _require_same_rows(members)
        require_same_floors(members)
        names = [name for name in chosen if chosen[name] == task]
        there = [n for n in HEADLINE[task] if any(n in file.metrics for file in members)]
        columns = _columns(members, names or there or HEADLINE[task][:1], headline=not names)
        figures = [
            figure
            for table in TABLES
            for figure in table.figures
            if paper != "none" and not table.ablation and figure.metric in columns
        ]
        if any(set(file.by_distractor) - PAPER_KINDS for file in members):
            figures = []
        asked = {file.meta.truth_fingerprint for file in members}
        same_request = {f.meta.truth_digest for f in files if f.meta.truth_fingerprint in asked} - {
            digest
        }
        for table, used in _tables(members, columns, figures, sorted(same_request)):
            tables.append(table)
            shown.update(used)
    floors = floors_table(files)
    tables += [floors] if floors else []
    if paper != "none":
        tasks = {file.task for file in files if paper == "task"} or {"rooms", "iqtt"}
        kept = (
            replace(t, figures=tuple(f for f in t.figures if metric(f.metric).task in tasks))
            for t in TABLES
        )
        tables += [_paper_table(t) for t in kept if not shown.issuperset(t.figures)]
    return tuple(tables)


def _require_once(files: Sequence[ScoreFile]) -> None:
    """Raise LeaderboardError where two files hold scores of the same submissions."""
    for one, other in itertools.combinations(files, 2):
        hashes = ({run.sha256 for run in file.meta.submissions} for file in (one, other))
        same = next(hashes) == next(hashes)
        if same and one.meta.truth_digest == other.meta.truth_digest:
            found = f"scores of the same submissions as {one.place}"
            raise LeaderboardError(other.place, found, "each submission once")


def _columns(files: Sequence[ScoreFile], names: Sequence[str], headline: bool) -> dict[str, Column]:
    """Return the columns by key: scores, and skills where any file has them.

    In the headline the skills stand before all scores that they are made of; else after each.
    """
    skilled = [name for name in names if any(name in file.skills for file in files)]
    skills = {skill_key(name): skill_column(name) for name in skilled}
    if headline:
        scores = sorted(names, key=lambda name: name in skilled)
        split = len(names) - len(skilled)
        first, last = (
            {name: score_column(name) for name in part} for part in (scores[:split], scores[split:])
        )
        return {**first, **skills, **last}
    found: dict[str, Column] = {}
    for name in names:
        found[name] = score_column(name)
        if name in skilled:
            found[skill_key(name)] = skills[skill_key(name)]
    return found


def _parts(columns: Mapping[str, Column]) -> list[dict[str, Column]]:
    """Return the columns as one table; where it would be too wide, skills and scores apart."""
    skills = {key: column for key, column in columns.items() if key.startswith(SKILL_OF)}
    scores = {key: column for key, column in columns.items() if key not in skills}
    return [skills, scores] if skills and len(columns) > WIDEST else [dict(columns)]


def _shown(file: ScoreFile) -> dict[str, Score | Skill]:
    """Return the scores of a file, and their skills, by the keys of their columns."""
    return {**file.metrics, **{skill_key(name): one for name, one in file.skills.items()}}


def _require_same_rows(files: Sequence[ScoreFile]) -> None:
    whole = [file for file in files if file.comparable]
    for file in whole[1:]:
        if not np.array_equal(np.sort(file.ids), np.sort(whole[0].ids)):
            what = ID_COLUMNS[file.task][0]
            raise LeaderboardError(
                file.place,
                f"{len(file.ids)} {what}s",
                f"the {len(whole[0].ids)} of {whole[0].place}",
                "both claim to score the whole of one test set",
            )


def _tables(
    files: Sequence[ScoreFile],
    columns: Mapping[str, Column],
    figures: Sequence[Figure],
    same_request: Sequence[str],
) -> Iterator[tuple[Table, list[Figure]]]:
    """Yield the ranking of a test set, then its scores by view angle or by kind of question.

    With each table come the figures of the paper that it shows. `same_request` has the digests
    of other test sets, which the same request made.
    """
    labels = distinct([f.method for f in files], [f.path.stem if f.path else "" for f in files])
    order = _order(files, columns)
    ranked = [(_label(files[i], labels[i]), files[i]) for i in order]
    first = ranked[0][1]  # comparable, if any is
    title, names = _title(first), [name for name in columns if not name.startswith(SKILL_OF)]
    notes = [*_notes([file for _, file in ranked]), *map(_same_request_note, same_request)]
    shown = [(label, file, _shown(file), own_floors(file)) for label, file in ranked]
    for i, part in enumerate(_parts(columns)):
        used = [f for f in figures if f.view_angle is None and f.metric in part]
        table = build_table(
            f"{title}: scores" if i else title,
            part,
            shown,
            {k: row for k, row in floor_rows(first, names).items() if row.keys() & part.keys()},
            _by_row(used, _figure_label, lambda figure: figure.metric),
            ["Rows as in the ranking."] if i else notes,
            ranked=not i,
        )
        yield table, used
    by_angle = first.task == "rooms"
    for name in names:
        entries: list[Entry] = []
        for label, file in ranked:
            groups = file.by_view_angle if by_angle else file.by_distractor
            found = {key: scores[name] for key, scores in groups.items() if name in scores}
            own = {} if is_shared(name) else angle_floors(file, name)
            entries.append((label, file, found, own))
        keys = by_number({key for _, _, scores, _ in entries for key in scores})
        if len(keys) < (1 if by_angle else 2):  # a single kind stands in the title
            continue
        used = [f for f in figures if f.metric == name and str(f.view_angle) in keys]
        column = score_column(name)
        table = build_table(
            f"{title}: {column.head} by {'view angle' if by_angle else 'kind of question'}",
            {key: replace(column, head=f"{key}°" if by_angle else plain(key)) for key in keys},
            entries,
            _floors_of_groups(first, name, keys),
            _by_row(used, _figure_label, lambda figure: str(figure.view_angle)),
            [ANGLES if by_angle else KINDS, "Rows as in the ranking."],
            ranked=False,
        )
        yield table, used


def _floors_of_groups(file: ScoreFile, name: str, keys: Sequence[str]) -> FloorRows:
    """Return the rows of floors below scores by view angle, or by kind of question."""
    if file.task == "iqtt":
        return kind_floor_rows(file, keys)
    found = angle_floors(file, name) if is_shared(name) else {}
    return {FLOOR + FLOORS_OF_ROOMS[EMPTY_ROOM]: found} if found else {}


def _title(file: ScoreFile) -> str:
    """Return task and truth, and the kind of the questions if all have one."""
    what = "Rooms" if file.task == "rooms" else "3D-IQTT"
    if len(file.by_distractor) == 1:
        what += f", {plain(*file.by_distractor)} questions"
    test = known_test(file.meta.truth_digest)
    return f"{what}, {plain(test.name) if test else f'truth {file.meta.truth_digest[:12]}'}"


def _order(files: Sequence[ScoreFile], columns: Mapping[str, Column]) -> list[int]:
    """Indices of the files: comparable ones from best to worst, those without a score, others.

    The first column decides; where it is equal, the second one does, and so on.
    """

    def place(i: int) -> tuple[bool, list[tuple[bool, float]]]:
        shown, values = _shown(files[i]), []
        for key, column in columns.items():
            sign = -1.0 if column.higher_is_better else 1.0
            values.append((key not in shown, sign * shown[key].value if key in shown else 0.0))
        return not files[i].comparable, values

    return sorted(range(len(files)), key=place)


def _label(file: ScoreFile, name: str) -> str:
    told = [f"{file.runs} runs"] if file.runs > 1 else []
    if file.alignment != "none":
        claim = metric(f"rmse_after_{file.alignment}").title.partition(", ")[2]
        told.append(f"claims depth when {claim}")
    mark = "" if file.comparable else f" {INCOMPARABLE_MARK}"
    return name + (f" ({'; '.join(told)})" if told else "") + mark


def _by_row(
    figures: Iterable[Figure], label: Callable[[Figure], str], key: Callable[[Figure], str]
) -> dict[str, dict[str, Figure]]:
    """Figures of the paper by the label of their row, then by the key of their column."""
    rows: dict[str, dict[str, Figure]] = {}
    for figure in figures:
        rows.setdefault(f"{label(figure)} {REPORTED_MARK}", {})[key(figure)] = figure
    return rows


def _figure_label(figure: Figure) -> str:
    labels = "" if figure.labels is None else f", {figure.labels} labels"
    return f"{figure.method}, {figure.data}{labels} (Table {figure.table})"


def _notes(files: Sequence[ScoreFile]) -> Iterator[str]:
    first, counts = files[0], files[0].meta.counts
    if first.task == "rooms":
        yield f"{len(first.ids):,} images of {len(np.unique(first.clusters)):,} scenes."
    else:
        chance = f"; chance is {1.0 / counts['answers']:.4f}" if "answers" in counts else ""
        yield f"{len(first.ids):,} questions{chance}."
    if any(file.skills for file in files):
        yield f"{SKILL} {what_the_floor_is(first)}"
    levels = " and ".join(
        f"{level:.4g}%" for level in sorted({100.0 * f.meta.confidence for f in files})
    )
    over = (
        "scenes" if first.task == "rooms" else "shapes" if "shape" in first.items else "questions"
    )
    yield (
        f"[low, high]: {levels} interval over {over}. ±: standard deviation over training runs."
        " Best in bold, which is no test of a difference: see bench compare."
    )
    if first.meta.noise_floors:
        yield (
            "Noise floor: the score of the true surface, sampled elsewhere, against itself. Floors"
            " are as the score files state them; files that disagree are refused. A relief has a"
            " floor of its own beside it."
        )


def _same_request_note(digest: str) -> str:
    return (
        f"Not ranked with truth {digest[:12]}: it answers the same request, but its content"
        " differs, so its scores are ranked separately."
    )


def _paper_table(table: PaperTable) -> Table:
    """A table of the paper on its own."""

    def key(figure: Figure) -> str:
        angle = "" if figure.view_angle is None else f" {figure.view_angle}°"
        labels = "" if figure.labels is None else f", {figure.labels} labels"
        return metric(figure.metric).title + angle + labels

    keys = tuple(dict.fromkeys(map(key, table.figures)))
    rows = _by_row(table.figures, lambda figure: f"{figure.method}, {figure.data}", key)
    return Table(
        f"{SOURCE}, {table.kind} {table.number}: {REPORTED}. {table.caption}",
        keys,
        reported_rows(rows, keys),
        (f"{REPORTED_MARK} {REPORTED}. Unit: {table.unit}.", table.remark),
    )
