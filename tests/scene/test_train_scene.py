"""Training of a scene end to end on a tiny capture."""

import numpy as np
import pytest
import torch

from ico3d import cli
from ico3d.errors import ModelError, SettingsError
from ico3d.measure.scene import evaluate_scene
from ico3d.scene.model_folder import TrainedScene
from ico3d.scene.optimise import SceneTrainer
from ico3d.scene.settings import settings_for
from ico3d.scene.train_scene import SceneJob, train_scene
from ico3d.splat.files.formats import read_gaussians
from ico3d.training.checkpoint import load_sealed, save_sealed
from ico3d.training.run import CHECKPOINT
from support.captures import open_with
from support.settings import changed

pytestmark = pytest.mark.slow

SMALL = {
    "steps": 200,
    "initial.gaussians": 120,
    "density.max_gaussians": 300,
    "density.begin": 20,
    "density.every": 20,
    "density.until": 120,
    "sh_every": 100,
    "rates.position": 2e-3,
}


def _job(only="person", strategy="default", frames="all", preset="cpu", **changes) -> SceneJob:
    settings = changed(settings_for(preset, strategy), SMALL | changes)
    return SceneJob(only, frames, strategy, 0, settings)


@pytest.mark.parametrize("strategy", ["default", "mcmc"])
def test_two_cameras_are_learnt(still, tmp_path, strategy):
    capture = still(2)
    scene = train_scene(capture, tmp_path / "model", _job(strategy=strategy, steps=300))
    metrics = evaluate_scene(scene, capture, "all", None)
    assert metrics["psnr"] > 33 and metrics["psnr_mask"] > 28
    assert 120 < metrics["num_gaussians"] <= 300


def test_a_person_has_no_background(still, tmp_path):
    capture = still(8)
    scene = train_scene(capture, tmp_path / "model", _job(steps=250)).scene
    from ico3d.splat.render import render

    with torch.no_grad():
        alpha = render(scene.gaussians(), [capture.cameras[4]]).alpha[0]
    outside = torch.from_numpy(capture.mask(4, 0)) < 0.01
    assert alpha[outside].mean() < 0.02


@pytest.mark.parametrize(
    ("preset", "strategy"), [("cpu", "default"), ("cpu", "mcmc"), ("paper", "default")]
)
def test_a_killed_run_resumes_to_the_same_scene(still, tmp_path, preset, strategy, monkeypatch):
    capture = still(3)
    often = {"checkpoint_every": 25, "density.begin": 10, "density.reset_every": 30, "sh_every": 15}
    job = _job(strategy=strategy, preset=preset, steps=60, **often)
    whole = train_scene(capture, tmp_path / "whole", job)
    step = SceneTrainer.step

    def dying_step(self, index):
        if index == 55:
            raise KeyboardInterrupt
        return step(self, index)

    monkeypatch.setattr(SceneTrainer, "step", dying_step)
    with pytest.raises(KeyboardInterrupt):
        train_scene(capture, tmp_path / "parts", job)
    monkeypatch.setattr(SceneTrainer, "step", step)
    resumed = train_scene(capture, tmp_path / "parts", job)
    assert len(whole.scene) > 120
    for name, value in whole.scene.parameters.items():
        assert torch.equal(resumed.scene.parameters[name], value), name
    made = TrainedScene.load(tmp_path / "parts").summary["made"]
    assert made["used"] == {"optimiser": "adam", "sh_degree": 3 if preset == "paper" else 1}


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("scene.means", torch.Tensor.double),
        ("scene.quats", lambda tensor: tensor[:, :3].contiguous()),
        ("moments.means.first", lambda tensor: tensor[:1].contiguous()),
        ("density.views", lambda tensor: tensor[:1].contiguous()),
    ],
)
def test_a_checkpoint_of_other_tensors_is_refused(still, tmp_path, monkeypatch, name, change):
    """The optimiser's kernels write to moments as far as their parameter reaches."""
    capture, job = still(3), _job(steps=4, checkpoint_every=2)
    step = SceneTrainer.step

    def dying_step(self, index):
        if index == 3:
            raise KeyboardInterrupt
        return step(self, index)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(SceneTrainer, "step", dying_step)
        train_scene(capture, tmp_path / "scene", job)
    file = tmp_path / "scene" / CHECKPOINT
    tensors, state = load_sealed(file)
    save_sealed(file, tensors | {name: change(tensors[name])}, state)
    with pytest.raises(ModelError, match="is of another training"):
        train_scene(capture, tmp_path / "scene", job)


