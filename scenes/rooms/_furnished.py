"""A room from what was built, its materials, its lights and its three ways."""

from collections.abc import Mapping, Sequence

from ._builder import Builder
from ._materials import Texture, textures
from ._paths import FRAMES_PER_S, TEST_FRAMES_PER_S, at_rate, constant_speed, frames
from ._types import RGB, AreaLight, Material, Room, Walk


def furnished(
    built: Builder,
    materials: Mapping[str, Material],
    own: Mapping[str, Texture],
    lights: Sequence[AreaLight],
    size: RGB,
    human: Walk,
    smooth: Sequence[tuple[RGB, RGB]],
    test: Walk,
    smooth_rate: float = FRAMES_PER_S,
) -> Room:
    """The room of `size` metres from the origin on, with `own` textures beside those that rooms share.

    `human` and `test` are steered paths, `smooth` the stations of one at constant speed, which is so fast that its
    frames are `smooth_rate` a second. Points are of what `human` sees.
    """
    meshes = built.meshes()
    used = {name: materials[name] for name in meshes}
    return Room(
        meshes=meshes,
        materials=used,
        textures=textures(used.values(), own),
        lights=tuple(lights),
        parts=tuple(built.parts),
        inside=((0.0, 0.0, 0.0), size),
        paths={
            "human": lambda count: frames(human, FRAMES_PER_S, count),
            "smooth": lambda count: constant_speed(smooth, count, smooth_rate),
            "test": lambda count: frames(test, TEST_FRAMES_PER_S, count),
        },
        points_path=at_rate(human, FRAMES_PER_S),
    )
