"""What a model is not told it has to say itself: materials, and where lights are."""

from dataclasses import fields

import pytest
import torch
from pix2shape_models import made, room_source, tiny
from refusals import refused
from torch.utils.data import default_collate

from baselines.pix2shape.network.model import shaded
from baselines.pix2shape.training.steps import draw, generator_step
from scenegen.common.errors import SpecError

LEARNS = {"material": True, "lights": 2}


@pytest.fixture(scope="module")
def colourful(make_rooms, tmp_path_factory):
    """Four rooms of several shining materials, with one or two lights."""
    path = tmp_path_factory.mktemp("colourful") / "rooms.h5"
    gloss = {"specular": (0.3, 0.8), "shininess": (8.0, 64.0)}
    return make_rooms(path, 4, random_reflectance=True, lights=(1, 2), **gloss)


def batch_of(path, config):
    source = room_source(path, config)
    return source.as_batch(default_collate([source[row] for row in range(len(source))]))


def test_rooms_of_several_materials_are_for_models_that_learn_them(colourful):
    with refused(SpecError, hint="material=true"):
        room_source(colourful, tiny())
    scene = batch_of(colourful, tiny(**LEARNS)).views.scene
    told = {f.name: getattr(scene, f.name) for f in fields(scene)}
    unknown = {name for name, v in told.items() if torch.is_tensor(v) and v.isnan().any()}
    assert unknown == {"light_position", "reflectance"}
    with pytest.raises(SpecError):
        room_source(colourful, tiny(lights=3))


def test_images_and_losses_follow_from_what_the_model_says(colourful):
    """No number that is not told, NaN, gets into an image, and every part of a code is taught."""
    batch, model = batch_of(colourful, tiny(**LEARNS)), made(tiny(**LEARNS)).train()
    loss, _ = generator_step(model, batch, draw(4, model.config.networks.z, 0))
    loss.backward()
    assert torch.isfinite(loss)
    assert model.decoder.lights.weight.grad.abs().min() > 0
    assert (model.decoder.last.weight.grad.abs().amax(dim=(0, 2, 3)) > 0).all()


def test_inferred_lights_are_one_place_in_all_cameras(colourful):
    batch, model = batch_of(colourful, tiny(**LEARNS)), made(tiny(**LEARNS))
    code = torch.randn(1, model.config.networks.z).expand(4, -1)
    with torch.autocast("cpu", torch.bfloat16):  # as in training with --precision bf16
        views = model.lit(code, batch.views)
        shaded(model.surfels(code, views.condition), views)
    pose = views.world_from_camera
    world = views.scene.light_position @ pose[:, :3, :3].mT + pose[:, None, :3, 3]
    assert not torch.allclose(views.scene.light_position[0], views.scene.light_position[1])
    torch.testing.assert_close(world, model.decoder.light_positions(code))
    assert (model.decoder.light_positions(100 * code) >= 0).all(), "a light behind a wall"
