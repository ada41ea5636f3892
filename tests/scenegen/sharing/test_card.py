"""A data card as its readers see it: Hugging Face's reader of headers, and Markdown on a page."""

from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace

import pytest
import yaml
from markdown_it import MarkdownIt

from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.description.presets import preset_spec
from scenegen.sharing.card import Publication
from scenegen.sharing.export import write_export
from scenegen.sharing.rooms import ROOMS, default_license, write_rooms_card

TOLD = Publication("Two rooms", ("A. Person", "B {Person}"), "CC-BY-4.0")
WICKED = "</code><script>alert(1)</script> `x` | [a](javascript:1)\n# Title\n\n---\n![i](http://x)"


def make_card(paths, path, publication=TOLD):
    with ExitStack() as stack:
        rooms = [stack.enter_context(open_rooms(path)) for path in paths]
        write_rooms_card(path, rooms, publication)
    return path.read_text()


@pytest.fixture(scope="module")
def page(holey_set, float_path, tmp_path_factory):
    """Return the card of a set and of a file."""
    return make_card([holey_set, float_path], tmp_path_factory.mktemp("card") / "README.md")


def test_no_licence_is_guessed_of_what_others_made():
    spec = preset_spec("interiors")
    assert default_license([SimpleNamespace(spec=spec)])
    for name in ("materials", "environment"):
        with pytest.raises(SpecError):
            default_license([SimpleNamespace(spec=replace(spec, **{name: "0" * 16}))])


def test_texts_from_files_and_people_stay_texts(damaged, tmp_path):
    changed = damaged(lambda file: file.attrs.update(creation_command=WICKED))
    path = changed.rename(changed.with_name("a [b].h5"))
    wicked = Publication(WICKED, (WICKED,), "LicenseRef-mine")
    _, head, page = make_card([path], tmp_path / "README.md", wicked).split("---\n", 2)
    header = yaml.safe_load(head)
    assert (header["license"], header["license_name"]) == ("other", "LicenseRef-mine")
    html = MarkdownIt("commonmark", {"html": True}).enable("table").render(page)
    assert not [tag for tag in ("<script", "<img", "href=\"javascript", "<h1>Title", "<hr")
                if tag in html]  # fmt: skip
    assert html.count("<h1>") == 1
    assert f"    {WICKED}".replace("\n", "\\n") in page.splitlines(), "a block, to be copied"


@pytest.mark.parametrize("several", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_parquet_beside_a_card_and_its_files_is_read(
    several, rooms_path, float_path, load, tmp_path
):
    paths, data = [rooms_path, float_path][: 1 + several], tmp_path / "data"
    data.mkdir()
    for path in paths:
        with open_rooms(path) as rooms:
            for part in write_export(rooms, ROOMS, "parquet", tmp_path / path.stem):
                part.rename(data / part.name)
        (data / path.name).write_bytes(path.read_bytes())
    make_card(paths, data / "README.md")
    for path, config in zip(paths, ["rooms", "float"] if several else [None], strict=True):
        with open_rooms(path) as rooms:
            loaded = load(str(data), config)
            assert loaded["scene_index"] == [room.scene.index for room in rooms]
            assert loaded.num_rows == len(rooms)


@pytest.mark.parametrize(
    ("wrong", "where"),
    [
        ({"title": " "}, "title"),
        ({"creators": ()}, "creator"),
        ({"creators": ("A", "")}, "creator"),
        ({"license": "do as you like"}, "license"),
        ({"license": "https://x.org/><script>"}, "license"),
    ],
)
def test_what_cannot_be_published(wrong, where):
    with pytest.raises(SpecError) as error:
        replace(TOLD, **wrong)
    assert error.value.where == where
    assert TOLD.license_address == "https://spdx.org/licenses/CC-BY-4.0.html"
    assert replace(TOLD, license="https://x.org/a").license_address == "https://x.org/a"
