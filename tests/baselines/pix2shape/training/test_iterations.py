"""Training: the same to the bit whenever it was stopped; it learns; it stops at nonsense."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from pix2shape_models import question_source, room_source, state_of, suited, tiny
from refusals import refused

from baselines.pix2shape.batch import turned
from baselines.pix2shape.network.architecture import NetworkSpec
from baselines.pix2shape.training import iterations
from baselines.pix2shape.training.batches import Sources
from baselines.pix2shape.training.iterations import Iterations, check_request
from baselines.pix2shape.training.run import learning_rate
from baselines.pix2shape.weights import METHOD
from baselines.training.checkpoint import load_checkpoint, moments_of
from baselines.training.fit import fit
from baselines.training.machine import Machine
from scenegen.common.errors import SpecError

TINY = tiny(mutual_information=0.0, questions=0.0)
PLAIN = replace(TINY, adversarial=0.0, code_reconstruction=0.0)
Losses = list[dict[str, float]]


class Stop(Exception):
    """What ends a run before its last iteration."""


def bits(state: Any) -> dict[str, Any]:
    """Return all that training changes, by name."""
    weights = {f"model.{name}": value for name, value in state.network.state_dict().items()}
    everything = {**weights, **moments_of(state.optimisers)}
    return {name: value.clone() for name, value in everything.items()}


def assert_same(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert one.keys() == other.keys()
    assert [name for name in one if not torch.equal(one[name], other[name])] == []


def run(
    state: Any,
    sources: Any,
    folder: Path,
    steps: int | None = None,
    workers: int = 0,
    every: int = 1,
) -> Losses:
    """Train, all iterations or some, and return the losses."""
    sources = sources if isinstance(sources, Sources) else Sources(sources)
    begun, reported = state.card.iteration, []
    check_request(state.network, sources, 1)
    losses = Iterations(state.network, sources, begun, workers)

    def progress(done: int, total: int, numbers: Any) -> None:
        reported.append(numbers)
        if len(reported) == steps:
            raise Stop

    try:
        fit(
            folder, METHOD, state, losses, learning_rate, Machine(every=every), progress=progress
        )  # fmt: skip
    except Stop:
        assert len(reported) == steps
    return reported


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("case", ["critic steps", "workers", "questions"])
def test_a_stop_in_the_middle_changes_nothing(case, rooms_path, train_questions, tmp_path):
    """Weights, moments and losses to the bit; nor do processes that read."""
    config = replace(TINY, decay=True)
    workers = 2 if case == "workers" else 0
    if case == "critic steps":
        config = replace(config, critic_steps=2)
    if case == "questions":
        more = {"questions": 0.1, "contrast": 1.0, "mutual_information": 0.1, "labelled_batch": 2}
        config = suited(replace(config, **more, batch=12, question_batch=6), train_questions)
        parts = (question_source(train_questions, p, config) for p in ("unlabeled", "labeled"))
        sources = Sources(*parts, 2)
    else:
        sources = Sources(room_source(rooms_path, config))
    unbroken = state_of(config)
    expected = run(unbroken, sources, tmp_path)
    assert unbroken.card.iteration == 4
    assert [("questions" in losses) for losses in expected] == [case == "questions"] * 4
    state = state_of(config)
    losses = run(state, sources, tmp_path, 2, workers)
    again = load_checkpoint(tmp_path, METHOD)
    assert (again.card, again.card.iteration) == (state.card, 2)
    assert_same(bits(again), bits(state))
    losses += run(again, sources, tmp_path, workers=workers)
    assert losses == expected
    assert_same(bits(again), bits(unbroken))


def test_every_step_has_noise_of_its_own(rooms_path, tmp_path, monkeypatch):
    """Of each critic's batch, too; but the same wherever training began."""
    seeds: list[int] = []
    draw = iterations.draw
    monkeypatch.setattr(iterations, "draw", lambda *a: (seeds.append(a[2]), draw(*a))[1])
    config = replace(TINY, critic_steps=2, iterations=2)
    for first in (0, 0, 1):
        run(state_of(config, iteration=first), room_source(rooms_path, config), tmp_path)
    assert len(set(seeds[:4])) == 4
    assert seeds == [*seeds[:4], *seeds[:4], *seeds[2:4]]


def test_some_of_the_contrasted_questions_are_labelled(train_questions, tmp_path, monkeypatch):
    plain = replace(TINY, questions=1.0, contrast=1.0, batch=8, question_batch=7, labelled_batch=1)
    config = suited(plain, train_questions)
    source = question_source(train_questions, "unlabeled", config)
    labelled = question_source(train_questions, "labeled", config)
    step, asked = iterations.generator_step, []

    def spy(model: Any, batch: Any, noise: Any, questions: Any) -> Any:
        asked.append(questions)
        return step(model, batch, noise, questions)

    monkeypatch.setattr(iterations, "generator_step", spy)
    items = [labelled[row] for row in range(len(labelled))]
    told = {item["image"].tobytes(): item["answer"] for item in items}
    for labels, known in ((3, 1), (0, 0)):
        asked.clear()
        losses = run(state_of(config), Sources(source, labelled, labels), tmp_path, 2)
        assert all(("questions" in one) == (labels > 0) and "contrast" in one for one in losses)
        for images, answers in asked:
            assert images.image.shape == (4 * (known + 7), 3, 32, 32)
            assert (answers >= 0).tolist() == [True] * known + [False] * 7
            rows = images.image.view(known + 7, -1)[:known].numpy()
            assert [told[row.tobytes()] for row in rows] == answers[:known].tolist()
        assert len({images.image.numpy().tobytes() for images, _ in asked}) == len(asked)
    losses = run(state_of(config), labelled, tmp_path, 2)  # a file with answers, but no labels
    assert all("contrast" in one and "questions" not in one for one in losses)
    assert run(state_of(replace(config, contrast=0.0)), source, tmp_path, 1)
    assert asked[-1] is None, "nothing is compared without a label"


