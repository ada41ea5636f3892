"""Every setting of a request has an option whose help tells its default; nonsense is one line."""

import json
import re
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import click
import h5py
import pytest
from click.testing import CliRunner, Result

import cli
from scenegen.description.presets import PATH_SAMPLES, PRESETS, VISIBLE_SHARE
from scenegen.description.specs import DatasetSpec

# Settings that no option sets by their own name.
BY_OTHERS = {"height", "width", "source", "listing"}  # --size; --shapes, --classes and the folders
FIXED = {"camera_target"}
NOT_SETTINGS = {
    "count", "out", "preset", "size", "classes", "shapenet_root", "objects_root", "up", "cache_dir",
    "compression", "batch", "device", "overwrite",
}  # fmt: skip
RENDER = ("render", "--n", 1, "--size", 16, "--objects", 1)


@pytest.fixture(scope="module")
def options() -> dict[str, click.Option]:
    """Return the options of `scenegen render` by name."""
    command = cli.scenegen.get_command(click.Context(cli.scenegen), "render")
    return {p.name: p for p in command.params if isinstance(p, click.Option)}


def test_every_setting_has_an_option(options: dict[str, click.Option]) -> None:
    settings = {field.name for field in fields(DatasetSpec)}
    assert settings - set(options) == BY_OTHERS | FIXED
    assert set(options) - settings == NOT_SETTINGS


