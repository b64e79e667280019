"""What is read from elsewhere: for each reader its files, how they are damaged, and the commands that read them."""

import json
import shutil
import sys
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import array_mutations
import h5py
import mutations
import numpy as np
from ct_pd_views import write_folder
from dicom_images import dicom
from mat_files import of_version_5, of_version_7_3
from mutations import Mutate
from small_comparison import make_comparison

from pnpct.cli import main
from pnpct.files import FractionMap, write_xcist_phantom
from pnpct.geometry import ImageGrid
from pnpct.simulation import Recipe, simulate_dataset

VIEWS, BINS, SIZE = 24, 30, 24
SCAN = f"--views {VIEWS} --bins {BINS} --size {SIZE}"

GEOMETRY = {"source_to_isocenter_mm": 541, "source_to_detector_mm": 949, "bins": BINS, "bin_width_mm": 30.7}
GEOMETRY |= {"detector_offset_bins": 0.25, "views": VIEWS}

TURN = np.linspace(0.0, 2 * np.pi, VIEWS, endpoint=False)
PEERS: Mapping[str, Mapping[str, object]] = {
    "astra": {
        "type": "fanflat",
        "DetectorWidth": 30.7,
        "DetectorCount": BINS,
        "ProjectionAngles": TURN.tolist(),
        "DistanceOriginSource": 541,
        "DistanceOriginDetector": 408,
    },
    "vectors": {
        "type": "fanflat_vec",
        "DetectorCount": BINS,
        "Vectors": [
            [541 * s, -541 * c, -408 * s, 408 * c, 30.7 * c, 30.7 * s]
            for s, c in zip(np.sin(TURN).tolist(), np.cos(TURN).tolist(), strict=True)
        ],
    },
    "odl": {"src_radius": 541, "det_radius": 408, "angles": TURN.tolist(), "dpart": [-450, 471, BINS]},
    "tigre": {
        "DSO": 541,
        "DSD": 949,
        "nDetector": [1, BINS],
        "dDetector": [1, 30.7],
        "angles": TURN.tolist(),
        "offDetector": [0, 8],
        "COR": 1,
    },
    "leap": {
        "sod": 541,
        "sdd": 949,
        "numCols": BINS,
        "pixelWidth": 30.7,
        "centerCol": 14.75,
        "phis": np.degrees(TURN).tolist(),
        "tau": 1,
    },
}
HELTOMO = {
    "projectName": "head",
    "distanceSourceOrigin": 541.0,
    "distanceSourceDetector": 949.0,
    "numDetectorsPost": BINS,
    "pixelSizePost": 30.7,
    "angles": np.degrees(TURN),
}

CONFIGURATION = f"""scanner.sid = 541.0
scanner.sdd = 949.0
scanner.detectorColOffset = 0.25
scanner.detectorColSize = 30.7
scanner.detectorColCount = {BINS}
scanner.detectorRowCount = 1
scanner.detectionGain = 17.0
scanner.eNoise = 3500.0
protocol.viewsPerRotation = {VIEWS}
protocol.viewCount = protocol.viewsPerRotation
protocol.wobbleDistance = 0.1
protocol.focalspotOffset = [0, 0, 0]
"""


@dataclass(frozen=True)
class Reader:
    """One way into the program.

    Args:
        files: Files and folders that the commands need.
        damaged: Those of them that are damaged, one at a time.
        commands: Command lines, in which {here} has copies of the files and a folder out.
        mutations: By suffix of the file.
    """

    files: Sequence[str]
    damaged: Sequence[str]
    commands: Sequence[str]
    mutations: Mapping[str, tuple[Mutate, ...]]


