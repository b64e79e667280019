import multiprocessing
import time

import pytest

from pnpct.files import sole_writer


def test_a_second_writer_is_told(tmp_path):
    with (
        sole_writer(tmp_path),
        pytest.raises(BlockingIOError, match="being written by another process; wait"),
        sole_writer(tmp_path),
    ):
        pass
    with sole_writer(tmp_path):
        assert list(tmp_path.iterdir()) == []


def test_another_file_in_the_folder_is_free(tmp_path):
    with sole_writer(tmp_path / "one.safetensors"), sole_writer(tmp_path / "other.safetensors"):
        with pytest.raises(BlockingIOError), sole_writer(tmp_path / "one.safetensors"):
            pass
        assert len(list(tmp_path.iterdir())) == 2
    assert list(tmp_path.iterdir()) == []


def claim(folder, claimed):
    with sole_writer(folder):
        claimed.set()
        time.sleep(60)


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="there are no locks of files")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # what is done in the other process needs no thread
def test_the_claim_of_a_killed_process_has_ended(tmp_path):
    context = multiprocessing.get_context("fork")
    claimed = context.Event()
    process = context.Process(target=claim, args=(tmp_path, claimed))
    process.start()
    assert claimed.wait(60)
    with pytest.raises(BlockingIOError), sole_writer(tmp_path):
        pass
    process.kill()
    process.join()
    with sole_writer(tmp_path):
        pass


def test_what_killed_writers_have_left_is_removed_and_nothing_else(tmp_path):
    inner = tmp_path / "train"
    inner.mkdir()
    for name in (".0123abcd-scan.h5", ".notes-of-mine", "scan.h5", ".0123abcd"):
        (inner / name).touch()
    with sole_writer(tmp_path):
        assert sorted(path.name for path in inner.iterdir()) == [".0123abcd", ".notes-of-mine", "scan.h5"]


def test_beside_a_file_only_what_has_its_name_is_removed(tmp_path):
    for name in (".0123abcd-a.training", ".0123abcd-a.safetensors", ".0123abcd-b.training", "a.training"):
        (tmp_path / name).touch()
    (tmp_path / ".0123abcd-a.safetensors.json").touch()
    with sole_writer(tmp_path / "a.safetensors"):
        pass
    assert sorted(path.name for path in tmp_path.iterdir()) == [".0123abcd-b.training", "a.training"]


@pytest.mark.parametrize("older", [False, True])
def test_half_of_a_folder_is_removed(tmp_path, older):
    series = tmp_path / "series"
    for folder in (".0123abcd-series", ".0123abcd-series of another", *(["series"] if older else [])):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "0001.dcm").touch()
    with sole_writer(series):
        pass
    left = [path.name for path in sorted(tmp_path.iterdir())]
    assert left == [".0123abcd-series of another", *(["series"] if older else [])]
