"""Examples cached in a folder, since making one takes longer than a training step.

A file is called <number>-<fingerprint>.safetensors. The fingerprint is the SHA-256, shortened, of the key: all that the
example depends on, in plain values, as JSON. The key itself stands in the metadata of the file, under "key".
"""

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from pnpct.files import atomic_path
from pnpct.training.examples import Example, Examples

FORMAT, FORMAT_VERSION = "pnpct-example", 4
"""Raise this when the same settings make other images."""


@dataclass(frozen=True, eq=False)
class CachedExamples:
    """Examples by number, each drawn once and read from its file ever after.

    Args:
        examples: What draws them.
        folder: Where the files are, for this and other trainings; it is created.
    """

    examples: Examples
    folder: Path

    @cached_property
    def key(self) -> str:
        """All that an example depends on besides its number, as JSON."""
        content = {"format": FORMAT, "format_version": FORMAT_VERSION, **self.examples.settings}
        return json.dumps(content, sort_keys=True, allow_nan=False)

    def __call__(self, number: int) -> Example:
        """Read the example of a number, from 0 on, or draw it.

        Raises:
            OSError: If a file cannot be read or written.
            ValueError: If a file of exposures does not say where the pixels of its truth are.
        """
        fingerprint = hashlib.sha256(self.key.encode()).hexdigest()[:16]
        path = self.folder / f"{number:06d}-{fingerprint}.safetensors"
        if path.exists():
            return self._read(path)
        example = self.examples(number)
        self.folder.mkdir(parents=True, exist_ok=True)
        tensors = {name: tensor.contiguous() for name, tensor in vars(example).items()}
        with atomic_path(path) as temporary:
            save_file(tensors, temporary, metadata={"key": self.key})
        return example

    def _read(self, path: Path) -> Example:
        try:
            with safe_open(path, "pt") as file:
                if (file.metadata() or {}).get("key") == self.key:
                    return Example(**{name: file.get_tensor(name) for name in file.keys()})  # noqa: SIM118  # it is no mapping
        except (SafetensorError, TypeError) as error:
            raise OSError(f"{path} is damaged; remove it, and it is made again.") from error
        raise OSError(f"{path} is of an example with other settings; remove it, and it is made again.")