OF = {
    ".h5": (mutations.of_hdf5,),
    ".json": (mutations.of_json, mutations.of_words),
    ".npy": (array_mutations.of_npz,),
    ".npz": (array_mutations.of_npz,),
    ".mat": (array_mutations.of_mat,),
    ".cfg": (mutations.of_text,),
    ".scan": (array_mutations.of_raw,),
    ".air": (array_mutations.of_raw,),
    ".dcm": (mutations.of_dicom,),
    ".zip": (mutations.of_zip,),
    ".training": (mutations.of_torch,),
    ".safetensors": (mutations.of_words, mutations.of_bytes),
    ".density_0": (array_mutations.of_raw,),
    ".nii": (mutations.of_bytes,),
    ".gz": (mutations.of_bytes,),
}


def reader(files: str, *commands: str, damaged: str = "") -> Reader:
    """A reader whose files are all damaged, unless some are named."""
    return Reader(files.split(), (damaged or files).split(), commands, OF)


ARRAYS = "import arrays {here}/counts.npy {here}/geometry.json {here}/out/s.h5 --kind counts"
TRAIN = "--epochs 1 --fine-tuning-epochs 1 --pairs-per-epoch 2 --batch 2 --cache {made}/cache"

READERS = {
    "scan": reader("scan.h5", "reconstruct {here}/scan.h5 {here}/out/i.h5 --method fbp", "info {here}/scan.h5"),
    "image": reader(
        "image.h5",
        "denoise {here}/image.h5 {here}/out/i.h5 --denoiser gaussian",
        "evaluate {made}/image.h5 {here}/image.h5 {here}/out/i.json",
        "info {here}/image.h5",
    ),
    "nifti": reader("image.nii", "denoise {here}/image.nii {here}/out/i.nii --denoiser gaussian"),
    "nifti-gz": reader("image.nii.gz", "denoise {here}/image.nii.gz {here}/out/i.nii.gz --denoiser gaussian"),
    "exposures": reader("slice.h5", "simulate draw {here}/slice.h5 {here}/out/s.h5", "info {here}/slice.h5"),
    "arrays": reader(
        "counts.npy incident.npy all.npz geometry.json",
        ARRAYS + " --incident {here}/incident.npy",
        ARRAYS.replace("counts.npy", "all.npz:counts") + " --incident {here}/all.npz:incident",
    ),
    "peers": reader(
        "counts.npy " + " ".join(f"{name}.json" for name in PEERS),
        *(ARRAYS.replace("geometry", name) + " --incident {made}/incident.npy" for name in PEERS),
        damaged=" ".join(f"{name}.json" for name in PEERS),
    ),
    "mat": reader(
        "scan.mat scan73.mat",
        "import arrays {here}/scan.mat {here}/scan.mat {here}/out/s.h5",
        "import arrays {here}/scan73.mat {here}/scan73.mat {here}/out/s.h5",
    ),
    "catsim": reader(
        "raw.scan raw.air raw.cfg",
        "import catsim {here}/raw {here}/out/s.h5 --configuration {here}/raw.cfg",
    ),
    "dicom": reader("series", "simulate scan {here}/out/s.h5 --body {here}/series " + SCAN),
    "ct-pd": reader("views", "import dicom-ct-pd {here}/views {here}/out/s.h5"),
    "dicom-series": reader(
        "series",
        "denoise {here}/series {here}/out/series --denoiser gaussian",
        "denoise {here}/series {here}/out/i.nii --denoiser gaussian",
    ),
    "volume": reader("volume.npz", "simulate scan {here}/out/s.h5 --body {here}/volume.npz " + SCAN),
    "xcist": reader(
        "phantom.json phantom.density_0",
        "simulate scan {here}/out/s.h5 --body {here}/phantom.json " + SCAN,
    ),
    "xcist-zip": reader("phantom.zip", "simulate scan {here}/out/s.h5 --body {here}/phantom.zip " + SCAN),
    "manifest": reader(
        "set",
        "train {here}/set {here}/out/n.safetensors --size red-cnn --method supervised --epochs 1 --pairs-per-epoch 1 "
        "--batch 1 --loop-iterations 1 --loop-images 1",
        damaged="set/manifest.json",
    ),
    "training": reader(
        "n.training", "train {made}/set {here}/n.safetensors --size red-cnn " + TRAIN, damaged="n.training"
    ),
    "network": reader(
        "n.safetensors n.safetensors.json",
        "denoise {made}/image.h5 {here}/out/i.h5 --denoiser {here}/n.safetensors",
    ),
    "comparison": reader("comparison", "report {here}/comparison {here}/out/r.html"),
}


