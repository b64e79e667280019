from pathlib import Path

import pytest
import torch

from pnpct.files import FileFormatError, Provenance, SlabFolder

PROVENANCE = Provenance(["pnpct", "reconstruct"], "0.1.0", inputs={"scan.h5": "0" * 64}, settings={"slices": 5})


def test_slabs_count_from_the_lowest_up_and_come_back_as_they_were(tmp_path, generator):
    volume = torch.rand(5, 3, 4, generator=generator)
    folder = SlabFolder.beside(tmp_path / "out.h5", PROVENANCE)
    assert folder.slices == 0
    assert not folder.path.exists()
    folder.write(0, volume[:2])
    assert folder.slices == 2
    folder.write(4, volume[4:])
    assert folder.slices == 2
    folder.write(2, volume[2:4])
    again = SlabFolder.beside(tmp_path / "out.h5", Provenance(["pnpct", "once", "more"], "0.1.0", **RUN))
    assert again.slices == 5
    assert torch.equal(again.read(), volume)
    again.remove()
    assert not list(tmp_path.iterdir())


RUN = {"inputs": {"elsewhere/scan.h5": "0" * 64}, "settings": {"slices": 5}}


@pytest.mark.parametrize(
    "other",
    [
        Provenance([], "0.2.0", **RUN),
        Provenance([], "0.1.0", inputs={"scan.h5": "1" * 64}, settings={"slices": 5}),
        Provenance([], "0.1.0", inputs={"scan.h5": "0" * 64}, settings={"slices": 6}),
    ],
)
def test_the_slabs_of_another_volume_are_not_taken(tmp_path, other):
    SlabFolder.beside(tmp_path / "out.h5", PROVENANCE).write(0, torch.ones(1, 2, 2))
    with pytest.raises(ValueError, match="slabs of another volume, with other options, inputs or another version"):
        SlabFolder.beside(tmp_path / "out.h5", other)


def test_what_is_no_folder_of_slabs(tmp_path):
    (tmp_path / "out.h5.slabs").write_text("notes")
    with pytest.raises(ValueError, match="is not a folder of slabs"):
        SlabFolder.beside(tmp_path / "out.h5", PROVENANCE)
    folder = SlabFolder.beside(tmp_path / "other.h5", PROVENANCE)
    with pytest.raises(FileFormatError, match="holds no slabs"):
        folder.read()
    with pytest.raises(ValueError, match="slices from 8 on hold values that are not finite"):
        folder.write(8, torch.full((1, 2, 2), torch.nan))
    assert not folder.path.exists()


@pytest.mark.parametrize("left", range(4))
def test_a_kill_while_the_folder_is_removed_leaves_one_of_fewer_slabs(tmp_path, monkeypatch, left):
    folder = SlabFolder.beside(tmp_path / "out.h5", PROVENANCE)
    for first in range(3):
        folder.write(first, torch.ones(1, 2, 2))
    removed, unlink = [], Path.unlink

    def killed(path, **options):
        if len(removed) == 3 - left:
            raise KeyboardInterrupt
        removed.append(path)
        unlink(path, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", killed)
        patch.setattr("shutil.rmtree", killed)
        with pytest.raises(KeyboardInterrupt):
            folder.remove()
    assert SlabFolder.beside(tmp_path / "out.h5", PROVENANCE).slices == left


def test_a_full_disk_is_said_and_leaves_the_slabs_that_are_whole(tmp_path, monkeypatch):
    folder = SlabFolder.beside(tmp_path / "out.h5", PROVENANCE)
    folder.write(0, torch.ones(2, 2, 2))

    def full(path, array):
        raise OSError("8 requested and 3 written")

    monkeypatch.setattr("numpy.save", full)
    with pytest.raises(OSError, match=r"000002\.npy was not written: the disk is full"):
        folder.write(2, torch.ones(2, 2, 2))
    assert folder.slices == 2
