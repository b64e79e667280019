"""CatSim's configuration files, read without executing them.

The files are Python that CatSim runs. Here only plain assignments such as `scanner.sid = 541.0` are
understood, with numbers, strings, lists of these, names assigned before, and + − * / between numbers; nothing
else is ever evaluated, and no value can grow beyond what stands in the file.
"""

import ast
from collections.abc import Callable, Sequence
from operator import add, mul, sub, truediv
from pathlib import Path
from typing import Any

from pnpct.files.errors import FileFormatError, PathLike, existing_file

_LARGEST_FILE = 1 << 20
_LARGEST_INTEGER = 1e300
_OPERATIONS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: add,
    ast.Sub: sub,
    ast.Mult: mul,
    ast.Div: truediv,
}


class Unreadable(str):
    """Where a value stands that is more than a plain one."""


def read_cfg(paths: Sequence[PathLike]) -> dict[str, Any]:
    """Read configuration files, later ones overriding earlier ones, as CatSim does.

    Args:
        paths: The files, such as Scanner.cfg and Protocol.cfg.

    Returns:
        Values by name, such as "scanner.sid"; an `Unreadable` where the value is not a plain one.

    Raises:
        OSError: If a file is not there or cannot be read.
        FileFormatError: If a file does more than assign values, or is not Python.
    """
    values: dict[str, Any] = {}
    for path in paths:
        if (size := existing_file(path).stat().st_size) > _LARGEST_FILE:
            raise FileFormatError(f"{path} has {size} bytes, far more than a configuration file of CatSim.")
        try:
            program = ast.parse(Path(path).read_text(encoding="utf-8"))
        except (MemoryError, RecursionError, SyntaxError, ValueError) as error:
            raise FileFormatError(f"{path}: this is not a configuration file of CatSim ({error}).") from error
        for statement in program.body:
            _assign(statement, values, f"{path}, line {statement.lineno}")
    return values


def _assign(statement: ast.stmt, values: dict[str, Any], where: str) -> None:
    if isinstance(statement, ast.Import | ast.ImportFrom):
        return
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return  # a comment in quotes
    names = [_name(target) for target in statement.targets] if isinstance(statement, ast.Assign) else []
    if not isinstance(statement, ast.Assign) or len(names) != 1 or names[0] is None:
        raise FileFormatError(f"{where}: only lines like `scanner.sid = 541.0` are read; files are never executed.")
    try:
        values[names[0]] = _value(statement.value, values)
    except (ArithmeticError, RecursionError, ValueError):
        values[names[0]] = Unreadable(where)


def _name(node: ast.expr) -> str | None:
    """The dotted name of a target or a value, "scanner.sid"; None if it is something else."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return f"{node.value.id}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else None


def _value(node: ast.expr, values: dict[str, Any]) -> Any:
    name = _name(node)
    if name in values and not isinstance(values[name], Unreadable):
        return values[name]
    if isinstance(node, ast.Constant):
        return _bounded(node.value)
    if isinstance(node, ast.List | ast.Tuple):
        elements = [_value(element, values) for element in node.elts]
        if any(isinstance(element, list) for element in elements):
            raise ValueError("lists of lists could grow with every name")
        return elements
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_plain_number(node.operand, values)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        return _bounded(_OPERATIONS[type(node.op)](_plain_number(node.left, values), _plain_number(node.right, values)))
    raise ValueError("more than a plain value")


def _bounded(value: Any) -> Any:
    """A value as it is, unless it is an integer of hundreds of digits, which would double with each product."""
    if isinstance(value, int) and not abs(value) < _LARGEST_INTEGER:
        raise ValueError("more than a plain number")
    return value


def _plain_number(node: ast.expr, values: dict[str, Any]) -> float:
    value = _value(node, values)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("more than a plain number")
    return value
