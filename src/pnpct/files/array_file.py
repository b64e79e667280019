"""Arrays on disk, of NumPy and MATLAB, one of them chosen by name."""

import re
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
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
    """Load an array of numbers from a .npy file, or one member of a .npz or .mat file.

    The member is named after a colon, "scan.npz:counts" or "scan.mat:CtData.sinogram"; without a name it is the only
    one with two dimensions, or the only one at all. Pickled objects are never loaded.

    Args:
        path: The file, with the member's name for a .npz or .mat file that has more than one.
        nan: Whether NaN, for what was not measured, and booleans are taken too.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a complete NumPy or MATLAB file, the member is missing or not clear, or it does
            not hold finite numbers.
    """
    file, member = file_and_member(path)
    arrays = _matlab_arrays(file) if file.suffix == ".mat" else _numpy_arrays(file)
    if "" in arrays and member:
        raise FileFormatError(f"{file} holds a single array, but its member {member} was asked for.")
    array = arrays[_choose(file, member, arrays)]
    if array.dtype.kind not in ("fiub" if nan else "fiu"):
        raise FileFormatError(f"{path}: an array of real numbers was needed, got {array.dtype}; convert it.")
    wrong = np.argwhere(np.isinf(array) if nan else ~np.isfinite(array))
    if len(wrong):
        where = tuple(int(index) for index in wrong[0])
        advice = "write NaN for rays that were not measured" if nan else "correct or mask them"
        raise FileFormatError(f"{path}: {len(wrong)} values are not finite, the first at {where}; {advice}.")
    return array


def file_and_member(path: PathLike) -> tuple[Path, str]:
    """Return the file and the member that "scan.npz:counts" names; a file whose own name has a colon is found as it is.

    Example:
        >>> file_and_member("scan.npz:counts")[1], file_and_member("counts.npy")[1]
        ('counts', '')
    """
    named = re.fullmatch(r"(.*\.(?:npz|mat)):(.*)", str(path), re.DOTALL)
    return (Path(path), "") if named is None or Path(path).exists() else (Path(named[1]), named[2])


def _matlab_arrays(file: Path) -> dict[str, NDArray[Any]]:
    from pnpct.files.mat_file import mat_arrays  # and SciPy's reader, which takes longer than FBP of a slice

    return mat_arrays(file)


def _numpy_arrays(file: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a .npz file by name; the one of a .npy file without a name."""
    existing_file(file)
    try:
        with file.open("rb") as stream:
            content = np.load(stream, allow_pickle=False)
            if isinstance(content, np.ndarray):
                return {"": content}
            return {name: each for name in content.files if isinstance(each := content[name], np.ndarray)}
    except MemoryError as error:
        raise FileFormatError(f"{file} declares more numbers than the memory holds; is it damaged?") from error
    except _DAMAGE as error:
        raise FileFormatError(
            f"{file}: this is not a complete .npy or .npz file of numbers; save it by numpy.save."
        ) from error


def _choose(file: Path, member: str, arrays: Mapping[str, NDArray[Any]]) -> str:
    names = list(arrays)
    if not names:
        raise FileFormatError(f"{file} holds no array of numbers; give a file that does.")
    if member:
        if member not in names:
            raise FileFormatError(f"{file} has no array {member}; it has {', '.join(names[:10])}.")
        return member
    planes = [name for name, array in arrays.items() if array.ndim == 2 and array.dtype.kind in "fiu"]
    matrices = [name for name in planes if 1 not in arrays[name].shape]  # to MATLAB, vectors are planes too
    for clear in (matrices, planes, names):
        if len(clear) == 1:
            return clear[0]
    raise FileFormatError(f"{file} holds the arrays {', '.join(names[:10])}; choose one, such as {file}:{names[0]}.")
