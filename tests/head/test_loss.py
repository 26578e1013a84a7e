"""The loss: its parts, and the perceptual term with and without weights."""

import json
import logging

import pytest
import torch
from safetensors.torch import save_file

from ico3d.errors import ModelError
from ico3d.head.loss import HeadLoss
from ico3d.head.optimise import HeadTrainer
from ico3d.head.perceptual import WEIGHTS, PerceptualLoss
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.head.views import Picture
from ico3d.splat.losses import ssim
from ico3d.splat.rendering import Drawing, Rendering
from support.settings import changed

PAPER = PRESETS["paper"]
CPU = torch.device("cpu")
SHORT = changed(
    PRESETS["cpu"],
    {
        "steps": 5,
        "initial.gaussians": 50,
        "loss.perceptual": 0.1,
        "loss.perceptual_from": 1,
        "checkpoint_every": 2,
    },
)


def _rendering(image: torch.Tensor, alpha: torch.Tensor) -> Rendering:
    return Rendering(image[None], alpha[None], Drawing(image[None], alpha[None], None, None))


def _images() -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    return torch.rand(16, 20, 3, generator=generator), torch.rand(16, 20, 3, generator=generator)


def test_l1_ssim_and_alpha_are_weighted():
    image, target = _images()
    settings = changed(PAPER, {"steps": 10, "loss.alpha": 0.5})
    alpha, mask = torch.full((16, 20), 0.25), torch.ones(16, 20)
    loss = HeadLoss(settings, CPU)(_rendering(image, alpha), target, Picture(target, mask, None), 0)
    expected = 0.8 * (image - target).abs().mean() + 0.2 * (1 - ssim(image, target)) + 0.5 * 0.75
    torch.testing.assert_close(loss, expected)


def test_squared_differences_are_weighted():
    image, target = _images()
    settings = changed(PAPER, {"steps": 10, "loss.ssim": 0.0, "loss.squares": 3.0})
    rendering, picture = _rendering(image, torch.ones(16, 20)), Picture(target, None, None)
    away = image - target
    expected = 0.8 * away.abs().mean() + 3 * away.square().mean()
    torch.testing.assert_close(HeadLoss(settings, CPU)(rendering, target, picture, 0), expected)


def test_a_torso_counts_by_its_weight():
    image, target = _images()
    image.requires_grad_()
    torso = torch.zeros(16, 20)
    torso[8:] = 1
    settings = changed(PAPER, {"steps": 10, "loss.ssim": 0.0, "loss.torso": 0.25})
    rendering = _rendering(image, torch.ones(16, 20))
    HeadLoss(settings, CPU)(rendering, target, Picture(target, None, torso), 0).backward()
    slopes = image.grad.abs()  # of 0.8·L1 over 16·20·3 numbers
    torch.testing.assert_close(slopes[:8], torch.full((8, 20, 3), 0.8 / 960))
    torch.testing.assert_close(slopes[8:], torch.full((8, 20, 3), 0.25 * 0.8 / 960))


def test_a_torso_without_weight_may_be_there_or_not():
    """Neither colours nor alpha count on it: bodies' recordings ask for heads alone."""
    image, target = _images()
    alpha = torch.full((16, 20), 0.25, requires_grad=True)
    torso = torch.zeros(16, 20)
    torso[8:] = 1
    settings = changed(PAPER, {"steps": 10, "loss.torso": 0.0, "loss.alpha": 0.5})
    picture = Picture(target, torch.ones(16, 20), torso)
    HeadLoss(settings, CPU)(_rendering(image, alpha), target, picture, 0).backward()
    torch.testing.assert_close(alpha.grad[:8], torch.full((8, 20), -0.5 / 320))
    assert (alpha.grad[8:] == 0).all()


@pytest.fixture
def models(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


def test_without_weights_training_goes_on_with_one_warning(models, caplog):
    image, target = _images()
    with caplog.at_level(logging.WARNING):
        loss = HeadLoss(PAPER, CPU)
    assert len(caplog.records) == 1
    assert WEIGHTS in caplog.text
    rendering = _rendering(image, torch.ones(16, 20))
    picture = Picture(target, None, None)
    assert loss(rendering, target, picture, 20_000) == loss(rendering, target, picture, 0)


def _write_weights(folder) -> None:
    generator = torch.Generator().manual_seed(0)
    tensors, width, index = {}, 3, 0
    for channels in (64, 64, 0, 128, 128, 0, 256, 256, 256):
        if channels:
            shape = (channels, width, 3, 3)
            tensors[f"features.{index}.weight"] = torch.randn(shape, generator=generator) * 0.05
            tensors[f"features.{index}.bias"] = torch.zeros(channels)
            width, index = channels, index + 2
        else:
            index += 1
    save_file(tensors, folder / WEIGHTS)


def test_the_perceptual_term_starts_when_it_should(models):
    _write_weights(models)
    image, target = _images()
    loss, rendering = HeadLoss(PAPER, CPU), _rendering(image, torch.ones(16, 20))
    picture = Picture(target, None, None)
    early, late = (loss(rendering, target, picture, step) for step in (9_999, 10_000))
    distance = PerceptualLoss()(image, target)
    assert distance > 0
    torch.testing.assert_close(late - early, 0.1 * distance)
    assert PerceptualLoss()(target, target) == 0


def test_other_weights_are_one_sentence(models):
    save_file({"features.0.weight": torch.zeros(1)}, models / WEIGHTS)
    with pytest.raises(ModelError, match="does not hold VGG-16 weights"):
        PerceptualLoss()


@pytest.mark.parametrize("weights", [False, True])
def test_a_head_says_whether_the_perceptual_term_was_there(weights, models, tiny, tmp_path, caplog):
    """`head.json` records what was used, not what was wished for."""
    if weights:
        _write_weights(models)
    job = HeadJob("blendshapes", "full", "builtin", 0, SHORT)
    train_head(tiny, tmp_path / "head", job)
    settings = json.loads((tmp_path / "head" / "head.json").read_text())["summary"]["settings"]
    assert settings["loss"]["perceptual"] == (0.1 if weights else 0.0)
    assert caplog.text.count("with weight 0") == (0 if weights else 1)


@pytest.mark.parametrize("first", [False, True])
def test_a_run_goes_on_with_the_terms_it_began_with(first, models, tiny, tmp_path, monkeypatch):
    job = HeadJob("blendshapes", "full", "builtin", 0, SHORT)
    if first:
        _write_weights(models)
    step = HeadTrainer.step

    def dying_step(self, index):
        if index == 3:
            raise KeyboardInterrupt
        return step(self, index)

    with monkeypatch.context() as patch:
        patch.setattr(HeadTrainer, "step", dying_step)
        with pytest.raises(KeyboardInterrupt):
            train_head(tiny, tmp_path / "head", job)
    if first:
        (models / WEIGHTS).unlink()
        with pytest.raises(ModelError, match="began with the perceptual term"):
            train_head(tiny, tmp_path / "head", job)
    else:
        _write_weights(models)
        head = train_head(tiny, tmp_path / "head", job)
        assert head.summary["settings"]["loss"]["perceptual"] == 0
