"""The loop: what each step sees, where it stops, what it writes, and how it goes on."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
import torch
from refusals import refused
from torch.optim import Adam

from baselines.training import checkpoint, machine
from baselines.training import fit as module
from baselines.training.checkpoint import (
    WEIGHTS,
    Method,
    load_checkpoint,
    load_weights,
    moments_of,
    new_state,
)
from baselines.training.fit import Loss, TrainingError, falling_late, fit
from baselines.training.machine import Machine
from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_rng


@dataclass(frozen=True)
class Settings:
    seed: int = 1
    iterations: int = 5
    learning_rate: float = 0.1
    batch: int = 7


@dataclass(frozen=True)
class Card(checkpoint.Card):
    settings: Settings = field(default_factory=Settings)


class Pair(torch.nn.Module):
    """Two numbers, each of which has an optimiser."""

    def __init__(self) -> None:
        super().__init__()
        self.first, self.second = (torch.nn.Parameter(torch.rand(1)) for _ in range(2))


METHOD = Method(
    "pair",
    Card,
    lambda card: Pair(),
    lambda card, pair: {"one": Adam([pair.first]), "two": Adam([pair.second])},
)
Spoil = Callable[[int, Any, Any], Any]  # iteration, weight and loss -> loss


class Steps:
    """The losses of a pair: it is pulled to numbers that derive from the iteration."""

    def __init__(self, pair: Pair, spoil: Spoil = lambda number, weight, loss: loss) -> None:
        self.pair, self.spoil, self.seen = pair, spoil, list[float]()

    def __call__(self, number: int) -> Iterator[Loss]:
        assert self.pair.training
        for name, weight in (("one", self.pair.first), ("two", self.pair.second)):
            self.seen.append(float(self.pair.first.detach()))
            goal = item_rng(1, number, Purpose.TRAINING).random()
            loss = self.spoil(number, weight, (weight - goal).square().sum())
            yield Loss(loss, {name: loss}, name)


def begun() -> Any:
    return new_state(METHOD, Card("pair"))


def run(folder: Path, state: Any, spoil: Spoil | None = None, **how: Any) -> list[Any]:
    """Train, and return what is reported."""
    folder.mkdir(exist_ok=True)
    told: list[Any] = []
    steps = Steps(state.network, *[spoil] * (spoil is not None))
    how = {"progress": lambda *now: told.append(now), "machine": Machine(every=2), **how}
    fit(folder, METHOD, state, steps, falling_late, **how)
    return told


def bits(state: Any) -> dict[str, Any]:
    return {**state.network.state_dict(), **moments_of(state.optimisers)}


def assert_same(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert one.keys() == other.keys()
    assert [name for name in one if not torch.equal(one[name], other[name])] == []


def test_each_step_sees_what_the_one_before_it_changed(tmp_path):
    state, told = begun(), []
    steps = Steps(state.network.eval())
    fit(
        tmp_path, METHOD, state, steps, falling_late, Machine(every=2),
        progress=lambda *now: told.append(now),
    )  # fmt: skip
    assert [now[:2] for now in told] == [(done, 5) for done in range(1, 6)]
    assert all(losses.keys() == {"one", "two"} for *_, losses in told)
    assert steps.seen[1::2][:-1] == steps.seen[2::2], "the second step leaves the first number"
    assert len(set(steps.seen)) == 6
    network, card = load_weights(tmp_path / WEIGHTS, METHOD)
    assert (card, card.iteration) == (state.card, 5)
    assert network.first == state.network.first.half()


@pytest.mark.parametrize("stop", [1, 2, 3, 4, 5])
def test_a_stop_anywhere_changes_nothing(stop, tmp_path):
    whole = begun()
    expected = run(tmp_path / "whole", whole)

    def kill(done: int, total: int, losses: Any) -> None:
        if done == stop:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "cut", begun(), progress=kill)
    if stop == 1:
        assert list((tmp_path / "cut").iterdir()) == []
        return
    (tmp_path / "cut" / WEIGHTS).unlink()  # the kill may have come before they were written
    again = load_checkpoint(tmp_path / "cut", METHOD)
    at = 5 if stop == 5 else stop // 2 * 2
    assert again.card.iteration == at
    again.card = replace(again.card, seconds=100.0)
    assert run(tmp_path / "cut", again) == expected[at:]
    assert_same(bits(again), bits(whole))
    files = (tmp_path / name / WEIGHTS for name in ("whole", "cut"))
    (one, card), (other, again) = (load_weights(path, METHOD) for path in files)
    assert_same(one.state_dict(), other.state_dict())
    assert replace(card, seconds=again.seconds) == again
    assert 100 <= again.seconds < 110, "the time of both parts"


SPOILT: dict[str, Callable[[Any, Any], Any]] = {
    "nan": lambda weight, loss: loss * torch.nan,
    "inf": lambda weight, loss: loss + torch.inf,
    "a loss whose slope is 0": lambda weight, loss: loss * 0 + torch.inf,
    "a slope whose loss is 0": lambda weight, loss: (weight - weight.detach()).abs().sqrt().sum(),
}


@pytest.mark.parametrize("step", [0, 1])
@pytest.mark.parametrize("name", SPOILT)
def test_a_loss_or_slope_that_is_not_finite_stops_it(step, name, tmp_path):
    """The weights stay as they are, and the files are those of the last checkpoint."""
    state, before = begun(), {}

    def spoil(number: int, weight: Any, loss: Any) -> Any:
        if number != 3 or weight is not (state.network.first, state.network.second)[step]:
            return loss
        before.update({key: value.clone() for key, value in bits(state).items()})
        return SPOILT[name](weight, loss)

    with refused(TrainingError, "iteration 3", ("one", "two")[step]):
        run(tmp_path / "run", state, spoil)
    assert_same(bits(state), before)
    assert load_checkpoint(tmp_path / "run", METHOD).card.iteration == 2


@pytest.mark.parametrize("kind", ["weights", "moments"])
def test_what_is_not_finite_after_a_step_replaces_no_files(kind, tmp_path):
    """The losses of an iteration are those before its step, which may be the one too far."""
    state, prepared = begun(), []

    def spoil(number: int, weight: Any, loss: Any) -> Any:
        if number == 3 and weight is state.network.second:
            if kind == "weights":
                state.network.first.data.fill_(torch.nan)
            else:
                state.optimisers["one"].state[state.network.first]["exp_avg"].fill_(torch.inf)
        return loss

    with refused(TrainingError, "iteration 4"):
        run(tmp_path / "run", state, spoil, prepare=lambda: prepared.append(1))
    assert prepared == [1], "of the checkpoint of iteration 2"
    assert load_weights(tmp_path / "run" / WEIGHTS, METHOD)[1].iteration == 2


def test_files_hold_what_is_prepared_for_them(tmp_path):
    state, at = begun(), []

    def prepare() -> None:
        at.append(state.card.iteration)
        state.network.second.data.fill_(7.0)

    run(tmp_path / "run", state, prepare=prepare)
    assert at == [2, 4, 5]
    assert load_weights(tmp_path / "run" / WEIGHTS, METHOD)[0].second == 7


def test_the_learning_rate_falls_over_the_second_half(tmp_path):
    state, rates = begun(), []

    def note(*_: Any) -> None:
        rates.append([o.param_groups[0]["lr"] for o in state.optimisers.values()])

    state.card = replace(state.card, settings=Settings(iterations=10))
    run(tmp_path / "run", state, progress=note)
    falling = [0.1] * 6 + [0.08, 0.06, 0.04, 0.02]
    assert [one for one, _ in rates] == pytest.approx(falling)
    assert all(one == other for one, other in rates)


def test_slopes_are_clipped_to_a_norm(tmp_path):
    slopes = []
    for clip in (None, 1e-3):
        state = begun()
        state.card = replace(state.card, settings=Settings(iterations=1))
        run(tmp_path / f"{clip}", state, clip=clip)
        slopes.append(float(state.network.first.grad.abs()))
    assert slopes[0] > 0.01
    assert slopes[1] == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.parametrize("later", [1.0, 3.0])
def test_a_limit_of_time_sets_the_schedule(later, tmp_path, monkeypatch):
    """Also where iterations become slower on the way; the learning rate has fallen at the end."""
    state, now, rates = begun(), [100.0], []
    monkeypatch.setattr(machine.time, "monotonic", lambda: now[0])

    def pass_time(done: int, *_: Any) -> None:
        rates.append(state.optimisers["one"].param_groups[0]["lr"])
        now[0] += 1.0 if done < 60 else later

    limited = Machine(every=1000, minutes=2, started=100.0)
    now[0] += 20  # for the reading of data
    run(tmp_path / "run", state, machine=limited, progress=pass_time)
    assert 120 <= now[0] - 100 <= 120 + later
    done = 100 if later == 1 else 60 + 40 // 3
    assert abs(state.card.iteration - done) <= 2
    assert state.card.settings.iterations == state.card.iteration
    assert rates[0] == 0.1
    assert rates[-1] < 0.01
    assert load_weights(tmp_path / "run" / WEIGHTS, METHOD)[1] == state.card


@pytest.mark.parametrize("planned", [30, 1000], ids=["it had ended", "it was stopped"])
def test_a_run_that_goes_on_gets_its_own_limit(planned, tmp_path, monkeypatch):
    state, now = begun(), [0.0]
    monkeypatch.setattr(machine.time, "monotonic", lambda: now[0])
    state.card = replace(state.card, iteration=30, settings=Settings(iterations=planned))

    def pass_time(*_: Any) -> None:
        now[0] += 1

    run(tmp_path / "run", state, machine=Machine(minutes=1, started=0.0), progress=pass_time)
    assert abs(state.card.iteration - 90) <= 1


def test_a_limit_that_is_over_before_training_is_refused(tmp_path):
    with refused(SpecError, "minutes", "0.5"):
        run(tmp_path / "run", begun(), machine=Machine(minutes=0.5, started=time.monotonic() - 31))
    assert not list((tmp_path / "run").iterdir())


def test_losses_are_fetched_from_a_gpu_once_in_a_while(tmp_path, monkeypatch):
    expected = run(tmp_path / "cpu", begun())
    monkeypatch.setattr(module, "fetch_interval", lambda device: 3)
    found = run(tmp_path / "gpu", begun(), machine=Machine(every=5))
    assert [losses for *_, losses in found[:2]] == [{}, {}]
    assert [losses for *_, losses in found[2:]] == [expected[k][2] for k in (2, 2, 4)]

    def spoil(number: int, weight: Any, loss: Any) -> Any:
        return loss * torch.nan if number == 1 else loss

    with refused(TrainingError, "iteration 2"):  # when they are fetched
        run(tmp_path / "spoilt", begun(), spoil, machine=Machine(every=5))
    assert not list((tmp_path / "spoilt").iterdir())


def test_a_gpu_without_memory_names_the_batch(tmp_path):
    def spoil(number: int, weight: Any, loss: Any) -> Any:
        raise torch.OutOfMemoryError

    with refused(TrainingError, "training", "batch of 7"):
        run(tmp_path / "run", begun(), spoil)
