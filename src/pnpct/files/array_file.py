"""NumPy arrays on disk, one of them chosen by name."""

import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pnpct.files.errors import FileFormatError, PathLike, existing_file

# What numpy and zipfile raise for files that are cut, damaged or of another kind.
_DAMAGE = (
    *(ArithmeticError, AttributeError, EOFError, KeyError, NotImplementedError, OSError, RuntimeError, SyntaxError),
    *(TypeError, ValueError, struct.error, tokenize.TokenError, zipfile.BadZipFile, zlib.error),
)


def load_array(path: PathLike, *, nan: bool = False) -> NDArray[Any]:
    """Load an array of numbers from a .npy file, or one member of a .npz file.

    The member is named after a colon, "scan.npz:counts"; without a name it is the only one with two
    dimensions, or the only one at all. Pickled objects are never loaded.

    Args:
        path: The file, with the member's name for a .npz file that has more than one.
        nan: Whether NaN, for what was not measured, and booleans are taken too.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a complete NumPy file, the member is missing or not clear, or it does
            not hold finite numbers.
    """
    file, member = _split(path)
    existing_file(file)
    try:
        with file.open("rb") as stream:
            content = np.load(stream, allow_pickle=False)
            single = isinstance(content, np.ndarray)
            if single and member:
                raise FileFormatError(f"{file} holds a single array, but its member {member} was asked for.")
            array: NDArray[Any] = content if single else content[_choose(file, member, content)]
    except FileFormatError:
        raise
    except _DAMAGE as error:
        raise FileFormatError(
            f"{file}: this is not a complete .npy or .npz file of numbers; save it by numpy.save."
        ) from error
    if array.dtype.kind not in ("fiub" if nan else "fiu"):
        raise FileFormatError(f"{path}: an array of real numbers was needed, got {array.dtype}; convert it.")
    wrong = np.argwhere(np.isinf(array) if nan else ~np.isfinite(array))
    if len(wrong):
        where = tuple(int(index) for index in wrong[0])
        advice = "write NaN for rays that were not measured" if nan else "correct or mask them"
        raise FileFormatError(f"{path}: {len(wrong)} values are not finite, the first at {where}; {advice}.")
    return array


def _split(path: PathLike) -> tuple[Path, str]:
    """The file and the member's name; a file whose own name has a colon is found as it is."""
    text = str(path)
    if not Path(text).exists() and ".npz:" in text:
        file, member = text.rsplit(".npz:", 1)
        return Path(file + ".npz"), member
    return Path(text), ""


def _choose(file: Path, member: str, content: Any) -> str:
    arrays = {name: each for name in content.files if isinstance(each := content[name], np.ndarray)}
    names = list(arrays)
    if not names:
        raise FileFormatError(f"{file} holds no array; give a file that numpy.savez has written.")
    if member:
        if member not in names:
            raise FileFormatError(f"{file} has no array {member}; it has {', '.join(names[:10])}.")
        return member
    flat = [name for name, array in arrays.items() if array.ndim == 2 and array.dtype.kind in "fiu"]
    for clear in (flat, names):
        if len(clear) == 1:
            return str(clear[0])
    raise FileFormatError(f"{file} holds the arrays {', '.join(names[:10])}; choose one, such as {file}:{names[0]}.")
