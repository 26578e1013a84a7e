"""Density control of a head: everything follows the plan."""

import pytest
import torch

from ico3d.errors import ModelError
from ico3d.head.density import HeadDensity, Sampled
from ico3d.head.model import HeadModel
from ico3d.head.settings import PRESETS
from ico3d.splat.density import DensityStats
from ico3d.training.optimiser import Optimiser
from support.heads.shapes import head_shape
from support.settings import changed

SETTINGS = changed(
    PRESETS["cpu"],
    {
        "density.begin": 0,
        "density.every": 1,
        "density.until": 9,
        "density.gradient": 0.5,
        "density.min_opacity": 0.01,
        "density.max_gaussians": 10,
    },
)


def _sampled(opacities: list[float], contributions: list[float]):
    return lambda step: Sampled(
        torch.tensor(opacities), torch.tensor(contributions, dtype=torch.float32)
    )


def _planned() -> tuple[HeadModel, HeadModel, Optimiser]:
    """Three Gaussians: one stays, a small one is cloned, a faint one dies; before and after."""
    models = [HeadModel(head_shape(2, features=4, displacements=2), 3) for _ in range(2)]
    for model in models:
        model.log_scales.data.fill_(-9)
        numbers = torch.arange(3.0)
        model.means.data = numbers[:, None].repeat(1, 3)
        model.basis.data = numbers[None, :, None].repeat(3, 1, 4).clone()
        model.displacement_basis.data = numbers[None, :, None].repeat(2, 1, 3).clone()
    before, after = models
    optimiser = Optimiser()
    for name in after.gaussian_axes:
        optimiser.moments[f"{name}.first"] = getattr(after, name).detach().clone() + 1
        optimiser.moments[f"{name}.second"] = getattr(after, name).detach().clone() + 2
    density = HeadDensity(SETTINGS.density, 0)
    density._stats = DensityStats(torch.tensor([0.0, 1.0, 1.0]), torch.ones(3))
    density.adapt(after, optimiser, _sampled([0.9, 0.9, 0.001], [9, 9, 9]), 1)
    return before, after, optimiser


def test_clones_copy_basis_and_geometry():
    before, after, _ = _planned()
    assert len(after) == 3
    sources = [0, 1, 1]
    for name, axis in after.gaussian_axes.items():
        expected = getattr(before, name).index_select(axis, torch.tensor(sources))
        torch.testing.assert_close(getattr(after, name), expected)


def test_moments_follow_and_those_of_clones_begin_at_zero():
    before, _, optimiser = _planned()
    for name, axis in before.gaussian_axes.items():
        moment = optimiser.moments[f"{name}.first"].movedim(axis, 0)
        old = getattr(before, name).detach().movedim(axis, 0) + 1
        torch.testing.assert_close(moment[:2], old[:2])
        assert not moment[2].any()


def test_a_head_that_faded_is_one_sentence():
    model, density = HeadModel(head_shape(2, features=4), 3), HeadDensity(SETTINGS.density, 0)
    density._stats = DensityStats.zeros(3)
    with pytest.raises(ModelError, match="faded away by step 1 of learning") as told:
        density.adapt(model, Optimiser(), _sampled([0, 0, 0], [9, 9, 9]), 1)
    assert (told.value.code, told.value.values) == ("faded", {"step": 1})


def test_what_no_picture_shows_dies():
    model, density = HeadModel(head_shape(2, features=4), 3), HeadDensity(SETTINGS.density, 0)
    model.log_scales.data.fill_(-9)
    density._stats = DensityStats.zeros(3)
    model.means.data = torch.arange(3.0)[:, None].repeat(1, 3)
    least = SETTINGS.density.min_contribution * 9
    density.adapt(model, Optimiser(), _sampled([0.9] * 3, [18, 0.9 * least, 9]), 1)
    assert model.means[:, 0].tolist() == [0, 2]


def test_what_was_gathered_survives_a_checkpoint():
    density, other = HeadDensity(SETTINGS.density, 0), HeadDensity(SETTINGS.density, 0)
    density._stats = DensityStats(torch.tensor([1.0, 2.0]), torch.tensor([3.0, 4.0]))
    other.restore(density.tensors())
    torch.testing.assert_close(other._stats.mean_gradient(), density._stats.mean_gradient())
