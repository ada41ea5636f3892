"""A data card as its readers see it: mlcroissant, datasets, and a browser that shows Markdown."""

import hashlib
import json
from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import yaml
from markdown_it import MarkdownIt

from scenegen import open_rooms
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.description.presets import preset_spec
from scenegen.files.content import row_digest
from scenegen.sharing.card import NAMES
from scenegen.sharing.export import write_export
from scenegen.sharing.index import index_columns
from scenegen.sharing.publication import Publication
from scenegen.sharing.rooms import ROOMS, default_license, make_rooms_card
from tests.support.loaders import faultless_croissant, validate

TOLD = Publication("Two rooms", ("A. Person", "B. Person"), "2026-01-31", "CC-BY-4.0")
WICKED = "</code><script>alert(1)</script> `x` | [a](javascript:1)\n# Title\n\n---\n![i](http://x)"


def make_card(paths, folder, publication=TOLD):
    with ExitStack() as stack:
        rooms = [stack.enter_context(open_rooms(path)) for path in paths]
        make_rooms_card(rooms, folder, publication)


@pytest.fixture(scope="module")
def made(holey_set, float_path, tmp_path_factory):
    """Return the folder of a card of a set and of a file."""
    folder = tmp_path_factory.mktemp("card") / "card"
    make_card([holey_set, float_path], folder)
    return folder


def test_a_card_of_interiors_says_what_is_true_of_them(interior_path, rooms_path, tmp_path):
    make_card([interior_path], tmp_path / "card")
    page = (tmp_path / "card" / "README.md").read_text()
    wrong = ("scene units", "corner", "no gamma", "two walls")
    assert not [words for words in wrong if words in page]
    assert "| `depth` | (y, x) | float32 | metre |" in page
    faultless_croissant(tmp_path / "card" / "croissant.json")
    with pytest.raises(SpecError):
        make_card([interior_path, rooms_path], tmp_path / "both")


def test_no_licence_is_guessed_of_what_others_made():
    spec = preset_spec("interiors")
    assert default_license([SimpleNamespace(spec=spec)])
    for name in ("materials", "environment"):
        with pytest.raises(SpecError):
            default_license([SimpleNamespace(spec=replace(spec, **{name: "0" * 16}))])


@pytest.fixture(scope="module")
def croissant(made):
    """Return the Croissant file as mlcroissant knows it; it may not find fault with it."""
    return faultless_croissant(made / "croissant.json")


@pytest.mark.slow
def test_the_validator_accepts_it(made, tmp_path):
    done = validate(made / "croissant.json")
    assert done.returncode == 0, done.stderr
    assert "Done." in done.stderr
    assert "WARNING" not in done.stderr.upper()
    told = json.loads((made / "croissant.json").read_text())
    told["distribution"][0].pop("sha256")
    (tmp_path / "broken.json").write_text(json.dumps(told))
    assert validate(tmp_path / "broken.json").returncode == 1, "the validator can fail"


def test_what_croissant_tells(croissant, made):
    metadata = croissant.metadata
    told = json.loads((made / "croissant.json").read_text())
    assert told["conformsTo"][0].endswith("croissant/1.1")
    assert metadata.name == "two-rooms"
    assert metadata.license == ["https://spdx.org/licenses/CC-BY-4.0.html"]
    assert [person.name for person in metadata.creators] == list(TOLD.creators)
    assert metadata.date_published.date().isoformat() == TOLD.date
    for name in ("data_collection", "data_use_cases", "data_limitations", "data_biases",
                 "personal_sensitive_information", "data_annotation_protocol"):  # fmt: skip
        assert getattr(metadata, name), name


def test_files_and_their_sha256(croissant, made, holey_set, float_path):
    folders = (made, holey_set.parent, float_path.parent)
    files = {f.name: f for f in croissant.metadata.file_objects}
    shards = [f"set-0000{i}-of-00003.h5" for i in range(3)]
    assert set(files) == {"set.h5", *shards, "float.h5", "index.parquet"}
    for name, told in files.items():
        data = next(f / name for f in folders if (f / name).exists()).read_bytes()
        assert told.sha256 == hashlib.sha256(data).hexdigest()
        assert (told.content_url, told.content_size) == (name, f"{len(data)} B")
        assert f"| {told.sha256} |" in (made / "README.md").read_text()


