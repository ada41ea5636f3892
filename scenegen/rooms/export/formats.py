"""The formats that rows are exported to, a record each: options, docs and tests derive from them.

A record names its writer, so that a list of formats imports nothing heavy.
"""

import importlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

HERE = "scenegen.rooms.export"


@dataclass(frozen=True)
class Format:
    """A format of exports.

    Attributes:
        name: as `--format` takes it.
        holds: what its files hold, for the help.
        writer: module and function that write it: of ROW_FORMATS, of which the function returns
            what writes each file of `single.export_paths`; of FOLDER_FORMATS `folder.Writer`; of
            DATA_FORMATS a writer of `scenegen.sharing.formats`.
        endings: of the files of a row, or of a file of many rows; () for a tool's folder.
    """

    name: str
    holds: str
    writer: str
    endings: tuple[str, ...] = ()

    def load_writer(self) -> Any:
        """Import the function that writes it."""
        module, _, function = self.writer.partition(":")
        return getattr(importlib.import_module(module), function)


def _by_name(formats: Iterable[Format]) -> dict[str, Format]:
    return {form.name: form for form in formats}


PICTURES = ("image", "depth", "normal", "object_id")  # a PNG file of each
ROW_FORMATS = _by_name((
    Format("exr", "all channels in one file", f"{HERE}.single:exr_writers", (".exr",)),
    Format("png", "one image per channel, and a JSON file with their encodings",
           f"{HERE}.single:png_writers", (*(f"-{name}.png" for name in PICTURES), ".json")),
    Format("ply", "a point cloud of surfels", f"{HERE}.single:ply_writers", (".ply",)),
    Format("obj", "the scene's mesh", f"{HERE}.single:obj_writers", (".obj", ".mtl")),
))  # fmt: skip
DATA_FORMATS = _by_name((
    Format("parquet", "Parquet files for data loaders",
           "scenegen.sharing.formats:write_parquet", (".parquet",)),
    Format("webdataset", "tar files for data loaders",
           "scenegen.sharing.formats:write_tar", (".tar",)),
))  # fmt: skip
FOLDER_FORMATS = _by_name(
    Format(name, f"a folder in the layout of {tool}", f"{HERE}.{name}:write")
    for name, tool in (
        ("nerfstudio", "nerfstudio"), ("colmap", "COLMAP"), ("bop", "BOP"),
        ("coco", "COCO"), ("moge", "MoGe"), ("stereo", "Middlebury's stereo pairs"),
    )
) | _by_name((
    Format("glb", "a glTF 2.0 file per scene, with its materials, cameras and lights",
           f"{HERE}.glb:write"),
))  # fmt: skip
FORMATS = ROW_FORMATS | DATA_FORMATS | FOLDER_FORMATS
