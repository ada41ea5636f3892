"""Classes of shapes and their splits: even shares, for ever, whatever else is asked for."""

import hashlib

import numpy as np
import pytest
from polycubes import some_shapes

from iqtt.shapes.chains_and_trees import all_classes
from iqtt.shapes.near import is_chain
from iqtt.shapes.polycube import bounding_radius, canonical_class, set_ids
from iqtt.shapes.splits import LISTED_CUBES, known_classes, split_classes, split_of

RNG = np.random.default_rng
# SHA-256 of the splits of all classes in the order of their ids, one byte each. A change here
# mixes the training and test shapes of all that was ever made.
FOR_EVER = {
    ("chain", 5): "b64b552703205089d08d4a065b0a30a7bf0b67b0994e038ba94040088a80cecc",
    ("chain", 6): "dfd78799167d05bfb520766c8bb7b4d730a8deef5a72bac5a530acfdd7b823fd",
    ("chain", 7): "e1f5d439c7b91e08652228e3bc80421f622b778ac2c5f89fa7614be489d919b8",
    ("chain", 8): "3109bb95d844f74431f66c10d5a6e5aa250515b970627d04e25bb2d22633909c",
    ("chain", 11): "43dc081af2624042b91947e1571da7c4294997bafa13da306f8bf10aa799a440",
    ("tree", 5): "93ec4b019432c116e12b4feabcfdd7162fb40717bb42c086ad23da0b67286422",
    ("tree", 8): "d23e227ccb3f0ecd23b5ba72ce439a64844a85c3c17d9b37f49643c205065f7e",
}


def ids_of(shapes):
    return {bytes(i) for i in set_ids(canonical_class(shapes))}


@pytest.mark.parametrize(("kind", "cubes"), FOR_EVER)
def test_the_split_of_each_class_is_what_it_always_was(kind, cubes):
    split = split_of(known_classes(cubes, kind))
    assert hashlib.sha256(split.astype(np.uint8).tobytes()).hexdigest() == FOR_EVER[kind, cubes]


@pytest.mark.parametrize(("kind", "cubes"), [("chain", n) for n in range(3, 10)] + [("tree", 7)])
def test_listed_classes_are_shared_out_evenly_by_their_hash(kind, cubes):
    """Reckoned with a plain sort; chains among chains, and shapes that branch among these."""
    classes = all_classes(cubes, kind)
    split, chain = split_of(classes), is_chain(classes)
    ranked = [hashlib.sha256(b"3D-IQTT split " + bytes(i)).digest()[:8] for i in set_ids(classes)]
    for rows in (np.flatnonzero(chain), np.flatnonzero(~chain)):
        order = sorted(rows, key=lambda row: ranked[row])
        cut = [len(order) * i // 3 for i in range(4)]
        for i in range(3):
            assert (split[order[cut[i] : cut[i + 1]]] == i).all()
            assert cut[i + 1] > cut[i] or len(order) < 3
    assert kind == "tree" or (split_of(classes, chains=True) == split).all()


@pytest.mark.parametrize(("kind", "cubes"), [("chain", 12), ("tree", 10)])
def test_beyond_the_lists_the_hash_alone_decides(kind, cubes):
    classes = canonical_class(some_shapes(RNG(0), 3000, cubes, kind))
    classes = classes[is_chain(classes) == (kind == "chain")]
    digests = [hashlib.sha256(b"3D-IQTT split " + bytes(i)).digest() for i in set_ids(classes)]
    expected = [int.from_bytes(digest[:8]) * 3 // 2**64 for digest in digests]
    assert split_of(classes).tolist() == expected
    assert set(expected) == {0, 1, 2}


@pytest.mark.parametrize(("cubes", "radius"), [(8, np.inf), (8, 2.8), (13, np.inf), (13, 3.2)])
def test_no_seed_kind_or_radius_puts_a_class_in_two_splits(cubes, radius):
    met = [set(), set(), set()]
    for seed, kind in ((1, "chain"), (2, "chain"), (3, "tree")):
        parts = split_classes(RNG(seed), cubes, kind, radius, most=200)
        again = split_classes(RNG(seed), cubes, kind, radius, most=200)
        for i, part in enumerate(parts):
            assert (part == again[i]).all()
            assert (canonical_class(part) == part).all()
            assert (split_of(part) == i).all()
            assert bounding_radius(part).max() <= radius
            assert len(ids_of(part)) == len(part) == 200 or cubes <= LISTED_CUBES[kind]
            met[i] |= ids_of(part)
    assert not met[0] & met[1] | met[0] & met[2] | met[1] & met[2]
    assert min(map(len, met)) > 100


def test_all_classes_there_are_are_in_a_split():
    assert ids_of(np.concatenate(split_classes(RNG(0), 8))) == ids_of(all_classes(8))
    rod = np.array([[[0, 0, 0], [1, 0, 0]]], np.int8)
    assert len(known_classes(2, max_radius=float(bounding_radius(rod)[0]))) == 1, "met exactly"
