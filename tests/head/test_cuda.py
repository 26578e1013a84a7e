"""Heads are trained, and go on being trained, where CUDA is."""

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from ico3d.cli import main
from ico3d.head.expressions import BlendshapeTrack
from ico3d.head.initial_gaussians import initial_head
from ico3d.head.optimise import HeadTrainer
from ico3d.head.perceptual import CHANNELS, WEIGHTS, vgg_layers
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.head.watch import WatchedHead
from ico3d.training.watch import _side_by_side
from support.captures import open_with
from support.pretended_cuda import assert_same_run, drawn, is_on_cuda
from support.settings import changed

pytestmark = pytest.mark.slow

SETTINGS = changed(
    PRESETS["cpu"],
    {
        "steps": 16,
        "initial.gaussians": 200,
        "density.max_gaussians": 400,
        "density.begin": 6,
        "density.every": 6,
        "density.until": 16,
        "density.gradient": 1e-5,
        "checkpoint_every": 8,
    },
)


def _job(inputs="blendshapes", variant="full", **changes) -> HeadJob:
    return HeadJob(inputs, variant, "builtin", 0, changed(SETTINGS, changes))


@pytest.fixture
def vgg(tmp_path, monkeypatch):
    """Random weights of the network that compares pictures."""
    torch.manual_seed(0)
    values = {f"features.{name}": v for name, v in vgg_layers(CHANNELS).state_dict().items()}
    save_file(values, tmp_path / WEIGHTS)
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))


@pytest.mark.parametrize("variant", ["full", "no-mlp", "no-blending"])
def test_every_variant_trains_there(cuda, tiny, tmp_path, variant):
    head = train_head(tiny, tmp_path, _job(variant=variant))
    assert is_on_cuda(head.model.means) and is_on_cuda(head.model.basis)


def test_a_perceptual_term_looks_at_pictures_there(cuda, vgg, tiny, tmp_path):
    """The paper's preset turns it on at step 10,000."""
    head = train_head(
        tiny, tmp_path, _job(**{"loss.perceptual": 0.1, "loss.perceptual_from": 2}, steps=4)
    )
    assert is_on_cuda(head.model.means)


def test_it_is_watched_there(cuda, tiny):
    """What a page shows of it can leave the device."""
    model = initial_head(tiny, SETTINGS, "full", 3, np.random.default_rng(0)).to(cuda)
    track = BlendshapeTrack(tiny, tiny.blendshape_names)
    watched = WatchedHead(HeadTrainer(tiny, model, track, None, SETTINGS, 0))
    assert is_on_cuda(watched.gaussians(0, watched.values(0)).colors)
    assert _side_by_side(*watched.pictures(0)).shape == (48, 96, 3)


@pytest.mark.parametrize("inputs", ["blendshapes", "speech"])
def test_an_interrupted_run_goes_on_there(cuda, tiny, tmp_path, inputs, monkeypatch):
    """To what it would have become; moments and density statistics lie where parameters do."""
    whole = train_head(tiny, tmp_path / "whole", _job(inputs))
    step = HeadTrainer.step

    def dying_step(self, index):
        if index == 10:
            raise KeyboardInterrupt
        return step(self, index)

    with monkeypatch.context() as patch:
        patch.setattr(HeadTrainer, "step", dying_step)
        with pytest.raises(KeyboardInterrupt):
            train_head(tiny, tmp_path / "parts", _job(inputs))
    resumed = train_head(tiny, tmp_path / "parts", _job(inputs))
    assert_same_run(resumed.model.state_dict(), whole.model.state_dict())


def test_the_papers_switches_work_there(cuda, vgg, tiny, tmp_path):
    """SGD, harmonics that turn with the head, and the perceptual term, for heads that speak."""
    job = _job(
        "speech",
        **{"optimiser": "sgd", "sh_degree": 3, "sh_every": 1, "loss.perceptual": 0.1},
        **{"loss.perceptual_from": 3, "loss.squares": 0.0},
        **{"steps": 4, "density.begin": 2, "density.every": 2},
    )
    head = train_head(tiny, tmp_path, job)
    assert is_on_cuda(head.model.means)
    assert head.summary["made"]["used"]["sh_degree"] == 3


def test_the_verb_tells_where(cuda, tiny, tmp_path, monkeypatch, capsys):
    """A dry run takes the way of a training, and tells of the GPU's memory."""
    open_with(monkeypatch, lambda _: tiny)
    words = ["train", "head", "capture", tmp_path / "head", "--inputs", "blendshapes", "--steps", 1]
    words += ["--initial.gaussians", 200, "--density.max-gaussians", 400, "--dry-run"]
    for device, told in (("cuda", True), ("cpu", False)):
        with drawn(monkeypatch) as pictures:
            assert main([*map(str, words), "--device", device]) == 0
        assert bool(pictures) == told == ("memory of the GPU" in capsys.readouterr().out)
