#!/usr/bin/env python3
"""Compresses the files of a Debian package again, so that its program takes less: pack-smaller.py PACKAGE.deb

Before xz looks for what repeats, the addresses that x86-64 calls are made absolute (its filter "x86", which every dpkg
can undo). The filter for ARM is younger than Debian 11, which packages are for, so those stay as they are.
"""

import io
import lzma
import pathlib
import sys

MAGIC = b"!<arch>\n"
HEADER = 60
FILTERS = [
    {"id": lzma.FILTER_X86},
    {"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "dict_size": 1 << 25},
]


def members(package):
    """Yields name, header and content of each member of an ar archive."""
    if package.read(len(MAGIC)) != MAGIC:
        sys.exit("pack-smaller: found no Debian package")
    while header := package.read(HEADER):
        size = int(header[48:58])
        content = package.read(size)
        package.read(size % 2)
        yield header[:16].decode().strip().rstrip("/"), header, content


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: pack-smaller.py PACKAGE.deb")
    path = pathlib.Path(sys.argv[1])
    out = io.BytesIO()
    out.write(MAGIC)
    for name, header, content in members(io.BytesIO(path.read_bytes())):
        if name == "data.tar.xz":
            content = lzma.compress(lzma.decompress(content), check=lzma.CHECK_CRC64, filters=FILTERS)
        out.write(header[:48] + f"{len(content):<10}".encode() + header[58:])
        out.write(content + b"\n" * (len(content) % 2))
    part = path.with_suffix(".part")
    part.write_bytes(out.getvalue())
    part.replace(path)


main()
