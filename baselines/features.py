"""Answers by features of a frozen encoder, anyone's: the nearest one, or a probe of labels.

The encoder runs elsewhere. Its features come as .npy files of (Q, 1 + K, D) numbers, the reference
first, in the order of the file's questions.

`probe` asks the hidden layers of an encoder of transformers, without labels: which of them knows a
shape turned? Its features are means over the tokens, or over the places of a map. Mason et al. 2025
(arXiv 2509.15271) ask the same of four encoders.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.outline import check_training, open_labelled
from iqtt.files.reader import QuestionsFile, open_questions
from iqtt.files.split import ANSWERS
from metrics.intake.array_files import read_array
from metrics.prediction_writer import write_answers
from metrics.score_file import write_scores
from metrics.scoring.evaluate import score
from metrics.scoring.records import ScoreFile
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check
from scenegen.files.new_file import check_writable
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.preview import srgb_bytes

Array = NDArray[Any]
FOLDS = 5  # of the choice of how strongly weights are held near 0
STRENGTHS = (1e-3, 1e-2, 1e-1, 1.0, 10.0)
Features = Callable[[Array], list[Array]]
PREFIX = "hf:"
TEST = "iqtt-test.h5"


def write_features(
    data: str | Path,
    out: str | Path,
    features: str | Path,
    *,
    train: str | Path | None = None,
    train_features: str | Path | None = None,
    labels: int | None = None,
    overwrite: bool = False,
) -> None:
    """Answer the questions of a file by features of their pictures.

    Without labels the answer of the greatest cosine with the reference wins. With labels a Siamese
    probe weighs the squared differences of each dimension by logistic regression.

    Args:
        features: .npy of the questions of `data`; train_features: of the labelled ones of `train`,
            or of its first ones.
        labels: how many of the labelled questions to learn from, the first ones; all by default.

    Raises SpecError as `check_training`, and where features of training are missing or not used;
    FileFormatError where features do not fit or are not finite; else as `open_questions`,
    `read_array` and `write_answers`.
    """
    check_writable(Path(out), overwrite)
    with open_questions(data) as questions:
        seen = read_features(features, len(questions), questions)
    if train is None or train_features is None:
        name, given = ("train_features", train) if train else ("train", train_features)
        check(given is None, name, "none", f"one that belongs to {given}")
        check(labels is None, "labels", labels, "none, as nothing is learned without --train")
        scores, notes = cosines_with_reference(seen), "cosine of features; no labels"
    else:
        with open_labelled(train) as labelled:
            count = check_training(questions, labelled, labels, least=2 * FOLDS)
            learned = read_features(train_features, count, labelled)
            if learned.shape[2] != seen.shape[2]:
                found, expected = (f"{one.shape[2]} numbers per image" for one in (learned, seen))
                raise FileFormatError(train_features, found, f"{expected}, as {features} has")
            right = labelled.read("answers", slice(0, count)).astype(int)
        scores, notes = probe_scores(learned, right, seen), f"a probe of {count} labels of {train}"
    write_answers(out, data, method="features", scores=scores, notes=notes, overwrite=overwrite)


def read_features(path: str | Path, count: int, questions: QuestionsFile) -> Array:
    """Return the features of the first questions, (count, 1 + K, D) float64 of length 1.

    Raises as `read_array`; FileFormatError where there are none of so many questions, or not finite
    ones.
    """
    values, pictures = read_array(Path(path)), 1 + questions.answers
    expected = f"numbers of the shape ({count}, {pictures}, D)"
    fits = values.ndim == 3 and values.shape[1] == pictures and values.size
    if not fits or not count <= len(values) <= len(questions):
        raise FileFormatError(path, f"the shape {values.shape}", expected)
    if values.dtype.kind not in "fiu":
        raise FileFormatError(path, f"values of {values.dtype}", expected)
    read = np.asarray(values[:count], np.float64)
    if not np.isfinite(read).all():
        row = int(np.flatnonzero(~np.isfinite(read).all(axis=(1, 2)))[0])
        raise FileFormatError(f"{path}: row {row}", "features that are not finite", "numbers")
    return of_length_one(read)


def of_length_one(features: Array) -> Array:
    """Return features (..., D) divided by their lengths, as float64; 0 stays 0."""
    values = np.asarray(features, np.float64)
    for norm in (np.inf, 2):  # the first, so that no square overflows
        length = np.linalg.norm(values, norm, axis=-1, keepdims=True)
        values = values / np.where(length > 0, length, 1)
    return values


def cosines_with_reference(features: Array) -> Array:
    """Return the cosine of each answer with the reference, (Q, K)."""
    cosines: Array = np.einsum("qd,qkd->qk", features[:, 0], features[:, 1:])
    return cosines


def probe_scores(learned: Array, right: Array, seen: Array) -> Array:
    """Return scores of answers, (Q, K), by weights of dimensions that labelled questions teach.

    Args:
        learned, seen: features of length 1, (N, 1 + K, D) and (Q, 1 + K, D).
        right: the right answers of the N questions.
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.model_selection import GroupKFold, cross_val_score

    columns, asked = (np.square(f[:, 1:] - f[:, :1]) for f in (learned, seen))
    spread = columns.std(axis=(0, 1))
    scale = np.where(spread > 0, spread, 1)
    count, answers, width = columns.shape
    flat = (columns / scale).reshape(-1, width)
    is_right = (np.arange(answers) == right[:, None]).reshape(-1)
    folds = list(GroupKFold(FOLDS).split(flat, groups=np.repeat(np.arange(count), answers)))
    probes = [LogisticRegression(C=strength, max_iter=1000) for strength in STRENGTHS]
    merits = [
        cross_val_score(probe, flat, is_right, cv=folds, scoring="neg_log_loss").mean()
        for probe in probes
    ]
    weights = probes[int(np.argmax(merits))].fit(flat, is_right).coef_[0] / scale
    return np.asarray(asked @ weights)


