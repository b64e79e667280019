"""Seeded damage to a file: bytes, structure, types, sizes, links. Each mutation says what it did."""

import json
import os
import random
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import torch
from pydicom import dcmread

Mutate = Callable[[Path, random.Random], str]

NUMBERS = (0, -1, 1, 2.5, 1e-300, 1e18, 1e300, 1e308, -1e18, 10**30, *map(float, ("nan", "inf", "-inf")), 100_000_000)
OTHERS = (
    *(None, True, False, ""),
    "x",
    "../../etc/passwd",
    "/dev/zero",
    "m" * 100_000,
    [],
    {},
    [[]],
    [1],
    ["a"],
    {"a": 1},
)
VALUES = (*NUMBERS, *OTHERS)


def of_bytes(path: Path, chance: random.Random) -> str:
    """Change, cut, add, repeat or zero some bytes."""
    content = bytearray(path.read_bytes())
    first = chance.randrange(len(content) or 1)
    length = min(chance.choice((1, 1, 4, 16, 256)), len(content) - first)
    how = chance.choice(("change", "change", "change", "cut", "add", "repeat", "zero", "remove"))
    if how == "change":
        content[first : first + length] = chance.randbytes(length)
    elif how == "cut":
        del content[first:]
    elif how == "add":
        content[first:first] = chance.randbytes(length)
    elif how == "repeat":
        content += content[first:]
    elif how == "zero":
        content[first : first + length] = bytes(length)
    else:
        del content[first : first + length]
    path.write_bytes(content)
    return f"{how} {length} bytes at {first}"


def of_place(path: Path, chance: random.Random) -> str:
    """Put something else where the file is: nothing, a folder, a pipe, a circle of links, a device, an empty file."""
    how = chance.choice(("nothing", "folder", "pipe", "circle", "device", "empty", "unreadable text"))
    path.unlink()
    if how == "folder":
        path.mkdir()
    elif how == "pipe":
        os.mkfifo(path)
    elif how == "circle":
        path.symlink_to(path.name)
    elif how == "device":
        path.symlink_to("/dev/zero")
    elif how != "nothing":
        path.write_bytes(b"" if how == "empty" else b"\xff\xfe" + b"[" * 100_000)
    return f"{how} in its place"


def of_json(path: Path, chance: random.Random) -> str:
    """Replace, remove, rename or repeat one of the values."""
    content = json.loads(path.read_text())
    said = change_value(content, chance)
    path.write_text(json.dumps(content))
    return said


def change_value(content: Any, chance: random.Random) -> str:
    """Change one value somewhere in dictionaries and lists, in place."""
    found = list(places(content))
    if not found:
        return "nothing to change"
    where, key = chance.choice(found)
    how = chance.choice(("replace", "replace", "replace", "remove", "rename", "repeat"))
    if how == "replace":
        where[key] = value = chance.choice(VALUES)
        return f"{key} becomes {str(value)[:40]!r}"
    value = where.pop(key)
    if how == "rename" and isinstance(where, dict):
        where[str(key) + "x"] = value
    elif how == "repeat" and isinstance(where, list):
        where.extend([value] * chance.choice((2, 1000)))
    return f"{how} {key}"


def places(content: Any) -> Any:
    """Yield every dictionary or list with each of its keys."""
    entries = list(content.items()) if isinstance(content, dict) else list(enumerate(content))
    for key, value in entries[:200]:
        yield content, key
        if isinstance(value, dict | list):
            yield from places(value)


def of_text(path: Path, chance: random.Random) -> str:
    """Change a line of a configuration file."""
    lines = path.read_text().splitlines()
    number = chance.randrange(len(lines))
    name = lines[number].partition("=")[0].strip() or "x"
    value = chance.choice(
        (*map(repr, VALUES), "x*x", "[" * 200, "1+" * 2000 + "1", "__import__('os')", "1/0", "-" * 5000 + "1")
    )
    growing = f"{name} = 3\n" + f"{name} = {name} * {name}\n" * 45
    nested = f"{name} = [1, 1]\n" + f"{name} = [{name}, {name}]\n" * 40
    lines[number] = chance.choice((f"{name} = {value}", f"{name} = {value}", "", growing, nested, f"del {name}"))
    path.write_text("\n".join(lines))
    return f"line {number} becomes {lines[number][:60]!r}"


def of_hdf5(path: Path, chance: random.Random) -> str:
    """Change an attribute, a dataset or a link."""
    with h5py.File(path, "r+") as file:
        names = ["/"]
        file.visit(names.append)
        name = chance.choice(names)
        if name == "/" or chance.random() < 0.5:
            return _change_attribute(file[name], chance)
        return _change_object(file, name, chance)


def _change_attribute(item: Any, chance: random.Random) -> str:
    attributes = list(item.attrs) or ["units"]
    key = chance.choice(attributes)
    odd = (
        *(value for value in VALUES if isinstance(value, int | float | str) and value != 10**30),
        np.array([1.0, 2.0]),
    )
    value = chance.choice((*odd, h5py.Empty("f4"), np.bytes_(b"\xff"), np.zeros((3, 3)), "[" * 10_000, np.inf, np.inf))
    if chance.random() < 0.15:
        item.attrs.pop(key, None)
        return f"attribute {key} of {item.name} removed"
    item.attrs[key] = value if not isinstance(value, str) else value[:60_000]
    return f"attribute {key} of {item.name} becomes {str(value)[:40]!r}"


