"""The checks that an HDF5 file holds all its data itself, and as much as it declares.

HDF5 can leave the values of a dataset in any other file that the reader may open: by external storage, by virtual
datasets, by external links. A file from elsewhere could so have a private file read, and written out again.
"""

import h5py

from pnpct.files.errors import FileFormatError

_LARGEST_RATIO = 1100
"""Bytes that one byte of gzip can become at most, and a little more."""

_LITTLE = 1 << 18
"""Bytes that any dataset may declare: what is small need not be stored at all."""


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
