"""Both strategies behind their one interface."""

import importlib.util

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from ico3d.errors import ModelError
from ico3d.splat.density import (
    MAX_COPIES,
    DefaultStrategy,
    DensitySettings,
    McmcSettings,
    McmcStrategy,
    Population,
    Schedule,
    relocated,
)
from ico3d.splat.rendering import RenderInfo

ALWAYS = Schedule(0, 100, 1)


def population(opacities, sizes=None, seed=0) -> Population:
    random = np.random.default_rng(seed)
    count = len(opacities)
    sizes = np.full(count, 0.01) if sizes is None else np.asarray(sizes)
    values = {
        "means": random.normal(size=(count, 3)),
        "quats": random.normal(size=(count, 4)),
        "log_scales": np.log(sizes)[:, None] + np.array([0.0, -0.5, -1]),
        "opacity_logits": torch.tensor(opacities).double().logit().numpy(),
        "f_dc": np.arange(count)[:, None, None] * np.ones((1, 1, 3)),
    }
    parameters = {n: torch.from_numpy(v).float().requires_grad_() for n, v in values.items()}
    moments = {f"{n}.first": torch.ones_like(v).detach() for n, v in parameters.items()}
    return Population(parameters, moments | {"means.steps": torch.tensor(7)})


def mcmc(schedule=ALWAYS, **changes) -> McmcStrategy:
    return McmcStrategy(schedule, McmcSettings(**changes), seed=0, extent=1.0)


def observe(strategy, gradients) -> None:
    """Lets a strategy see these screen gradients, in a picture 2 pixels wide and high."""
    means2d = torch.zeros(1, len(gradients), 2, requires_grad=True)
    means2d.grad = torch.tensor(gradients).float()[None, :, None] * torch.tensor([1.0, 0])
    radii = torch.ones(1, len(gradients), dtype=torch.int32)
    strategy.observe(RenderInfo(radii, means2d, 2, 2), 0)


@settings(max_examples=60)
@given(st.floats(1e-4, 0.999), st.integers(1, MAX_COPIES))
def test_copies_together_are_as_opaque_and_as_wide_as_their_source(opacity, count):
    """Against the definition, integrated numerically in float64."""
    source = torch.tensor([opacity], dtype=torch.float64)
    scales = torch.tensor([[0.3, 0.02, 1.0]], dtype=torch.float64)
    opacities, widths = relocated(source, scales, torch.tensor([count]))
    new, factor = float(opacities), float(widths[0, 0] / 0.3)
    assert 1 - (1 - new) ** count == pytest.approx(opacity, rel=1e-9)
    torch.testing.assert_close(widths, scales * factor)
    light, _ = quad(lambda x: 1 - (1 - new * np.exp(-((x / factor) ** 2) / 2)) ** count, -30, 30,
                    points=[0], epsabs=1e-12, limit=200)  # fmt: skip
    assert light == pytest.approx(opacity * np.sqrt(2 * np.pi), rel=1e-6)


def test_relocation_at_the_ends():
    opacities, scales = relocated(
        torch.tensor([0.0, 1.0, 0.5]), torch.ones(3, 3), torch.tensor([9, 9, 9999])
    )
    assert opacities[0] == 0 and torch.equal(scales[0], torch.ones(3))
    assert 0.7 < opacities[1] < 1 and torch.isfinite(scales).all()
    assert opacities[2] == pytest.approx(1 - 0.5 ** (1 / MAX_COPIES), rel=1e-5)


@settings(max_examples=60)
@given(st.integers(1, 60), st.integers(1, 60), st.sampled_from(["default", "mcmc"]), st.integers())
def test_the_budget_is_never_exceeded(count, cap, name, seed):
    random = np.random.default_rng(abs(seed))
    people = population(random.uniform(0.1, 0.99, count), random.uniform(0, 0.4, count), 1)
    if name == "default":
        rules = DensitySettings(cap, 0.5, 0.01, 0.05, 5.0)
        strategy = DefaultStrategy(ALWAYS, rules, seed % 1000, reset_every=3)
    else:
        strategy = mcmc(max_gaussians=cap, growth=1.7)
    for step in range(5):
        observe(strategy, random.uniform(0, 1, len(people)))
        strategy.adapt(people, step, 1e-4)
        assert 1 <= len(people) <= cap
        lengths = {len(v) for v in people.parameters.values()}
        lengths |= {len(v) for v in people.moments.values() if v.dim()}
        assert lengths == {len(people)}
        assert all(torch.isfinite(v).all() for v in people.parameters.values())


def test_the_budget_holds_between_two_changes_too():
    people = population([0.9, 0.2, 0.8, 0.7])
    for strategy in (
        DefaultStrategy(Schedule(50, 60, 5), DensitySettings(3), 0, 0),
        mcmc(Schedule(50, 60, 5), max_gaussians=2),
    ):
        strategy.adapt(people, 7, 0.0)
        assert len(people) == strategy.max_gaussians
    torch.testing.assert_close(people.opacities, torch.tensor([0.9, 0.8]))


