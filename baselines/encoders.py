"""Mental rotation by the hidden layers of a frozen encoder: which of them knows a shape turned?

Pictures of a question go through an encoder of transformers. In every layer, the answer whose
features have the greatest cosine with those of the reference is taken; nothing is learned. Features
are means over the tokens, or over the places of a map. Mason et al. 2025 (arXiv 2509.15271) ask the
same of four encoders.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.features import cosines_with_reference, of_length_one
from iqtt.files.reader import QuestionsFile, open_questions
from iqtt.files.split import ANSWERS
from metrics.prediction_writer import write_answers
from metrics.score_file import write_scores
from metrics.scoring.evaluate import score
from metrics.scoring.records import ScoreFile
from scenegen.common.errors import SpecError
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.preview import srgb_bytes

Array = NDArray[Any]
Features = Callable[[Array], list[Array]]
PREFIX = "hf:"
TEST = "iqtt-test.h5"


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
            raise SpecError("--data", f"no {answers_path}", "answers beside the questions")
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
    axes.legend(fontsize=8, title="kind; dashed: floor")
    figure.savefig(out, dpi=dpi, metadata={"Software": None})
