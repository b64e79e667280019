"""A file for the HDF5 library to write to, on a disk that may fill up."""

import io
from types import TracebackType
from typing import Any

from pnpct.files.errors import PathLike


class GrowingFile(io.FileIO):
    """A file that takes whatever is written, and says at its end whether the disk took it.

    The HDF5 library crashes the process when a write fails under it. Here none does: after the first failure what
    is written is lost. The end of the block raises that failure, in place of what HDF5 may say when it reads back what
    is not there. Its buffers are of any type that has one.

    Args:
        path: File to write.

    Raises:
        OSError: If the file cannot be opened.
    """

    def __init__(self, path: PathLike) -> None:
        super().__init__(path, "w+")
        self._failure: OSError | None = None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close, and raise what went wrong with a write, if something did."""
        super().__exit__(kind, error, trace)
        if self._failure is not None and (error is None or isinstance(error, Exception)):
            raise self._failure from error

    def write(self, content: Any, /) -> int:
        """Write all of the content, or remember why not."""
        left = memoryview(content).cast("B")
        size = len(left)
        try:
            while left and self._failure is None:
                left = left[super().write(left) :]
        except OSError as error:
            self._failure = error
        return size

    def readinto(self, buffer: Any, /) -> int:
        """Read; zeros where nothing could be written."""
        view = memoryview(buffer).cast("B")
        count = super().readinto(view) or 0
        view[count:] = bytes(len(view) - count)
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Change the size, or remember why not."""
        try:
            return super().truncate(size)
        except OSError as error:
            self._failure = self._failure or error
            return self.tell()
