import pytest
import torch
from scipy.ndimage import correlate1d

from ico3d.splat import losses
from ico3d.splat.convention import ssim_window


def images(*shape, seed=0):
    generator = torch.Generator().manual_seed(seed)
    x = torch.rand(shape, generator=generator, dtype=torch.float64)
    return x, (x + 0.3 * torch.randn(shape, generator=generator)).clamp(0, 1)


def ssim_by_scipy(x, y):
    """Mean SSIM by its definition, zero-padded."""

    def blur(image):
        for axis in (0, 1):
            image = correlate1d(image, ssim_window(), axis, mode="constant")
        return image

    mx, my = blur(x), blur(y)
    vx, vy, cov = blur(x * x) - mx**2, blur(y * y) - my**2, blur(x * y) - mx * my
    c1, c2 = 0.01**2, 0.03**2
    return (((2 * mx * my + c1) * (2 * cov + c2)) / ((mx**2 + my**2 + c1) * (vx + vy + c2))).mean()


@pytest.mark.parametrize("size", [(40, 33), (7, 5)])
def test_ssim_is_its_definition(size):
    x, y = images(*size, 3)
    expected = ssim_by_scipy(x.numpy(), y.numpy())
    assert abs(losses.ssim(x.float(), y.float()).item() - expected) < 1e-5
    by_convolution = losses._ssim_by_convolution(x[None], y[None]).item()
    assert abs(by_convolution - expected) < 1e-12


def test_ssim_gradient_is_that_of_the_convolution():
    x, y = images(2, 21, 30, 3)
    exact, fused = x.clone().requires_grad_(), x.float().requires_grad_()
    losses._ssim_by_convolution(exact, y).backward()
    losses.ssim(fused, y.float()).backward()
    assert (fused.grad - exact.grad).abs().max() < 1e-4 * exact.grad.abs().max()


def test_the_convolution_has_the_gradient_of_finite_differences():
    x, y = images(1, 6, 7, 3)
    assert torch.autograd.gradcheck(
        lambda image: losses._ssim_by_convolution(image, y), x.requires_grad_()
    )


def test_equal_images_cost_nothing():
    x, _ = images(16, 16, 3)
    assert losses.photometric(x.float(), x.float()).item() == pytest.approx(0, abs=1e-6)


def test_photometric_weighs_its_parts():
    x, y = (image.float() for image in images(16, 20, 3))
    expected = 0.7 * (x - y).abs().mean() + 0.3 * (1 - losses.ssim(x, y))
    assert losses.photometric(x, y, l1_weight=0.7, ssim_weight=0.3).item() == pytest.approx(
        expected.item(), rel=1e-5
    )


def test_the_fused_loss_is_that_of_torch_with_its_gradient():
    x, y = images(2, 21, 30, 3)
    y[0, 3:9] = x[0, 3:9]  # where pictures agree L1 has no slope
    exact, fused = x.clone().requires_grad_(), x.float().requires_grad_()
    expected = losses._photometric_by_torch(exact, y, 0.3, 0.9, 8.0)
    value = losses.photometric(fused, y.float(), l1_weight=0.9, ssim_weight=0.3, squares_weight=8.0)
    assert value.item() == pytest.approx(expected.item(), rel=1e-5)
    expected.backward()
    value.backward()
    assert (fused.grad - exact.grad).abs().max() < 1e-4 * exact.grad.abs().max()


def test_differing_shapes_are_refused():
    with pytest.raises(ValueError, match="comparing pictures of"):
        losses.ssim(torch.zeros(4, 5, 3), torch.zeros(5, 4, 3))
