"""Training end to end on a tiny capture."""

import json

import numpy as np
import pytest
import torch

from ico3d.capture.capture import Sound
from ico3d.common.expression import EyeRange, eye_range
from ico3d.errors import CaptureError, ModelError, SettingsError
from ico3d.head.model_folder import TrainedHead
from ico3d.head.optimise import HeadTrainer
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head, trainer_of
from ico3d.splat.render import render
from ico3d.training.checkpoint import load_sealed, load_tensors, save_sealed
from ico3d.training.finite import check_finite
from ico3d.training.run import CHECKPOINT
from support.settings import changed

pytestmark = pytest.mark.slow

SETTINGS = changed(
    PRESETS["cpu"],
    {
        "steps": 100,
        "initial.gaussians": 200,
        "density.max_gaussians": 400,
        "density.begin": 40,
        "density.every": 20,
        "density.until": 70,
        "density.gradient": 1e-5,
        "rates.basis_weight_decay": 0.0,  # what this capture shows is exact
    },
)


def _job(inputs="blendshapes", variant="full", **changes) -> HeadJob:
    settings = changed(SETTINGS, changes)
    return HeadJob(inputs, variant, "builtin", 0, settings)


def _held_out_psnr(head: TrainedHead, capture) -> float:
    track, errors = head.track(capture), []
    for frame in capture.split.test:
        camera = frame % 2
        view = capture.cameras[camera].moved(capture.world_from_head(frame))
        background = torch.from_numpy(capture.background(camera))
        with torch.no_grad():
            picture = render(head.model(track.at(frame)), [view], background).rgb[0].numpy()
        errors.append(((picture - capture.image(camera, frame)) ** 2).mean())
    return float(-10 * np.log10(np.mean(errors)))


@pytest.mark.slow
def test_expressions_are_learnt_where_a_static_head_cannot(tiny, tmp_path):
    scores = {
        variant: _held_out_psnr(train_head(tiny, tmp_path / variant, _job(variant=variant)), tiny)
        for variant in ("full", "no-mlp", "no-blending", "static")
    }
    assert scores["full"] > 27
    assert scores["full"] > scores["static"] + 2
    assert scores["no-mlp"] > scores["static"]
    assert scores["no-blending"] > scores["static"]


def _train_until(step: int, monkeypatch, capture, folder, job) -> None:
    """A training that is interrupted before a step."""
    whole_step = HeadTrainer.step

    def dying_step(self, index):
        if index == step:
            raise KeyboardInterrupt
        return whole_step(self, index)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(HeadTrainer, "step", dying_step)
        train_head(capture, folder, job)


@pytest.mark.parametrize("inputs", ["blendshapes", "speech"])
def test_a_killed_run_resumes_to_the_same_weights(tiny, tmp_path, inputs, monkeypatch):
    job = _job(inputs, steps=60, checkpoint_every=25, **{"density.begin": 10, "density.every": 10})
    whole = train_head(tiny, tmp_path / "whole", job)
    _train_until(55, monkeypatch, tiny, tmp_path / "parts", job)
    resumed = train_head(tiny, tmp_path / "parts", job)
    for name, value in whole.model.state_dict().items():
        assert torch.equal(resumed.model.state_dict()[name], value), name
    if inputs == "speech":
        for name, value in whole.adaptor.state_dict().items():
            assert torch.equal(resumed.adaptor.state_dict()[name], value), name


@pytest.mark.parametrize("rows", ["adam", "rmsprop"])
@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("model.means", lambda tensor: tensor[:, :1].contiguous()),
        ("moments.basis.second", lambda tensor: tensor[:, :1].contiguous()),
        ("moments.basis.steps", lambda tensor: tensor[:1].contiguous()),
        ("moments.means.first", lambda tensor: tensor[:1].contiguous()),
    ],
)
def test_a_checkpoint_of_other_tensors_is_refused(tiny, tmp_path, monkeypatch, rows, name, change):
    """The optimiser's kernels write to moments as far as their parameter reaches."""
    job = _job(steps=6, checkpoint_every=2, basis_optimiser=rows)
    _train_until(3, monkeypatch, tiny, tmp_path / "head", job)
    file = tmp_path / "head" / CHECKPOINT
    tensors, state = load_sealed(file)
    save_sealed(file, tensors | {name: change(tensors[name])}, state)
    with pytest.raises(ModelError, match="is of another training"):
        train_head(tiny, tmp_path / "head", job)