def test_a_saved_scene_is_the_same(still, tmp_path):
    job = _job("all", steps=30)
    scene = train_scene(still(2), tmp_path / "model", job)
    loaded = TrainedScene.load(tmp_path / "model")
    assert (loaded.only, loaded.frames, loaded.space) == ("all", "all", "world")
    assert loaded.summary["strategy"] == "default" and loaded.summary["train_seconds"] > 0
    for name, value in scene.scene.parameters.items():
        assert torch.equal(loaded.scene.parameters[name], value)
    again = train_scene(still(2), tmp_path / "model", job)
    assert torch.equal(again.scene.parameters["means"], loaded.scene.parameters["means"])
    with pytest.raises(SettingsError, match="another 'only'"):
        train_scene(still(2), tmp_path / "model", _job("person", steps=30))


def test_the_verb_trains_and_exports(still, tmp_path, monkeypatch):
    open_with(monkeypatch, lambda _: still(2))
    out = tmp_path / "model"
    words = ["train", "static", str(tmp_path), str(out), "--only", "person", "--frames", "0"]
    words += ["--steps", "20", "--initial.gaussians", "80", "--sh-degree", "2"]
    for name in ("scene.ply", "scene.spz"):
        assert cli.main([*words, "--export", str(tmp_path / name)]) == 0
    assert cli.main([*words, "--export", "scene.obj"]) == 1
    parameters = TrainedScene.load(out).scene.parameters
    ply, spz = (read_gaussians(tmp_path / name) for name in ("scene.ply", "scene.spz"))
    assert len(ply) == len(spz) == 80 and ply.degree == spz.degree == 2
    np.testing.assert_allclose(spz.means, ply.means, atol=1e-3)
    np.testing.assert_array_equal(ply.means, parameters["means"] * torch.tensor([1, -1, -1]))
    turned = ply.half_turn()
    np.testing.assert_array_equal(turned.rest, parameters["f_rest"])
    np.testing.assert_array_equal(turned.quats, parameters["quats"])
    np.testing.assert_array_equal(turned.opacities, parameters["opacity_logits"])


def test_a_dry_run_writes_nothing(still, tmp_path, monkeypatch, capsys):
    open_with(monkeypatch, lambda _: still(2))
    words = ["train", "static", str(tmp_path), str(tmp_path / "model"), "--dry-run"]
    words += ["--initial.gaussians", "80", "--density.max-gaussians", "250", "--cache-gib", "0"]
    assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert "with 80 Gaussians" in said and "with 250;" in said and "GB are free" in said
    assert "give --cache-dir a folder" in said
    assert not (tmp_path / "model").exists()


def test_harmonics_are_raised_over_time(still, tmp_path):
    scenes = [
        train_scene(still(2), tmp_path / str(every), _job(steps=30, sh_every=every, sh_degree=2))
        for every in (100, 15, 10)
    ]
    rest = [scene.scene.parameters["f_rest"] for scene in scenes]
    assert not rest[0].any()
    assert rest[1][:, :3].any() and not rest[1][:, 3:].any()
    assert rest[2][:, 3:].any()


def test_what_the_mask_hides_teaches_a_background_nothing(still, tmp_path, monkeypatch):
    capture = still(2)
    monkeypatch.setattr(type(capture), "background", lambda *_: None)
    scene = train_scene(capture, tmp_path / "model", _job("background", steps=200))
    metrics = evaluate_scene(scene, capture, "all", None)
    assert metrics["psnr_background"] > 28
    assert metrics["psnr"] is None and metrics["psnr_mask"] is None


def test_damaged_models_are_one_sentence(still, tmp_path):
    with pytest.raises(ModelError, match="holds no scene"):
        TrainedScene.load(tmp_path)
    train_scene(still(2), tmp_path / "model", _job(steps=2))
    from ico3d.training.checkpoint import load_tensors, save_tensors

    file = tmp_path / "model" / "scene.safetensors"
    tensors, _ = load_tensors(file)
    save_tensors(file, {**tensors, "quats": tensors["means"].clone()}, {})
    with pytest.raises(ModelError, match="does not hold a scene: quats of 120"):
        TrainedScene.load(tmp_path / "model")


def test_the_verb_names_what_is_wrong(tmp_path, capsys):
    words = ["train", "static", str(tmp_path / "no"), str(tmp_path / "out"), "--frames", "3"]
    assert cli.main(words) == 1
    assert "there is no capture at" in capsys.readouterr().err
