"""Renders a room with Blender's Cycles; the only module that needs bpy, besides `_tracing`.

bpy 5.0 is for Python 3.11 and numpy 1.26 alone, so it wants an environment of its own. Pixels are the same in every
process and for any number of threads; processors differ in a pixel in a thousand, by their approximate reciprocals.
"""

import contextlib
import math
import os
import signal
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ...common import extras
from ...common.errors import UserError
from ._types import VERTEX_COLOUR, AreaLight, Material, Mesh, Room

FIELD_OF_VIEW = math.radians(75)  # from left to right
BOUNCES, DIFFUSE_BOUNCES = 6, 4
BRIGHTEST = 8.0  # indirect light of one sample is cut here, against fireflies
NEAREST_M = 0.02  # what is closer to the camera is not drawn
PALETTE = 32  # a mesh's own colours are texels of an image of so many squared
SMOOTHEST = 0.05  # alpha of microfacets; Cycles' roughness is its root


def available() -> str | None:
    """Why nothing can be rendered here, or None."""
    reason = extras.missing("bpy")
    return f"{reason} (in an environment of its own: bpy is for Python 3.11 and numpy 1.26)" if reason else None


class Renderer:
    """A room made ready for Cycles; a context manager, since textures go through a temporary folder.

    There is one Blender in a process, so the last Renderer made is the only one that renders.
    """

    def __init__(self, room: Room, size: int, threads: int = 1) -> None:
        import bpy  # pyright: ignore[reportMissingImports]: an extra

        self._bpy: Any = bpy
        self._stopped = False
        self._handlers: dict[int, Any] = {}
        if threading.current_thread() is threading.main_thread():  # bpy has set its own when it was imported
            self._handlers = {number: signal.signal(number, self._stop) for number in (signal.SIGINT, signal.SIGTERM)}
        self._folder = tempfile.TemporaryDirectory(prefix="viewbench-")
        with _quiet():
            bpy.ops.wm.read_factory_settings(use_empty=True)
            for name, mesh in room.meshes.items():
                self._add(name, mesh, room.materials[name], room.textures)
            for light in room.lights:
                self._light(light)
            self._camera = self._add_camera()
            self._set_up(size, threads)

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._folder.cleanup()

    def _stop(self, number: int, frame: object) -> None:
        """An exception in a render would end in Blender's own Python callbacks; so it waits for the picture."""
        self._stopped = True

    def render(self, c2w: np.ndarray, samples: int, seed: int) -> np.ndarray:
        """(size, size, 3) uint8, sRGB, seen from a (4, 4) camera-to-world pose with OpenGL axes.

        `samples` rays a pixel, then Open Image Denoise. Raises KeyboardInterrupt when the process was told to stop
        since the picture before, and UserError where Blender could not write it.
        """
        import mathutils  # pyright: ignore[reportMissingImports]: comes with bpy

        if self._stopped:
            raise KeyboardInterrupt
        scene = self._bpy.context.scene
        self._camera.matrix_world = mathutils.Matrix(c2w.tolist())
        scene.cycles.samples, scene.cycles.seed = samples, seed
        picture = Path(self._folder.name) / "frame.png"
        scene.render.filepath = str(picture)
        picture.unlink(missing_ok=True)
        try:
            with _quiet():
                ended = self._bpy.ops.render.render(write_still=True)
        except RuntimeError as error:  # of the disk, as a rule
            raise UserError(f"Blender could not render: {' '.join(str(error).split())}") from None
        if ended != {"FINISHED"}:
            raise KeyboardInterrupt
        with Image.open(picture) as image:
            return np.asarray(image.convert("RGB"))

    def _add(self, name: str, mesh: Mesh, material: Material, textures: Any) -> None:
        """One mesh, with its texture coordinates, its normals and its material."""
        uv, palette = mesh.uv.copy(), None
        if material.colour == VERTEX_COLOUR:
            palette, uv = _palette(mesh.colours)
        uv[:, 1] = 1 - uv[:, 1]  # Blender counts from below
        data, corners = self._bpy.data.meshes.new(name), mesh.triangles.ravel().astype(np.int32)
        data.vertices.add(len(mesh.vertices))
        data.vertices.foreach_set("co", mesh.vertices.ravel())
        data.loops.add(len(corners))
        data.loops.foreach_set("vertex_index", corners)
        data.polygons.add(len(mesh.triangles))
        data.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
        data.update(calc_edges=True)
        layer = data.uv_layers.new(name="UVMap")
        layer.uv.foreach_set("vector", uv[corners].astype(np.float32).ravel())
        data.normals_split_custom_set_from_vertices(_normals(mesh))
        data.validate()
        data.materials.append(self._material(name, material, textures, palette))
        self._link(name, data)

    def _link(self, name: str, data: Any) -> Any:
        thing = self._bpy.data.objects.new(name, data)
        self._bpy.context.scene.collection.objects.link(thing)
        return thing

    def _material(self, name: str, material: Material, textures: Any, palette: np.ndarray | None) -> Any:
        made = self._bpy.data.materials.new(name)
        made.use_nodes = True
        tree = made.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        shader = tree.nodes.new(
            {
                "diffuse": "ShaderNodeBsdfDiffuse",
                "glossy": "ShaderNodeBsdfPrincipled",
                "metal": "ShaderNodeBsdfPrincipled",
                "mirror": "ShaderNodeBsdfAnisotropic",
                "glass": "ShaderNodeBsdfGlass",
                "light": "ShaderNodeEmission",
            }[material.kind]
        )
        inputs = shader.inputs
        colour = inputs["Base Color" if material.kind in ("glossy", "metal") else "Color"]
        if isinstance(material.colour, str):
            texture = tree.nodes.new("ShaderNodeTexImage")
            if palette is not None:
                texture.image, texture.interpolation = self._palette_image(name, palette), "Closest"
            else:
                texture.image = self._texture(material.colour, textures[material.colour])
            tree.links.new(texture.outputs["Color"], colour)
        elif material.kind != "glass":
            colour.default_value = (*material.colour, 1)
        if material.kind in ("glossy", "metal"):
            inputs["Roughness"].default_value = max(material.roughness, SMOOTHEST) ** 0.5
            inputs["Metallic"].default_value = float(material.kind == "metal")
        elif material.kind in ("mirror", "glass"):
            inputs["Roughness"].default_value = 0.0
        elif material.kind == "light":
            inputs["Strength"].default_value = material.strength
        if material.kind == "glass":
            inputs["IOR"].default_value = 1.5
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
        return made

    def _texture(self, name: str, pixels: np.ndarray) -> Any:
        file = Path(self._folder.name) / f"{name}.png"
        Image.fromarray(pixels).save(file)
        return self._bpy.data.images.load(str(file))

    def _palette_image(self, name: str, palette: np.ndarray) -> Any:
        image = self._bpy.data.images.new(f"{name} colours", PALETTE, PALETTE, float_buffer=True, is_data=True)
        pixels = np.ones((PALETTE, PALETTE, 4), np.float32)
        pixels[..., :3] = palette[::-1]
        image.pixels.foreach_set(pixels.ravel())
        image.update()
        image.pack()
        return image

    def _light(self, light: AreaLight) -> None:
        data = self._bpy.data.lights.new(light.name, "AREA")
        data.shape, (data.size, data.size_y) = "RECTANGLE", light.size
        data.energy, data.color = light.watts, light.colour
        thing = self._link(light.name, data)
        thing.location, thing.rotation_euler = light.position, light.rotation
        thing.visible_camera = thing.visible_glossy = thing.visible_transmission = False

    def _add_camera(self) -> Any:
        data = self._bpy.data.cameras.new("camera")
        data.sensor_fit, data.angle, data.clip_start = "HORIZONTAL", FIELD_OF_VIEW, NEAREST_M
        camera = self._link("camera", data)
        self._bpy.context.scene.camera = camera
        return camera

    def _set_up(self, size: int, threads: int) -> None:
        scene = self._bpy.context.scene
        render = scene.render
        render.engine = "CYCLES"
        cycles = scene.cycles
        cycles.device, cycles.use_adaptive_sampling = "CPU", False
        cycles.max_bounces, cycles.diffuse_bounces = BOUNCES, DIFFUSE_BOUNCES
        cycles.caustics_reflective = cycles.caustics_refractive = False
        cycles.sample_clamp_indirect = BRIGHTEST
        cycles.use_denoising, cycles.denoiser, cycles.denoising_use_gpu = True, "OPENIMAGEDENOISE", False
        cycles.denoising_input_passes, cycles.denoising_prefilter = "RGB_ALBEDO_NORMAL", "ACCURATE"
        cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
        render.use_persistent_data = True
        render.resolution_x = render.resolution_y = size
        render.resolution_percentage = 100
        render.threads_mode, render.threads = "FIXED", threads
        render.image_settings.file_format, render.image_settings.color_mode = "PNG", "RGB"
        scene.view_settings.view_transform = "Standard"
        world = self._bpy.data.worlds.new("world")
        scene.world, world.use_nodes = world, True
        world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0