def test_labelled_questions_are_a_batch_of_their_own_where_others_are_compared(train_questions):
    config = replace(TINY, questions=1.0, contrast=1.0, question_batch=32, labelled_batch=5)
    config = suited(config, train_questions)
    source = question_source(train_questions, "labeled", config)
    for labels, expected in ((0, 0), (3, 5)):
        assert Sources(source, source, labels).question_sizes(config) == (expected, 32)
    plain = replace(config, contrast=0.0)
    for labels, expected in ((0, 0), (3, 32)):
        assert Sources(source, source, labels).question_sizes(plain) == (expected, 0)


def test_compared_questions_are_turned_and_may_be_all_that_is_learned_from(
    train_questions, tmp_path, monkeypatch
):
    zero = dict.fromkeys(("adversarial", "reconstruction", "code_reconstruction"), 0.0)
    on = dict.fromkeys(("contrast", "questions"), 1.0)
    own = {**zero, **on, "question_batch": 8, "labelled_batch": 2}
    config = suited(replace(TINY, **own), train_questions)
    source = question_source(train_questions, "unlabeled", config)
    labelled = question_source(train_questions, "labeled", config)
    seen: list[Any] = []
    step = iterations.generator_step

    def spy(model: Any, batch: Any, noise: Any, questions: Any) -> Any:
        seen.append((questions, noise))
        return step(model, batch, noise, questions)

    monkeypatch.setattr(iterations, "generator_step", spy)
    pictures = []
    for turn in (False, True):
        seen.clear()
        state = state_of(replace(config, turned=turn))
        losses = run(state, Sources(source, labelled, 3), tmp_path, 2)
        assert set(losses[0]) == {"questions", "contrast"}
        assert (seen[0][0][1] >= 0).tolist() == [True] * 2 + [False] * 8
        pictures.append(seen[0])
    ((plain, _), _), ((found, _), noise) = pictures
    expected = turned(plain, noise.turn, noise.mirror)
    assert torch.equal(found.image, expected.image)
    assert not torch.equal(found.image, plain.image)


@pytest.mark.parametrize(
    ("data", "change", "where"),
    [
        ("rooms", {"material": True, "reconstruction": 0.0, "depth": 1.0}, "material"),
        ("rooms", {"lights": 3, "reconstruction": 0.0, "depth": 1.0}, "lights"),
        ("rooms", {"reconstruction": 0.0}, "losses"),
        ("rooms", {"batch": 5}, "devices"),
    ],
)
def test_requests_that_teach_nothing_are_refused(data, change, where, rooms_path, train_questions):
    config = suited(PLAIN, train_questions) if data == "questions" else PLAIN
    config = replace(config, **change)
    source = room_source(rooms_path, config)
    if data == "questions":
        source = question_source(train_questions, "unlabeled", config)
    with refused(SpecError, where):
        check_request(state_of(config).network, Sources(source), 2)


def test_the_generators_step_leaves_the_critic_alone(rooms_path, tmp_path, monkeypatch):
    config = replace(TINY, mutual_information=0.1, networks=replace(TINY.networks, z_view=2))
    state, before = state_of(config), {}
    step = iterations.generator_step

    def spy(model: Any, *rest: Any) -> Any:
        before.update(bits(state))
        return step(model, *rest)

    monkeypatch.setattr(iterations, "generator_step", spy)
    start = bits(state)
    run(state, room_source(rooms_path, config), tmp_path, 3)
    after = bits(state)
    for name, value in after.items():
        if name.removeprefix("model.").split(".")[0] in ("critic", "statistics"):
            assert torch.equal(value, before[name]), name
    for network in (state.network.critic, state.network.statistics):
        assert all(p.requires_grad for p in network.parameters())
    for kind in ("encoder", "decoder", "critic", "statistics"):
        weight = next(n for n in start if n.startswith(f"model.{kind}.") and "weight" in n)
        assert not torch.equal(start[weight], after[weight]), kind


def test_it_learns(rooms_path, tmp_path):
    config = replace(PLAIN, iterations=60, batch=4, learning_rate=3e-3)
    config = replace(config, networks=NetworkSpec(size=32, width=0.05, z_scene=32))
    losses = run(state_of(config), room_source(rooms_path, config), tmp_path, every=60)
    found = [numbers["reconstruction"] for numbers in losses]
    assert np.mean(found[-10:]) < 0.5 * found[0]
