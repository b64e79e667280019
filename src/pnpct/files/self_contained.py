"""The checks that an HDF5 file holds all its data itself, as much as it declares, and can be read to an end.

HDF5 can leave the values of a dataset in any other file that the reader may open: by external storage, by virtual
datasets, by external links. A file from elsewhere could so have a private file read, and written out again.
"""

import mmap
from functools import lru_cache
from pathlib import Path

import h5py

from pnpct.files.errors import FileFormatError

_LARGEST_RATIO = 1100
"""Bytes that one byte of gzip can become at most, and a little more."""

_LITTLE = 1 << 18
"""Bytes that any dataset may declare: what is small need not be stored at all."""


_HEAP = b"GCOL\x01"
"""What a global heap collection begins with, where texts of any length are."""

_HEAP_HEADER = 16
"""Bytes of the header of a collection, and of each object in it, where lengths have 8 bytes."""

_TEXT = bytes.fromhex("19010100 10000000 10000000 01000000 00000800 00000000 01000000 00000000")
"""What stands before one text of any length in an attribute: its type, and that it is one. Its length follows."""


def check_heaps(path: Path) -> None:
    """Check texts of any length, and that one object follows another where they are kept; else HDF5 reads for ever.

    HDF5 gives memory to a text before it looks whether there is one of this length.

    Raises:
        OSError: If the file cannot be read.
        FileFormatError: If an object has no length, or another than there is room for, or a text is longer than the
            file.
    """
    state = path.stat()
    if state.st_size and not _texts_end(path, state.st_size, state.st_mtime_ns):
        raise FileFormatError("this file is damaged (a text without its length); copy it again or create it again.")


@lru_cache(maxsize=64)
def _texts_end(path: Path, length: int, _changed: int) -> bool:
    with path.open("rb") as file, mmap.mmap(file.fileno(), length, access=mmap.ACCESS_READ) as content:
        at = content.find(_TEXT)
        while at >= 0:
            if _number(content, at + len(_TEXT), 4) > length:
                return False
            at = content.find(_TEXT, at + 1)
        at = content.find(_HEAP)
        while at >= 0:
            end = at + _number(content, at + 8, 8)
            here = at + _HEAP_HEADER
            while end <= length and here + _HEAP_HEADER <= end:
                free, size = _number(content, here, 2) == 0, _number(content, here + 8, 8)
                step = size if free else _HEAP_HEADER + -(-size // 8) * 8
                if not 0 < step <= end - here:
                    return False
                here += step
            at = content.find(_HEAP, at + 1)
    return True


def _number(content: mmap.mmap, at: int, length: int) -> int:
    return int.from_bytes(content[at : at + length], "little")


def check_self_contained(file: h5py.File) -> None:
    """Check that nothing in an open file leads to another one; nothing is followed to find out.

    Soft links lead to other places in the same file, and what is there is checked like all the rest.

    Raises:
        FileFormatError: If a link or a dataset leads to another file.
    """
    links: list[tuple[bytes, int]] = []
    # The HDF5 library cannot pass on what a visitor raises.
    file.id.links.visit(lambda name, link: links.append((name, link.type)), info=True)
    for name, kind in links:
        shown = "/" + name.decode("utf-8", "replace")
        if kind not in (h5py.h5l.TYPE_HARD, h5py.h5l.TYPE_SOFT):
            raise FileFormatError(f"{shown} is a link to another file, which is not followed; {_REMEDY}")
        if kind == h5py.h5l.TYPE_HARD and _is_elsewhere(h5py.h5o.open(file.id, name)):
            raise FileFormatError(f"{shown} keeps its values in another file, which is not read; {_REMEDY}")


def _is_elsewhere(item: h5py.h5g.GroupID | h5py.h5d.DatasetID | h5py.h5t.TypeID) -> bool:
    if not isinstance(item, h5py.h5d.DatasetID):
        return False
    creation = item.get_create_plist()
    return bool(creation.get_layout() == h5py.h5d.VIRTUAL or creation.get_external_count() > 0)


_REMEDY = "copy the values into this file."


def check_stored(dataset: h5py.Dataset) -> None:
    """Check that a file holds about as much as a dataset declares, before memory is given to it.

    Raises:
        FileFormatError: If it declares more.
    """
    stored = dataset.id.get_storage_size()
    if dataset.size and dataset.nbytes > _LARGEST_RATIO * stored + _LITTLE:
        raise FileFormatError(
            f"{dataset.name} declares {dataset.size} numbers, which cannot be in the {stored} bytes that the file has "
            "of it; create the file again."
        )
