"""Models from files: cleaned once, named by the file's content, refused with a reason."""

from unittest.mock import Mock

import numpy as np
import pytest
import trimesh

from scenegen.objects.cache import DiskCache
from scenegen.objects.meshes import models
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.models import content_hash, load_model


@pytest.fixture
def ball(tmp_path):
    path = tmp_path / "ball.ply"
    path.write_bytes(trimesh.creation.icosphere(subdivisions=2).export(file_type="ply"))
    return path


@pytest.fixture
def disk(tmp_path):
    return DiskCache(tmp_path / "cache")


@pytest.fixture
def cleaned(monkeypatch):
    """Its `call_count` says how often a model was cleaned, not read from the cache."""
    counted = Mock(wraps=models.clean_mesh)
    monkeypatch.setattr(models, "clean_mesh", counted)
    return counted


def test_a_model_is_cleaned_once(ball, disk, cleaned):
    fresh, kept = load_model(ball, "y", disk), load_model(ball, "y", disk)
    assert cleaned.call_count == 1
    for name, kind in (("vertices", "float32"), ("faces", "int32"), ("hull_points", "float64")):
        assert getattr(kept, name).dtype == kind
        np.testing.assert_array_equal(getattr(kept, name), getattr(fresh, name))
    assert kept.mended == fresh.mended
    assert kept.digest == fresh.digest == content_hash(ball.read_bytes(), ".ply", "y")


def test_what_a_model_was_made_from_is_in_its_key(ball, disk, cleaned, monkeypatch):
    """The key depends on up axis, suffix, content and cleaning version, but not on the path."""
    load_model(ball, "y", disk)
    copy = ball.with_name("copy.PLY")
    copy.write_bytes(ball.read_bytes())
    load_model(copy, "y", disk)
    assert cleaned.call_count == 1
    load_model(ball, "z", disk)
    ball.write_bytes(ball.read_bytes() + b"\0")
    load_model(ball, "y", disk)
    monkeypatch.setattr(models, "CLEANING_VERSION", models.CLEANING_VERSION + 1)
    load_model(ball, "y", disk)
    assert cleaned.call_count == 4
    assert content_hash(b"", ".obj", "y") != content_hash(b"", ".off", "y")


@pytest.mark.parametrize(
    ("error", "where"), [(MemoryError(), "model"), (np.linalg.LinAlgError("odd"), "cleaning")]
)
def test_errors_that_are_not_the_file_s_are_not_kept(error, where, ball, disk, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(models, "clean_mesh", Mock(side_effect=error))
        with pytest.raises(BadMeshError) as refused:
            load_model(ball, "y", disk)
    assert refused.value.where == where
    assert str(error) in refused.value.found
    load_model(ball, "y", disk)
