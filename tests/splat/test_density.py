import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.common.camera import Camera
from ico3d.splat import density
from ico3d.splat.density import DensitySettings, DensityStats, densify_plan
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from ico3d.splat.rendering import RenderInfo

RULES = DensitySettings(
    max_gaussians=100, gradient_threshold=1.0, clone_below=0.01, prune_opacity=0.1, prune_scale=0.5
)


def plan_of(gradients, sizes, opacities, rules=RULES):
    stats = DensityStats(torch.tensor(gradients), torch.ones(len(gradients)))
    scales = torch.tensor(sizes)[:, None] * torch.tensor([0.5, 1.0, 0.2])
    return densify_plan(stats, scales, torch.tensor(opacities), rules)


def test_clone_split_prune_and_stay():
    plan = plan_of(
        #   stays  cloned  split  faint  too large  too large but splits small enough
        [0.5, 2.0, 2.0, 9.0, 0.0, 2.0],
        [0.2, 0.01, 0.2, 0.01, 0.6, 0.7],
        [0.9, 0.9, 0.9, 0.05, 0.9, 0.9],
    )
    assert plan.keep.tolist() == [0, 1]
    assert plan.clone_from.tolist() == [1]
    assert plan.split_from.tolist() == [2, 2, 5, 5]
    assert len(plan) == 7


def test_the_cap_lets_the_strongest_grow():
    rules = DensitySettings(6, 1.0, 0.01, 0.1, 0.5)
    plan = plan_of([2.0, 5.0, 3.0, 4.0], [0.2, 0.001, 0.2, 0.001], [0.9] * 4, rules)
    assert plan.clone_from.tolist() == [1, 3]
    assert plan.split_from.tolist() == []
    assert len(plan) == 6


def test_above_the_cap_the_faintest_die():
    rules = DensitySettings(2, 1.0, 0.01, 0.1, 0.5)
    plan = plan_of([2.0, 5.0, 3.0], [0.2, 0.001, 0.2], [0.9, 0.3, 0.8], rules)
    assert plan.keep.tolist() == [0, 2] and len(plan) == 2


def test_the_hidden_die_and_do_not_multiply():
    rules = DensitySettings(10, 1.0, 0.01, 0.1, 0.5, prune_contribution=0.4)
    stats = DensityStats(torch.tensor([0.0, 2.0, 2.0]), torch.ones(3))
    arguments = (stats, torch.full((3, 3), 0.001), torch.ones(3), rules)
    plan = densify_plan(*arguments, torch.tensor([5.0, 0.5, 2.0]))
    assert plan.keep.tolist() == [0, 2] and plan.clone_from.tolist() == [2]
    assert densify_plan(*arguments).keep.tolist() == [0, 1, 2]


def test_contributions_add_up_to_alpha_and_see_what_hides():
    camera = Camera(32, 32, np.array([[40.0, 0, 16], [0, 40, 16], [0, 0, 1]]), np.eye(4))
    front, behind, aside = [0.0, 0, 1], [0.0, 0, 2], [9.0, 0, 1]
    gaussians = Gaussians(
        torch.tensor([front, behind, aside]),
        torch.tensor([[1.0, 0, 0, 0]]).repeat(3, 1),
        torch.tensor([[0.2], [0.02], [0.2]]).repeat(1, 3),
        torch.tensor([0.999, 0.9, 0.9]),
        torch.rand(3, 3, generator=torch.Generator().manual_seed(0)),
    )
    given = density.contributions(gaussians, [camera, camera])
    assert given.shape == (2, 3)
    alpha = render(gaussians, [camera]).alpha.sum()
    torch.testing.assert_close(given[0].sum(), alpha, rtol=1e-4, atol=0)
    assert given[0, 0] > 100 and given[0, 1] < 0.1 and given[0, 2] == 0


@settings(max_examples=60)
@given(st.integers(0, 40), st.integers(1, 60), st.integers(0, 2**31))
def test_the_cap_holds_and_nobody_is_lost(count, cap, seed):
    random = np.random.default_rng(seed)
    rules = DensitySettings(cap, 1.0, 0.01, 0.1, 0.5)
    opacities = random.random(count).astype(np.float32)
    sizes = random.uniform(0, 0.6, count).astype(np.float32) ** 3
    gradients = random.uniform(0, 2, count).astype(np.float32)
    plan = plan_of(gradients.tolist(), sizes.tolist(), opacities.tolist(), rules)
    assert len(plan) == len(plan.sources) <= cap
    alive = {i for i in range(count) if opacities[i] >= 0.1 and sizes[i] <= 0.5}
    assert set(plan.sources.tolist()) <= alive
    assert len(alive) > cap or set(plan.sources.tolist()) == alive
    assert set(plan.clone_from.tolist()) <= set(plan.keep.tolist())
    assert not set(plan.split_from.tolist()) & set(plan.keep.tolist())


