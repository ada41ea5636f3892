"""The audit's small network: exact gradients, equal treatment of places, and what it can find."""

import numpy as np

from iqtt.audit.probes.small_network import SmallNetwork


def pictures(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((count, 3, 16, 16), np.float32)


def loss(network: SmallNetwork, images: np.ndarray, right: np.ndarray) -> float:
    scores = network.scores(images).astype(np.float64)
    total = np.log(np.exp(scores).sum(axis=1))
    return float((total - scores[np.arange(len(right)), right]).mean())


def test_gradients_are_those_of_finite_differences() -> None:
    network, images, right = SmallNetwork(), pictures(4), np.array([0, 1, 2, 1])
    rng = np.random.default_rng(1)
    # In double precision, and with weights large enough that the scores depend on all of them.
    network._weights = [rng.normal(0, 0.3, w.shape) for w in network._weights]
    slopes = network._gradients(images, right)
    for i, slope in enumerate(slopes):
        for at in rng.integers(slope.size, size=4).tolist():
            value = network._weights[i].flat[at]
            ends = []
            for step in (1e-4, -1e-4):
                network._weights[i].flat[at] = value + step
                ends.append(loss(network, images, right))
            network._weights[i].flat[at] = value
            expected = (ends[0] - ends[1]) / 2e-4
            assert abs(slope.flat[at] - expected) < 1e-3 + 0.02 * abs(expected)


def test_a_mark_is_found_wherever_it_is() -> None:
    images, right = pictures(240, 2) * 0.2, np.arange(240) % 3
    place = np.random.default_rng(3).integers(2, 12, (240, 2))
    for k, (y, x) in enumerate(place.tolist()):
        images[k, right[k], y : y + 3, x : x + 3] += 0.8
    network = SmallNetwork().fit(images[:180], right[:180])
    scores = network.scores(images[180:])
    assert (scores.argmax(axis=1) == right[180:]).mean() > 0.8
    order = [1, 2, 0]
    np.testing.assert_allclose(network.scores(images[180:, order]), scores[:, order], atol=1e-4)
    again = SmallNetwork().fit(images[:180], right[:180]).scores(images[180:])
    np.testing.assert_array_equal(again, scores)


def test_nothing_to_score() -> None:
    assert SmallNetwork().scores(pictures(0)).shape == (0, 3)
