"""Scenes as binary glTF 2.0, one file each: geometry, materials, cameras and lights.

The world has y up, as glTF has. Cameras are ours. An object is a node below what it stands on.
Maps of materials are baked to textures of at most SIDE pixels a side. The rows of our maps go up,
those of images go down, so v becomes 1 - v.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenegen.camera import look_at
from scenegen.common.errors import SpecError
from scenegen.common.records import check
from scenegen.common.srgb import encoded
from scenegen.description.interiors import WALLS
from scenegen.objects.catalogue import Objects, changed_meshes, objects_of
from scenegen.objects.furniture.room_shell import PARTS, shell
from scenegen.objects.scene_mesh import ScenePart, scene_parts, world_from_object
from scenegen.rendering.materials.material import SLOPE_STEPS, Material
from scenegen.rendering.pictures.assets import block_means, materials_of
from scenegen.rendering.pictures.matter import (
    CEILING_FLUX,
    GLOW,
    LAMP_FLUX,
    Collector,
    area_of,
    glowing,
)
from scenegen.rendering.pictures.sun import sunlight_of
from scenegen.rooms.export.gltf import Gltf
from scenegen.rooms.reader import Room

Array = NDArray[Any]
SIDE = 512  # pixels of a texture's side, at most
LAMP_AWAY = 1.5  # metres from a lamp at which a white surface may look white
NEAR = 0.01  # plane of cameras, metres
LEAST_AREA = 1e-12  # of a triangle: smaller ones have no normal in float32
WRAPS = (10497, 33071, 33648)  # repeat, clamp and mirror, as glTF numbers them


class Faces(NamedTuple):
    """Triangles of one material: corners and normals, (F, 3, 3), and what their corners have.

    `uv` is in repeats, (F, 3, 2); `colors` are linear RGB, (F, 3, 3). None for neither.
    """

    corners: Array
    normals: Array
    uv: Array | None = None
    colors: Array | None = None


def write(source: Any, folder: Path) -> dict[str, Any]:
    """Write a `folder.Source`; return its conventions.

    Raises SpecError where meshes changed, or the principal point is not the middle.
    """
    spec = source.rooms.spec
    middle = "the middle of the image, which cameras of glTF have"
    check(spec.principal_point == (0.5, 0.5), "principal point", spec.principal_point, middle)
    objects = source.objects or objects_of(spec)
    for scene, views in source.views():
        if changed := changed_meshes(objects, views[0].scene):
            found = f"models that changed in the folder: {', '.join(changed)}"
            raise SpecError(f"scene {scene}", found, "the files it was made from")
        path = folder / f"scene-{scene:06d}.glb"
        path.write_bytes(_Scene(spec, views[0], objects).file())
    return {
        "world": "right-handed, y up",
        "unit": source.unit,
        "camera": "x right, y up, looks along -z; a node for each view of the scene",
        "pixel_centers": "+0.5",
        "lights": "intensities are relative: light_scale of the scene's extras times those of the"
        " rooms, so that the brightest light makes a white surface white",
        "pictures": {"textures": {"encoding": "srgb", "bits": 8, "most_pixels_a_side": SIDE}},
    }


class _Scene:
    """A scene and its file in the making."""

    def __init__(self, spec: Any, room: Room, objects: Objects) -> None:
        self.spec, self.scene, self.shape_of = spec, room.scene, objects.shape
        self.gltf, self.roots = Gltf(), list[int]()
        self.lights: list[tuple[str, str, Array, Array]] = []  # name, type, colour and pose
        self.exposure = float(room.truth["exposure"][0]) if spec.interior else 1.0
        if spec.interior:
            self.matter = Collector(spec.seed, room.scene.index, materials_of(spec))

    def file(self) -> bytes:
        """Return the bytes of the file."""
        scene = self.scene
        below: list[list[int]] = [[] for _ in range(len(scene.objects) + 1)]
        on = scene.interior.stands_on if scene.interior else (0,) * len(scene.objects)
        placed = [world_from_object(o.position, o.rotation, o.scale) for o in scene.objects]
        placed.insert(0, np.eye(4))
        if scene.interior:
            below[0] += self._shell()
        elif scene.room_reflectance is not None:
            below[0] += self._planes(scene_parts(replace(scene, objects=())))
        nodes = [self.gltf.add("nodes", {"name": "room"})]
        for k, item in enumerate(scene.objects, start=1):
            about = {"object_id": k, "category": item.name, "instance": item.shape}
            name = f"object_{k}_{item.shape}"
            held = {"name": name, "mesh": self._object(k, placed[k]), "extras": about}
            nodes.append(self._node(held, np.linalg.inv(placed[on[k - 1]]) @ placed[k]))
        for k, support in enumerate(on, start=1):
            below[support].append(nodes[k])
        for node, children in zip(nodes, below, strict=True):
            if children:
                self.gltf.lists["nodes"][node]["children"] = children
        self._cameras()
        about = {"index": scene.index, "unit": "metre" if scene.interior else "scene unit"}
        about["light_scale"] = self._lights()
        root = {"name": f"scene-{scene.index:06d}", "nodes": [nodes[0], *self.roots]}
        whole = {"asset": {"version": "2.0", "generator": "pix2shape-bench"}, "scene": 0}
        if lights := self.gltf.lists.pop("lights", None):
            whole["extensions"] = self.gltf.extended("KHR_lights_punctual", {"lights": lights})
        return self.gltf.file({**whole, "scenes": [{**root, "extras": about}]})

    def _node(self, node: dict[str, Any], matrix: Array) -> int:
        """Add a node in its place, a similarity, and return its number."""
        scale = float(np.linalg.norm(matrix[:3, 0]))
        turned = Rotation.from_matrix(matrix[:3, :3] / scale).as_quat(canonical=True)
        told: dict[str, Any] = {"translation": (matrix[:3, 3] + 0.0).tolist()}
        told["rotation"] = (turned + 0.0).tolist()
        told |= {"scale": [scale] * 3} if abs(scale - 1) > 1e-12 else {}
        return self.gltf.add("nodes", {**node, **told})

    def _cameras(self) -> None:
        aspect = self.spec.width / self.spec.height * self.spec.pixel_aspect
        for i, camera in enumerate(self.scene.cameras):
            lens = {"yfov": float(np.radians(camera.fov_y_degrees)), "aspectRatio": aspect}
            told = {"type": "perspective", "perspective": {**lens, "znear": NEAR}}
            node = {"name": f"view_{i}", "camera": self.gltf.add("cameras", told)}
            self.roots.append(self._node(node, camera.world_from_camera))

    def _lights(self) -> float:
        """Add the sun or the paper's point lights to the lamps, and return by what all are scaled.

        A point light is as bright at the cameras' target as by the shading equation. Viewers lack
        the light that walls reflect and, mostly, shadows: the exposure of an image would be too
        much for its sun.
        """
        if self.scene.interior:
            toward, light = sunlight_of(self.scene.interior)
            if light.any() and not self.spec.environment:
                pose = look_at(toward, np.zeros(3))
                pose[:3, 3] = 0.0
                self.lights.append(("sun", "directional", light, pose))
        k_l, k_q = self.scene.attenuation
        for j, point in enumerate(self.scene.lights, start=1):
            away = float(np.linalg.norm(np.subtract(point.position, self.spec.camera_target)))
            color = np.pi * np.array(point.color) * away / (k_l + k_q * away)
            self.lights.append((f"light_{j}", "point", color, _moved(point.position)))
        scale = self.exposure
        for _, kind, color, _ in self.lights if self.scene.interior else ():
            received = float(color.max()) / (LAMP_AWAY**2 if kind == "point" else 1.0)
            scale = min(scale, np.pi / received)
        for name, kind, color, pose in self.lights:
            most = max(float(color.max()), 1e-9)
            told = {"type": kind, "name": name, "color": (color / most).tolist()}
            number = {"light": self.gltf.add("lights", {**told, "intensity": scale * most})}
            node = {"name": name, "extensions": self.gltf.extended("KHR_lights_punctual", number)}
            self.roots.append(self._node(node, pose))
        return float(scale)

    def _lamp(self, name: str, corners: Array, flux: float) -> Material:
        """Return the material of triangles that shine, and add a point light of their flux."""
        made, middle = glowing(corners, flux), corners.reshape(-1, 3).mean(axis=0)
        color = np.array(made.radiance) * area_of(corners) / 4  # of pi radiance area / (4 pi)
        self.lights.append((name, "point", color, _moved(middle)))
        return made

    def _shell(self) -> Iterator[int]:
        assert self.scene.interior is not None
        found, rows = shell(self.scene.interior), self.matter.of_room()
        normals = np.repeat(found.normals[:, None], 3, axis=1)
        for i, part in enumerate(PARTS):
            of = found.part == i
            if not of.any():
                continue
            one, corners = self.matter.materials[rows[i]], found.corners[of]
            if part == GLOW and self.scene.interior.lit:
                one = self._lamp("ceiling_light", corners, CEILING_FLUX)
            faces = Faces(corners, normals[of], found.uv[of] / one.metres)
            yield self._part(f"wall_{part}" if part in WALLS else part, faces, one)

    def _planes(self, parts: list[ScenePart]) -> Iterator[int]:
        one = _painted(self.scene.room_reflectance)
        for part in parts:
            faces = Faces(part.mesh.vertices[part.mesh.faces], part.normals)
            yield self._part(part.name, faces, one)

    def _part(self, name: str, faces: Faces, one: Material) -> int:
        """Add a node for a part of the room, which is seen from inside alone."""
        mesh = {"primitives": [self._primitive(faces, one, two_sided=False)]}
        return self.gltf.add("nodes", {"name": name, "mesh": self.gltf.add("meshes", mesh)})

    def _object(self, k: int, placed: Array) -> int:
        """Return the number of an object's mesh; objects of one shape and material share it."""
        item = self.scene.objects[k - 1]
        shape = self.shape_of(item.shape)
        if shape.furnished is None:
            one = _painted(item.reflectance, item.specular, item.shininess)
            own = shape.colors if getattr(self.spec, "own_reflectance", False) else None
            faces = Faces(shape.triangles, shape.normals, None, own)
            return self.gltf.add("meshes", {"primitives": [self._primitive(faces, one)]})
        primitives, lit = [], self.scene.interior is not None and self.scene.interior.lit
        thing, vertices, _ = shape.furnished
        rows = self.matter.of_piece(item.shape, thing)
        corners = vertices[thing.faces]
        for i, kind in enumerate(thing.materials):
            of = thing.part == i
            if not of.any():
                continue
            one = self.matter.materials[rows[i]]
            if kind == GLOW and lit:
                world = corners[of] @ placed[:3, :3].T + placed[:3, 3]
                one = self._lamp(f"lamp_of_object_{k}", world, LAMP_FLUX)
            uv = thing.corner_uv[of].astype(float) / one.metres
            faces = Faces(corners[of], thing.corner_normals[of], uv)
            primitives.append(self._primitive(faces, one))
        return self.gltf.add("meshes", {"primitives": primitives})

    def _primitive(self, faces: Faces, one: Material, two_sided: bool = True) -> dict[str, Any]:
        """Return triangles and their material. Vertices that are equal in all are one."""
        texels = _unpacked(one.texels())
        if texels.shape[0] == 1 < texels.shape[1]:  # colours of faces, which no filter may mix
            assert faces.uv is not None
            place = (faces.uv[..., 0] * texels.shape[1]).astype(int).clip(0, texels.shape[1] - 1)
            faces = faces._replace(colors=texels[0, place, :3])
            texels = np.append(np.ones(3), texels[0, 0, 3]).reshape(1, 1, 4)
        material, textured = self._material(one, texels, two_sided)
        a, b, c = np.asarray(faces.corners, float).swapaxes(0, 1)
        across = np.cross(b - a, c - a)
        solid = np.linalg.norm(across, axis=1) > LEAST_AREA
        normals = np.asarray(faces.normals, float)
        length = np.linalg.norm(normals, axis=2, keepdims=True)
        flat = np.broadcast_to(across[:, None], normals.shape)
        normals = np.where(length > 0.5, normals, flat)
        normals = normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-30)
        columns = {"POSITION": np.asarray(faces.corners), "NORMAL": normals}
        if textured and faces.uv is not None:
            columns["TEXCOORD_0"] = np.stack([faces.uv[..., 0], 1 - faces.uv[..., 1]], axis=-1)
        if faces.colors is not None:
            columns["COLOR_0"] = faces.colors
        kept = [np.asarray(x[solid], "<f4").reshape(-1, x.shape[-1]) for x in columns.values()]
        rows = np.ascontiguousarray(np.concatenate(kept, axis=1) + np.float32(0))  # no minus 0
        keys = rows.view(np.dtype((np.void, rows.strides[0])))[:, 0]
        _, first, index = np.unique(keys, return_index=True, return_inverse=True)
        ends = np.cumsum([x.shape[1] for x in kept])[:-1]
        attributes = {
            name: self.gltf.accessor(values, "<f4", name == "POSITION")
            for name, values in zip(columns, np.split(rows[first], ends, axis=1), strict=True)
        }
        if "normalTexture" in self.gltf.lists["materials"][material]:
            tangents = _tangents(rows[first, :8].astype(float), index.reshape(-1, 3))
            attributes["TANGENT"] = self.gltf.accessor(tangents, "<f4")
        small = "<u2" if len(first) < 2**16 else "<u4"
        indices = self.gltf.accessor(index.reshape(-1), small)
        return {"attributes": attributes, "indices": indices, "material": material}

    def _material(self, one: Material, texels: Array, two_sided: bool) -> tuple[int, bool]:
        """Return the number of a material, and whether it has textures."""
        wrap = (WRAPS[one.wrap[0]], WRAPS[one.wrap[1]])
        texels = _reduced(texels)[::-1]
        color, rough = texels[..., :3], texels[..., 3]
        surface: dict[str, Any] = {"metallicFactor": one.metallic}
        if np.ptp(color.reshape(-1, 3), axis=0).any():
            surface["baseColorTexture"] = self.gltf.texture(_bytes(encoded(color)), wrap)
        else:
            surface["baseColorFactor"] = [*color[0, 0].tolist(), 1.0]
        if np.ptp(rough):
            planes = np.stack([0 * rough, rough, np.full_like(rough, one.metallic)], axis=-1)
            surface["metallicRoughnessTexture"] = self.gltf.texture(_bytes(planes), wrap)
            surface["metallicFactor"] = 1.0
        else:
            surface["roughnessFactor"] = float(rough[0, 0])
        told: dict[str, Any] = {"pbrMetallicRoughness": surface}
        if one.slopes is not None:
            told["normalTexture"] = self.gltf.texture(_normal_map(one), wrap)
        textured = "normalTexture" in told or any("Texture" in name for name in surface)
        extensions: dict[str, Any] = {}
        if one.specular < 0.5 and not one.metallic:  # 0.5 is F0 = 0.04, that of glTF
            factor = {"specularFactor": 2 * one.specular}
            extensions |= self.gltf.extended("KHR_materials_specular", factor)
        if any(one.radiance):
            bright = self.exposure * max(one.radiance)
            surface["baseColorFactor"] = [0.0, 0.0, 0.0, 1.0]
            told["emissiveFactor"] = (np.array(one.radiance) / max(one.radiance)).tolist()
            factor = {"emissiveStrength": bright}
            extensions |= self.gltf.extended("KHR_materials_emissive_strength", factor)
        told |= {"extensions": extensions} if extensions else {}
        told |= {"doubleSided": True} if two_sided else {}
        return self.gltf.add("materials", told), textured


