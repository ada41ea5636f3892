"""Many scenes as one struct of arrays; each can be had as a `SceneSpec` or as its JSON."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Camera
from scenegen.common.records import from_json
from scenegen.description.interiors import Interior
from scenegen.description.scenes import Light, PlacedObject, SceneSpec

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class SceneArrays:
    """S scenes with V cameras, K object slots and L light slots; unused slots hold zeros.

    Attributes:
        names: names of models, as in `scenes.PlacedObject.shape`; `shape` is an index into them.
        index: numbers of the scenes in their data set, (S,) int64.
        camera_position, camera_target: world, (S, V, 3).
        fov_y_degrees: (S, V).
        object_count, light_count: (S,) int32.
        shape: index into `names`, (S, K) int32; -1 in unused slots.
        mesh: digests of the models' files, (S, K) texts; empty for built-in objects.
        position, rotation, scale: of objects, (S, K, 3), (S, K, 4) and (S, K).
        reflectance, gloss: rho, (S, K, 3), and Phong's k_s and exponent, (S, K, 2).
        light_position, light_color: (S, L, 3).
        ambient, attenuation: (S, 3) and (S, 2).
        room_reflectance: (S, 3); NaN where there is no room.
        background: (S, 3).
        interior: closed rooms as JSON, (S,) texts; empty for others.
    """

    names: Sequence[str]
    index: Array
    camera_position: Array
    camera_target: Array
    fov_y_degrees: Array
    object_count: Array
    shape: Array
    mesh: Array
    position: Array
    rotation: Array
    scale: Array
    reflectance: Array
    gloss: Array
    light_count: Array
    light_position: Array
    light_color: Array
    ambient: Array
    attenuation: Array
    room_reflectance: Array
    background: Array
    interior: Array

    def __len__(self) -> int:
        return len(self.index)

    def take(self, rows: Any) -> "SceneArrays":
        """Return some of the scenes, by their rows here."""
        arrays = {name: getattr(self, name)[rows] for name in _ARRAYS}
        return replace(self, **arrays)

    def scene(self, row: int) -> SceneSpec:
        """Return one scene as a record of its own."""
        parts = self._described(row)
        kinds: dict[str, Callable[..., Any]]
        kinds = {"cameras": Camera, "objects": PlacedObject, "lights": Light}
        for name, kind in kinds.items():
            parts[name] = [kind(**_with_tuples(part)) for part in parts[name]]
        if self.interior[row]:
            parts["interior"] = from_json(Interior, self.interior[row], "interior")
        return SceneSpec(**_with_tuples(parts))

    def to_json(self, row: int) -> str:
        """Return what `SceneSpec.to_json` gives for one scene, without the records."""
        return json.dumps(self._described(row), separators=(",", ":"))

    def _described(self, row: int) -> dict[str, Any]:
        """Return one scene as dictionaries and lists, in the order of the records' fields."""
        objects, lights = int(self.object_count[row]), int(self.light_count[row])
        room = self.room_reflectance[row].tolist()

        def used(*names: str, count: int | None) -> list[Any]:
            return list(zip(*(getattr(self, n)[row, :count].tolist() for n in names), strict=True))

        return {
            "index": int(self.index[row]),
            "cameras": [
                {"position": position, "target": target, "fov_y_degrees": fov}
                for position, target, fov in used(
                    "camera_position", "camera_target", "fov_y_degrees", count=None
                )
            ],
            "objects": [
                {
                    "shape": self.names[shape],
                    "position": position,
                    "rotation": rotation,
                    "scale": scale,
                    "reflectance": reflectance,
                    "specular": specular,
                    "shininess": shininess,
                    "mesh": mesh,
                }
                for shape, position, rotation, scale, reflectance, (specular, shininess), mesh in (
                    used(
                        "shape", "position", "rotation", "scale", "reflectance", "gloss", "mesh",
                        count=objects,
                    )
                )
            ],
            "lights": [
                {"position": position, "color": color}
                for position, color in used("light_position", "light_color", count=lights)
            ],
            "ambient": self.ambient[row].tolist(),
            "attenuation": self.attenuation[row].tolist(),
            "room_reflectance": None if room[0] != room[0] else room,
            "background": self.background[row].tolist(),
            **({"interior": json.loads(self.interior[row])} if self.interior[row] else {}),
        }  # fmt: skip


_ARRAYS = tuple(field.name for field in fields(SceneArrays) if field.name != "names")


def _with_tuples(values: dict[str, Any]) -> dict[str, Any]:
    return {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}


def joined(parts: Sequence[SceneArrays]) -> SceneArrays:
    """Return the scenes of all parts, which have the same slots and the same names."""
    if len(parts) == 1:
        return parts[0]
    arrays: dict[str, Any]
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS}
    return replace(parts[0], **arrays)
