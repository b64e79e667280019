"""Networks as ONNX, run by another program; exporting takes PyTorch about ten seconds."""

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import pnpct.files
from pnpct.denoisers import REDCNN
from pnpct.files import export_onnx

NETWORKS = {
    "local": "RDNCBAM(RDNSize(4, 2, 1, 2, 2))",
    "told": "RDNCBAM(RDNSize(4, 2, 1, 2), noise_input=True)",
    "global": "RDNCBAM(RDNSize(4, 2, 1, 2, 2), attention='global')",
    "red-cnn": "REDCNN(filters=2)",
}

# Apart from the checks of shapes that tests switch on, which PyTorch cannot trace.
PROGRAM = """
    import sys
    import onnxruntime
    import torch
    from pnpct.denoisers import RDNCBAM, REDCNN, RDNSize
    from pnpct.files import export_onnx
    torch.manual_seed(0)
    network = {network}
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    export_onnx(network, sys.argv[1])
    assert network.training
    session = onnxruntime.InferenceSession(sys.argv[1], providers=["CPUExecutionProvider"])
    names = [given.name for given in session.get_inputs()]
    assert names == (["image", "noise_level"] if getattr(network, "noise_input", False) else ["image"])
    assert [given.shape for given in session.get_inputs()] == [["batch", "rows", "cols"]] * len(names)
    for shape in ((1, 32, 32), (3, 41, 28), (2, 30, 33)):
        arrays = [torch.rand(shape) for _ in names]
        result, = session.run(["denoised"], {{name: array.numpy() for name, array in zip(names, arrays)}})
        with torch.no_grad():
            expected = network(*arrays)
        assert (expected - arrays[0]).abs().max() > 0.01
        torch.testing.assert_close(torch.from_numpy(result), expected, rtol=0, atol=1e-4)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
def test_another_program_computes_the_same_for_any_size(name, tmp_path):
    for module in ("onnx", "onnxscript", "onnxruntime"):
        pytest.importorskip(module, reason="the extra onnx is not installed")
    path = tmp_path / "net.onnx"
    program = textwrap.dedent(PROGRAM.format(network=NETWORKS[name]))
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["net.onnx"]
    assert str(Path(pnpct.files.__file__).parents[1]).encode() not in path.read_bytes()


def test_another_suffix_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"must end in \.onnx"):
        export_onnx(REDCNN(filters=2), tmp_path / "net.safetensors")


def test_without_the_extra_it_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("pnpct.files.onnx_file.find_spec", lambda name: None)
    with pytest.raises(ModuleNotFoundError, match=r"need onnx and onnxscript; pip install 'pnpct\[onnx\]'"):
        export_onnx(REDCNN(filters=2), tmp_path / "net.onnx")