def shown(value: Any) -> str:
    """A default as the help tells it."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        if len(set(value)) == 1:
            return shown(value[0])
        return ("-" if len(value) == 2 else ",").join(map(shown, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def test_the_help_tells_the_defaults(options: dict[str, click.Option]) -> None:
    spec = DatasetSpec()
    special = {
        "shapes": "all",
        "min_visible_pixels": f"{VISIBLE_SHARE:.1%}",
        "random_reflectance": "same",
        "attenuation": "0.5,0.5",
        "views": "0",
    }
    untold = {"allow_cropped", "room_reflectance"}  # a flag; and what follows another
    for name, option in options.items():
        if name in NOT_SETTINGS or name in untold:
            continue
        expected = special.get(name, shown(getattr(spec, name)))
        if option.show_default:
            assert option.default == getattr(spec, name), name
        else:
            told = re.search(r"\[(.*)\]\.$", option.help or "")
            assert told, name
            assert told[1] == expected, name
            assert option.default not in (True, False, getattr(spec, name)), (
                "a preset may say other"
            )
    assert f"[{DatasetSpec.height}]" in (options["size"].help or "")
    assert options["preset"].default == "shapes"
    assert PRESETS["shapes"].settings == {}
    assert not spec.allow_cropped


@pytest.mark.parametrize(
    ("option", "setting"),
    [
        ("--views 0,5,35", ("views", [0, 5, 35])),
        ("--shading path --spp 1", ("shading", "path")),
        ("--shading path", ("spp", PATH_SAMPLES)),
        ("--specular 0.2-0.4", ("specular", [0.2, 0.4])),
        ("--preset specular --shininess 30", ("shininess", [30, 30])),
        ("--random-reflectance", ("random_reflectance", True)),
        ("--preset albedo --same-reflectance", ("random_reflectance", False)),
        ("--light-saturation 0", ("light_saturation", 0)),
        ("--light-level 2", ("light_level", 2)),
        ("--light-radius 3", ("light_radius", 3)),
        ("--ambient 0.1,0.2,0.3", ("ambient", [0.1, 0.2, 0.3])),
        ("--ambient black", ("ambient", [0, 0, 0])),
        ("--attenuation 1,0", ("attenuation", [1, 0])),
        ("--fov 20", ("fov_degrees", 20)),
        ("--camera-radius 2", ("camera_radius", 2)),
        ("--classes mug,bowl", ("source", "families")),
        ("--classes 'mug, bowl'", ("shapes", ["mug", "bowl"])),
        ("--classes mug --object-split val", ("object_split", "val")),
        ("--preset shapenet --object-split test", ("object_split", "test")),
        ("--preset shapenet --shapes box", ("source", "shapes")),
        ("--preset shapenet --classes chair", ("shapes", ["chair"])),
        ("--preset random-lights", ("lights", [1, 5])),
        ("--preset random-lights --lights 2", ("lights", [2, 2])),
        ("--preset furniture-256", ("height", 16)),
    ],
)
def test_options_reach_the_request(
    run: Callable[..., Result], option: str, setting: tuple[str, Any]
) -> None:
    result = run(*RENDER, *(part.strip("'") for part in re.findall(r"'[^']*'|\S+", option)))
    assert result.exit_code == 0, result.output
    with h5py.File("rooms.h5") as file:
        assert json.loads(file.attrs["spec"])[setting[0]] == setting[1]


def test_images_are_counted_by_views(run: Callable[..., Result]) -> None:
    result = run("render", "--n", 2, "--size", 16, "--views", "0,10,20")
    assert result.stdout.startswith("rooms.h5: 6 images, ")
    with h5py.File("rooms.h5") as file:
        assert len(file["image"]) == 6


NONSENSE = [
    ("--preset nosuch", "preset: found nosuch", "shapes-single", "views"),
    ("--views 5,0", "views: found 5, 0", "rising degrees from 0"),
    ("--views 5", "views: found 5", "rising degrees from 0"),
    ("--views 0,5,5", "views: found 0, 5, 5", "rising"),
    ("--views 0,81", "views: found 0, 81", "at most 80"),
    ("--views 0,-5", "--views", "'0,-5'", "numbers such as 0,5,35"),
    ("--views 0,,5", "--views", "'0,,5'", "numbers"),
    ("--views 0,nan", "--views", "'0,nan'", "numbers"),
    ("--views " + ",".join(map(str, range(70))), "views: found", "80"),
    ("--attenuation 1", "attenuation: found (1.0,)", "k_l and k_q"),
    ("--attenuation 1,2,3", "attenuation: found (1.0, 2.0, 3.0)", "k_l and k_q"),
    ("--attenuation 0,0", "attenuation: found (0.0, 0.0)", "not both 0"),
    ("--attenuation x", "--attenuation", "'x'", "numbers"),
    ("--attenuation 1e999,1", "attenuation: found (inf, 1.0)", "from 0 to 100"),
    ("--attenuation 0,1e-300", "attenuation: found (0.0, 1e-300)", "from 0 to 100"),
    ("--light-saturation 1.5", "light saturation: found 1.5", "0 to 1"),
    ("--light-saturation nan", "light saturation: found nan", "0 to 1"),
    ("--light-level -1", "light level: found -1", "0 to 100"),
    ("--light-level inf", "light level: found inf", "0 to 100"),
    ("--light-radius 1", "light radius: found 1.0", "around the room"),
    ("--camera-radius nan", "camera radius: found nan", "around the room"),
    ("--fov 0", "fov: found 0.0", "1 to 120"),
    ("--fov nan", "fov: found nan", "1 to 120"),
    ("--ambient 2", "ambient: found (2.0, 2.0, 2.0)", "0 to 1"),
    ("--reflectance 0.5,0.5", "--reflectance", "'0.5,0.5'", "R,G,B"),
    ("--reflectance red", "--reflectance", "'red'", "R,G,B"),
    ("--reflectance 1.5", "reflectance: found (1.5, 1.5, 1.5)", "0 to 1"),
    ("--room-reflectance 1,1,1.1", "room reflectance: found", "0 to 1"),
    ("--specular 11", "specular: found 11", "0.0-10.0"),
    ("--specular 0.5-0.1", "specular: found 0.5-0.1", "rising range"),
    ("--specular -1", "--specular", "'-1'", "number or a range"),
    ("--specular 1 --shininess 0.5", "shininess: found 0.5", "1.0-10000.0"),
    ("--shininess 1,5", "--shininess", "'1,5'", "number or a range"),
    ("--shading raster", "--shading", "'raster'", "'paper', 'path'"),
    ("--shading path --shadows", "shadows: found with shading 'path'", "one of the two"),
    ("--classes box", "classes: found 'box'", "bag, bottle, bowl"),
    ("--classes mug,mug", "classes: found", "each name once"),
    ("--classes mug,", "classes: found ''", "bag, bottle"),
    ("--classes MUG", "classes: found 'MUG'", "mug"),
    ("--shapes mug", "shapes: found 'mug'", "box, sphere"),
    ("--shapes box --classes mug", "--shapes beside --classes", "one of them"),
    ("--shapes box --objects-root .", "--shapes beside", "folder of meshes", "one of them"),
    ("--shapes box --object-split train", "object split: found train", "'all' for shapes"),
    ("--object-split train", "object split: found train", "'all' for shapes"),
    ("--classes mug --object-split dev", "--object-split", "'dev'"),
    ("--shapenet-root . --objects-root .", "--shapenet-root and --objects-root", "one of them"),
    ("--objects-root nosuch", "nosuch: no such folder"),
    ("--shapenet-root nosuch", "nosuch: no such folder"),
    ("--shapenet-root .", "found no ShapeNet", "--objects-root"),
    ("--objects-root .", "no sub-folders"),
    ("--up x", "--up", "'x'"),
]


@pytest.mark.parametrize("case", NONSENSE, ids=lambda case: case[0][:40])
def test_nonsense_is_told_in_one_line(refuses: Callable[..., str], case: tuple[str, ...]) -> None:
    options, *words = case
    refuses("render", "--n", 1, "--size", 16, *options.split(), words=tuple(words))


def test_the_help_of_presets_and_render_names_what_is_there() -> None:
    help_text = CliRunner().invoke(cli.scenegen, ["render", "--help"]).output
    assert "scenegen presets" in help_text
    assert max(map(len, help_text.splitlines())) <= 80
    assert CliRunner().invoke(cli.scenegen, ["presets", "--help"]).exit_code == 0
