"""Materials of `glass_living` by name: its own, and those that it takes from what rooms share."""

from . import _glass_pictures, _glass_textures, _materials
from ._materials import Texture
from ._types import Material

TEXTURES: dict[str, Texture] = {
    "terrazzo": _glass_textures.terrazzo,
    "fans_green": lambda: _glass_textures.fans(250, "2f6d57", "b6d3ac", "e2bd62"),
    "fans_cream": lambda: _glass_textures.fans(270, "f8eecf", "d4aa7c", "962f44"),
    "stucco": _glass_textures.stucco,
    "stucco_beam": _glass_textures.plaster_grain,
    "velvet_green": lambda: _glass_textures.velvet(290, "175a47", "5fb08e"),
    "velvet_wine": lambda: _glass_textures.velvet(294, "6a162c", "c05a6a"),
    "chevrons": _glass_textures.chevrons,
    "sunburst": _glass_textures.sunburst,
    "brocade": _glass_textures.brocade,
    "records": _glass_textures.records,
    "keys": _glass_textures.keys,
    "walnut": lambda: _glass_textures.parquetry(296, "5e3620", "c08850"),
    "rosewood": lambda: _glass_textures.parquetry(298, "5c231c", "b05a3a"),
    "alabaster": _glass_textures.alabaster,
    "posters": _glass_pictures.posters,
    "skyline": _glass_pictures.skyline,
    "deco_rug": _glass_pictures.deco_rug,
    "chess": _glass_pictures.chess,
}

MATERIALS = {
    **_materials.MATERIALS,
    "terrazzo": Material("glossy", "terrazzo", 0.08),
    "walnut": Material("glossy", "walnut", 0.15),
    "rosewood": Material("glossy", "rosewood", 0.06),
    "keys": Material("glossy", "keys", 0.15),
    "chess": Material("glossy", "chess", 0.1),
    "gold": Material("metal", (0.93, 0.68, 0.27), 0.12),
    "alabaster": Material("light", "alabaster", strength=0.92),
    "skyline": Material("light", "skyline", strength=1.02),
    **{
        name: Material("diffuse", name)
        for name in ("fans_green", "fans_cream", "stucco", "stucco_beam", "velvet_green", "velvet_wine", "chevrons")
    },
    **{name: Material("diffuse", name) for name in ("sunburst", "brocade", "records", "posters", "deco_rug")},
}
