"""Check types of every call, and that shapes agree wherever there are arrays, while tests run.

jaxtyping's own import hook checks as much, but it binds the signature of every call, wraps functions anew whenever they
are made inside others, and compiles anew all that is imported under it: a fifth of the time of the tests.
"""

import ast
import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import nullcontext
from dataclasses import is_dataclass
from functools import wraps
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType, ModuleType
from typing import Any, get_args

import pytest
import tyro  # noqa: F401  it looks at all builtins as it is imported, and a doctest leaves its last value there
from beartype import BeartypeConf, beartype
from jaxtyping import AbstractArray, config, jaxtyped

UNCHECKED = ("_kernels", ".vector_ir")  # numba compiles these from the bare functions
with_types = beartype(conf=BeartypeConf(is_pep484_tower=True))


def checked(of: Any) -> Any:
    """Decorate a function, or the constructor of a dataclass."""
    if isinstance(of, type):
        if is_dataclass(of) and "__init__" in vars(of):
            of.__init__ = checked(of.__init__)
        return of
    function: Callable[..., Any] = with_types(of)
    hints = getattr(of, "__annotations__", {}).values()
    if not any(isinstance(hint, str) or holds_arrays(hint) for hint in hints):
        return function

    @wraps(of)
    def with_shapes(*args: Any, **kwargs: Any) -> Any:
        if config.jaxtyping_disable:
            return of(*args, **kwargs)
        with jaxtyped("context"):
            return function(*args, **kwargs)

    return with_shapes


def holds_arrays(hint: Any) -> bool:
    """Whether a type is one of arrays, or is made of such."""
    return (isinstance(hint, type) and issubclass(hint, AbstractArray)) or any(map(holds_arrays, get_args(hint)))


def decorate(body: list[ast.stmt]) -> None:
    """Put the decorator on classes and functions, but not on functions inside others."""
    for node in body:
        name = ast.copy_location(ast.Name(checked.__name__, ast.Load()), node)
        if isinstance(node, ast.FunctionDef):
            node.decorator_list.append(name)
        elif isinstance(node, ast.ClassDef):
            node.decorator_list.insert(0, name)
            decorate(node.body)


class CheckedModule(SourceFileLoader):
    """Loads a module with its functions decorated."""

    def get_code(self, fullname: str) -> CodeType:
        """Compile the decorated source."""
        path = self.get_filename(fullname)
        tree = ast.parse(self.get_data(path), path)
        decorate(tree.body)
        return compile(tree, path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        """Run it, with the decorator at hand."""
        vars(module)[checked.__name__] = checked
        super().exec_module(module)


class CheckedPackage(PathFinder):
    """Finds the modules of pnpct."""

    @classmethod
    def find_spec(cls, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """Have a module of pnpct loaded with its functions decorated."""
        if not fullname.startswith("pnpct.") or fullname.endswith(UNCHECKED):
            return None
        spec = super().find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = CheckedModule(fullname, spec.loader.path)
        return spec


sys.meta_path.insert(0, CheckedPackage)


def pytest_configure(config: pytest.Config) -> None:
    """Give workers that share the processors one thread each."""
    if config.getoption("numprocesses", default=None):
        os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("MKL_CBWR", "COMPATIBLE")  # the same bytes wherever arrays lie, as worker processes have them


class ThisProcess(Executor):
    """Does at once, in this process, what it is asked for."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return what the function has returned or raised."""
        done: Future[Any] = Future()
        try:
            done.set_result(function(*args, **kwargs))
        except Exception as error:
            done.set_exception(error)
        return done


@pytest.fixture(scope="session", autouse=True)
def one_worker_is_this_process() -> Iterator[None]:
    """Start no process where one is asked for: it would import for longer than it works. Two are real."""
    from pnpct.operators import processes

    several = processes.worker_processes
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(processes, "worker_processes", lambda of: several(of) if of > 1 else nullcontext(ThisProcess()))
        yield


@pytest.fixture(autouse=True)
def example_scan(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Give the README the scan that it reads, a small one, and 64 pixels a side where it asks for 512."""
    if not (isinstance(request.node, pytest.DoctestItem) and request.path.name == "README.md"):
        return
    from pnpct.cli import main
    from pnpct.geometry import FanBeam

    monkeypatch.chdir(tmp_path_factory.mktemp("readme"))
    body = ["--anatomy", "head", "--size", "32", "--views", "48", "--bins", "60"]
    assert main(["simulate", "scan", "scan.h5", *body]) == 0
    whole = FanBeam.grid
    monkeypatch.setattr(FanBeam, "grid", lambda geometry, size: whole(geometry, size // 8))