def _palette(colours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(PALETTE, PALETTE, 3) of a mesh's different colours, and each vertex's (V, 2) place in it."""
    different, which = np.unique(colours, axis=0, return_inverse=True)
    which = which.ravel()
    if len(different) > PALETTE**2:
        raise ValueError(f"a mesh has {len(different)} colours; at most {PALETTE**2} fit")
    palette = np.zeros((PALETTE**2, 3), np.float32)
    palette[: len(different)] = different
    places = np.stack([(which % PALETTE + 0.5) / PALETTE, (which // PALETTE + 0.5) / PALETTE], 1)
    return palette.reshape(PALETTE, PALETTE, 3), places


def _normals(mesh: Mesh) -> np.ndarray:
    """(V, 3) the mesh's normals, and where it has none the mean of the triangles there."""
    bare = np.linalg.norm(mesh.normals, axis=1) < 0.5
    if not bare.any():
        return mesh.normals
    first, second, third = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    across = np.cross(second - first, third - first)
    mean = np.zeros_like(mesh.vertices)
    for k in range(3):
        np.add.at(mean, mesh.triangles[:, k], across)
    mean /= np.linalg.norm(mean, axis=1, keepdims=True) + 1e-12
    return np.where(bare[:, None], mean, mesh.normals)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Blender writes on the process's own stdout, which has results only."""
    kept, nothing = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nothing)