def test_any_tensor_follows_the_plan():
    plan = density.Plan(torch.tensor([0, 2]), torch.tensor([2]), torch.tensor([1, 1]))
    basis = torch.arange(3 * 4.0).view(3, 4, 1)
    assert torch.equal(density.apply_plan(basis, plan), basis[[0, 2, 2, 1, 1]])
    state = density.apply_plan_to_state(basis + 1, plan)
    assert torch.equal(state[:2], basis[[0, 2]] + 1) and not state[2:].any()


def test_parts_scatter_as_their_source():
    """Parts of many splits have the mean and covariance of the Gaussian they come from."""
    count = 40_000
    plan = density.Plan(torch.tensor([1]), torch.tensor([]).long(), torch.zeros(count).long())
    means, scales = torch.tensor([[1.0, 2, 3], [4, 5, 6]]), torch.tensor([[0.3, 0.1, 0.02]] * 2)
    half = np.sqrt(0.5)
    quats = torch.tensor([[half, 0, 0, half]] * 2, dtype=torch.float32)  # a quarter turn about z
    generator = torch.Generator().manual_seed(3)
    new_means, new_scales = density.apply_plan_to_geometry(means, quats, scales, plan, generator)
    assert torch.equal(new_means[0], means[1]) and torch.equal(new_scales[0], scales[1])
    assert torch.allclose(new_scales[1:], scales[:1] / 1.6)
    parts = new_means[1:].numpy()
    np.testing.assert_allclose(parts.mean(0), [1, 2, 3], atol=0.006)
    covariance = np.cov(parts.T)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), [0.1, 0.3, 0.02], rtol=0.02)
    again = density.apply_plan_to_geometry(
        means, quats, scales, plan, torch.Generator().manual_seed(3)
    )
    assert torch.equal(again[0], new_means)


def test_a_population_carries_parameters_and_moments_along_their_axes():
    parameters = {
        "means": torch.arange(3.0)[:, None].repeat(1, 3).requires_grad_(),
        "quats": torch.tensor([[1.0, 0, 0, 0]]).repeat(3, 1),
        "log_scales": torch.full((3, 3), -2.0),
        "basis": torch.arange(6.0).view(2, 3),
    }
    moments = {"basis.first": torch.ones(2, 3), "means.second": torch.ones(3, 3)}
    moments["means.steps"] = torch.tensor(4)
    population = density.Population(parameters, moments, {"basis": 1})
    plan = density.Plan(torch.tensor([2]), torch.tensor([2]), torch.tensor([0, 0]))
    population.carry_out(plan, torch.Generator().manual_seed(0))
    assert len(population) == 4
    assert population.parameters["means"][:2, 0].tolist() == [2, 2]
    assert population.parameters["means"].requires_grad and population.parameters["means"].is_leaf
    assert not population.parameters["basis"].requires_grad
    assert population.parameters["basis"].tolist() == [[2, 2, 0, 0], [5, 5, 3, 3]]
    assert moments["basis.first"].tolist() == [[1, 0, 0, 0]] * 2
    assert moments["means.second"].tolist() == [[1] * 3] + [[0] * 3] * 3
    assert moments["means.steps"] == 4
    torch.testing.assert_close(
        population.scales[:, 0] / np.exp(-2), torch.tensor([1, 1, 1 / 1.6, 1 / 1.6])
    )


def test_statistics_average_over_the_views_that_saw_a_gaussian():
    means2d = torch.zeros(2, 3, 2, requires_grad=True)
    means2d.grad = torch.tensor([[[3.0, 0], [0, 1], [9, 9]], [[1, 0], [0, 0], [9, 9]]])
    info = RenderInfo(torch.tensor([[4, 2, 0], [1, 0, 0]]), means2d, width=4, height=8)
    stats = DensityStats.zeros(3)
    stats.add(info)
    # Half sizes 2 and 4, two cameras: (3·2 + 1·2)·2 / 2 views, 1·4·2 / 1 view, never seen.
    assert stats.mean_gradient().tolist() == [8.0, 8.0, 0.0]


def test_opacity_reset_only_lowers():
    logits = torch.tensor([-9.0, 0.0, 9.0])
    reset = density.reset_opacity_logits(logits, 0.01).sigmoid()
    assert torch.allclose(reset, torch.tensor([torch.sigmoid(logits[0]), 0.01, 0.01]))


def test_growth_is_limited():
    """Of four that want to, half may: those of strongest gradient."""
    rules = DensitySettings(100, 1.0, 0.01, 0.1, 0.5, growth=0.5)
    plan = plan_of([2.0, 5.0, 3.0, 4.0], [0.001] * 4, [0.9] * 4, rules)
    assert plan.clone_from.tolist() == [1, 3]
