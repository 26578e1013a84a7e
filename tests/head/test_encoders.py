"""Heads that listen with the encoders that users bring, from training to the server's face."""

import warnings

import numpy as np
import pytest

from ico3d.head.model_folder import TrainedHead
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.speech.encoder import load_encoder
from ico3d.speech.export import export_speech, make_servable
from ico3d.speech.runtime import open_speech
from support.settings import changed
from support.users_weights import write_ave, write_hubert

pytestmark = pytest.mark.slow


@pytest.fixture(params=["ave", "hubert"])
def encoder(request, tmp_path, monkeypatch):
    """The name of an encoder whose weights the user has."""
    models = tmp_path / "models"
    models.mkdir()
    monkeypatch.setenv("ICO3D_MODELS", str(models))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    if request.param == "hubert":
        pytest.importorskip("transformers")
        write_hubert(models)
    else:
        write_ave(models)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the licence
        yield request.param


def test_a_head_learns_from_them_and_is_served_as_it_was_trained(tiny, tmp_path, encoder):
    settings = changed(PRESETS["cpu"], {"steps": 20, "initial.gaussians": 60})
    head = train_head(tiny, tmp_path / "model", HeadJob("speech", "full", encoder, 0, settings))
    loaded = TrainedHead.load(tmp_path / "model")
    track = loaded.track(tiny)
    expected = track.at(9).detach().numpy()
    np.testing.assert_array_equal(expected, head.track(tiny).at(9).detach().numpy())

    frozen = load_encoder(encoder)
    assert loaded.encoder == encoder and loaded.encoder_sha256 == frozen.sha256
    graph = export_speech(loaded.adaptor, frozen)
    make_servable(frozen)
    model = open_speech(graph, encoder, frozen.sha256, "features")
    np.testing.assert_allclose(model.silent_expression, loaded.neutral()[:32], atol=1e-5)
    sound = tiny.audio()
    rows = model.expressions(sound.samples, sound.rate)
    place = 9 / tiny.fps * 25
    row = int(place)
    between = rows[row] + (place - row) * (rows[row + 1] - rows[row])
    np.testing.assert_allclose(between, expected[:32], atol=1e-4)
