"""Training: the same to the bit whenever it was stopped; it learns; it stops at nonsense."""

import math
import re
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import pytest
from pix2shape_models import tiny

from scenegen.common.errors import SpecError

torch = pytest.importorskip("torch")
from lightning_fabric import Fabric  # noqa: E402

from baselines.pix2shape.data.questions import QuestionImages, for_questions  # noqa: E402
from baselines.pix2shape.data.rooms import RoomImages  # noqa: E402
from baselines.pix2shape.network.architecture import NetworkSpec  # noqa: E402
from baselines.pix2shape.training import loop as training  # noqa: E402
from baselines.pix2shape.training.batches import question_sizes  # noqa: E402
from baselines.pix2shape.training.loop import TrainingError, train  # noqa: E402
from baselines.pix2shape.training.state import State, load_state, new_state, save_state  # noqa: E402
from baselines.pix2shape.training.turning import turned  # noqa: E402
from baselines.pix2shape.weights.storage import Card  # noqa: E402

TINY = tiny(mutual_information=0.0, questions=0.0)
PLAIN = replace(TINY, adversarial=0.0, code_reconstruction=0.0)
Losses = list[dict[str, float]]


def bits(state: State) -> dict[str, Any]:
    """Return all that training changes, by name."""
    found = {f"model.{name}": value.clone() for name, value in state.model.state_dict().items()}
    for kind in ("generator", "critic"):
        for index, values in getattr(state, kind).state_dict()["state"].items():
            found |= {f"{kind}.{index}.{name}": value.clone() for name, value in values.items()}
    return found


