"""Training: the same to the bit whenever it was stopped; it learns; it stops at nonsense."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from pix2shape_models import question_source, room_source, state_of, suited, tiny
from refusals import refused

from baselines.pix2shape.training import steps
from baselines.pix2shape.training.batches import Sources
from baselines.pix2shape.training.run import learning_rate
from baselines.pix2shape.training.steps import Iterations, check_request
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
    check_request(state.network, sources)
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


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"material": True, "reconstruction": 0.0, "depth": 1.0}, "material"),
        ({"lights": 3, "reconstruction": 0.0, "depth": 1.0}, "lights"),
        ({"reconstruction": 0.0}, "losses"),
    ],
)
def test_requests_that_teach_nothing_are_refused(change, where, rooms_path):
    config = replace(PLAIN, **change)
    source = room_source(rooms_path, config)
    with refused(SpecError, where):
        check_request(state_of(config).network, Sources(source))


def test_the_generators_step_leaves_the_critic_alone(rooms_path, tmp_path, monkeypatch):
    config = replace(TINY, mutual_information=0.1, networks=replace(TINY.networks, z_view=2))
    state, before = state_of(config), {}
    step = steps.generator_step

    def spy(model: Any, *rest: Any) -> Any:
        before.update(bits(state))
        return step(model, *rest)

    monkeypatch.setattr(steps, "generator_step", spy)
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
