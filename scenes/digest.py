"""One hash of everything that a scene was read from."""

import hashlib
from pathlib import Path

from viewbench.common.errors import UserError
from viewbench.common.files import sha256_file
from viewbench.scenes.types import Scene


def scene_sha256(scene: Scene) -> str:
    """Hex SHA-256 over the metadata files, the images of both splits and the rule of the test split."""
    digest = hashlib.sha256(scene.holdout.encode())
    try:
        for path in scene.files:
            digest.update(_entry(path.name, path))
        for split in (scene.train, scene.test):
            for name, path in zip(split.names, split.paths, strict=True):
                digest.update(_entry(name, path))
    except OSError as error:
        raise UserError(f"scene '{scene.name}': '{error.filename}' cannot be read: {error.strerror}") from None
    return digest.hexdigest()


def _entry(name: str, path: Path) -> bytes:
    """Surrogates stand in names that are not UTF-8 on disk."""
    return f"{name}\0{sha256_file(path)}\0".encode(errors="surrogatepass")
