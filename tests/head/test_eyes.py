"""What is said where a recording has no eye values: one sentence, once."""

import logging

import numpy as np
import pytest
import torch

from ico3d.common.expression import EyeRange
from ico3d.head.expressions import eye_track
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.speech.encoder import load_encoder
from ico3d.speech.network import SpeechAdaptor
from support.heads.shapes import head_shape
from support.heads.tiny_capture import TinyCapture


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
