"""What an iteration changes, and requests that teach nothing."""

from dataclasses import replace
from typing import Any

import pytest
import torch
from pix2shape_models import room_source, state_of, tiny
from refusals import refused

from baselines.pix2shape.training import steps
from baselines.pix2shape.training.batches import Sources
from baselines.pix2shape.training.run import learning_rate
from baselines.pix2shape.training.steps import Iterations, check_request
from baselines.pix2shape.weights import METHOD
from baselines.training.fit import fit
from baselines.training.machine import Machine
from scenegen.common.errors import SpecError

TINY = tiny(mutual_information=0.0, questions=0.0)
PLAIN = replace(TINY, adversarial=0.0, code_reconstruction=0.0)


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
    state, sources, before = state_of(config), Sources(room_source(rooms_path, config)), {}
    step = steps.generator_step

    def weights() -> dict[str, Any]:
        return {name: value.clone() for name, value in state.network.state_dict().items()}

    def spy(model: Any, *rest: Any) -> Any:
        before.update(weights())
        return step(model, *rest)

    monkeypatch.setattr(steps, "generator_step", spy)
    start = weights()
    fit(tmp_path, METHOD, state, Iterations(state.network, sources, 0, 0), learning_rate, Machine())
    after = weights()
    for name, value in after.items():
        if name.split(".")[0] in ("critic", "statistics"):
            assert torch.equal(value, before[name]), name
    for network in (state.network.critic, state.network.statistics):
        assert all(p.requires_grad for p in network.parameters())
    for kind in ("encoder", "decoder", "critic", "statistics"):
        weight = next(n for n in start if n.startswith(f"{kind}.") and "weight" in n)
        assert not torch.equal(start[weight], after[weight]), kind
