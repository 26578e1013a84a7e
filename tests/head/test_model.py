"""The head model: shapes, the paper's equations, files."""

import math
import subprocess
import sys

import pytest
import torch

from ico3d.errors import ModelError, SettingsError
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.speech.network import SpeechAdaptor
from ico3d.splat import harmonics
from ico3d.training import checkpoint
from ico3d.training.checkpoint import load_tensors, save_tensors
from support.heads.shapes import head_shape

VARIANTS = ("full", "no-mlp", "no-blending", "static")


def _model(variant: str, dtype=torch.float64, count: int = 5) -> HeadModel:
    torch.manual_seed(0)
    model = HeadModel(head_shape(3, variant, features=8, hidden=6, frequencies=2), count).to(dtype)
    model.means.data = torch.randn(count, 3, dtype=dtype)
    model.basis.data += torch.randn_like(model.basis)
    return model


@pytest.mark.parametrize(
    ("variant", "basis"),
    [("full", (4, 5, 8)), ("no-mlp", (4, 5, 4)), ("no-blending", (1, 5, 8)), ("static", (1, 5, 4))],
)
def test_the_basis_has_a_row_per_expression_value_and_one_for_the_bias(variant, basis):
    assert _model(variant).basis.shape == basis


def test_a_head_that_follows_its_rotation_is_drawn_at_the_mean_one_without():
    shape = head_shape(2, features=8, hidden=6, frequencies=2, turns=True)
    model = HeadModel(shape, 5)
    model.basis.data = torch.randn(model.basis.shape)
    assert model.basis.shape == (2 + 3 + 1, 5, 8)
    expression, still = torch.tensor([0.3, -1.0]), torch.zeros(3)
    assert torch.equal(model.logits(expression), model.logits(torch.cat([expression, still])))
    turned = torch.cat([expression, torch.tensor([0.0, 0.5, 0.0])])
    moved = model.blended(turned) - model.blended(expression)
    torch.testing.assert_close(moved, 0.5 * model.basis[3].detach())


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_new_head_is_faint_whatever_the_expression(variant):
    model = HeadModel(head_shape(3, variant), 4)
    if model.shape.has_mlp:
        torch.nn.init.zeros_(model.opacity_branch.weight)
    for expression in (torch.zeros(3), torch.ones(3)):
        torch.testing.assert_close(model(expression).opacities, torch.full((4,), 0.1))


def test_full_follows_the_equations():
    model, expression = _model("full"), torch.tensor([0.2, -0.5, 0.7], dtype=torch.float64)
    features = torch.einsum("bnf,b->nf", model.basis[:3], expression) + model.basis[3]
    position = model.means / model.shape.box_size
    angles = [position * math.pi * 2**octave for octave in range(2)]
    parts = [features, position, *(a.sin() for a in angles), *(a.cos() for a in angles)]
    encoded = torch.cat(parts[1:], 1)
    found = torch.cat(model.encoded_positions(), 1)
    assert sorted(encoded[0].tolist()) == pytest.approx(sorted(found[0].tolist()))
    inputs = torch.cat([features, found], 1)
    hidden = torch.nn.functional.leaky_relu(model.trunk(inputs))
    gaussians = model(expression)
    torch.testing.assert_close(gaussians.colors, model.color_branch(hidden).sigmoid())
    torch.testing.assert_close(gaussians.opacities, model.opacity_branch(hidden).sigmoid()[:, 0])


@pytest.mark.parametrize("variant", VARIANTS)
def test_gradients_by_finite_differences(variant):
    model = _model(variant)
    names = [name for name, _ in model.named_parameters() if name not in ("quats", "log_scales")]

    def appearance(expression, *values):
        named = dict(zip(names, values, strict=True))
        gaussians = torch.func.functional_call(model, named, expression)
        return gaussians.colors, gaussians.opacities

    expression = torch.tensor([0.2, -0.5, 0.7], dtype=torch.float64, requires_grad=True)
    parameters = [dict(model.named_parameters())[name] for name in names]
    assert torch.autograd.gradcheck(appearance, (expression, *parameters))


def _moving(dtype=torch.float64) -> HeadModel:
    torch.manual_seed(0)
    shape = head_shape(3, features=8, hidden=6, frequencies=2, turns=True, displacements=2)
    model = HeadModel(shape, 5).to(dtype)
    model.displacement_basis.data = torch.randn(2, 5, 3, dtype=dtype)
    for layer in model.move_network:
        layer.copy_(torch.randn(layer.shape))
    return model


