"""What the tables of bad inputs are made of: cases, bad files, and what must hold after each mistake."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

Prepare = Callable[[Path, Path], object]


def nothing(here: Path, made: Path) -> None:
    """No bad file is needed."""


@dataclass(frozen=True)
class Case:
    """A command line, in which {here} is an empty folder and {made} has good files, and what its complaint must name.

    `prepare(here, made)` makes bad files first.
    """

    name: str
    words: str
    names: str
    prepare: Prepare = nothing


def check(case: Case, run, made: Path, here: Path) -> None:
    """Run a case: exit status 2, one line, with the words it must name, and not a file more or less than before."""
    case.prepare(here, made)
    before = contents(here), contents(made)
    status, out, err = run(*(word.format(here=here, made=made) for word in case.words.split()))
    assert status == 2, out + err
    assert err.startswith("pnpct: ")
    assert err.endswith((".\n", "?\n"))
    assert err.count("\n") == 1
    assert "Wrote" not in out
    missing = [name for name in case.names.split() if name not in err]
    assert not missing, f"{missing} not in: {err}"
    assert (contents(here), contents(made)) == before


def contents(folder: Path) -> dict[str, bytes]:
    """Everything below a folder."""
    return {str(path): path.read_bytes() if path.is_file() else b"" for path in sorted(folder.rglob("*"))}


def changed(change: Callable[[h5py.File], object], *, of: str = "scan.h5") -> Prepare:
    """Copy a good file to bad.h5 and change it."""

    def prepare(here: Path, made: Path) -> None:
        shutil.copy(made / of, here / "bad.h5")
        with h5py.File(here / "bad.h5", "r+") as file:
            change(file)

    return prepare


def without(name: str) -> Prepare:
    """A scan that lacks something."""
    return changed(lambda file: file.pop(name))


def with_count(value: float) -> Prepare:
    """A scan with one other count."""
    return changed(lambda file: file["counts"].__setitem__((0, 0), value))


def with_dataset(name: str, *shape: int, value: float = 1.0, of: str = "scan.h5", **attributes: object) -> Prepare:
    """A file with one value everywhere in a dataset of some shape, and other attributes."""

    def change(file: h5py.File) -> None:
        kept = {**file[name].attrs, **attributes}
        del file[name]
        file.create_dataset(name, data=np.full(shape, value)).attrs.update(kept)

    return changed(change, of=of)


def with_attributes(name: str, *, of: str = "scan.h5", **attributes: object) -> Prepare:
    """A file with other attributes somewhere."""
    return changed(lambda file: file[name].attrs.update(attributes), of=of)


def cut(share: float, *, of: str = "scan.h5") -> Prepare:
    """Copy the beginning of a good file to bad.h5."""

    def prepare(here: Path, made: Path) -> None:
        content = (made / of).read_bytes()
        (here / "bad.h5").write_bytes(content[: int(share * len(content))])

    return prepare


def with_counts(change: Callable[[np.ndarray], np.ndarray]) -> Prepare:
    """Save the counts, changed, as bad.npy."""
    return lambda here, made: np.save(here / "bad.npy", change(np.load(made / "counts.npy")))


def with_array(name: str, values: np.ndarray) -> Prepare:
    """Save an array."""
    save = np.savez if name.endswith(".npz") else np.save
    return lambda here, made: save(here / name, values)


def with_geometry(drop: str = "", **values: object) -> Prepare:
    """Write the geometry, changed, as bad.json."""

    def prepare(here: Path, made: Path) -> None:
        content = {**json.loads((made / "geometry.json").read_text()), **values}
        content.pop(drop, None)
        (here / "bad.json").write_text(json.dumps(content))

    return prepare


def with_catsim(*sizes: int) -> Prepare:
    """Write raw files of CatSim with so many numbers, for two views of three columns; 0 leaves the file out."""

    def prepare(here: Path, made: Path) -> None:
        geometry = {"sid_mm": 541, "sdd_mm": 949, "n_cols": 3, "col_pitch_mm": 1, "col_offset_cols": 0, "n_views": 2}
        geometry |= {"views_per_rotation": 2, "start_angle_deg": 0, "rotation_direction": 1}
        geometry |= {"gain_e_per_keV": 17, "eNoise_e": 0}
        (here / "raw.json").write_text(json.dumps(geometry))
        for suffix, size in zip(("scan", "air"), sizes, strict=True):
            if size:
                np.full(size, 1e6, dtype="<f4").tofile(here / f"raw.{suffix}")

    return prepare


def with_text(name: str, text: str) -> Prepare:
    """Write a file of text."""
    return lambda here, made: (here / name).write_text(text)


def with_folder(name: str) -> Prepare:
    """Make a folder."""
    return lambda here, made: (here / name).mkdir()


def with_link(name: str, target: str) -> Prepare:
    """Make a symbolic link."""
    return lambda here, made: (here / name).symlink_to(target)
