"""Methods that a user has written, by where they can be imported from."""

from collections.abc import Mapping

from pnpct.comparison.methods import Reconstruct
from pnpct.files import imported


def imported_methods(path: str) -> dict[str, Reconstruct]:
    """Import methods from a module, which is looked for in the working directory too.

    Args:
        path: "my.module:name", where `name` is a method, a mapping from names to methods, or a function without
            arguments that returns one of these. A single method is called by `name`.

    Raises:
        ValueError: If it cannot be imported, or is no method.

    Example:
        >>> imported_methods("pnpct.reconstruction:FBP")
        {'FBP': FBP(kernel='hann')}
    """
    found = imported(path, kind="method")
    methods = dict(found) if isinstance(found, Mapping) else {path.partition(":")[2]: found}
    for name, method in methods.items():
        if not isinstance(name, str) or not callable(method):
            raise ValueError(
                f"{path} must be a method (sinogram, A), a mapping from names to methods, or a function without "
                f"arguments that returns one; got {found!r}."
            )
    return methods