@pytest.mark.filterwarnings("ignore:The inplace keyword")  # of pandas, in mlcroissant
def test_records_are_the_rows(croissant, holey_set, float_path):
    """Values as mlcroissant reads them from the Parquet file, beside those of the HDF5 files."""
    records = [
        {key.removeprefix("rows/"): value for key, value in record.items()}
        for record in croissant.records("rows")
    ]
    assert [set(record) for record in records] == [{c.name for c in index_columns(ROOMS)}] * 19
    for path, some in ((holey_set, records[:14]), (float_path, records[14:])):
        with open_rooms(path) as rooms:
            assert len(some) == len(rooms)
            for row, record in enumerate(some):
                room = rooms[row]
                assert (record["file"], record["row"]) == (path.name.encode(), row)
                with h5py.File(path.parent / record["shard"].decode()) as part:
                    depth = part["depth"][record["shard_row"]]
                np.testing.assert_array_equal(depth, room.depth)
                pose = np.array(record["camera_world_from_camera"])
                np.testing.assert_array_equal(pose, room.world_from_camera)
                shapes = [item.shape.encode() for item in room.scene.objects]
                assert record["object_shapes"] == shapes
                positions = [list(light.position) for light in room.scene.lights]
                assert np.array_equal(np.array(record["light_position"]), np.array(positions))
                assert record["depth_sha256"] == row_digest(room.depth).hex().encode()
                assert record["object_count"] == len(shapes)


def test_index_and_images_in_datasets(made, holey_set, load, tmp_path):
    """The index names the rows of an export: joined, they give the pixels of the file."""
    index = load(str(made), "index").filter(lambda line: line["file"] == "set.h5")
    assert len(index) == 14
    for form, image in (("parquet", "image"), ("webdataset", "image.png")):
        with open_rooms(holey_set) as rooms:
            how = {"encoding": "linear", "rows_per_file": 5}
            write_export(rooms, ROOMS, form, tmp_path / form, **how)
            images = load(str(tmp_path / form))
            for line, row in zip(index, images, strict=True):
                pixels = np.asarray(row[image])
                assert row_digest(pixels).hex() == line["image_sha256"]
                np.testing.assert_array_equal(pixels, rooms.read("image", line["row"]))


def test_the_same_bytes_again(made, holey_set, float_path, tmp_path):
    make_card([holey_set, float_path], tmp_path / "card")
    for name in NAMES:
        assert (tmp_path / "card" / name).read_bytes() == (made / name).read_bytes()


def test_texts_from_files_and_people_stay_texts(damaged, tmp_path):
    line = WICKED.replace("\n", " ")
    changed = damaged(lambda file: file.attrs.update(creation_command=WICKED, writer=line))
    path = changed.rename(changed.with_name("a b.h5"))
    wicked = Publication(WICKED, (WICKED,), "2026-01-31", "LicenseRef-mine")
    make_card([path], tmp_path / "card", wicked)
    _, head, page = (tmp_path / "card" / "README.md").read_text().split("---\n", 2)
    assert yaml.safe_load(head)["license_name"] == "LicenseRef-mine"
    html = MarkdownIt("commonmark", {"html": True}).enable("table").render(page)
    assert not [tag for tag in ("<script", "<img", "href=\"javascript", "<h1>Title", "<hr")
                if tag in html]  # fmt: skip
    assert html.count("<h1>") == 1
    assert f"    {WICKED}".replace("\n", "\\n") in page.splitlines(), "a block, to be copied"
    told = json.loads((tmp_path / "card" / "croissant.json").read_text())
    assert told["distribution"][0]["contentUrl"] == "a%20b.h5"
    assert yaml.safe_load(head)["size_categories"] == ["n<1K"]


def test_scenes_that_are_in_two_files_are_told(rooms_path, made, tmp_path):
    assert "no scene is in two" in (made / "README.md").read_text()
    (tmp_path / "other.h5").write_bytes(rooms_path.read_bytes())
    make_card([rooms_path, tmp_path / "other.h5"], tmp_path / "card")
    page = (tmp_path / "card" / "README.md").read_text()
    assert "**8 scenes are in more than one file**" in page


def test_no_card_of_a_changed_file(damaged, tmp_path):
    def change(file):
        file["depth"][2, 3, 4] += np.float32(0.25)

    path = damaged(change)
    with pytest.raises(FileFormatError) as error:
        make_card([path], tmp_path / "card")
    assert "depth" in error.value.found
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_one_name_twice(rooms_path, tmp_path):
    (tmp_path / "rooms.h5").write_bytes(rooms_path.read_bytes())
    with pytest.raises(SpecError) as error:
        make_card([rooms_path, tmp_path / "rooms.h5"], tmp_path / "card")
    assert error.value.where == "files"
