"""Methods that a user has written, by where they can be imported from."""

import inspect
import sys
from collections.abc import Callable, Mapping
from importlib import import_module

from pnpct.comparison.methods import Reconstruct


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
    module, _, attribute = path.partition(":")
    if not module or not attribute.isidentifier():
        raise ValueError(f'A method is named like "my.module:method", got "{path}".')
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        found = getattr(import_module(module), attribute)
        if callable(found) and _needs_nothing(found):
            found = found()
    except Exception as error:  # whatever a user's module may raise
        raise ValueError(f"{path} cannot be imported as a method: {type(error).__name__}, {error}.") from error
    methods = dict(found) if isinstance(found, Mapping) else {attribute: found}
    for name, method in methods.items():
        if not isinstance(name, str) or not callable(method):
            raise ValueError(
                f"{path} must be a method (sinogram, A), a mapping from names to methods, or a function without "
                f"arguments that returns one; got {found!r}."
            )
    return methods


def _needs_nothing(found: Callable[..., object]) -> bool:
    """Whether it can be called without arguments."""
    try:
        inspect.signature(found).bind()
    except TypeError:
        return False
    return True
