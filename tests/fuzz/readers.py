"""All readers that are fuzzed, by name; those whose package is not installed are left out."""

from tests.fuzz import _files, _records, _scenes
from tests.fuzz._reader import Reader
from viewbench.common import extras

ALL = (*_scenes.READERS, *_files.READERS, *_records.READERS)


def known() -> dict[str, Reader]:
    """The readers that can be tried here."""
    return {reader.name: reader for reader in ALL if not reader.package or extras.missing(reader.package) is None}
