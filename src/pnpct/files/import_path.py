"""What a user has written in Python, by where it can be imported from: "my_package.module:name"."""

import copy
import inspect
import re
import sys
from collections.abc import Callable
from importlib import import_module
from os import fspath
from typing import Any, get_type_hints

from torch import nn

from pnpct.files.errors import FileFormatError, PathLike

_WHERE = "import_path"
"""Attribute of an imported network that says where it was found, so that it can be found again."""


def is_import_path(name: PathLike) -> bool:
    """Return whether a name is one of a module and of something in it."""
    return re.fullmatch(r"[^\W\d][\w.]*:[^\W\d]\w*", fspath(name)) is not None


def imported(path: str, *, kind: str) -> Any:
    """Import what a user has written, from the working directory or an installed package.

    Args:
        path: "my_package.module:name"; a class, or a function, that needs no arguments is called.
        kind: What it should be, for errors: "method".

    Raises:
        ValueError: If it cannot be imported, or raises an error when it is called.

    Example:
        >>> imported("pnpct.reconstruction:FBP", kind="method")
        FBP(kernel='hann')
    """
    if not is_import_path(path):
        raise ValueError(f'A {kind} is named like "my_package.module:{kind}", got "{path}".')
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        found = _found(path)
        return found() if callable(found) and _needs_nothing(found) else found
    except Exception as error:  # whatever a user's module may raise
        raise ValueError(f"{path} cannot be imported as a {kind}: {type(error).__name__}, {error}.") from error


def imported_network(path: str) -> nn.Module:
    """Import a network by its path and return a copy, which knows the path.

    Raises:
        ValueError: If it cannot be imported, or is no network.
    """
    network = imported(path, kind="network")
    if not isinstance(network, nn.Module):
        raise ValueError(f"{path} must be a torch.nn.Module, or make one without arguments; got {network!r}.")
    return _copied(network, path)


def described_network(path: str) -> nn.Module:
    """Return a network for weights whose file names this path.

    The file may come from anybody. So its module is not looked for in the working directory, and nothing is called but
    what says that it is, or returns, a network.

    Raises:
        FileFormatError: If it cannot be imported, or is no network.
    """
    try:
        found = _found(path)
        if not isinstance(found, nn.Module):
            makes = get_type_hints(found).get("return") if inspect.isfunction(found) else found
            if not (inspect.isclass(makes) and issubclass(makes, nn.Module)):
                raise TypeError("it is no torch.nn.Module, no class of one, and no function that says -> nn.Module")
            found = found()
    except Exception as error:  # whatever the module may raise
        raise FileFormatError(
            f"The network is described as {path}, which cannot be used ({type(error).__name__}, {error}); install that "
            "package, or name its folder in PYTHONPATH."
        ) from error
    return _copied(found, path)


def where_imported(network: nn.Module) -> str | None:
    """Return the path that a network was imported by; None if it was not."""
    path = getattr(network, _WHERE, None)
    return path if isinstance(path, str) else None


def _copied(network: nn.Module, path: str) -> nn.Module:
    copied = copy.deepcopy(network)
    setattr(copied, _WHERE, path)
    return copied


def _found(path: str) -> Any:
    module, _, name = path.partition(":")
    return getattr(import_module(module), name)


def _needs_nothing(found: Callable[..., object]) -> bool:
    """Whether it is a class or a function that can be called without arguments."""
    if isinstance(found, nn.Module):
        return False
    try:
        inspect.signature(found).bind()
    except (TypeError, ValueError):
        return False
    return True
