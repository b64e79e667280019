"""Processes in which contenders run: each package in its own, so that none meets another's threads or versions.

A worker waits, without using the processor, until it is asked by a line of JSON to make a contender, to call one of
its parts once, or to drop all. All answer, so rounds over several workers are interleaved in one run.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from contenders import World

HERE = Path(__file__).parent


class ContenderError(Exception):
    """A contender could not do what it was asked; the message is its own."""


class Worker:
    """A process of a package.

    Args:
        threads: That PyTorch, OpenMP and JAX may use.
        source: Folder with the `pnpct` to import; that of this process if None.
    """

    def __init__(self, *, threads: int, source: Path | None = None) -> None:
        count = str(threads)
        settings = {"OMP_NUM_THREADS": count, "MKL_NUM_THREADS": count, "OMP_WAIT_POLICY": "PASSIVE"}
        environment = {**os.environ, **settings, "JAX_PLATFORMS": "cpu"}
        if source:
            environment["PYTHONPATH"] = str(source)
        command = [sys.executable, str(HERE / "worker.py")]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, text=True
        )

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def make(self, contender: str, world: World, **options: Any) -> dict[str, Any]:
        """Make a contender; return its "number" and its "parts"."""
        return self._ask(do="make", contender=contender, world=asdict(world), options=options)

    def call(self, number: int, part: str, threads: int) -> dict[str, Any]:
        """Call a part of what was made once; return "seconds" and whatever the part itself answers."""
        return self._ask(do="call", number=number, part=part, threads=threads)

    def drop(self) -> None:
        """Let go of all that was made."""
        self._ask(do="drop")

    def close(self) -> None:
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()

    def _ask(self, **request: Any) -> dict[str, Any]:
        assert self._process.stdin
        assert self._process.stdout
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise ContenderError("its process has ended") from None
        line = self._process.stdout.readline()
        if not line:
            raise ContenderError(f"its process has ended ({self._process.wait()})")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise ContenderError(answer["error"])
        return answer


def serve() -> None:
    """Answer the requests of standard input; what packages print goes to standard error."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    made: list[Mapping[str, Callable[[], object]]] = []
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = _answer(request, made)
        except ModuleNotFoundError as missing:
            answer = {"error": f"not installed ({missing.name})"}
        except Exception as error:  # whatever a peer raises is one line of the report
            answer = {"error": f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


def _answer(request: dict[str, Any], made: list[Any]) -> dict[str, Any]:
    if request["do"] == "drop":
        made.clear()
        return {}
    if request["do"] == "call":
        import torch

        torch.set_num_threads(request["threads"])
        call = made[request["number"]][request["part"]]
        began = time.perf_counter()
        result = call()
        seconds = time.perf_counter() - began
        return {"seconds": seconds, **(result if isinstance(result, dict) else {})}
    contender = _contender(request["contender"])
    if find_spec(contender.module) is None:
        raise ModuleNotFoundError(name=contender.module)
    made.append(contender.make(World(**request["world"]), **request["options"]))
    return {"number": len(made) - 1, "parts": list(made[-1])}


def _contender(name: str) -> Any:
    if name.endswith("loop"):
        from loops import LOOPS

        return LOOPS[name]
    from contenders import OURS, PEERS

    return {"pnpct": OURS, **PEERS}[name]


if __name__ == "__main__":
    serve()
