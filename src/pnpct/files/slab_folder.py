"""Slabs of a volume that is being made: a folder beside its file, from which an interrupted run goes on.

OUT.slabs/of.json       what the volume depends on: versions, settings and the fingerprints of the inputs
OUT.slabs/000016.npy    slices 16 and on, float32, relative to water
"""

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch

from pnpct.arrays import Volume
from pnpct.files.array_file import load_array
from pnpct.files.atomic import atomic_path
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.files.provenance import Provenance

_OF = "of.json"


@dataclass(frozen=True)
class SlabFolder:
    """The slabs of one volume, each complete or absent; the folder is made with the first of them.

    Args:
        path: The folder.
        volume: What the volume depends on, as text.

    Raises:
        ValueError: If the folder holds the slabs of another volume, or something else.
    """

    path: Path
    volume: str

    def __post_init__(self) -> None:
        if not self.path.exists():
            return
        if not self.path.is_dir() or (self._slabs() and not self._of.exists()):
            raise ValueError(f"{self.path} is not a folder of slabs; remove it, or choose another output.")
        if self._of.exists() and self._of.read_text(encoding="utf-8") != self.volume:
            raise ValueError(
                f"{self.path} holds slabs of another volume, with other options, inputs or another version; remove "
                "it, or choose another output."
            )

    @classmethod
    def beside(cls, output: PathLike, provenance: Provenance) -> "SlabFolder":
        """Return the folder of a volume.

        Args:
            output: File or folder that the volume will be written to.
            provenance: What it depends on: all of it but the command line, and the names of the inputs.

        Raises:
            ValueError: If the folder holds the slabs of another volume, or something else.
        """
        known = asdict(provenance)
        del known["command"]
        known["inputs"] = sorted(provenance.inputs.values())
        return cls(Path(output).with_name(Path(output).name + ".slabs"), json.dumps(known, indent=1, sort_keys=True))

    @property
    def slices(self) -> int:
        """Slices that are done, from the lowest up."""
        done = 0
        for first, path in self._slabs():
            if first != done:
                break
            done += int(np.load(path, mmap_mode="r").shape[-3])
        return done

    def write(self, first: int, image: Volume) -> None:
        """Write a slab.

        Args:
            first: Number of its lowest slice.
            image: Its slices.

        Raises:
            OSError: If it cannot be written.
            ValueError: If a value is not finite.
        """
        if not bool(image.isfinite().all()):
            raise ValueError(f"The slices from {first} on hold values that are not finite; check the scan.")
        self.path.mkdir(exist_ok=True)
        if not self._of.exists():
            with atomic_path(self._of) as temporary:
                temporary.write_text(self.volume, encoding="utf-8")
        with atomic_path(self.path / f"{first:06d}.npy") as temporary:
            np.save(temporary, image.detach().cpu().numpy().astype(np.float32))

    def read(self) -> Volume:
        """Return all slabs as one volume.

        Raises:
            OSError: If one cannot be read.
            FileFormatError: If one is damaged.
        """
        parts = [torch.from_numpy(load_array(path)) for _, path in self._slabs()]
        if not parts:
            raise FileFormatError(f"{self.path} holds no slabs; reconstruct again.")
        return torch.cat(parts, dim=-3)

    def remove(self) -> None:
        """Remove the folder, when the volume is written: what a kill leaves of it is a folder of slabs."""
        for _, path in reversed(self._slabs()):
            path.unlink()
        shutil.rmtree(self.path)

    @property
    def _of(self) -> Path:
        return self.path / _OF

    def _slabs(self) -> list[tuple[int, Path]]:
        return sorted((int(path.stem), path) for path in self.path.glob("[0-9]*.npy"))
