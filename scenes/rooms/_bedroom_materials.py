"""Materials and textures that only the bedroom has; the rest are those of `_materials`."""

from . import _bedroom_faces as faces
from . import _bedroom_prints as prints
from . import _bedroom_textures as made
from . import _materials
from ._materials import Texture
from ._surfaces import wood
from ._types import Material

TEXTURES: dict[str, Texture] = {
    "herringbone": made.herringbone,
    "pine": lambda: made.boards(350, "9c5f28", "e2b874", 8, 26),
    "whitewash": lambda: made.boards(355, "b8a68a", "f6efe0", 8, 20, 0.3),
    "sage": lambda: made.boards(360, "6d6f42", "a9a772", 8, 14, 0.35),
    "logs": lambda: made.boards(365, "80502a", "e0ac6a", 6, 22, 0.25),
    "birch": lambda: wood(370, "a3743e", "dfc08a"),
    "walnut": lambda: wood(371, "3a2114", "8a5630"),
    "blossom": made.blossom,
    "patchwork": made.patchwork,
    "knit_red": lambda: made.knitting(380, "8f2b22", "f2e6cc", "e0a040"),
    "knit_grey": lambda: made.knitting(381, "d8c8a8", "6a3a2a", "5f6b3c"),
    "kilim": made.kilim,
    "tartan": lambda: made.weave(382, "c9a25a", "6b2a22", "2f3a28"),
    "ticking": lambda: made.weave(383, "efe4cc", "c8794a", "7a8a5c"),
    "tweed": lambda: made.weave(384, "6a5a42", "8f7a50", "3a2c22"),
    "volumes": faces.volumes,
    "cork": made.cork,
    "wicker": faces.wicker,
    "lantern": faces.lantern,
    "posters": prints.posters,
    "notes": prints.notes,
    "screen": faces.screen,
    "keys": faces.keys,
    "folk": faces.folk,
    "guitar": faces.guitar,
    "globe": faces.globe,
    "dial": faces.clock,
    "fells": faces.fells,
}
GLOSSY = {"herringbone": 0.3, "walnut": 0.25, "guitar": 0.1, "globe": 0.15}
LIGHTS = {"lantern": 1.15, "screen": 0.8, "fells": 1.15}


def _material(name: str) -> Material:
    if name in LIGHTS:
        return Material("light", name, strength=LIGHTS[name])
    return Material("glossy", name, GLOSSY[name]) if name in GLOSSY else Material("diffuse", name)


MATERIALS = {**_materials.MATERIALS, **{name: _material(name) for name in TEXTURES}}
