"""Rooms in shards are predicted and scored as one file with the same rows."""

import json

from click.testing import CliRunner

import cli
from scenegen.files.info import size_text


def call(program, *arguments):
    words = [str(argument) for argument in arguments]
    result = CliRunner().invoke(program, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_every_command_takes_a_set(make_rooms, tmp_path):
    scores, told = [], []
    for name, how in (("one", {}), ("set", {"shard_size": 3})):
        folder = tmp_path / name
        folder.mkdir()
        rooms = make_rooms(folder / "rooms.h5", 8, how)
        prediction, score = folder / "empty.h5", folder / "empty.json"
        call(cli.bench, "baseline", "empty-room", "--data", rooms, "--out", prediction)
        call(cli.bench, "validate", prediction, "--truth", rooms)
        call(cli.bench, "score", prediction, "--truth", rooms, "--json", score)
        scores.append(json.loads(score.read_text()))
        call(cli.scenegen, "preview", rooms, "--out", folder / "sheet.png")
        call(cli.scenegen, "export", rooms, "--items", "0,7", "--format", "ply", "--out", folder)
        call(cli.scenegen, "verify", rooms, "--items", 2)
        told.append(call(cli.scenegen, "info", rooms))
    assert scores[0]["summary"] == scores[1]["summary"]
    assert scores[0]["meta"]["truth_digest"] == scores[1]["meta"]["truth_digest"]
    sizes = [sum(p.stat().st_size for p in (tmp_path / "set").glob("rooms-*.h5"))]
    sizes.insert(0, (tmp_path / "one" / "rooms.h5").stat().st_size)
    for text, size in zip(told, sizes, strict=True):
        assert text.splitlines()[0].endswith(f"8 images of 32x32, {size_text(size)}")
    for file in ("sheet.png", "rooms-000007.ply"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "set" / file).read_bytes()
    verified = call(cli.scenegen, "verify", tmp_path / "set", "--items", 2)
    assert "verified" in verified