def _change_object(file: h5py.File, name: str, chance: random.Random) -> str:
    old = file[name][()] if isinstance(file[name], h5py.Dataset) else np.ones(3)
    attributes = dict(file[name].attrs)
    del file[name]
    shape = np.shape(old)
    external = [("/etc/passwd", 0, 64)]
    layout = h5py.VirtualLayout((3,), "f4")
    layout[:] = h5py.VirtualSource("/tmp/none.h5", "x", (3,))
    how, make = chance.choice(
        (
            ("removed", lambda: None),
            ("text", lambda: file.create_dataset(name, data="words")),
            ("a group", lambda: file.create_group(name)),
            ("empty", lambda: file.create_dataset(name, data=h5py.Empty("f4"))),
            ("NaN", lambda: file.create_dataset(name, data=np.full(shape, np.nan))),
            ("infinite", lambda: file.create_dataset(name, data=np.full(shape, np.inf))),
            ("1e300", lambda: file.create_dataset(name, data=np.full(shape, 1e300))),
            ("negative", lambda: file.create_dataset(name, data=-np.abs(np.asarray(old, float)) - 1)),
            ("zero", lambda: file.create_dataset(name, data=np.zeros(shape))),
            ("complex", lambda: file.create_dataset(name, data=np.zeros(shape, complex))),
            ("another shape", lambda: file.create_dataset(name, data=np.ones((*shape, 2)))),
            ("transposed", lambda: file.create_dataset(name, data=np.asarray(old).T)),
            ("huge", lambda: file.create_dataset(name, (1 << 20, 1 << 20), "f4", chunks=True, compression="gzip")),
            ("no length", lambda: file.create_dataset(name, data=np.zeros((0, *shape)))),
            ("external", lambda: file.create_dataset(name, (8,), "f8", external=external)),
            ("virtual", lambda: file.create_virtual_dataset(name, layout)),
            ("a link elsewhere", lambda: file.__setitem__(name, h5py.ExternalLink("/etc/passwd", "/x"))),
            ("a link to itself", lambda: file.__setitem__(name, h5py.SoftLink("/" + name))),
            ("the root", lambda: file.__setitem__(name, file["/"])),
        )
    )
    make()
    if name in file and chance.random() < 0.8 and how not in ("a link elsewhere", "a link to itself", "the root"):
        file[name].attrs.update(attributes)
    return f"{name} becomes {how}"


def of_zip(path: Path, chance: random.Random) -> str:
    """Change the description in an archive, or take away, repeat or rename a member."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = chance.choice(list(members))
    how = chance.choice(("description", "description", "remove", "rename", "cut", "another description"))
    if how == "description":
        (described,) = (each for each in members if each.endswith(".json"))
        content = json.loads(members[described])
        how = change_value(content, chance)
        members[described] = json.dumps(content).encode()
    elif how == "another description":
        members["b.json"] = b"{}"
    else:
        content = members.pop(name)
        if how != "remove":
            members[name if how == "cut" else "../" + name] = content[: len(content) // 2]
    with zipfile.ZipFile(path, "w", chance.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA))) as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    return f"{how} {name}"


def of_dicom(path: Path, chance: random.Random) -> str:
    """Change an element of an image."""
    image = dcmread(path)
    element = chance.choice(list(image))
    value = chance.choice(("", "0", "-1", "1", "99999999", "1e300", "nan", "1\\2", "words", "1.2.3.9", None))
    if value is None:
        del image[element.tag]
    elif element.VR in ("US", "SS", "UL"):
        element._value = chance.choice((0, 1, 2, 7, 65535))
    elif element.VR in ("OW", "OB"):
        element._value = element.value[: chance.choice((0, 2, 10))]
    elif element.VR == "UN":  # private: floats, whole numbers or words
        element._value = chance.choice((b"", bytes(4), b"\xff" * 4, b"\0\0\x80\x7f", b"NO", b"\1\0", 9 * element.value))
    else:
        element._value = value
    content = path.read_bytes()
    try:
        image.save_as(path)
    except Exception:  # pydicom does not write everything that it reads
        path.write_bytes(content)
        return of_bytes(path, chance)
    return f"{element.keyword or element.tag} becomes {value}"


def of_torch(path: Path, chance: random.Random) -> str:
    """Change one value in a file of torch."""
    content = torch.load(path, weights_only=True)
    said = change_value(content, chance)
    torch.save(content, path)
    return said


def of_words(path: Path, chance: random.Random) -> str:
    """Change a number that is written in a text, wherever it is."""
    content = path.read_text(errors="replace")
    found = list(re.finditer(r"-?\d+\.?\d*", content))
    if not found:
        return of_bytes(path, chance)
    one = chance.choice(found)
    value = chance.choice(("0", "-1", "1e308", "1e18", "NaN", "null", '"x"', "[]", "1" * 400))
    path.write_text(content[: one.start()] + value + content[one.end() :])
    return f"{one.group()} becomes {value[:20]}"
