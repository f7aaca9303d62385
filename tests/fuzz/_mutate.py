"""Damages the content of files: bytes of any kind, lines of text, and values of JSON, YAML and TOML."""

import json
import struct
import tomllib
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

from tests.fuzz import _odd

MOST = 1 << 18  # bytes of a damaged file


def damaged(name: str, data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """The content of the file `name` with one to four faults; `pool` has contents to splice parts from."""
    from tests.fuzz import _containers

    suffix = name.rsplit(".", 1)[-1].lower()
    known = {**KINDS, **_containers.KINDS}.get(suffix, any_bytes)
    for _ in range(rng.choice((1, 1, 1, 1, 2, 2, 3, 4))):
        way = any_bytes if rng.random() < 0.2 else known
        try:
            data = way(data, rng, pool)[:MOST]
        except (ArithmeticError, LookupError, RecursionError, TypeError, ValueError):  # what is damaged is odd already
            data = any_bytes(data, rng, pool)[:MOST]
    return data


def place(size: int, rng: Random) -> int:
    """A place in so many bytes, more often one near the start or the end, where lengths and counts are."""
    if size < 2:
        return 0
    way = rng.random()
    if way < 0.45:
        return rng.randrange(min(size, 128))
    return rng.randrange(max(0, size - 64), size) if way < 0.55 else rng.randrange(size)


def any_bytes(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of any file."""
    made, at = bytearray(data), place(len(data), rng)
    way = rng.randrange(12)
    if way <= 1:
        for _ in range(rng.choice((1, 1, 2, 8))):
            if made:
                made[place(len(made), rng)] ^= 1 << rng.randrange(8)
    elif way == 2:
        for _ in range(rng.choice((1, 1, 4))):
            if made:
                made[place(len(made), rng)] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
    elif way <= 5:
        at -= at % rng.choice((1, 1, 2, 4, 8))
        number = odd_number(rng)
        made[at : at + len(number)] = number
    elif way == 6:
        del made[at:]
    elif way == 7:
        del made[at : at + rng.choice((1, 2, 4, 8, 64))]
    elif way == 8:
        made[at:at] = rng.randbytes(rng.choice((1, 2, 4, 16)))
    elif way == 9:
        part = made[at : at + rng.choice((1, 4, 16, 64, 256))]
        made[at:at] = part * rng.choice((1, 1, 2, 16, 200))
    elif way == 10 and pool:
        other = rng.choice(pool)
        begin = place(len(other), rng)
        part = other[begin : begin + rng.choice((4, 16, 128, 4096))]
        made[at : at + rng.choice((0, len(part)))] = part
    else:
        made[at : at + rng.choice((4, 16, 64))] = rng.choice((b"\0", b"\xff")) * rng.choice((4, 16, 64))
    return bytes(made)


def odd_number(rng: Random) -> bytes:
    """An odd number as files have it: 1 to 8 bytes, either end first, or a float."""
    if rng.random() < 0.25:
        value = rng.choice(_odd.FLOATS)
        layout = rng.choice(("<d", "<d", ">d", "<f", ">f"))
        return struct.pack(layout, min(max(value, -3e38), 3e38) if layout[1] == "f" else value)
    size = rng.choice((1, 2, 4, 4, 4, 8, 8))
    return (rng.choice(_odd.INTEGERS) % (1 << (8 * size))).to_bytes(size, rng.choice(("little", "little", "big")))


def text(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of a file of lines of words."""
    rows = data.decode("utf-8", errors="surrogateescape").split("\n")
    i, j = rng.randrange(len(rows)), rng.randrange(len(rows))
    way = rng.randrange(18)
    if way == 0:
        del rows[i]
    elif way == 1:
        rows[i:i] = [rows[i]] * rng.choice((1, 1, 2, 50))
    elif way == 2:
        rows[i], rows[j] = rows[j], rows[i]
    elif way == 3:
        rows[i] = rng.choice(("", "#", "# a", " ", rng.choice(_odd.WORDS), "\0" * 8, "x" * 100_000))
    elif way == 4:
        rows[i] = rng.choice((",", " ", "\t", ";", "  ")).join(rows[i].replace(",", " ").split())
    elif way == 5:
        rows[i] = rows[i][: rng.randrange(len(rows[i]) + 1)]
    elif way == 6:
        return "\r\n".join(rows).encode(errors="surrogateescape")
    elif way == 7:
        return b"\xef\xbb\xbf" + data
    elif way == 8:
        return "\n".join(rows).encode(rng.choice(_odd.ENCODINGS), errors="replace")
    elif way == 9:
        return "\n".join(rows[: i + 1]).encode(errors="surrogateescape")
    else:
        _words(rows, i, rng)
    return "\n".join(rows).encode(errors="surrogateescape")


def _words(rows: list[str], i: int, rng: Random) -> None:
    """One fault in the words of a line."""
    mark = next((mark for mark in (",", "\t", " ", ":", "=") if mark in rows[i]), " ")
    words = rows[i].split(mark)
    k, other = rng.randrange(len(words)), rng.randrange(len(words))
    way = rng.randrange(8)
    if way <= 3:
        words[k] = rng.choice(_odd.WORDS)
    elif way == 4:
        words[k], words[other] = words[other], words[k]
    elif way == 5:
        del words[k]
    elif way == 6:
        words[k:k] = [words[k]] * rng.choice((1, 1, 3, 100))
    else:
        at = rng.randrange(len(words[k]) + 1)
        words[k] = words[k][:at] + rng.choice(_odd.WORDS) + words[k][at:]
    rows[i] = mark.join(words)


def values(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of a JSON file: of a value or a key, or of the text."""
    try:
        whole = json.loads(data)
    except (ValueError, RecursionError):
        return text(data, rng, pool) if rng.random() < 0.5 else any_bytes(data, rng, pool)
    way = rng.random()
    if way < 0.04:
        deep = rng.choice((20, 500, 5000, 100_000))
        return rng.choice((b"[", b'{"a":')) * deep + rng.choice((b"", b"1", data))
    if way < 0.12:
        return text(json.dumps(whole, indent=rng.choice((None, 0, 1))).encode(), rng, pool)
    made = json.dumps(changed(whole, rng), ensure_ascii=rng.random() < 0.8)
    if way < 0.2:  # a key twice, or a number that no float holds
        word = rng.choice(("1e400", "-1e400", "1E+5", "0." + "1" * 400, "9" * 4000, "9" * 6000, '"\\ud800"'))
        at = [k for k, letter in enumerate(made) if letter == ":"]
        if at:
            k = rng.choice(at)
            end = min((made.find(mark, k) for mark in ",}" if made.find(mark, k) > 0), default=len(made))
            made = made[: k + 1] + word + made[end:]
    return made.encode(errors="surrogatepass")


def changed(whole: Any, rng: Random) -> Any:
    """The value with one fault somewhere in it; the value itself may be changed in place."""
    at, holders = whole, []
    while isinstance(at, (dict, list)) and at and (not holders or rng.random() < 0.85):
        key = rng.choice(list(at)) if isinstance(at, dict) else rng.randrange(len(at))
        holders.append((at, key))
        at = at[key]
    if not holders:
        return rng.choice(_odd.VALUES)
    holder, key = holders[-1]
    way = rng.randrange(12)
    if way <= 5:
        holder[key] = rng.choice(_odd.VALUES)
    elif way == 6:
        del holder[key]
    elif way == 7:
        other, name = rng.choice(holders)
        holder[key] = json.loads(json.dumps(other[name])) if other is not holder else rng.choice(_odd.VALUES)
    elif way == 8 and isinstance(holder, list):
        holder[key:key] = [holder[key]] * rng.choice((1, 1, 2, 30))
    elif way == 8 and isinstance(holder, dict):
        holder[rng.choice(_odd.NAMES)] = holder.pop(key) if rng.random() < 0.5 else holder[key]
    elif way == 9:
        holder[key] = rng.choice(([at], {"a": at}, str(at), [at, at], [[at]]))
    elif way == 10 and isinstance(at, str):
        k = rng.randrange(len(at) + 1)
        holder[key] = at[:k] + rng.choice(_odd.NAMES) + at[k:]
    elif way == 10 and isinstance(at, (int, float)):
        holder[key] = rng.choice(
            (-at, at * 1e6, at * 1e-6, at + 1, str(at), int(at) if at == at and abs(at) < 1e300 else 0)
        )
    else:
        holder[key] = rng.choice(_odd.FLOATS)
    return whole


def yaml_values(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of a YAML file; values are written as JSON, which is YAML."""
    import yaml

    if rng.random() < 0.4:
        if rng.random() < 0.15:
            extra = rng.choice(
                (b"!!python/object:os.system {}\n", b"&a [*a]\n", b"a: &a [1]\nb: *a\n", b"? [1]\n: 2\n")
            )
            return extra + data if rng.random() < 0.5 else data + extra
        return text(data, rng, pool)
    try:
        whole = yaml.safe_load(data)
        return json.dumps(changed(whole, rng)).encode(errors="surrogatepass")
    except (yaml.YAMLError, ValueError, TypeError, RecursionError):
        return text(data, rng, pool)


def toml_values(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of a TOML file; tables are written on one line."""
    if rng.random() < 0.3:
        return text(data, rng, pool)
    try:
        whole = changed(tomllib.loads(data.decode()), rng)
    except (ValueError, TypeError, RecursionError):
        return text(data, rng, pool)
    if not isinstance(whole, dict):
        whole = {"a": whole}
    return "\n".join(f"{_quoted(key)} = {_toml(value)}" for key, value in whole.items()).encode(errors="surrogatepass")


def _quoted(key: str) -> str:
    return json.dumps(str(key), ensure_ascii=False)


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quoted(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return repr(value)
    return '""' if value is None else json.dumps(value)


Way = Callable[[bytes, Random, Sequence[bytes]], bytes]
KINDS: dict[str, Way] = {
    **dict.fromkeys(("txt", "csv", "tum", "lst", "html", "sha256", "log"), text),
    "json": values,
    "yaml": yaml_values,
    "toml": toml_values,
}
