import json
import math
import re

import numpy as np
import pytest

from pnpct.files import FileFormatError
from pnpct.files.catsim_cfg import Unreadable, read_cfg
from pnpct.files.catsim_settings import read_settings

SCANNER = """
# Scanner geometry
scanner.detectorCallback = "Detector_ThirdgenCurved" # name of function
scanner.sid = 541.0                         # source-to-iso distance (in mm)
scanner.sdd = 949.0
scanner.detectorColsPerMod = 1
scanner.detectorRowsPerMod = 16
scanner.detectorColOffset = 0.25
scanner.detectorColSize = 1.0239
scanner.detectorColCount = 900
scanner.detectorRowCount = scanner.detectorRowsPerMod     # total number of detector rows
scanner.detectorPrefilter = ['graphite', 1.0]
scanner.detectionGain = 17.0
scanner.eNoise = 3500.0
"""
PROTOCOL = """
'''Protocol'''
import numpy as np
protocol.viewsPerRotation = 984
protocol.viewCount = 984
protocol.startViewId = 0
protocol.stopViewId = protocol.startViewId+protocol.viewCount-1
protocol.spectrumUnit_mm = 0;               # a semicolon, as in CatSim's own
protocol.flatFilter = ['Al',3.0]
protocol.mA = np.float32(200)
"""


@pytest.fixture
def configured(tmp_path):
    """Settings of the two files above and one more that overrides them."""

    def read(text=""):
        (tmp_path / "Scanner.cfg").write_text(SCANNER)
        (tmp_path / "Protocol.cfg").write_text(PROTOCOL)
        (tmp_path / "mine.cfg").write_text(text)
        return read_settings([tmp_path / name for name in ("Scanner.cfg", "Protocol.cfg", "mine.cfg")])

    return read


def test_plain_values_names_and_sums_are_read(tmp_path):
    (tmp_path / "a.cfg").write_text(SCANNER)
    (tmp_path / "b.cfg").write_text(PROTOCOL + "scanner.sid = 2 * (scanner.sid - 1) / 4\nphysics.x = -3\n")
    values = read_cfg([tmp_path / "a.cfg", tmp_path / "b.cfg"])
    assert values["scanner.sid"] == 270.0
    assert values["scanner.detectorRowCount"] == 16
    assert values["protocol.stopViewId"] == 983
    assert values["protocol.flatFilter"] == ["Al", 3.0]
    assert values["physics.x"] == -3
    assert isinstance(values["protocol.mA"], Unreadable)
    assert values["protocol.mA"] == f"{tmp_path / 'b.cfg'}, line 10"


def test_nothing_is_executed(tmp_path, configured):
    victim = tmp_path / "victim"
    victim.write_text("still here")
    harm = f"__import__('os').remove({str(victim)!r})"
    with pytest.raises(FileFormatError, match=r"mine.cfg, line 1: scanner.sid must be a plain number here"):
        configured(f"scanner.sid = {harm}")
    with pytest.raises(FileFormatError, match=r"mine.cfg, line 2: only lines like `scanner.sid = 541.0` are read"):
        configured(f"\n{harm}")
    assert victim.exists()


@pytest.mark.parametrize("text", ["scanner.sid = (", "scanner.sid = 1\x00", "scanner.sid = " + "(" * 10_000])
def test_what_is_no_configuration_is_one_sentence(configured, text):
    with pytest.raises(FileFormatError, match=r"mine.cfg: this is not a configuration file of CatSim"):
        configured(text)


@pytest.mark.parametrize("text", ["if True:\n    scanner.sid = 1", "a = b = 1", "for i in []: pass", "f(1)"])
def test_programs_are_refused(configured, text):
    with pytest.raises(FileFormatError, match=r"mine.cfg, line 1: only lines like"):
        configured(text)


@pytest.mark.parametrize(
    "text",
    [
        "x = 3\n" + "x = x * x\n" * 45 + "scanner.sid = x",
        "x = [1, 1]\n" + "x = [x, x]\n" * 30 + "scanner.sid = x",
        "scanner.sid = " + "[" * 60 + "]" * 60,
        "scanner.sid = 0x1" + "0" * 400,
    ],
)
def test_values_cannot_grow(configured, text):
    with pytest.raises(FileFormatError, match=r"mine.cfg, line \d+: scanner.sid must be a plain number here"):
        configured(text)


def test_a_configuration_is_a_small_file(configured):
    with pytest.raises(FileFormatError, match="far more than a configuration file"):
        configured("# nothing\n" * 200_000)


@pytest.mark.parametrize("terms", [900, 3000, 100_000])
def test_a_sum_too_long_to_follow_is_not_followed(configured, terms):
    with pytest.raises(FileFormatError, match=r"mine\.cfg"):
        configured("scanner.sid = " + "+".join(["1"] * terms))


