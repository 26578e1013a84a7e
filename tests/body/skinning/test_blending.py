"""Linear blend skinning by kernels."""

import pytest
import torch

from ico3d.body.skinning.blending import blended
from ico3d.body.skinning.light import lit
from ico3d.splat import harmonics


def random_parts(dtype, count=40, joints=7):
    """A table, joints, logits, means, quaternions and normals."""
    generator = torch.Generator().manual_seed(0)

    def random(*shape):
        return torch.randn(*shape, generator=generator, dtype=torch.float64).to(dtype)

    chosen = torch.randint(joints, (count, 4), generator=generator, dtype=torch.int32)
    parts = (random(count, 4), random(count, 3), random(count, 4), random(count, 3))
    return random(joints, 16), chosen, *parts


def test_kernels_agree_with_torch():
    """Results and gradients of float32, which kernels compute, are those of float64."""
    found = []
    for dtype in (torch.float32, torch.float64):
        parts = random_parts(dtype)
        learnt = [parts[index].requires_grad_() for index in (0, 2, 3, 4)]
        posed = blended(*parts)
        weights = [torch.linspace(-1, 1, p.numel(), dtype=dtype).view_as(p) for p in posed]
        total = sum((p * w).sum() for p, w in zip(posed, weights, strict=True))
        found.append([*posed, *torch.autograd.grad(total, learnt)])
    for kernel, reference in zip(*found, strict=True):
        torch.testing.assert_close(kernel.double(), reference, rtol=1e-4, atol=1e-4)


def test_gradients():
    """By finite differences."""
    table, joints, *rest = random_parts(torch.float64, 6)
    learnt = [t.requires_grad_() for t in (table, *rest[:3])]
    assert torch.autograd.gradcheck(lambda t, *r: tuple(blended(t, joints, *r, rest[3])), learnt)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_light_is_made_of_harmonics(dtype):
    """Degrees 1 and 2 at the normal."""
    generator = torch.Generator().manual_seed(1)
    normals = torch.nn.functional.normalize(torch.randn(20, 3, generator=generator), dim=1)
    normals, light = normals.to(dtype), torch.randn(8, 3, generator=generator).to(dtype)
    expected = harmonics.basis(normals, 2)[:, 1:] @ light
    torch.testing.assert_close(lit(normals, light), expected, atol=1e-5, rtol=1e-5)