def split_paths(data: str | Path) -> tuple[Path, Path]:
    """Return the test questions of a split's folder and their answers; a file's lie beside it."""
    path = Path(data) / TEST if Path(data).is_dir() else Path(data)
    return path, path.with_name(ANSWERS)


def encoder(name: str, device: str = "cpu") -> tuple[str, Features]:
    """Return a title with the revision, and a function from pictures to the features of all layers.

    The function takes sRGB bytes, (N, H, W, 3), and gives (N, D) float32 for each layer, the
    embedding first. Raises SpecError for a name that transformers cannot load.
    """
    import torch
    from transformers import AutoImageProcessor, AutoModel

    named = name.removeprefix(PREFIX)
    try:
        processor = AutoImageProcessor.from_pretrained(named)
        whole = AutoModel.from_pretrained(named)
    except (OSError, ValueError, ImportError) as error:
        found = " ".join(f"{error}".split())[:300]
        raise SpecError(name, found, "an encoder of images that transformers loads") from error
    network = getattr(whole, "vision_model", whole).to(device).eval()  # of CLIP, without its text
    revision = getattr(whole.config, "_commit_hash", None)

    @torch.inference_mode()
    def features(pictures: Array) -> list[Array]:
        pixels = processor(images=list(pictures), return_tensors="pt")["pixel_values"].to(device)
        told = network(pixels, output_hidden_states=True)
        layers = getattr(told, "hidden_states", None)
        if layers is None:
            raise SpecError(name, f"{type(network).__name__} without hidden states", "an encoder")
        axes = {3: (1,), 4: (2, 3)}  # tokens (N, T, D), or a map (N, D, h, w)
        return [layer.float().mean(dim=axes[layer.ndim]).cpu().numpy() for layer in layers]

    title = Path(named).resolve().name if Path(named).exists() else named
    return f"{title}@{revision[:7]}" if revision else title, features


def probe(
    name: str,
    data: str | Path,
    out: str | Path,
    *,
    device: str = "cpu",
    batch: int = 8,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[ScoreFile]:
    """Write answers and scores of every layer to a folder; return the scores in their order.

    Memory does not grow with the number of questions: of each, only its cosines are kept.

    Args:
        name: of the encoder, such as `hf:facebook/dinov2-base`.
        data: a split's folder, or its test questions beside their answers.
        out: the folder, which must not be there.
        batch: questions that go through the encoder at a time.

    Raises as `encoder`, `open_questions`, `write_answers` and `evaluate.score`; OSError for `out`.
    """
    questions_path, answers_path = split_paths(data)
    with open_questions(questions_path) as questions:
        if not answers_path.exists():
            raise SpecError("--data", f"no {answers_path}", "an answer key next to the questions")
        title, features = encoder(name, device)
        parts = list(_cosines(questions, features, batch, progress))
    Path(out).mkdir(parents=True)
    found = []
    for layer in range(len(parts[0])):
        path = Path(out) / f"layer-{layer:02d}.h5"
        scores = np.concatenate([part[layer] for part in parts])
        method = f"{title} layer {layer}"
        notes = "cosine of mean features; nothing is learned"
        write_answers(path, questions_path, method=method, scores=scores, notes=notes)
        found.append(score([path], answers_path))
        write_scores(found[-1], path.with_suffix(".json"))
    return found


def _cosines(
    questions: QuestionsFile, features: Features, batch: int, progress: Callable[[int], Any]
) -> Iterator[list[Array]]:
    """Yield cosines (Q, K) of each layer, for some questions after others."""
    for start in range(0, len(questions), batch):
        stored = questions.read("questions", slice(start, min(start + batch, len(questions))))
        pictures = srgb_bytes(decode_image(stored))
        count, shown = pictures.shape[:2]
        layers = features(pictures.reshape(-1, *pictures.shape[2:]))
        yield [
            cosines_with_reference(of_length_one(layer.reshape(count, shown, -1)))
            for layer in layers
        ]
        progress(count)


def accuracies(scores: ScoreFile) -> dict[str, Any]:
    """Return accuracy with its interval by kind of question."""
    return {kind: group.score for kind, group in scores.answer_groups["by_distractor"].items()}


def draw(scores: list[ScoreFile], out: Path, dpi: int = 150) -> None:
    """Draw accuracy by layer, a line for each kind, with its floor, to a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axes = figure.subplots()
    floors = scores[0].question_floors
    for i, kind in enumerate(accuracies(scores[0])):
        values = [accuracies(one)[kind] for one in scores]
        layers, colour = range(len(values)), f"C{i}"
        axes.plot(layers, [v.value for v in values], "o-", color=colour, ms=3, label=kind)
        axes.fill_between(
            layers, [v.low for v in values], [v.high for v in values], color=colour, alpha=0.15
        )
        if kind in floors:
            axes.axhline(floors[kind].accuracy, color=colour, ls="--", lw=1)
    method = re.sub(r" layer \d+$", "", scores[0].method)
    axes.set(xlabel="layer", ylabel="accuracy", title=method, ylim=(0, 1))
    axes.legend(fontsize=8, title="distractor type; dashed: baseline")
    figure.savefig(out, dpi=dpi, metadata={"Software": None})
