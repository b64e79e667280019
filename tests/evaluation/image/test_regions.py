from pathlib import Path

import numpy as np
import pytest
import torch

from pnpct.evaluation import body_mask, soft_tissue_mask


@pytest.fixture
def patient() -> torch.Tensor:
    """Soft tissue with a lung and a bone inside, on a thin table that touches the skin."""
    y, x = torch.meshgrid(torch.arange(96.0), torch.arange(96.0), indexing="ij")

    def disc(cx: float, cy: float, radius: float) -> torch.Tensor:
        return (x - cx) ** 2 + (y - cy) ** 2 < radius**2

    image = torch.zeros(96, 96)
    image[disc(48, 44, 35)] = 1.04
    image[disc(36, 44, 12)] = 0.2
    image[disc(62, 44, 8)] = 1.8
    image[79:81] = 1.5
    return image


def test_the_body_has_its_lung_but_not_the_table(patient: torch.Tensor) -> None:
    mask = body_mask(patient)
    assert mask[44, 36]
    assert not mask[80, 4]
    assert not mask[3, 3]
    assert mask.sum().item() == pytest.approx(torch.pi * 35**2, rel=0.03)


def test_a_body_that_leaves_the_image_reaches_the_border(patient: torch.Tensor) -> None:
    mask = body_mask(patient[24:60, 24:70])
    assert mask.all()


def test_without_a_body_the_masks_are_empty() -> None:
    air = torch.zeros(2, 20, 20)
    assert not body_mask(air).any()
    assert not soft_tissue_mask(air).any()


@pytest.mark.parametrize("margin", [0, 3, 5])
def test_soft_tissue_keeps_its_distance_from_air_lung_and_bone(patient: torch.Tensor, margin: int) -> None:
    mask = soft_tissue_mask(patient, margin=margin)
    assert set(patient[mask].tolist()) == {torch.tensor(1.04).item()}
    others = torch.nonzero(patient != torch.tensor(1.04))
    distance = torch.cdist(torch.nonzero(mask).float(), others.float()).min()
    assert distance > margin
    # Pixels lie at whole steps, so the next ring is not far.
    assert distance <= margin + 1


def test_soft_tissue_is_inside_the_body(patient: torch.Tensor) -> None:
    patient[85:95, 5:40] = 1.0  # a cushion
    assert not soft_tissue_mask(patient)[85:].any()


def test_a_batch_is_its_slices(patient: torch.Tensor) -> None:
    batch = torch.stack([patient, patient.flip(1), torch.zeros_like(patient)])
    for region in (body_mask, soft_tissue_mask):
        assert torch.equal(region(batch), torch.stack([region(one) for one in batch]))


def test_on_a_real_chest_the_body_is_in_one_piece_without_the_table(shared_data: Path) -> None:
    with np.load(shared_data / "ct_series" / "chest.npz") as series:
        hu = torch.from_numpy(series["hu"][[10, 50]].astype(np.float32))
    mask = body_mask(1 + hu / 1000)
    # The table's shell begins at row 400 or so; the chest has about 100,000 pixels of 0.78 mm².
    assert not mask[:, 425:].any()
    assert ((mask.sum((1, 2)) > 60_000) & (mask.sum((1, 2)) < 130_000)).all()
    tissue = soft_tissue_mask(1 + hu / 1000)
    assert (tissue <= mask).all()
    assert -120 < hu[tissue].median() < 120
