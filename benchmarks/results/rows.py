"""A row of a table: training runs of one method, and a score file for each test file."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.markdown import NOTHING
from benchmarks.results.steps import BUNDLED, Step
from metrics.score_file import ScoreFile, Skill, read_scores


@dataclass(frozen=True)
class Row:
    """A method with its settings.

    Attributes:
        name: of its folders and score files; no other row has it.
        predict: the command that writes a submission for {test} to {out}; it may name {weights},
            {seed} and {data}.
        train: the command that trains in folder {run} from {data}, with {seed} and maybe {start};
            empty where nothing is trained.
        data: the training file, for `train` or `predict`; or empty.
        start: a row whose weights of the same seed are {start}, where training begins with them.
        most_seeds: 1 where the seed changes nothing.
    """

    name: str
    predict: str
    train: str = ""
    data: str = ""
    start: "Row | None" = field(default=None, repr=False)
    most_seeds: int = 10


def steps(row: Row, test: str, truth: str, column: str, seeds: int) -> Iterator[Step]:
    """Yield what makes the score file of a row on one test file, over runs with seeds 0, 1, ..."""
    commands, reads, submissions = [], [test, truth], []
    for seed in range(min(seeds, row.most_seeds)):
        run, weights = _run(row, seed), _weights(row, seed)
        if row.train:
            yield from _training(row, seed)
            reads.append(weights)
        out = f"{run}-{column}.h5"
        words = {"data": row.data, "weights": weights, "seed": seed, "test": test, "out": out}
        commands.append(row.predict.format(**words))
        submissions.append(out)
    if not row.train:
        reads += filter(None, [BUNDLED, row.data])
    result = f"scores/{row.name}-{column}.json"
    commands.append(f"bench score {' '.join(submissions)} --truth {truth} --json {result}")
    yield Step(tuple(commands), result, tuple(reads), scratch=tuple(submissions))


def _training(row: Row, seed: int) -> Iterator[Step]:
    words = {"data": row.data, "seed": seed, "run": _run(row, seed)}
    reads = [row.data]
    if row.start:
        yield from _training(row.start, seed)
        words["start"] = _weights(row.start, seed)
        reads.append(words["start"])
    command = row.train.format(**words)
    yield Step((command,), _weights(row, seed), tuple(reads), run=_run(row, seed))


def _run(row: Row, seed: int) -> str:
    return f"runs/{row.name}-{seed}"


def _weights(row: Row, seed: int) -> str:
    return f"{_run(row, seed)}/weights.safetensors"


def scores(folder: Path, row: Row, column: str) -> ScoreFile | None:
    """Return the scores of a row on one test file; None where it is not scored yet."""
    path = folder / f"scores/{row.name}-{column}.json"
    return read_scores(path) if path.exists() else None


def cells(
    file: ScoreFile | None, part: str, names: Iterable[str], digits: int = 3, spread: bool = False
) -> list[str]:
    """Return scores as text, with their intervals or with their spread over runs.

    Args:
        part: "metrics", "skills", or an angle of views in degrees.
        names: of the metrics.
    """
    if file is None:
        return [NOTHING for _ in names]
    groups = {"metrics": file.metrics, "skills": file.skills}
    group = groups[part] if part in groups else file.by_view_angle.get(part, {})
    texts = []
    for name in names:
        score = group.get(name)
        if score is None:
            texts.append(NOTHING)
            continue
        text = f"{score.value:.{digits}f}"
        if spread and not isinstance(score, Skill):
            text += "" if score.std is None else f" ± {score.std:.{digits}f}"
        elif not spread and score.low is not None:
            text += f" [{score.low:.{digits}f}, {score.high:.{digits}f}]"
        texts.append(text)
    return texts