def assert_same(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert one.keys() == other.keys()
    assert [name for name in one if not torch.equal(one[name], other[name])] == []


def run(state: State, source: Any, fabric: Fabric, steps: int | None = None, **how: Any) -> Losses:
    return [losses for losses, _ in islice(train(state, source, fabric, **how), steps)]


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("case", ["rooms", "critic steps", "workers", "questions"])
def test_a_stop_in_the_middle_changes_nothing(case, rooms_path, train_questions, fabric, tmp_path):
    """Weights, moments and losses to the bit; nor do processes that read."""
    config, how = replace(TINY, decay=True), {}
    broken_how = {"workers": 2} if case == "workers" else {}
    if case == "critic steps":
        config = replace(config, critic_steps=2, consistency=0.1)
    source = RoomImages(rooms_path, config)
    if case == "questions":
        more = {"questions": 0.1, "contrast": 1.0, "mutual_information": 0.1, "consistency": 1.0}
        config = replace(config, **more, batch=12, question_batch=8)
        config = for_questions(config, train_questions, "unlabeled")
        source = QuestionImages(train_questions, "unlabeled", config)
        how = {"labelled": QuestionImages(train_questions, "labeled", config), "labels": 2}
    unbroken = new_state(config)
    expected = run(unbroken, source, fabric, **how)
    assert unbroken.iteration == 4
    assert [("questions" in one) for one in expected] == [case == "questions"] * 4
    state = new_state(config)
    losses = run(state, source, fabric, 2, **how, **broken_how)
    save_state(tmp_path, state, Card(config, state.iteration, seconds=state.seconds))
    again, card = load_state(tmp_path)
    assert (card.config, again.iteration, again.seconds > 0) == (config, 2, True)
    assert_same(bits(again), bits(state))
    losses += run(again, source, fabric, **how, **broken_how)
    assert losses == expected
    assert_same(bits(again), bits(unbroken))


def test_the_seed_decides_and_nothing_else(rooms_path, fabric):
    found = []
    for seed in (1, 1, 2):
        torch.manual_seed(len(found))
        before = torch.get_rng_state()
        state = new_state(replace(TINY, seed=seed))
        assert torch.equal(torch.get_rng_state(), before)
        losses = run(state, RoomImages(rooms_path, TINY), fabric, 2)
        found.append((losses, bits(state)))
    assert found[0][0] == found[1][0]
    assert_same(found[0][1], found[1][1])
    assert not torch.equal(*(found[i][1]["model.decoder.last.weight"] for i in (0, 2)))


def test_only_the_labels_that_are_told_are_used(train_questions, fabric, monkeypatch):
    config = for_questions(replace(TINY, questions=1.0, batch=8), train_questions, "labeled")
    source = QuestionImages(train_questions, "unlabeled", config)
    labelled = QuestionImages(train_questions, "labeled", config)
    read: set[int] = set()
    item = QuestionImages.__getitem__

    def spy(self: QuestionImages, row: int) -> dict[str, Any]:
        if self is labelled:
            read.add(row)
        return item(self, row)

    monkeypatch.setattr(QuestionImages, "__getitem__", spy)
    losses = run(new_state(config), source, fabric, labelled=labelled, labels=2)
    assert read == {0, 1}
    assert all("questions" in one for one in losses)
    read.clear()
    losses = run(new_state(config), source, fabric, labelled=labelled, labels=0)
    assert read == set()
    assert not any("questions" in one for one in losses)


def test_some_of_the_contrasted_questions_are_labelled(train_questions, fabric, monkeypatch):
    plain = replace(TINY, questions=1.0, contrast=1.0, batch=8, question_batch=8)
    config = for_questions(plain, train_questions, "labeled")
    source = QuestionImages(train_questions, "unlabeled", config)
    labelled = QuestionImages(train_questions, "labeled", config)
    step, asked = training.generator_step, []

    def spy(model: Any, batch: Any, noise: Any, questions: Any) -> Any:
        asked.append(questions)
        return step(model, batch, noise, questions)

    monkeypatch.setattr(training, "generator_step", spy)
    items = [labelled[row] for row in range(len(labelled))]
    told = {item["image"].tobytes(): item["answer"] for item in items}
    for labels, known in ((3, 1), (0, 0)):
        asked.clear()
        losses = run(new_state(config), source, fabric, 2, labelled=labelled, labels=labels)
        assert all(("questions" in one) == (labels > 0) and "contrast" in one for one in losses)
        for images, answers in asked:
            assert images.image.shape == (32, 3, 32, 32)
            assert (answers >= 0).tolist() == [True] * known + [False] * (8 - known)
            rows = images.image.view(8, -1)[:known].numpy()
            assert [told[row.tobytes()] for row in rows] == answers[:known].tolist()
        assert len({images.image.numpy().tobytes() for images, _ in asked}) == len(asked)
    losses = run(new_state(config), labelled, fabric, 2)  # a file with answers, but no labels
    assert all("contrast" in one and "questions" not in one for one in losses)
    assert run(new_state(replace(config, contrast=0.0)), source, fabric, 1)
    assert asked[-1] is None, "nothing is compared without a label"


@pytest.mark.parametrize(
    ("labels", "expected"), [(0, 0), (1, 1), (100, 1), (101, 2), (200, 2), (1000, 8), (9000, 8)]
)
def test_one_place_for_every_hundred_labels_up_to_a_quarter(labels, expected, train_questions):
    config = replace(TINY, questions=1.0, contrast=1.0, question_batch=32)
    config = for_questions(config, train_questions, "labeled")
    source = QuestionImages(train_questions, "labeled", config)
    assert question_sizes(config, source, labels) == (expected, 32 - expected)
    plain = replace(config, contrast=0.0)
    assert question_sizes(plain, source, labels) == (32 if labels else 0, 0)
    own = replace(config, labelled_batch=5)
    assert question_sizes(own, source, labels) == (5 if labels else 0, 32)
    assert question_sizes(replace(own, contrast=0.0), source, labels) == (5 if labels else 0, 0)


def test_compared_questions_are_turned_and_may_be_all_that_is_learned_from(
    train_questions, fabric, monkeypatch
):
    """The critic sees the same pictures; the encoder sees no others."""
    zero = dict.fromkeys(("adversarial", "reconstruction", "code_reconstruction"), 0.0)
    on = dict.fromkeys(("contrast", "questions", "mutual_information"), 1.0)
    own = {**zero, **on, "question_batch": 8, "labelled_batch": 2, "compared_information": True}
    config = for_questions(replace(TINY, **own), train_questions, "labeled")
    source = QuestionImages(train_questions, "unlabeled", config)
    labelled = QuestionImages(train_questions, "labeled", config)
    seen: list[Any] = []
    step, critic = training.generator_step, training.critic_step

    def spy(name: str, function: Any) -> Any:
        def spied(model: Any, batch: Any, noise: Any, questions: Any) -> Any:
            seen.append((name, questions, noise))
            return function(model, batch, noise, questions)

        return spied

    monkeypatch.setattr(training, "generator_step", spy("generator", step))
    monkeypatch.setattr(training, "critic_step", spy("critic", critic))
    pictures = []
    for turn in (False, True):
        seen.clear()
        state = new_state(replace(config, turned=turn))
        losses = run(state, source, fabric, 2, labelled=labelled, labels=3)
        assert set(losses[0]) == {"mutual_information", "questions", "contrast"}
        assert [name for name, _, _ in seen] == ["critic", "generator"] * 2
        assert seen[0][1] is seen[1][1]
        assert (seen[0][1][1] >= 0).tolist() == [True] * 2 + [False] * 8
        pictures.append(seen[0])
    (_, (plain, _), _), (_, (found, _), noise) = pictures
    expected = turned(plain, noise.turn, noise.mirror)
    assert torch.equal(found.image, expected.image)
    assert not torch.equal(found.image, plain.image)


def test_views_of_questions_are_not_compared(train_questions, fabric):
    config = replace(for_questions(TINY, train_questions, "labeled"), consistency=1.0)
    source = QuestionImages(train_questions, "unlabeled", config)
    with pytest.raises(SpecError, match="consistency"):
        run(new_state(config), source, fabric)


@pytest.mark.parametrize("change", [{"material": True}, {"lights": 3}])
def test_materials_and_lights_are_learned_from_images_alone(change, rooms_path, fabric):
    blind = {"adversarial": 0.0, "code_reconstruction": 0.0, "reconstruction": 0.0}
    config = replace(TINY, **blind, consistency=1.0, **change)
    with pytest.raises(SpecError) as error:
        run(new_state(config), RoomImages(rooms_path, config), fabric)
    assert error.value.where in change


def test_the_generators_step_leaves_the_critic_alone(rooms_path, fabric, monkeypatch):
    config = replace(TINY, mutual_information=0.1, networks=replace(TINY.networks, z_view=2))
    state, before = new_state(config), {}
    step = training.generator_step

    def spy(model: Any, *rest: Any) -> Any:
        before.update(bits(state))
        return step(model, *rest)

    monkeypatch.setattr(training, "generator_step", spy)
    start = bits(state)
    for _ in islice(train(state, RoomImages(rooms_path, config), fabric), 3):
        for name, value in bits(state).items():
            kind = name.removeprefix("model.").split(".")[0]
            if kind in ("critic", "statistics"):
                assert torch.equal(value, before[name]), name
        for network in (state.model.critic, state.model.statistics):
            assert all(p.requires_grad for p in network.parameters())
        for kind in ("encoder", "decoder", "critic", "statistics"):
            weight = next(n for n in start if n.startswith(f"model.{kind}.") and "weight" in n)
            assert not torch.equal(start[weight], bits(state)[weight]), kind


def test_it_learns(rooms_path, fabric):
    config = replace(PLAIN, iterations=60, batch=4, learning_rate=3e-3)
    config = replace(config, networks=NetworkSpec(size=32, width=0.05, z_scene=32))
    losses = run(new_state(config), RoomImages(rooms_path, config), fabric)
    found = [one["reconstruction"] for one in losses]
    assert np.mean(found[-10:]) < 0.5 * found[0]


@pytest.mark.parametrize("decay", [False, True])
def test_the_learning_rate(rooms_path, fabric, decay):
    config = replace(PLAIN, iterations=10, learning_rate=0.01, decay=decay)
    state, rates = new_state(config), []
    for _ in train(state, RoomImages(rooms_path, config), fabric):
        rates += [group["lr"] for o in (state.generator, state.critic) for group in o.param_groups]
    falling = [0.01] * 6 + [0.008, 0.006, 0.004, 0.002]
    assert rates[::2] == pytest.approx(falling if decay else [0.01] * 10)
    assert rates[::2] == rates[1::2]


class Poisoned(RoomImages):
    """Rooms whose row 5 has one impossible pixel, as no file can have that is read."""

    value = math.nan

    def __getitem__(self, row: int) -> dict[str, Any]:
        item = super().__getitem__(row)
        if row == 5:
            item["image"][:, 4, 4] = self.value
        return item


def stopped(state: State, source: Any, fabric: Fabric) -> tuple[TrainingError, dict[str, Any]]:
    """Train until it stops; return why, and the state after the last whole iteration."""
    last = bits(state)
    with pytest.raises(TrainingError) as error:  # noqa: PT012
        for _ in train(state, source, fabric):
            last = bits(state)
    return error.value, last


@pytest.mark.parametrize("config", [TINY, PLAIN], ids=["all", "plain"])
def test_an_image_that_is_not_finite_stops_it(rooms_path, fabric, config):
    state = new_state(replace(config, batch=2))
    error, last = stopped(state, Poisoned(rooms_path, config), fabric)
    assert 0 < state.iteration < 4
    assert error.where == f"iteration {state.iteration}"
    assert "nan" in error.found
    now, batch_statistics = bits(state), re.compile("running|tracked")
    kept = [name for name in last if not batch_statistics.search(name)]
    assert_same({name: now[name] for name in kept}, {name: last[name] for name in kept})


def test_a_loss_that_is_not_finite_stops_it_though_its_gradient_is(rooms_path, fabric):
    source = Poisoned(rooms_path, PLAIN)
    source.value = 1e30  # its square is infinite, its slope 0
    state = new_state(replace(PLAIN, batch=8))
    assert "reconstruction inf" in stopped(state, source, fabric)[0].found


def test_a_gradient_that_is_not_finite_stops_it_though_the_loss_is(rooms_path, fabric):
    state = new_state(PLAIN)
    state.model.decoder.last.weight.data[0, 0, 0, 0] = math.inf
    before = {name: value.clone() for name, value in state.model.named_parameters()}
    error, _ = stopped(state, RoomImages(rooms_path, PLAIN), fabric)
    assert re.search(r"\(reconstruction [0-9.]+\)", error.found)
    assert_same(dict(state.model.named_parameters()), before)