def test_centres_move_with_the_expression_and_not_with_the_heads_rotation():
    model, e = _moving(), torch.tensor([0.2, -0.5, 0.7], dtype=torch.float64)
    w1, b1, w2, b2 = model.move_network
    hidden = [float(sum(e[b] * w1[b, g] for b in range(3)) + b1[g]) for g in range(64)]
    hidden = [x if x > 0 else 0.02 * x for x in hidden]
    c = [float(sum(hidden[g] * w2[g, m] for g in range(64)) + b2[m]) for m in range(2)]
    expected = model.means + c[0] * model.displacement_basis[0] + c[1] * model.displacement_basis[1]
    torch.testing.assert_close(model(e).means, expected)
    turned = torch.cat([e, torch.ones(3, dtype=torch.float64)])
    assert torch.equal(model(turned).means, model(e).means)


def test_displacements_have_the_gradients_of_finite_differences():
    model = _moving()

    def places(expression, means, basis):
        named = {"means": means, "displacement_basis": basis}
        return torch.func.functional_call(model, named, expression).means

    e = torch.tensor([0.2, -0.5, 0.7], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(places, (e, model.means, model.displacement_basis))


@pytest.mark.parametrize("count", [-1, 17, 2.0])
def test_a_head_has_no_more_displacements_than_a_bundle_can_hold(count):
    with pytest.raises(SettingsError, match="A head's displacements is 0 to 16, not"):
        head_shape(3, displacements=count)


def test_a_file_brings_the_displacements_back(tmp_path):
    model = _moving(torch.float32)
    model.save(tmp_path / "model.safetensors")
    loaded = HeadModel.load(tmp_path / "model.safetensors")
    e = torch.tensor([0.2, -0.5, 0.7])
    assert loaded.shape.displacements == 2 and torch.equal(loaded(e).means, model(e).means)


@pytest.mark.parametrize("name", ["displacement_basis", "move_w1", "move_b2"])
def test_displacements_that_are_no_numbers_are_refused(tmp_path, name):
    model = _moving(torch.float32)
    getattr(model, name).data.view(-1)[0] = math.nan
    model.save(tmp_path / "model.safetensors")
    with pytest.raises(ModelError, match="its displacements are not finite"):
        HeadModel.load(tmp_path / "model.safetensors")


@pytest.mark.parametrize("variant", VARIANTS)
def test_only_static_ignores_the_expression(variant):
    model = _model(variant)
    zeros, ones = (torch.full((3,), v, dtype=torch.float64) for v in (0.0, 1.0))
    same = torch.equal(model.logits(zeros), model.logits(ones))
    assert same == (variant == "static")


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_file_brings_the_same_head_back(tmp_path, variant):
    model = _model(variant, torch.float32)
    model.save(tmp_path / "model.safetensors")
    loaded = HeadModel.load(tmp_path / "model.safetensors")
    assert loaded.shape == model.shape
    expression = torch.tensor([0.2, -0.5, 0.7])
    assert torch.equal(loaded.logits(expression), model.logits(expression))


@pytest.mark.parametrize("variant", ["full", "no-mlp"])
def test_colours_that_depend_on_the_view(variant, tmp_path):
    """A slow sum over the harmonics, gradients by finite differences, and the file."""
    shape = head_shape(2, variant, features=4, hidden=3, frequencies=1, sh_degree=2)
    model = HeadModel(shape, 3).double()
    for value in model.parameters():
        value.data = 0.3 * torch.randn_like(value)
    expression = torch.tensor([0.2, -0.5], dtype=torch.float64)
    values, gaussians = model.logits(expression), model(expression)
    assert values.shape == (3, 4 + 3 * 8) and gaussians.colors is None
    way = torch.nn.functional.normalize(torch.randn(3, 3, dtype=torch.float64), dim=-1)
    seen = harmonics.to_colors(gaussians.sh, way)
    for n in range(3):
        weights = harmonics.basis(way[n], 2)
        for c in range(3):
            slow = values[n, c].sigmoid()
            for k in range(1, 9):
                slow = slow + weights[k] * values[n, 4 + 3 * (k - 1) + c]
            torch.testing.assert_close(seen[n, c], slow.clamp_min(0))
    names = [n for n, _ in model.named_parameters() if n not in ("quats", "log_scales", "means")]

    def harmonics_of(*parameters):
        named = dict(zip(names, parameters, strict=True))
        return torch.func.functional_call(model, named, expression).sh

    assert torch.autograd.gradcheck(
        harmonics_of, [dict(model.named_parameters())[n] for n in names]
    )
    model.float().save(tmp_path / "model.safetensors")
    loaded = HeadModel.load(tmp_path / "model.safetensors")
    assert loaded.shape == shape
    assert torch.equal(loaded(expression.float()).sh, model(expression.float()).sh)


def test_a_file_of_something_else_is_one_sentence(tmp_path):
    save_tensors(tmp_path / "x.safetensors", {"a": torch.zeros(1)}, {"shape": {"nonsense": 1}})
    with pytest.raises(ModelError, match="does not hold a head model"):
        HeadModel.load(tmp_path / "x.safetensors")


def test_layers_of_more_values_than_are_drawn_are_refused(tmp_path, monkeypatch):
    """1.3 MB on the disk took 4.1 GB to draw: 8,192 octaves of each Gaussian's place."""
    file = tmp_path / "model.safetensors"
    HeadModel(head_shape(2, features=4, hidden=3, frequencies=100), 5).save(file)
    assert len(HeadModel.load(file)) == 5
    monkeypatch.setattr(checkpoint, "MOST_VALUES", 5 * 600)
    with pytest.raises(ModelError, match="layers of 607 values of 5 Gaussians are too large"):
        HeadModel.load(file)


@pytest.mark.parametrize("value", [1e30, -1e30, float("nan")])
def test_places_out_of_this_world_are_refused(tmp_path, value):
    file = tmp_path / "model.safetensors"
    HeadModel(head_shape(2, features=4, hidden=3, frequencies=1), 3).save(file)
    tensors, state = load_tensors(file)
    tensors["means"][1, 2] = value
    save_tensors(file, tensors, state)
    with pytest.raises(ModelError, match=r"does not hold a head model: .*more than 10,000 m"):
        HeadModel.load(file)


@pytest.mark.parametrize(
    ("field", "value", "named"),
    [
        ("hidden", 8000, "color_branch"),
        ("features", 8000, "basis"),
        ("expression_size", 8000, "basis"),
    ],
)
def test_what_a_file_describes_is_compared_before_it_is_built(tmp_path, field, value, named):
    file = tmp_path / "model.safetensors"
    HeadModel(head_shape(2, features=4, hidden=3, frequencies=1), 3).save(file)
    tensors, state = load_tensors(file)
    save_tensors(file, tensors, {"shape": state["shape"] | {field: value}})
    with pytest.raises(ModelError, match=rf"does not hold a head model: .*'{named}.* expected"):
        HeadModel.load(file)


@pytest.mark.parametrize(
    "changes",
    [
        {"hidden": 10**9},
        {"frequencies": 10**8, "hidden": 0},
        {"features": 0},
        {"features": 2.0},
        {"expression_size": -1},
    ],
)
def test_sizes_that_no_head_has_are_refused(tmp_path, changes):
    """An MLP without values has no weights, however much it reads: only a limit tells."""
    file = tmp_path / "model.safetensors"
    HeadModel(head_shape(2, features=4, hidden=3, frequencies=1), 3).save(file)
    tensors, state = load_tensors(file)
    save_tensors(file, tensors, {"shape": state["shape"] | changes})
    with pytest.raises(ModelError, match=r"does not hold a head model: .*A head's"):
        HeadModel.load(file)


@pytest.mark.parametrize(
    ("size", "vectors"), [(10**8, 1), (10**8, 10**8), (64, 65), (64, 0), (-1, -1)]
)
def test_an_adaptor_for_features_that_no_encoder_gives_is_not_built(tmp_path, size, vectors):
    adaptor = SpeechAdaptor(64)
    model = HeadModel(head_shape(39), 4)
    TrainedHead(model, "speech", (), "builtin", "", adaptor, {}).save(tmp_path)
    file = tmp_path / "adaptor.safetensors"
    tensors, _ = load_tensors(file)
    save_tensors(file, tensors, {"features": size, "vectors": vectors})
    with pytest.raises(ModelError, match=f"no speech encoder gives {size} features in {vectors}"):
        TrainedHead.load(tmp_path)


def test_harmonics_follow_a_change_of_light():
    """As small changes of colour do: by the derivative of new colours by old ones."""
    model = HeadModel(head_shape(2, features=4, hidden=3, frequencies=1, sh_degree=1), 3).double()
    for value in model.parameters():
        value.data = 0.3 * torch.randn_like(value)
    change = torch.linspace(-1, 1, 9, dtype=torch.float64).reshape(3, 3)
    expression = torch.tensor([0.2, -0.5], dtype=torch.float64)
    before, after = model.logits(expression), model.relit(change).double().logits(expression)
    colors, tiny = before[:, :3].sigmoid(), 1e-6
    nudged = ((colors + tiny).logit() + change).sigmoid()
    slope = (nudged - (colors.logit() + change).sigmoid()) / tiny  # (N, 3)
    expected = before[:, 4:] * slope.repeat(1, 3)
    torch.testing.assert_close(after[:, 4:], expected, rtol=1e-4, atol=1e-6)
    torch.testing.assert_close(after[:, 3], before[:, 3], rtol=1e-6, atol=1e-6)


def test_a_head_is_loaded_without_what_takes_seconds_to_import(tmp_path):
    """Comparing shapes on torch's device without memory must not call for sympy."""
    HeadModel(head_shape(3), 5).save(tmp_path / "head.safetensors")
    program = (
        "import sys\nfrom pathlib import Path\nfrom ico3d.head.model import HeadModel\n"
        f"HeadModel.load(Path({str(tmp_path / 'head.safetensors')!r}))\n"
        "sys.exit('sympy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0