def test_a_run_and_its_head_know_their_space(tiny, tmp_path, monkeypatch):
    """The recording's head poses or points may become others: weights would not fit."""
    job = _job(steps=40, checkpoint_every=10)
    _train_until(25, monkeypatch, tiny, tmp_path / "head", job)
    with monkeypatch.context() as patch:
        patch.setattr(tiny, "head_points", lambda frame=0: 1.1 * type(tiny).head_points(tiny))
        with pytest.raises(SettingsError, match="have changed since: train in an empty folder"):
            train_head(tiny, tmp_path / "head", job)
    head = train_head(tiny, tmp_path / "head", job)  # nothing was lost
    head.track(tiny)
    moved = np.eye(4)
    moved[1, 3] = 0.02
    with monkeypatch.context() as patch:
        patch.setattr(tiny, "world_from_head", lambda frame: moved)
        with pytest.raises(ModelError, match="have changed since this head was trained"):
            head.track(tiny)
        patch.setattr(tiny, "path", tmp_path / "another")  # which may have poses of its own
        head.track(tiny)


def test_a_saved_head_gives_the_same_expressions_and_gaussians(tiny, tmp_path):
    head = train_head(tiny, tmp_path / "model", _job("speech", steps=30))
    loaded = TrainedHead.load(tmp_path / "model")
    expression = head.track(tiny).at(7)
    assert expression.shape == (39,)
    assert torch.equal(loaded.track(tiny).at(7), expression)
    assert torch.equal(loaded.model.logits(expression), head.model.logits(expression))
    assert len(loaded.model) <= SETTINGS.density.max_gaussians
    recorded = np.stack([tiny.eyes(frame) for frame in tiny.split.train])
    assert loaded.eyes == head.eyes == eye_range(recorded)
    np.testing.assert_allclose(loaded.neutral()[32:], loaded.eyes.rest)


def test_a_head_of_an_earlier_version_opens(tiny, tmp_path):
    """Only its run is refused: settings had other names, in the model's file and in the run's."""
    old = {"steps": 3, "l1_weight": 0.8, "basis_rate": 2.5e-3, "densify_until": 100}
    head = train_head(tiny, tmp_path, _job(steps=3))
    about = json.loads((tmp_path / "head.json").read_text())
    assert about["summary"]["settings"]["loss"]["l1"] == 0.8
    about["summary"]["settings"] = old
    (tmp_path / "head.json").write_text(json.dumps(about))
    run = json.loads((tmp_path / "settings.json").read_text())
    del run["settings"]
    (tmp_path / "settings.json").write_text(json.dumps(run | old))
    loaded = TrainedHead.load(tmp_path)
    assert loaded.summary["settings"] == old
    assert torch.equal(loaded.model.means, head.model.means)
    with pytest.raises(SettingsError, match="holds a run that an earlier version of ico3d began"):
        train_head(tiny, tmp_path, _job(steps=3))


def test_what_no_head_tells_of_itself_is_refused(tiny, tmp_path):
    train_head(tiny, tmp_path, _job(steps=2))
    about = json.loads((tmp_path / "head.json").read_text())
    false = ({"summary": []}, {"inputs": 5}, {"inputs": []}, {"blendshape_names": [1]})
    for changes in (*false, {"encoder": []}, {"summary": {"recoloured": 7}}):
        (tmp_path / "head.json").write_text(json.dumps({**about, **changes}))
        with pytest.raises(ModelError, match="holds no trained head"):
            TrainedHead.load(tmp_path)


def test_eyes_that_make_no_sense_are_refused(tiny, tmp_path):
    train_head(tiny, tmp_path, _job("speech", steps=2))
    about = json.loads((tmp_path / "head.json").read_text())

    def load(eyes) -> TrainedHead:
        (tmp_path / "head.json").write_text(json.dumps({**about, "eyes": eyes}))
        return TrainedHead.load(tmp_path)

    low, high = [0] * 7, [1] * 7
    for eyes in (7, {"rest": low}, {"rest": low, "most": high[1:]}, {"rest": high, "most": low}):
        with pytest.raises(ModelError, match="holds no trained head"):
            load(eyes)
    assert load({"rest": low, "most": high}).eyes == load(None).eyes == EyeRange()


