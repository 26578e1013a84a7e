import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from ico3d.splat import harmonics, quaternions
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.render import render
from support.splats import reference


def similarity(scale=1.7, seed=0):
    matrix = np.eye(4)
    matrix[:3, :3] = scale * Rotation.random(random_state=seed).as_matrix()
    matrix[:3, 3] = 0.3, -0.2, 0.5
    return matrix


def with_harmonics(count, degree, seed=0):
    generator = torch.Generator().manual_seed(seed)
    sh = 0.3 * torch.randn(count, (degree + 1) ** 2, 3, generator=generator)
    base = reference.scene(count, seed, dtype=torch.float32)
    return Gaussians(base.means, base.quats, base.scales, base.opacities, sh=sh)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_what_moves_with_its_camera_looks_the_same(cameras, degree):
    """A world of another scale: the camera moves along, depth scales."""
    gaussians, scale = with_harmonics(60, degree), 1.7
    a_from_b = similarity(scale)
    rigid = a_from_b.copy()
    rigid[:3, :3] /= scale
    shrink = np.diag([scale, scale, scale, 1.0])
    camera = cameras[0]
    matrix = shrink @ camera.world_to_camera @ np.linalg.inv(shrink) @ np.linalg.inv(rigid)
    moved = type(camera)(camera.width, camera.height, camera.intrinsics, matrix)
    before = render(gaussians, [camera])
    after = render(gaussians.transform(a_from_b), [moved])
    assert (before.rgb - after.rgb).abs().max() < 1e-4
    assert (before.depth * scale - after.depth).abs().max() < 1e-3


def test_quaternions_agree_with_scipy():
    a, b = Rotation.random(20, random_state=1), Rotation.random(20, random_state=2)
    first, second = (torch.from_numpy(r.as_quat(scalar_first=True)) for r in (a, b))
    product = quaternions.to_matrix(quaternions.multiply(first, second)).numpy()
    np.testing.assert_allclose(product, (a * b).as_matrix(), atol=1e-12)
    for matrix in a.as_matrix():
        quat = quaternions.from_matrix(torch.from_numpy(matrix))
        np.testing.assert_allclose(quaternions.to_matrix(quat), matrix, atol=1e-12)


def test_harmonics_are_orthonormal():
    """Over the sphere the mean of Y_i·Y_j is δ_ij / 4π (Gauss-Legendre × uniform is exact)."""
    z, weights = np.polynomial.legendre.leggauss(8)
    angles = np.arange(16) * 2 * np.pi / 16
    z, angles = np.meshgrid(z, angles, indexing="ij")
    radius = np.sqrt(1 - z**2)
    points = np.stack([radius * np.cos(angles), radius * np.sin(angles), z], -1)
    values = harmonics.basis(torch.from_numpy(points), 3).numpy()
    gram = np.einsum("t,tpi,tpj->ij", weights, values, values) * 2 * np.pi / 16
    np.testing.assert_allclose(gram, np.eye(16), atol=1e-12)


def test_degree_zero_is_a_plain_color(cameras):
    plain = reference.scene(20, dtype=torch.float32)
    sh = ((plain.colors - 0.5) / harmonics.C0)[:, None]
    as_sh = Gaussians(plain.means, plain.quats, plain.scales, plain.opacities, sh=sh)
    assert (render(plain, cameras).rgb - render(as_sh, cameras).rgb).abs().max() < 1e-6


def test_a_transform_passes_gradients_on():
    gaussians = reference.scene(5).map(torch.Tensor.requires_grad_)
    matrix = torch.from_numpy(similarity()).requires_grad_()
    gaussians.transform(matrix).means.sum().backward()
    assert torch.allclose(gaussians.means.grad[0], matrix.detach()[:3, :3].sum(0))
    assert torch.allclose(matrix.grad[:3, 3], torch.full((3,), 5.0).double())


@pytest.mark.parametrize(
    "change", [np.diag([1, 1, -1, 1]), np.diag([1, 2, 1, 1]), np.zeros((4, 4))]
)
def test_only_similarities_transform(change):
    with pytest.raises(ValueError, match="similarity"):
        reference.scene(3).transform(change.astype(float))


def test_cat_and_selection_undo_each_other():
    a, b = with_harmonics(4, 1), with_harmonics(6, 1, seed=1)
    both = cat([a, b])
    assert len(both) == 10
    assert torch.equal(both[4:].sh, b.sh) and torch.equal(both[:4].quats, a.quats)


def test_joined_gaussians_look_as_before():
    """Whether they have colours, or harmonics of whatever degree."""
    parts = [with_harmonics(4, 1), reference.scene(3, dtype=torch.float32), with_harmonics(3, 2)]
    both = cat(parts)
    assert both.sh.shape == (10, 9, 3) and both.colors is None
    ways = torch.nn.functional.normalize(torch.randn(10, 3), dim=-1)
    seen = harmonics.to_colors(both.sh, ways).split([4, 3, 3])
    torch.testing.assert_close(seen[0], harmonics.to_colors(parts[0].sh, ways[:4]))
    torch.testing.assert_close(seen[1], parts[1].colors)
    torch.testing.assert_close(seen[2], harmonics.to_colors(parts[2].sh, ways[7:]))


def test_what_is_above_a_degree_is_dropped():
    a = with_harmonics(4, 2)
    assert torch.equal(a.up_to_degree(1).sh, a.sh[:, :4])
    assert torch.equal(a.up_to_degree(3).sh, a.sh)
    painted = a.painted(torch.ones(4, 3))
    assert painted.sh is None and painted.up_to_degree(0) is painted
