"""Floors that are measured: of each kind, on questions of the same settings, or chance."""

from dataclasses import replace

import numpy as np
import pytest

from iqtt.audit.probes.masks import RULES
from iqtt.audit.probes.rules import Probe
from iqtt.floor_probes import floor_of, floor_specs, measure_floors, probe_file
from iqtt.floors import CHANCE, read_floors, settings_of, to_json
from iqtt.perspective.specs import perspective_spec
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.splits import TooFewShapesError

SPEC = SplitSpec(cubes=(6, 6), height=32, width=32, min_cube_pixels=3, min_sight_angle_degrees=0.0)


def test_floors_of_a_mixed_file_are_those_of_its_kinds(monkeypatch):
    monkeypatch.setattr("iqtt.audit.probes.trees.FOLDS", 2)  # as fast as it is enough
    spec = replace(SPEC, seed=None, test=7)
    ((measured, probes),) = measure_floors([spec], 100)
    floors = {floor.kind: floor for floor in measured.floors}
    # Too few shapes of six cubes are matched, so that a mixed file has none.
    assert floors.keys() == {"other", "near", "mirror", "mirror-pair"}
    assert measured.settings == settings_of(replace(SPEC, seed=5, test=9, image_dtype="float32"))
    assert floors["other"].accuracy > 0.4
    assert floors["mirror-pair"].probe == CHANCE
    best = max(probes[list(floors).index("other")], key=lambda probe: probe.accuracy)
    assert (floors["other"].accuracy, floors["other"].questions) == (best.accuracy, 100)
    assert read_floors(to_json([measured])) == (measured,)
    with pytest.raises(TooFewShapesError):
        measure_floors([replace(spec, distractors="matched")], 100)


def test_what_is_measured_on_depends_on_no_seed_and_on_training_shapes_alone():
    two = replace(SPEC, distractors="mirror-pair", answers=2)
    specs = floor_specs([replace(SPEC, seed=1, test=8), replace(SPEC, seed=2), two], 9)
    assert len(specs) == 6
    for (settings, kind), of_kind in specs.items():
        assert settings == settings_of(of_kind) == settings_of(SPEC)
        assert (of_kind.train, of_kind.labeled, of_kind.val, of_kind.test) == (9, 9, 0, 0)
        assert of_kind.answers == (2 if kind == "mirror-pair-2" else 3)


def test_a_probe_that_may_be_lucky_is_no_floor():
    lucky = Probe("area", "nearest", "outline", 75, 200, 1 / 3, 0.31, 0.44, 0.1, False)
    good = replace(lucky, correct=70, beats_chance=True)
    assert floor_of("near", 3, (lucky,)) == floor_of("near", 3, (lucky, lucky))
    assert (floor_of("near", 3, (lucky,)).probe, floor_of("near-2", 2, (lucky,)).accuracy) == (
        CHANCE,
        0.5,
    )
    assert floor_of("near", 3, (lucky, good)).accuracy == 0.35


def test_floors_of_rooms_are_those_of_masks_of_other_objects(rooms_folder, monkeypatch):
    monkeypatch.setattr("iqtt.floor_probes.run_floor_probes", lambda *seen: seen)
    statistics, right, masks = probe_file(rooms_folder / "iqtt-train.h5")
    assert len(statistics) == len(right) == 2
    assert masks.shape == (2, 3, len(RULES))
    assert np.ptp(masks, axis=1).all(axis=0).any()
    spec = perspective_spec("perspective", seed=9, object_split="test", height=512)
    ((settings, kind), measured), *_ = floor_specs([spec], 300).items()
    assert (kind, measured.object_split, measured.train) == ("moved", "train", 300)
    assert settings == settings_of(replace(spec, spp=4)) != settings_of(replace(spec, width=512))
