"""Damages files made of chunks so that a reader gets past the frame: lengths that fit, check sums that are right."""

import io
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Sequence
from random import Random

from tests.fuzz import _odd
from tests.fuzz._mutate import Way, any_bytes, odd_number, text

PNG = b"\x89PNG\r\n\x1a\n"
ODD_CHUNKS = (
    b"tEXt",
    b"zTXt",
    b"iTXt",
    b"iCCP",
    b"eXIf",
    b"tRNS",
    b"PLTE",
    b"gAMA",
    b"acTL",
    b"fcTL",
    b"fdAT",
    b"sRGB",
)
MP4 = re.compile(rb"(?:moov|trak|mdia|minf|stbl|mvhd|tkhd|mdhd|hdlr|stsd|stts|stsc|stsz|stco|stss|ctts|avcC|elst|edts)")


def png(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of a chunk, whose check sum is then right; or of the pixels before they are packed."""
    chunks = _png_chunks(data)
    if not chunks:
        return any_bytes(data, rng, pool)
    k = rng.randrange(len(chunks))
    kind, body = chunks[k]
    way = rng.randrange(8)
    if way <= 2:
        if kind == b"IDAT" and rng.random() < 0.7:
            try:
                body = zlib.compress(any_bytes(zlib.decompress(body), rng, pool), 1)
            except zlib.error:
                body = any_bytes(body, rng, pool)
        else:
            body = any_bytes(body, rng, pool)
        chunks[k] = (kind, body)
    elif way == 3:
        del chunks[k]
    elif way == 4:
        chunks[k:k] = [chunks[k]] * rng.choice((1, 2, 20))
    elif way == 5:
        other = rng.randrange(len(chunks))
        chunks[k], chunks[other] = chunks[other], chunks[k]
    elif way == 6:
        fill = rng.choice((b"", rng.randbytes(8), b"a\0\0" + zlib.compress(b"\0" * 1000), b"II*\0\x08\0\0\0", body))
        chunks[k:k] = [(rng.choice(ODD_CHUNKS), fill)]
    else:
        chunks = [(b"IHDR", _ihdr(body, rng)) if kind == b"IHDR" else (kind, body) for kind, body in chunks]
    parts = (struct.pack(">I", len(b)) + t + b + struct.pack(">I", zlib.crc32(t + b)) for t, b in chunks)
    return PNG + b"".join(parts)


def _png_chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    at, found = 8, []
    while data[:8] == PNG and at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        found.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 12 + length
    return found


def _ihdr(body: bytes, rng: Random) -> bytes:
    """Another size, depth or colour type."""
    head = list(struct.unpack(">IIBBBBB", body[:13].ljust(13, b"\0")))
    k = rng.randrange(7)
    sizes = (0, 1, 2, 31, 33, 65, 1000, 5000, 20000, 2**31 - 1, 2**32 - 1)
    head[k] = rng.choice(sizes) if k < 2 else rng.choice((0, 1, 2, 3, 4, 5, 6, 7, 8, 16, 32, 255))
    return struct.pack(">IIBBBBB", *head)


def jpeg(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of a segment, whose length then fits."""
    at, segments = 2, []
    while data[at : at + 1] == b"\xff" and at + 4 <= len(data) and data[at + 1] != 0xDA:
        length = int.from_bytes(data[at + 2 : at + 4], "big")
        segments.append((data[at + 1], data[at + 4 : at + 2 + length]))
        at += 2 + max(length, 2)
    if not segments or rng.random() < 0.3:
        return any_bytes(data, rng, pool)
    k = rng.randrange(len(segments))
    way = rng.randrange(6)
    if way <= 2:
        segments[k] = (segments[k][0], any_bytes(segments[k][1], rng, pool)[:65000])
    elif way == 3:
        del segments[k]
    elif way == 4:
        segments[k:k] = [segments[k]] * rng.choice((1, 2, 20))
    else:
        segments[k] = (rng.randrange(0xC0, 0x100), segments[k][1])
    head = b"".join(b"\xff" + bytes([mark]) + struct.pack(">H", len(body) + 2) + body for mark, body in segments)
    return data[:2] + head + data[at:]


def tiff(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of an entry of a directory."""
    order = "little" if data[:2] == b"II" else "big"
    first = int.from_bytes(data[4:8], order)
    if rng.random() < 0.3 or first + 2 > len(data):
        return any_bytes(data, rng, pool)
    count = int.from_bytes(data[first : first + 2], order)
    entry = first + 2 + 12 * rng.randrange(max(1, min(count, 40)))
    made = bytearray(data)
    offset, size = rng.choice(((0, 2), (2, 2), (4, 4), (8, 4), (8, 2)))
    value = rng.choice((*_odd.INTEGERS, *range(14), 273, 274, 277, 279, 34665, 34675, 256, 257, 258, 259, 262))
    made[entry + offset : entry + offset + size] = (value % (1 << 8 * size)).to_bytes(size, order)
    return bytes(made)


def boxes(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of a box of MP4 or HEIF: its length, its name, a number in it, or that it is there once."""
    found = [match.start() for match in MP4.finditer(data)]
    if not found or rng.random() < 0.35:
        return any_bytes(data, rng, pool)
    at = rng.choice(found) - 4
    size = min(int.from_bytes(data[at : at + 4], "big"), len(data) - at)
    made = bytearray(data)
    way = rng.randrange(6)
    if way == 0:
        made[at : at + 4] = (rng.choice(_odd.INTEGERS) % 2**32).to_bytes(4, "big")
    elif way == 1:
        made[at + 4 : at + 8] = rng.choice((b"free", b"skip", b"udta", b"moov", b"stsz", b"\0\0\0\0"))
    elif way == 2:
        made[at:at] = made[at : at + size]
    elif way == 3:
        del made[at : at + size]
    else:
        number = odd_number(rng)
        inside = at + 8 + 4 * rng.randrange(max(1, min(size // 4, 40)))
        made[inside : inside + len(number)] = number
    return bytes(made)


def ply(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of the head, which is text, or of what follows."""
    end = data.find(b"end_header\n") + len(b"end_header\n")
    if end < 12 or rng.random() < 0.35:
        return text(data, rng, pool) if b"format ascii" in data[:64] else any_bytes(data, rng, pool)
    head, body = data[:end], data[end:]
    if rng.random() < 0.3:
        types = (
            b"char",
            b"uchar",
            b"short",
            b"int",
            b"uint",
            b"float",
            b"double",
            b"list uchar int",
            b"list double float",
        )
        lines = head.split(b"\n")
        k = rng.randrange(len(lines))
        if lines[k].startswith(b"property"):
            lines[k] = b"property " + rng.choice(types) + b" " + rng.choice((lines[k].split()[-1], b"x", b"red", b""))
        elif lines[k].startswith(b"element"):
            count = str(rng.choice((0, 1, 3, 100, 10**6, 10**9, 2**31, 2**63, -1))).encode()
            lines[k] = b"element " + rng.choice((lines[k].split()[1], b"vertex", b"face")) + b" " + count
        elif lines[k].startswith(b"format"):
            form = rng.choice((b"ascii", b"binary_little_endian", b"binary_big_endian", b"binary"))
            lines[k] = b"format " + form + b" " + rng.choice((b"1.0", b"2.0", b""))
        return b"\n".join(lines) + body
    return text(head, rng, pool) + body


def npy(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """One fault of the head, whose length then fits, or of the numbers."""
    if data[:6] != b"\x93NUMPY" or rng.random() < 0.35:
        return any_bytes(data, rng, pool)
    length = int.from_bytes(data[8:10], "little")
    head, body = data[10 : 10 + length], data[10 + length :]
    if rng.random() < 0.5:
        kind = rng.choice(
            (b"<f4", b">f8", b"<f2", b"|O", b"<U4", b"|S8", b"<i8", b"|b1", b"<c8", b"<M8[s]", b"|V8", b"|u1")
        )
        head = re.sub(rb"'[<>|][a-zA-Z]\d+'", b"'" + kind + b"'", head)
    if rng.random() < 0.5:
        odd = (
            b"(-1, 4)",
            b"(2, 9999999999999)",
            b"()",
            b"(4,)",
            b"(0, 0)",
            b"(2, 2, 2)",
            b"(2.5, 1)",
            b"('a',)",
            b"(True, 4)",
        )
        shape = rng.choice(
            (*odd, b"(9223372036854775807,)", b"(4294967296, 4294967296)", b"None", b"[2, 4]", b"(3, 0)")
        )
        head = re.sub(rb"\([^)]*\)", lambda match: shape, head)
    if rng.random() < 0.3:
        head = text(head.rstrip(), rng, pool)
    head = head[:60000]
    return data[:8] + struct.pack("<H", len(head)) + head + body


def zipped(data: bytes, rng: Random, pool: Sequence[bytes]) -> bytes:
    """An archive with one odd member, or one fault of a member's record."""
    if rng.random() < 0.5:
        places = [m.start() for m in re.finditer(rb"PK(?:\x01\x02|\x05\x06|\x03\x04|\x06\x06)", data)]
        if not places:
            return any_bytes(data, rng, pool)
        made, at = bytearray(data), rng.choice(places)
        number = odd_number(rng)
        inside = at + 4 + 2 * rng.randrange(20)
        made[inside : inside + len(number)] = number
        return bytes(made)
    out = io.BytesIO()
    try:
        with (
            warnings.catch_warnings(action="ignore"),
            zipfile.ZipFile(io.BytesIO(data)) as source,
            zipfile.ZipFile(out, "w") as made,
        ):
            infos = source.infolist()
            odd = rng.randrange(max(1, len(infos)))
            for k, info in enumerate(infos):
                content = source.read(info)
                if k == odd:
                    way = rng.randrange(5)
                    if way == 0:
                        info.filename = rng.choice(_odd.NAMES).encode(errors="replace").decode() or "a"
                    elif way == 1:
                        info.external_attr = rng.choice((0o120777 << 16, 0o10777 << 16, 0o40777 << 16, 0x10, 2**32 - 1))
                    elif way == 2:
                        content = any_bytes(content, rng, pool)
                    elif way == 3:
                        info.filename = info.filename + rng.choice(("/", "/x", ".zip", "\\x", " ", "."))
                    else:
                        made.writestr(info, content)
                made.writestr(info, content)
    except Exception:  # what was damaged before need not be an archive any more
        return any_bytes(data, rng, pool)
    return out.getvalue()


KINDS: dict[str, Way] = {
    "png": png,
    **dict.fromkeys(("jpg", "jpeg", "JPG"), jpeg),
    **dict.fromkeys(("tif", "tiff"), tiff),
    **dict.fromkeys(("mp4", "mov", "heic", "heif", "avif"), boxes),
    "ply": ply,
    "npy": npy,
    **dict.fromkeys(("zip", "npz"), zipped),
}