def _tangents(vertices: Array, faces: Array) -> Array:
    """Return the directions of u along the surface, and the side of v, (V, 4).

    `vertices` are position, normal and texture coordinates, (V, 8).
    """
    points, normals, uv = np.split(vertices, (3, 6), axis=1)
    a, b = (points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2))
    (ua, va), (ub, vb) = ((uv[faces[:, k]] - uv[faces[:, 0]]).T[..., None] for k in (1, 2))
    side = np.sign(ua * vb - ub * va)
    along = np.zeros((2, len(vertices), 3))
    for k in range(3):
        np.add.at(along[0], faces[:, k], side * (a * vb - b * va))
        np.add.at(along[1], faces[:, k], side * (b * ua - a * ub))
    flat = along[0] - normals * (normals * along[0]).sum(axis=1, keepdims=True)
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    other = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])  # where u is constant
    flat = np.where(length > 1e-12, flat / np.maximum(length, 1e-12), other)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    up = -(np.cross(normals, flat) * along[1]).sum(axis=1)  # v goes down in images
    return np.column_stack([flat, np.where(up < 0, -1.0, 1.0)])


def _moved(place: Any) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return matrix


def _painted(rho: Any, specular: float = 0.0, shininess: float = 1.0) -> Material:
    """Return a surface of the paper's shading equation.

    Its highlight is as wide as Phong's, and as bright where it is brightest, up to what glTF has.
    """
    at_normal = 8 * specular / (shininess + 2)  # F0: that of GGX is F0 / (4 alpha^2)
    rough = (2 / (shininess + 2)) ** 0.25 if specular else 1.0
    return Material(np.array(rho), rough, specular=min(0.5, at_normal / 0.08))


def _unpacked(texels: Array) -> Array:
    """Return linear RGB and roughness, (H, W, 4), of `Material.texels`."""
    values = np.ascontiguousarray(texels).view(np.uint8).reshape(*texels.shape, 4) / np.float32(255)
    values[..., :3] **= 2
    return np.asarray(values)


def _reduced(values: Array) -> Array:
    """Return a map, (H, W, C), of at most SIDE pixels a side, as means of blocks."""
    return block_means(values, -(-max(values.shape[:2]) // SIDE))


def _normal_map(one: Material) -> Array:
    """Return normals in the frame of texture coordinates, x right and y up, (H, W, 3) uint8."""
    assert one.slopes is not None
    slopes = np.ascontiguousarray(one.slopes).view("<i2").reshape(*one.slopes.shape, 2)
    tilt = _reduced(slopes * np.float32(one.bumps / (one.metres * SLOPE_STEPS)))[::-1]
    normals = np.concatenate([-tilt, np.ones_like(tilt[..., :1])], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return _bytes(normals * 0.5 + 0.5)


def _bytes(shares: Array) -> Array:
    return np.asarray(np.rint(np.clip(shares, 0, 1) * 255).astype(np.uint8))
