"""Score files side by side: one ranking for each test set, with the paper's figures beside it.

Scores of different test sets never share a ranking. Scores that are not comparable stand below it,
and so do the paper's figures, which were measured on the authors' data; neither has a rank.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from metrics.leaderboard.names import check_names
from metrics.leaderboard.paper_tables import REPORTED, SOURCE, TABLES, Figure, PaperTable
from metrics.leaderboard.table import (
    INCOMPARABLE_MARK,
    REPORTED_MARK,
    Table,
    build_table,
    column_head,
    reported_rows,
)
from metrics.measures.answers import CHANCE
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.scoring.records import ID_COLUMNS, ScoreFile
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import by_number, distinct, number, plain


class LeaderboardError(SceneGenError):
    """Score files that cannot stand in one table."""


def leaderboard(
    files: Sequence[ScoreFile], metrics: Sequence[str] | None = None, *, paper: bool = True
) -> tuple[Table, ...]:
    """Return tables of these scores, grouped by test set in the order of the files.

    A test set is what the digest of its truth says, wherever its file lay and whatever made it.

    Args:
        files: any number, of any test sets.
        metrics: the scores to show; the first one ranks. A task that has none of them, or any task
            if they are None, shows `metric_names.HEADLINE`.
        paper: whether to show the paper's figures: those of the shown scores in each ranking, and
            below all rankings the paper's tables of which some figure found no place.

    Raises LeaderboardError where files that claim to score all of one test set score different
    rows of it, LookAlikeError for names that could be taken for others, and UnknownMetricError.
    """
    check_names(files)
    chosen = {name: metric(name).task for name in metrics or ()}
    groups: dict[tuple[str, str], list[ScoreFile]] = {}
    for file in files:
        groups.setdefault((file.task, file.meta.truth_digest), []).append(file)
    tables: list[Table] = []
    shown: set[Figure] = set()
    for (task, digest), members in groups.items():
        _require_same_rows(members)
        names = [name for name in chosen if chosen[name] == task] or HEADLINE[task]
        figures = [f for t in TABLES for f in t.figures if paper and f.metric in names]
        asked = {file.meta.truth_fingerprint for file in members}
        same_request = {f.meta.truth_digest for f in files if f.meta.truth_fingerprint in asked} - {
            digest
        }
        for table, used in _tables(members, names, figures, sorted(same_request)):
            tables.append(table)
            shown.update(used)
    if paper:
        tables += [_paper_table(t) for t in TABLES if not shown.issuperset(t.figures)]
    return tuple(tables)


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
    names: Sequence[str],
    figures: Sequence[Figure],
    same_request: Sequence[str],
) -> Iterator[tuple[Table, list[Figure]]]:
    """Yield the ranking of a test set, then each score by view angle where any file has that.

    With each table come the figures of the paper that it shows. `same_request` has the digests
    of other test sets, which the same request made.
    """
    labels = distinct([f.method for f in files], [f.path.stem if f.path else "" for f in files])
    ranked = [(_label(files[i], labels[i]), files[i]) for i in _order(files, names[0])]
    first = ranked[0][1]
    what = "Rooms" if first.task == "rooms" else "3D-IQTT"
    test = known_test(first.meta.truth_digest)
    title = f"{what}, {plain(test.name) if test else f'truth {first.meta.truth_digest[:12]}'}"
    used = [f for f in figures if f.view_angle is None]
    table = build_table(
        title,
        {name: (name, column_head(name)) for name in names},
        [(label, file.comparable, file.metrics) for label, file in ranked],
        _by_row(used, _figure_label, lambda figure: figure.metric),
        [*_notes([file for _, file in ranked], names), *map(_same_request_note, same_request)],
        ranked=True,
    )
    yield table, used
    for name in names:
        entries = []
        for label, file in ranked:
            found = {a: s[name] for a, s in file.by_view_angle.items() if name in s}
            entries.append((label, file.comparable, found))
        angles = by_number({angle for _, _, scores in entries for angle in scores})
        if angles:
            used = [f for f in figures if f.metric == name and str(f.view_angle) in angles]
            table = build_table(
                f"{title}: {column_head(name)} by view angle",
                {angle: (name, f"{angle}°") for angle in angles},
                entries,
                _by_row(used, _figure_label, lambda figure: str(figure.view_angle)),
                ["Angle between each view and its scene's first one. Rows as in the ranking."],
                ranked=False,
            )
            yield table, used


def _order(files: Sequence[ScoreFile], name: str) -> list[int]:
    """Indices of the files: comparable ones from best to worst, those without a score, others."""

    def place(i: int) -> tuple[bool, bool, float]:
        score = files[i].metrics.get(name)
        sign = -1.0 if metric(name).higher_is_better else 1.0
        return not files[i].comparable, score is None, sign * score.value if score else 0.0

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


def _notes(files: Sequence[ScoreFile], names: Sequence[str]) -> Iterator[str]:
    first = files[0]
    clusters = len(np.unique(first.clusters))
    if first.task == "rooms":
        yield f"{len(first.ids):,} images of {clusters:,} scenes."
    else:
        yield f"{clusters:,} questions; chance is {CHANCE:.4f}."
    levels = " and ".join(
        f"{level:.4g}%" for level in sorted({100.0 * f.meta.confidence for f in files})
    )
    yield (
        f"[low, high]: {levels} interval over {'scenes' if first.task == 'rooms' else 'questions'}."
        " ±: standard deviation over training runs. Best in bold, which is no test of a difference:"
        " see bench compare."
    )
    floors = [f.meta.noise_floors["chamfer"] for f in files if "chamfer" in f.meta.noise_floors]
    if floors and "chamfer" in names:
        yield f"Noise floor of Chamfer at this resolution: {number(max(floors))} scene units."


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
        f"{SOURCE}, Table {table.number}: {REPORTED}. {table.caption}",
        keys,
        reported_rows(rows, keys),
        (f"{REPORTED_MARK} {REPORTED}. Unit: {table.unit}.", table.remark),
    )