def test_the_adaptor_learns(tiny, tmp_path):
    torch.manual_seed(0)
    head = train_head(tiny, tmp_path / "model", _job("speech", steps=30))
    torch.manual_seed(0)
    from ico3d.speech.network import SpeechAdaptor

    fresh = SpeechAdaptor(64).state_dict()
    trained = head.adaptor.state_dict()
    assert any(not torch.equal(fresh[name], trained[name]) for name in fresh)


def test_a_head_begins_with_the_lips_that_its_recording_tells(tiny, monkeypatch):
    def audio(self):  # a tone that swells three times a second
        times = np.arange(int(16000 * self.num_frames / self.fps)) / 16000
        swell = 0.5 - 0.5 * np.cos(2 * np.pi * 3 * times)
        return Sound((0.3 * swell * np.sin(2 * np.pi * 300 * times)).astype(np.float32), 16000)

    def landmarks(self, frame):  # a jaw that opens as loud as the sound is
        loud = np.abs(self.audio().samples[round(frame * 16000 / self.fps) :][:320]).mean()
        return np.full((68, 3), loud)

    monkeypatch.setattr(type(tiny), "audio", audio)
    general = trainer_of(tiny, _job("speech"), "cpu")[0].adaptor.lips  # told by the encoder
    assert general[0].any() and not general[5:].any()
    monkeypatch.setattr(type(tiny), "landmarks_3d", landmarks)
    trainer, _ = trainer_of(tiny, _job("speech"), "cpu")
    reading = trainer.adaptor.lips.clone()
    assert reading[0].any() and not reading[1:].any()  # all landmarks move alike: one value
    spoken = torch.stack([trainer.track.at(frame).detach() for frame in tiny.split.train])
    heard = np.array([landmarks(tiny, frame)[0, 0] for frame in tiny.split.train])
    assert abs(np.corrcoef(spoken[:, 0].numpy(), heard)[0, 1]) > 0.8
    trainer.step(0)
    torch.testing.assert_close(trainer.adaptor.lips, reading)


@pytest.mark.parametrize(
    ("method", "inputs", "sentence"),
    [
        ("audio", "speech", "has no sound"),
        ("head_points", "blendshapes", "no finite surface points"),
        ("blendshapes", "blendshapes", "frame 0 has no finite blendshapes"),
        ("world_from_head", "blendshapes", "frame 0 has no finite head pose"),
    ],
)
def test_what_a_capture_lacks_is_one_sentence(
    tiny, tmp_path, monkeypatch, method, inputs, sentence
):
    monkeypatch.setattr(type(tiny), method, lambda *_: None)
    with pytest.raises(CaptureError, match=sentence):
        train_head(tiny, tmp_path / "model", _job(inputs))


def test_a_nan_pose_names_its_frame(tiny, tmp_path, monkeypatch):
    pose = type(tiny).world_from_head
    broken = lambda self, frame: pose(self, frame) * (np.nan if frame == 5 else 1)  # noqa: E731
    monkeypatch.setattr(type(tiny), "world_from_head", broken)
    with pytest.raises(CaptureError, match="frame 5 has no finite head pose"):
        train_head(tiny, tmp_path / "model", _job())


def test_a_nan_in_a_picture_stops_before_anything_is_spoiled(tiny, tmp_path, monkeypatch):
    job = _job(steps=60, checkpoint_every=25)
    staged = HeadTrainer._staged

    def torn(self, view, picture, index):
        background, target = staged(self, view, picture, index)
        target[3, 3] = np.nan if index == 31 else target[3, 3]
        return background, target

    monkeypatch.setattr(HeadTrainer, "_staged", torn)
    with pytest.raises(ModelError, match=r"'basis' is not finite at step 31: .* from step 25\)"):
        train_head(tiny, tmp_path / "model", job)
    tensors, state = load_tensors(tmp_path / "model" / "checkpoint.safetensors")
    assert state["step"] == 25
    check_finite(tensors)
