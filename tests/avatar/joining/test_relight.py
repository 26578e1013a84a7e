"""A head in another light."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ico3d.avatar.joining.cropping import cropped
from ico3d.avatar.joining.relight import color_difference, harmonics_of, relit
from ico3d.capture.face.region import HeadRegion
from support.avatars.planted_person import face
from support.avatars.tiny_joining import parts_of


def test_a_tint_is_recovered(head, abroad):
    """A quarter of the difference is left at most, by cameras that were not learnt from, too."""
    placement, expressions, views, tested = parts_of(abroad, head)
    before = [color_difference(head.model, placement, expressions, v) for v in (views, tested)]
    assert min(before) > 0.03
    kept = {name: value.clone() for name, value in head.model.state_dict().items()}
    model = relit(head.model, face(), placement, expressions, views)
    after = [color_difference(model, placement, expressions, v) for v in (views, tested)]
    assert after[0] < 0.25 * before[0] and after[1] < 0.25 * before[1]
    assert all(torch.equal(v, kept[n]) for n, v in head.model.state_dict().items())
    assert {n for n, v in model.state_dict().items() if n not in kept} == {"light"}


def test_noise_paints_no_blotch(head, abroad):
    """What is added to colours is a function of the normal with 9 numbers for each channel."""
    placement, expressions, views, _ = parts_of(abroad, head)
    noise = torch.Generator().manual_seed(0)
    views = [
        replace(v, image=v.image + 0.3 * torch.randn(v.image.shape, generator=noise)) for v in views
    ]
    clean = relit(head.model, face(), placement, expressions, parts_of(abroad, head)[2])
    noisy = relit(head.model, face(), placement, expressions, views)
    assert (noisy.light - clean.light).abs().max() < 0.6
    basis = harmonics_of(head.model, face(), expressions[views[0].frame]).double()
    inside = (noisy.light > noisy.light.min(0).values) & (noisy.light < noisy.light.max(0).values)
    for channel in range(3):
        rows = inside[:, channel]
        change = noisy.light[rows, channel].double()
        rest = (
            change - basis[rows] @ torch.linalg.lstsq(basis[rows], change[:, None]).solution[:, 0]
        )
        assert float(rest.abs().max()) < 1e-4


def test_lamps_from_one_side(head, abroad):
    """Brighter on the left: found there, by cameras that were not learnt from, too."""
    across = harmonics_of(head.model, face(), np.zeros(10, np.float32))[:, 3]  # (N,), −.49·x
    abroad.head.model = head.model.relit(-1.2 * across[:, None].expand(-1, 3))
    placement, expressions, views, tested = parts_of(abroad, head)
    model = relit(head.model, face(), placement, expressions, views)
    left, right = head.model.means[:, 0] > 0.04, head.model.means[:, 0] < -0.04
    assert model.light[left].mean() > model.light[right].mean() + 0.4
    before = color_difference(head.model, placement, expressions, tested)
    assert color_difference(model, placement, expressions, tested) < 0.35 * before


@pytest.mark.parametrize("twice", [False, True])
def test_a_relit_head_is_kept_in_its_file(head, tmp_path, twice):
    """And what is added a second time is added to the first."""
    change = torch.linspace(-0.5, 0.5, 3 * len(head.model)).reshape(-1, 3)
    model = head.model.relit(change)
    model = model.relit(change) if twice else model
    model.save(tmp_path / "model.safetensors")
    loaded = type(model).load(tmp_path / "model.safetensors")
    for value in (0.0, 0.8):
        values = torch.full((10,), value)
        expected = head.model.logits(values)
        expected[:, :3] += (2 if twice else 1) * change
        torch.testing.assert_close(loaded.logits(values), expected)


def test_a_relit_head_can_be_cropped(head):
    """What is left keeps its own change of light."""
    change = torch.arange(3.0 * len(head.model)).reshape(-1, 3) / 1000
    region = HeadRegion.around(face())
    inside = region.depth(head.model.means.detach().numpy().astype(np.float64)) > 0
    head.model = head.model.relit(change)
    left = cropped(head, region).model
    assert 0 < len(left) < len(change)
    assert set(left.light[:, 0].tolist()) <= set(change[inside, 0].tolist())