def test_the_default_scan_is_a_full_turn_from_the_top(configured):
    settings = configured()
    geometry = settings.geometry
    assert geometry.shape == (984, 900)
    assert (geometry.source_to_isocenter, geometry.source_to_detector) == (541.0, 949.0)
    assert (geometry.bin_width, geometry.detector_offset, geometry.detector) == (1.0239, 0.25, "arc")
    assert geometry.view_angles == pytest.approx(2 * math.pi * np.arange(984) / 984)
    assert geometry.focal_spot_shifts == ()
    assert (settings.rows, settings.gain_of(7), settings.electron_noise) == (16, 17.0, 3500.0)


def test_angles_start_and_turn_as_in_catsim(configured):
    # The figures were compared with an analytic disc that gecatsim 1.6.6 scanned with these settings.
    settings = configured("""
protocol.viewsPerRotation = 48
protocol.viewCount = 24
protocol.startViewId = 5
protocol.startAngle = 30
protocol.rotationDirection = -1
protocol.dutyRatio = 0.5
protocol.wobbleDistance = 2.0
protocol.focalspotOffset = [3.0, 4.0, 0]
""")
    assert np.degrees(settings.geometry.view_angles[:3]) == pytest.approx([-5.625, -13.125, -20.625])
    assert settings.geometry.focal_spot_shifts[:3] == ((5.0, 4.0), (1.0, 4.0), (5.0, 4.0))


def test_rows_may_have_their_own_gain_and_noise_may_be_off(configured):
    settings = configured(
        "scanner.detectorRowCount = 2\nscanner.detectionGain = [17, 18.5]\nphysics.enableElectronicNoise = 0"
    )
    assert [settings.gain_of(row) for row in (0, 1)] == [17.0, 18.5]
    assert settings.electron_noise == 0.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'scanner.detectorCallback = "Detector_FlatPanel"',
            "scanner.detectorCallback is 'Detector_FlatPanel', but only",
        ),
        ('scanner.detectionCallback = "Detection_PC"', "scanner.detectionCallback is 'Detection_PC'"),
        ("scanner.detectorColsPerMod = 16", "scanner.detectorColsPerMod is 16, but only scans with 1"),
        ("protocol.tiltAngle = 5", "protocol.tiltAngle is 5"),
        ("protocol.rotationDirection = 2", "protocol.rotationDirection must be 1 or -1"),
        ("protocol.viewCount = 1e18", "at most 1000000 views"),
        ("scanner.detectorColCount = 1e18", "at most 1000000 bins and rows"),
        ("protocol.viewCount = 2.5", "protocol.viewCount must be a whole number of at least 1, got 2.5"),
        ("protocol.focalspotOffset = [0, 0, 1]", "protocol.focalspotOffset must be [x, y, 0] in mm"),
        (
            "scanner.detectionGain = [17, 17]",
            "scanner.detectionGain must be a positive number, or one per row",
        ),
        ("scanner.detectionGain = -1", "scanner.detectionGain must be a positive number"),
        ("scanner.sid = '541'", "scanner.sid must be a number, got '541'"),
        ("scanner.sid = 1e400", "scanner.sid must be a number, got inf"),
        ("scanner.sdd = 100", "The detector must lie beyond the isocentre"),
        ("scanner.eNoise = max(1, 2)", "mine.cfg, line 1: scanner.eNoise must be a plain number here"),
    ],
)
def test_scans_of_another_kind_are_one_sentence(configured, text, message):
    with pytest.raises(FileFormatError, match=re.escape(message)):
        configured(text)


@pytest.mark.parametrize(
    "key", re.findall(r"scanner\.(?:sid|sdd|detectorCol[OSC]\w+|detectorRowCount|eNoise)", SCANNER)
)
def test_a_missing_value_is_named(tmp_path, key):
    lines = [line for line in (SCANNER + PROTOCOL).splitlines() if not line.startswith(f"{key} ")]
    (tmp_path / "all.cfg").write_text("\n".join(lines))
    with pytest.raises(FileFormatError, match=f"all.cfg: {key} is missing; add the file that sets it"):
        read_settings(tmp_path / "all.cfg")


def test_no_files_and_mixed_files_are_refused(tmp_path):
    with pytest.raises(FileFormatError, match="need their configuration; none was given"):
        read_settings([])
    with pytest.raises(FileNotFoundError, match="There is no file"):
        read_settings(tmp_path / "absent.cfg")
    with pytest.raises(FileFormatError, match=r"One JSON file or \.cfg files say how CatSim scanned"):
        read_settings(["geometry.json", "Scanner.cfg"])


def test_a_json_file_needs_gain_and_noise(tmp_path, shared_data):
    path = shared_data / "catsim" / "chest" / "geometry.json"
    settings = read_settings(path)
    assert (settings.rows, settings.gain_of(3), settings.electron_noise) == (0, 17.0, 3500.0)
    content = json.loads(path.read_text())
    del content["gain_e_per_keV"]
    (tmp_path / "geometry.json").write_text(json.dumps(content))
    with pytest.raises(FileFormatError, match=r"need gain_e_per_keV > 0 and eNoise_e"):
        read_settings(tmp_path / "geometry.json")
