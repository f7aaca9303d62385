"""What is known of downloads: hashes that ship with viewbench, and those of the user's first downloads."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...common.errors import UserError
from ...common.files import read_json, write_json

SHIPPED = Path(__file__).resolve().parent.parent / "catalogue.sha256.json"


class Hashes:
    """SHA-256 by address: of the file, or of the directory at the end of a zip of which only parts are fetched.

    The directory has the CRC-32 and the length of every member.
    """

    def __init__(self, root: Path, say: Callable[[str], None], shipped: Path = SHIPPED):
        self.own, self.say = root / ".viewbench" / "hashes.json", say
        self.files = (shipped, self.own)

    def check(self, address: str, what: str, sha256: str, record: bool = True) -> None:
        """Compares with what is known of the address; what is not known is recorded and said unless `record` is False.

        `what` is "file" or "directory". Raises UserError that names both hashes where they differ.
        """
        for file in self.files:
            known = self._read(file).get(address, {}).get(what)
            if known == sha256:
                return
            if known is not None:
                raise UserError(
                    f"'{address}' has another {what} than '{file}' says: its sha256 is {sha256}, expected {known}; it "
                    "was changed on the server or on the way. If you trust the new one, remove the old from that file"
                )
        if not record:
            return
        hashes = self._read(self.own)
        hashes[address] = {**hashes.get(address, {}), what: sha256}
        write_json(self.own, hashes)
        of = "" if what == "file" else " of the archive's directory"
        self.say(
            f"no hash is known for '{address}' yet: recorded sha256 {sha256}{of} in '{self.own}'; later downloads are "
            "checked against it"
        )

    @staticmethod
    def _read(file: Path) -> dict[str, Any]:
        record = read_json(file, "hashes of downloads") if file.is_file() else {}
        if not isinstance(record, dict) or not all(isinstance(value, dict) for value in record.values()):
            raise UserError(f"hashes of downloads '{file}' are not as viewbench writes them; remove the file")
        return record
