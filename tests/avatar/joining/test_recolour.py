"""The head's colours under another light."""

import numpy as np
import pytest
import torch
from scipy.spatial import KDTree

from ico3d.avatar.joining import recolour as module
from ico3d.avatar.joining.recolour import RecolourSettings, color_difference, recolour
from support.avatars.tiny_joining import RECOLOUR, parts_of


@pytest.fixture
def head(head):
    """As it is when it has just been loaded."""
    head.model.requires_grad_()
    return head


def test_a_tint_is_recovered(head, abroad):
    """A quarter of the difference is left at most, by cameras that were not learnt from, too."""
    placement, expressions, views, tested = parts_of(abroad, head)
    before = [color_difference(head.model, placement, expressions, v) for v in (views, tested)]
    assert min(before) > 0.03
    kept = {name: value.clone() for name, value in head.model.state_dict().items()}
    recolour(head.model, placement, expressions, views, RECOLOUR)
    after = [color_difference(head.model, placement, expressions, v) for v in (views, tested)]
    assert after[0] < 0.25 * before[0] and after[1] < 0.25 * before[1]
    changed = {n for n, v in head.model.state_dict().items() if not torch.equal(v, kept[n])}
    assert changed == {"color_branch.weight", "color_branch.bias"}
    assert all(parameter.grad is None for parameter in head.model.parameters())


def test_one_seed_one_result(head, abroad):
    """Bit by bit, however little of what does not change is kept in memory."""
    placement, expressions, views, _ = parts_of(abroad, head)
    start = {name: value.clone() for name, value in head.model.state_dict().items()}
    found = []
    for memory in (2**30, 0):
        head.model.load_state_dict(start)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "MEMORY", memory)
            recolour(head.model, placement, expressions, views, RecolourSettings(steps=12))
        found.append(head.model.color_branch.weight.detach().clone())
    assert torch.equal(*found)


def test_light_changes_little_between_neighbours(head, abroad):
    """Pictures with much noise do not make the head spotty, as they would otherwise."""
    placement, expressions, views, _ = parts_of(abroad, head)
    noise = torch.Generator().manual_seed(0)
    for view in views:
        view.image.add_(0.3 * torch.randn(view.image.shape, generator=noise)).clamp_(0, 1)
    start = {name: value.clone() for name, value in head.model.state_dict().items()}
    nearest = KDTree(start["means"].numpy()).query(start["means"].numpy(), k=2)[1][:, 1]
    values = torch.from_numpy(expressions[0])
    rough = []
    for weight in (module.ROUGHNESS, 0.0):
        head.model.load_state_dict(start)
        before = head.model.logits(values)[:, :3].detach()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "ROUGHNESS", weight)
            recolour(head.model, placement, expressions, views, RECOLOUR)
        change = head.model.logits(values)[:, :3] - before
        rough.append(float((change - change[nearest]).detach().square().mean()))
    assert rough[0] < 0.75 * rough[1]


def test_roughness_is_the_mean_square_of_neighbours_differences(head):
    """By hand, with the six nearest of every Gaussian."""
    generator = torch.Generator().manual_seed(1)
    hidden = torch.randn(len(head.model), 64, generator=generator)
    change = torch.randn(3, 64, generator=generator)
    light, means = (hidden @ change.T).numpy(), head.model.means.detach().numpy()
    total = 0.0
    for index, place in enumerate(means):
        nearest = np.argsort(np.linalg.norm(means - place, axis=1))[1:7]
        total += np.square(light[index] - light[nearest]).sum() / 6
    found = float((change @ module._roughness(head.model, [hidden, hidden]) * change).sum())
    assert found == pytest.approx(total / len(means), rel=1e-4)
