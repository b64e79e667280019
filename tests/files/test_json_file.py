import json
import os

import pytest

from pnpct.files import FileFormatError
from pnpct.files.json_file import file_beside, load_json


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "this is not JSON"),
        ("[" * 100_000 + "]" * 100_000, "nested too deeply"),
        ("[1, 2]", r"a JSON object with named values was needed, got \[1, 2\]"),
        (json.dumps("m" * 100_000), r"got 'm{76}\.\.\.\.$"),
        ("\xff", "this is not JSON"),
        ('{"a": ' + "9" * 5000 + "}", "a number has thousands of digits"),
    ],
)
def test_what_is_no_object_is_one_short_sentence(tmp_path, text, message):
    path = tmp_path / "a.json"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(FileFormatError, match=f"^{path}: .*{message}") as raised:
        load_json(path)
    assert len(str(raised.value)) < 400


@pytest.mark.parametrize("name", ["map.raw", "maps/map.raw", "./map.raw", "maps/../map.raw", "absent.raw"])
def test_files_in_the_folder_and_below_may_be_named(tmp_path, name):
    assert file_beside(tmp_path, name) == tmp_path / name


@pytest.mark.parametrize("name", ["../map.raw", "/etc/passwd", "maps/../../map.raw", "away/map.raw", "circle", "a\0b"])
def test_files_elsewhere_may_not(tmp_path, name):
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "away").symlink_to(tmp_path)
    (tmp_path / "here" / "circle").symlink_to("circle")
    with pytest.raises(FileFormatError, match="which is not in its own folder"):
        file_beside(tmp_path / "here", name)


def test_a_pipe_is_no_file_to_wait_for(tmp_path):
    os.mkfifo(tmp_path / "a.json")
    with pytest.raises(OSError, match="is a pipe or a device, but an ordinary file is needed"):
        load_json(tmp_path / "a.json")
