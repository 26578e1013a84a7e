"""Maps of the cameras' colours."""

import numpy as np
import torch

from ico3d.body.camera_colors import center, identities, seen_by
from ico3d.common.camera import Camera, look_at
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

CAMERA = Camera(
    24, 20, np.array([[30.0, 0, 12], [0, 30.0, 10], [0, 0, 1]]), look_at([0, 0, 2], np.zeros(3))
)


def test_a_map_of_the_picture_is_one_of_the_gaussians():
    """The background stays as it is."""
    torch.manual_seed(0)
    parts = Gaussians(
        0.3 * torch.randn(30, 3),
        torch.randn(30, 4),
        torch.full((30, 3), 0.1),
        torch.rand(30),
        torch.rand(30, 3),
    )
    mapped, behind = torch.randn(3, 4), torch.rand(3)
    whole = render(parts, [CAMERA], behind)
    parts.colors = parts.colors @ mapped[:, :3].T + mapped[:, 3]
    expected = render(parts, [CAMERA], behind).rgb
    found = seen_by(whole, mapped, behind)
    torch.testing.assert_close(found.rgb, expected, rtol=0, atol=1e-5)
    assert found.info is whole.info and found.alpha is whole.alpha


def test_nothing_is_learnt_that_all_cameras_have_in_common():
    """Their mean is the identity; the cameras' differences stay, and those who learnt nothing."""
    maps = identities(4, torch.device("cpu")) + torch.randn(4, 3, 4)
    before = maps.clone()
    center(maps, [0, 2, 3])
    torch.testing.assert_close(maps[[0, 2, 3]].mean(0), torch.eye(3, 4))
    torch.testing.assert_close(maps[0] - maps[3], before[0] - before[3])
    assert torch.equal(maps[1], before[1])
