"""What a head is told besides speech: a smile, and eyes, which may be missing."""

import json
import logging

import numpy as np
import pytest
import torch

from ico3d.avatar.baking.head_bundle import idle_expression
from ico3d.avatar.baking.samples import spoken_expressions
from ico3d.common.expression import SMILES, EyeRange
from ico3d.errors import CaptureError, ModelError
from ico3d.head.expressions import SpeechTrack, eye_track, is_of_eyes, smile_track
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.speech.encoder import load_encoder
from ico3d.speech.network import SpeechAdaptor
from support.heads.shapes import head_shape
from support.heads.tiny_capture import FRAMES, TinyCapture
from support.settings import changed

FPS = TinyCapture.fps
SETTINGS = changed(
    PRESETS["cpu"],
    {"steps": 2, "smile": True, "initial.gaussians": 200, "density.max_gaussians": 400},
)


@pytest.fixture
def smiling(tiny, monkeypatch):
    """Somebody who begins to smile in the middle, and says something all the while."""
    mood = np.where(np.arange(FRAMES) < FRAMES // 2, 0.1, 0.7)
    vowels = 0.1 * np.sin(2 * np.pi * 6 * np.arange(FRAMES) / FPS)
    weights = np.stack([mood + vowels, 0 * mood, mood + vowels], 1).astype(np.float32)
    monkeypatch.setattr(TinyCapture, "blendshape_names", (SMILES[0], "jawOpen", SMILES[1]))
    monkeypatch.setattr(TinyCapture, "blendshapes", lambda _, frame: weights[frame])
    return tiny


def test_it_is_the_mood_without_what_vowels_do(smiling):
    smile = smile_track(smiling)
    assert smile.shape == (FRAMES,) and (smile[1:] >= smile[:-1] - 0.01).all()
    assert float(smile[0]) == pytest.approx(0.1, abs=0.08)
    assert float(smile[-1]) == pytest.approx(0.7, abs=0.08)


def test_a_frame_without_it_has_that_of_its_neighbours(smiling, monkeypatch):
    whole, row = smile_track(smiling), smiling.blendshapes
    lacking = {5: None, 30: np.full(3, np.nan, np.float32)}
    monkeypatch.setattr(TinyCapture, "blendshapes", lambda _, frame: lacking.get(frame, row(frame)))
    assert torch.allclose(smile_track(smiling), whole, atol=0.02)
    monkeypatch.setattr(TinyCapture, "blendshapes", lambda *_: None)
    with pytest.raises(CaptureError, match="no frame has finite blendshapes"):
        smile_track(smiling)


def test_a_recording_that_does_not_tell_it_is_refused_in_a_sentence(tiny):
    with pytest.raises(CaptureError, match=r"no blendshapes: train without --smile"):
        smile_track(tiny)


def test_expressions_end_with_it_and_it_is_no_value_of_eyes(smiling):
    track = SpeechTrack(smiling, np.zeros((40, 64), np.float32), SpeechAdaptor(64), smile=True)
    assert track.size == 40 and track.at(9).shape == (40,)
    assert float(track.at(9)[-1]) == float(smile_track(smiling)[9])
    assert is_of_eyes(track).nonzero()[:, 0].tolist() == list(range(32, 39))


def test_a_head_learns_by_it_and_rests_as_the_person_did(smiling, tmp_path):
    job = HeadJob("speech", "full", "builtin", 0, SETTINGS)
    head = train_head(smiling, tmp_path, job)
    loaded = TrainedHead.load(tmp_path)
    assert loaded.smiles and loaded.eyes == head.eyes and len(head.eyes.rest) == 8
    recorded = smile_track(smiling)[list(smiling.split.train)].numpy()
    assert head.eyes.rest[-1] == pytest.approx(np.median(recorded), abs=1e-6)
    assert head.eyes.most[-1] == pytest.approx(recorded.max(), abs=1e-6)
    assert loaded.track(smiling).at(3).shape == loaded.neutral().shape == (40,)
    idle = idle_expression(loaded, np.zeros((1, 40), np.float32))
    assert idle.shape == (40,) and loaded.recorded(idle)[-1] == pytest.approx(head.eyes.rest[-1])
    spoken = spoken_expressions(loaded, ["How do you do?"])
    assert spoken.shape[1] == 40 and np.ptp(spoken[:, -1]) > 0
    about = json.loads((tmp_path / "head.json").read_text())
    about["eyes"]["most"] = about["eyes"]["most"][:7]
    (tmp_path / "head.json").write_text(json.dumps(about))
    with pytest.raises(ModelError, match="holds no trained head"):
        TrainedHead.load(tmp_path)


def test_other_heads_do_not_know_it(tiny):
    encoder = load_encoder("builtin")
    adaptor = SpeechAdaptor(encoder.size, encoder.vectors)
    about = (encoder.name, encoder.sha256, adaptor, {}, None, EyeRange())
    head = TrainedHead(HeadModel(head_shape(39), 4), "speech", (), *about)
    assert not head.smiles and head.track(tiny).size == 39


@pytest.fixture
def eyeless(tiny, monkeypatch):
    monkeypatch.setattr(TinyCapture, "eyes", lambda *_: None)
    return tiny


def _said(caplog):
    return [record.getMessage() for record in caplog.records if "eye values" in record.getMessage()]


def test_missing_eyes_are_one_sentence_however_often_they_are_read(eyeless, caplog):
    with caplog.at_level(logging.WARNING):
        tracks = [eye_track(eyeless) for _ in range(3)]
    assert all(torch.equal(track, torch.zeros(44, 7)) for track in tracks)
    assert _said(caplog) == [f"{eyeless.path} has no eye values: eyes and brows will not move."]


def test_a_few_missing_frames_are_counted(tiny, monkeypatch, caplog):
    row = np.full(7, 0.2, np.float32)
    monkeypatch.setattr(TinyCapture, "eyes", lambda _, frame: None if frame in (3, 9) else row)
    with caplog.at_level(logging.WARNING):
        eyes = eye_track(tiny)
    assert eyes[3].max() == 0 and float(eyes[4, 0]) == pytest.approx(0.2)
    (told,) = _said(caplog)
    assert "2 of 44 frames have no eye values (first: 3)" in told


@pytest.mark.parametrize("trained_with", [True, False])
def test_a_head_without_eyes_needs_none(eyeless, caplog, trained_with):
    encoder = load_encoder("builtin")
    adaptor = SpeechAdaptor(encoder.size, encoder.vectors)
    eyes = EyeRange() if trained_with else EyeRange(most=(0.0,) * 7)
    model = HeadModel(head_shape(39), 4)
    head = TrainedHead(model, "speech", (), encoder.name, encoder.sha256, adaptor, {}, None, eyes)
    with caplog.at_level(logging.WARNING):
        head.track(eyeless)
    assert len(_said(caplog)) == trained_with
