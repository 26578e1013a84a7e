import json
from dataclasses import asdict

import numpy as np
import pytest
import torch

from ico3d.cli import main
from ico3d.errors import ModelError, SettingsError
from ico3d.speech.encoder import load_builtin
from ico3d.speech.training import train_encoder as training
from ico3d.speech.training.settings import EncoderSettings
from ico3d.speech.training.train_encoder import EncoderTraining, load_readout

pytestmark = pytest.mark.slow

pytest.importorskip("espeakng_loader")

SETTINGS = EncoderSettings(steps=4, batch=2, seconds=1.0, seed=5)


def test_an_interrupted_training_goes_on_exactly(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "_CHECKPOINT_EVERY", 2)
    whole = EncoderTraining(SETTINGS, tmp_path / "whole.pt")
    expected = list(whole.run())
    first = EncoderTraining(SETTINGS, tmp_path / "cut.pt")
    steps = first.run()
    found = [next(steps) for _ in range(3)][:2]
    steps.close()
    second = EncoderTraining(SETTINGS, tmp_path / "cut.pt")
    assert second.step == 2
    found += list(second.run())
    assert found == expected
    for name, value in whole.network.state_dict().items():
        torch.testing.assert_close(second.network.state_dict()[name], value, atol=0, rtol=0)


def test_other_settings_need_another_folder(tmp_path):
    list(EncoderTraining(SETTINGS, tmp_path / "checkpoint.pt").run())
    with pytest.raises(SettingsError, match="other settings"):
        EncoderTraining(EncoderSettings(steps=5), tmp_path / "checkpoint.pt")


def test_a_checkpoint_of_something_else_is_one_sentence(tmp_path):
    for held in ([], {"settings": asdict(SETTINGS), "network": 5}):
        torch.save(held, tmp_path / "checkpoint.pt")
        with pytest.raises(ModelError, match="holds no training of an encoder"):
            EncoderTraining(SETTINGS, tmp_path / "checkpoint.pt")


def test_the_finished_encoder_is_the_trained_one_with_unit_features(tmp_path):
    run = EncoderTraining(SETTINGS, tmp_path / "checkpoint.pt")
    list(run.run())
    network, readout = run.finished()
    batches = [run._batch(step) for step in range(4, 12)]
    mel = torch.from_numpy(np.concatenate([b.mel for b in batches]))[:, None]
    run.network.eval()
    with torch.no_grad():
        features = network.dense(mel).transpose(1, 2)
        expected = run.readout(run.network.dense(mel).transpose(1, 2))
        found = readout(features)
    for a, b in zip(found, expected, strict=True):
        torch.testing.assert_close(a, b, atol=0.02, rtol=0.02)  # half precision
    flat = features.flatten(0, 1)
    torch.testing.assert_close(flat.mean(0), torch.zeros(64), atol=0.02, rtol=0)
    torch.testing.assert_close(flat.std(0), torch.ones(64), atol=0.02, rtol=0)


def test_lag_is_positive_when_late():
    random = np.random.default_rng(0)
    smooth = np.stack([np.convolve(random.normal(size=300), np.ones(9), "same") for _ in range(3)])
    late = np.roll(smooth, 2, axis=1)
    assert training._lag_ms(late, smooth) == pytest.approx(25, abs=2)
    assert training._lag_ms(smooth, smooth) == pytest.approx(0, abs=2)


def test_what_a_link_leads_to_is_left_as_it_is(tmp_path):
    diary = tmp_path / "diary.txt"
    diary.write_text("Dear diary\n")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "metrics.jsonl").symlink_to(diary)
    command = f"train speech {tmp_path / 'out'} --steps 1 --batch 1 --test-batches 1"
    assert main(command.split()) == 0
    assert diary.read_text() == "Dear diary\n"
    assert len((tmp_path / "out" / "metrics.jsonl").read_text().splitlines()) == 1


def test_the_command_writes_an_encoder_and_its_card(tmp_path):
    command = f"train speech {tmp_path} --steps 2 --batch 2 --test-batches 2"
    assert main(command.split()) == 0
    encoder = load_builtin(tmp_path / "encoder.safetensors")
    card = json.loads((tmp_path / "encoder.json").read_text())
    assert card["sha256"] == encoder.sha256
    assert 0 <= card["held_out"]["viseme_accuracy"] <= 1
    assert set(card["held_out"]["correlation"]) == set(training.ARTICULATION)
    assert len((tmp_path / "metrics.jsonl").read_text().splitlines()) == 2
    assert encoder.features(np.zeros(16000, np.float32), 16000).shape == (26, 64)
    logits, values = load_readout(tmp_path / "encoder.safetensors")(torch.zeros(3, 64))
    assert logits.shape == (3, 3, 15) and values.shape == (3, 5)