QUICK = [name for name in READERS if name not in ("exposures", "manifest", "training", "network", "comparison")]
"""Readers whose files take no training to make."""


def make_trained(folder: Path) -> None:
    """Add the files of readers that are not `QUICK`, which others than those make."""
    recipe = Recipe(("head",), cases=3, rows=1, tube_voltages_kvp=(120.0,), views=VIEWS, bins=BINS, size=SIZE)
    with patch(
        "pnpct.simulation.dataset.side_by_side", lambda function, calls, **workers: (function(*call) for call in calls)
    ):
        list(simulate_dataset(folder / "set", recipe))
    shutil.copy(next((folder / "set" / "train").glob("*.h5")), folder / "slice.h5")
    done(folder, "train {made}/set {made}/n.safetensors --size red-cnn " + TRAIN)
    (folder / "comparison").mkdir()
    make_comparison(folder / "comparison")


def done(folder: Path, words: str) -> None:
    """Run a command that must succeed."""
    if main([word.format(made=folder, here=folder) for word in words.split()]):
        raise RuntimeError(words)


def make(folder: Path) -> None:
    """Fill a folder with good files of the readers that are `QUICK`."""
    done(folder, "simulate scan {made}/scan.h5 --anatomy head " + SCAN)
    for name in ("image.h5", "image.nii", "image.nii.gz"):
        done(folder, "reconstruct {made}/scan.h5 {made}/" + name + " --method fbp")
    with h5py.File(folder / "scan.h5") as file:
        counts, incident = file["counts"][()], file["incident"][()]
    np.save(folder / "counts.npy", counts)
    np.save(folder / "incident.npy", incident)
    np.savez(folder / "all.npz", counts=counts, incident=incident)
    for name, content in {"geometry": GEOMETRY, **PEERS}.items():
        (folder / f"{name}.json").write_text(json.dumps(content))
    line_integrals = -np.log(counts.clip(1) / incident)
    of_version_5(folder / "scan.mat", line_integrals, HELTOMO)
    of_version_7_3(folder / "scan73.mat", line_integrals, HELTOMO)
    (folder / "raw.cfg").write_text(CONFIGURATION)
    (counts * 1200).astype("<f4").tofile(folder / "raw.scan")
    np.broadcast_to(incident * 1200, BINS).astype("<f4").tofile(folder / "raw.air")
    hu = np.full((3, 8, 8), -1000, np.int16)
    hu[:, 2:6, 1:7] = 40
    np.savez(folder / "volume.npz", hu=hu, z_mm=np.array([0.0, 3.0, 6.0]), spacing_mm=np.array(30.0))
    (folder / "series").mkdir()
    for number, z in enumerate((0.0, 3.0, 6.0)):
        dicom(z, hu[0], PixelSpacing=[30.0, 30.0]).save_as(
            folder / "series" / f"{number}.dcm", enforce_file_format=True
        )
    write_folder(folder / "views", views=4)
    water = FractionMap("water", (hu > 0).astype(np.float32), ImageGrid(8, 8, 30.0), slice_thickness=3.0)
    write_xcist_phantom(folder / "phantom.json", [water])
    with zipfile.ZipFile(folder / "phantom.zip", "w") as archive:
        for name in ("phantom.json", "phantom.density_0"):
            archive.write(folder / name, name)


if __name__ == "__main__":
    make(Path(sys.argv[1]))
    make_trained(Path(sys.argv[1]))
