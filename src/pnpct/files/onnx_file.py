"""Networks for other programs, as ONNX."""

import warnings
from importlib.util import find_spec
from typing import Any

import torch
from torch import nn

from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.files.atomic import atomic_path
from pnpct.files.errors import PathLike

_EXAMPLE = (2, 33, 38)
"""Arbitrary: batch, rows and columns stay free. They differ, so that none is taken for another."""


def export_onnx(network: nn.Module, path: PathLike) -> None:
    """Write a network as ONNX.

    The input "image" and the output "denoised" are float32 [batch, rows, cols], relative to water, of any size that
    the network takes; noise-conditioned networks have the second input "noise_level", of the shape of
    the image. Nothing else is in the file: how it was trained is recorded beside the .safetensors file.

    Args:
        network: An `RDNCBAM` or a `REDCNN`, on the CPU, in float32.
        path: File to write, .onnx; an existing one is replaced.

    Raises:
        OSError: If the file cannot be written.
        ModuleNotFoundError: If the extra `onnx` is not installed.
        ValueError: If the suffix is another.
    """
    if not str(path).endswith(".onnx"):
        raise ValueError(f"The file must end in .onnx, got {path}.")
    if absent := [name for name in ("onnx", "onnxscript") if find_spec(name) is None]:
        raise ModuleNotFoundError(f"ONNX files need {' and '.join(absent)}; pip install 'pnpct[onnx]' brings them.")
    names = ["image", "noise_level"] if is_noise_conditioned(network) else ["image"]
    sizes = dict.fromkeys(range(3), torch.export.Dim.DYNAMIC)
    was_training = network.training
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # PyTorch's, about its own insides
            program = torch.onnx.export(
                network.eval(),
                tuple(torch.rand(_EXAMPLE) for _ in names),
                input_names=names,
                output_names=["denoised"],
                dynamic_shapes=tuple(sizes for _ in names),
                dynamo=True,
                verbose=False,
            )
    finally:
        network.train(was_training)
    if program is None:
        raise RuntimeError("PyTorch has exported nothing.")
    with atomic_path(path) as temporary:
        temporary.write_bytes(_tidy(program.model_proto).SerializeToString())


def _tidy(exported: Any) -> Any:
    """The same without PyTorch's notes, which name folders of this machine, and with names for the free sizes."""
    for graph in (exported.graph, *exported.functions):
        for item in (graph, *graph.node, *graph.value_info):
            del item.metadata_props[:]
    del exported.graph.value_info[:]  # its sizes have PyTorch's names; readers infer them anew
    for item in (*exported.graph.input, *exported.graph.output):
        del item.metadata_props[:]
        for dimension, name in zip(item.type.tensor_type.shape.dim, ("batch", "rows", "cols"), strict=True):
            dimension.dim_param = name
    return exported