def test_the_dead_move_to_the_living():
    people = population([0.8, 0.001, 0.8, 0.004, 0.002])
    before = {name: value.detach().clone() for name, value in people.parameters.items()}
    mcmc(max_gaussians=5, noise_rate=0.0).adapt(people, 1, 1e-4)
    assert len(people) == 5
    sources = people.parameters["f_dc"][:, 0, 0].long().tolist()
    assert sources[:2] == [0, 2] and set(sources) == {0, 2}
    for source in (0, 2):
        members = [i for i, s in enumerate(sources) if s == source]
        hidden = 1 - (1 - people.opacities[members].detach()).prod()
        assert float(hidden) == pytest.approx(0.8, abs=1e-5)
        same = before["means"][source].expand(len(members), 3)
        assert torch.equal(people.parameters["means"][members], same)
        for moment in (value[members] for value in people.moments.values() if value.dim()):
            assert moment.any() == (len(members) == 1)


def test_growth_is_five_percent_up_to_the_cap():
    people = population([0.5] * 100)
    strategy = mcmc(max_gaussians=108)
    sizes = []
    for step in range(3):
        strategy.adapt(people, step, 1e-4)
        sizes.append(len(people))
    assert sizes == [105, 108, 108]


def test_noise_shakes_the_faint_along_their_axes():
    people = population([0.005] * 4000 + [0.5] * 10, [0.1] * 4010)
    people.parameters["quats"] = torch.tensor([[0.5**0.5, 0, 0, 0.5**0.5]]).repeat(4010, 1)
    before = people.parameters["means"].detach().clone()
    strategy = McmcStrategy(Schedule(0, 0), McmcSettings(noise_rate=100.0), 0, extent=2.0)
    strategy.adapt(people, 3, 0.01)
    moved = (people.parameters["means"].detach() - before).numpy()
    # σ(0) = ½ of rate · noise / extent · s², axes turned by a quarter about z
    expected = 0.5 * 0.01 * 100 / 2 * 0.01 * np.exp([-1.0, 0, -2])
    np.testing.assert_allclose(moved[:4000].std(0), expected, rtol=0.05)
    assert np.abs(moved[4000:]).max() < 1e-9
    assert people.parameters["means"].requires_grad


def test_penalty_is_the_mean_opacity_and_scale():
    people = population([0.2, 0.6], [0.4, 0.4])
    scale = 0.4 * np.exp([0, -0.5, -1]).mean() / 2
    strategy = McmcStrategy(ALWAYS, McmcSettings(opacity_weight=0.5, scale_weight=3.0), 0, 2.0)
    penalty = strategy.penalty(people)
    assert penalty.item() == pytest.approx(0.5 * 0.4 + 3 * scale, rel=1e-5)
    penalty.backward()
    assert (people.parameters["opacity_logits"].grad > 0).all()
    assert DefaultStrategy(ALWAYS, DensitySettings(), 0, 0).penalty(people) == 0


def test_opacities_are_reset_and_their_moments_forgotten():
    people = population([0.9, 0.006])
    rules = DensitySettings(prune_opacity=0.005, prune_scale=1.0)
    strategy = DefaultStrategy(Schedule(50, 100, 10), rules, 0, reset_every=20)
    for step, opacity in ((10, 0.9), (20, 0.01), (100, 0.01)):
        strategy.adapt(people, step, 0.0)
        assert people.opacities[0].item() == pytest.approx(opacity, rel=1e-4)
    assert people.opacities[1].item() == pytest.approx(0.006, rel=1e-4)
    assert not people.moments["opacity_logits.first"].any()
    assert people.moments["means.first"].all()


def test_the_huge_die_after_the_first_reset_only():
    rules = DensitySettings(prune_opacity=0.005, prune_scale=0.1)
    people = population([0.9, 0.9], [0.05, 0.2])
    never = DefaultStrategy(ALWAYS, rules, 0, reset_every=0)
    strategy = DefaultStrategy(ALWAYS, rules, 0, reset_every=20)
    for step, left in ((19, 2), (20, 2), (21, 1)):
        never.adapt(people, step, 0.0)
        strategy.adapt(people, step, 0.0)
        assert len(people) == left


def test_no_gaussian_left_is_one_sentence():
    for strategy in (mcmc(), DefaultStrategy(ALWAYS, DensitySettings(), 0, 0)):
        with pytest.raises(ModelError, match="all Gaussians have faded by step 4"):
            strategy.adapt(population([1e-4, 1e-4]), 4, 0.0)


def test_the_same_seed_and_step_do_the_same():
    results = []
    for _ in range(2):
        people = population([0.5, 0.002, 0.9, 0.3])
        mcmc(growth=2.0).adapt(people, 5, 1e-4)
        results.append(people.parameters["means"])
    assert torch.equal(*results)


@pytest.mark.skipif(
    not torch.cuda.is_available() or importlib.util.find_spec("gsplat") is None,
    reason="needs a CUDA device and gsplat",
)
def test_the_kernel_of_gsplat_relocates_as_we_do():
    opacities = torch.linspace(0.01, 0.99, 51)
    scales, copies = torch.rand(51, 3) + 0.1, torch.arange(1, 52)
    ours = relocated(opacities, scales, copies)
    theirs = relocated(opacities.cuda(), scales.cuda(), copies.cuda())
    for a, b in zip(ours, theirs, strict=True):
        torch.testing.assert_close(a, b.cpu(), rtol=1e-3, atol=1e-5)
