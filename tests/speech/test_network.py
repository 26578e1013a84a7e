import numpy as np
import pytest
import torch

from ico3d.errors import MissingModelError, ModelError, SettingsError
from ico3d.speech.encoder import load_ave, load_builtin, load_encoder
from ico3d.speech.network import (
    AudioAttNet,
    AudioEncoder,
    BuiltinEncoder,
    ConvBlock,
    SpeechAdaptor,
    feature_windows,
)
from support.users_weights import write_ave


def sound(seconds=1.5, seed=0):
    samples = np.random.default_rng(seed).normal(0, 0.1, int(16000 * seconds))
    return samples.astype(np.float32)


def test_ave_has_the_published_keys_and_shapes():
    state = AudioEncoder().state_dict()
    norm = [f"1.{name}" for name in ("weight", "bias", "running_mean", "running_var")]
    names = ["0.weight", "0.bias", *norm, "1.num_batches_tracked"]
    assert set(state) == {f"{n}.conv_block.{name}" for n in range(13) for name in names}
    shapes = [tuple(state[f"{n}.conv_block.0.weight"].shape) for n in range(13)]
    channels = [1, 32, 32, 32, 64, 64, 64, 128, 128, 128, 256, 256, 512, 512]
    kernels = [3] * 12 + [1]
    assert shapes == [(channels[n + 1], channels[n], kernels[n], kernels[n]) for n in range(13)]


def test_ave_shrinks_the_window_as_published():
    x = torch.zeros(2, 1, 80, 16)
    sizes = []
    for block in AudioEncoder().eval():
        x = block(x)
        sizes.append(tuple(x.shape[2:]))
    assert sizes == [(80, 16)] * 3 + [(27, 16)] * 3 + [(9, 6)] * 3 + [(3, 3)] * 2 + [(1, 1)] * 2


@pytest.mark.parametrize("prefix", ["", "audio_encoder."])
def test_ave_is_loaded_from_the_users_file(tmp_path, monkeypatch, prefix):
    expected = write_ave(tmp_path, prefix)
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    with pytest.warns(UserWarning, match=r"CC BY-NC 4\.0"):
        encoder = load_encoder("ave")
    assert (encoder.name, encoder.size, len(encoder.sha256)) == ("ave", 512, 64)
    features = encoder.features(sound(), 16000)
    assert features.shape == (38, 512) and features.min() >= 0 and features.max() > 0
    x = torch.randn(3, 1, 80, 16)
    with torch.no_grad():
        torch.testing.assert_close(encoder.network(x), expected(x))


def test_a_missing_or_wrong_file_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.raises(MissingModelError, match=r"audio_visual_encoder\.pth"):
        load_encoder("ave")
    torch.save(BuiltinEncoder().state_dict(), tmp_path / "other.pth")
    with pytest.warns(UserWarning), pytest.raises(ModelError, match="does not hold"):
        load_ave(tmp_path / "other.pth")
    (tmp_path / "text.pth").write_text("hello")
    with pytest.warns(UserWarning), pytest.raises(ModelError, match="damaged file of weights"):
        load_ave(tmp_path / "text.pth")
    with pytest.raises(ModelError, match="cannot be read"):
        load_builtin(tmp_path / "nothing.safetensors")
    with pytest.raises(SettingsError, match="no speech encoder 'x'"):
        load_encoder("x")


def test_builtin_gives_one_row_per_frame():
    encoder = load_encoder()
    features = encoder.features(sound(2.0), 16000)
    assert encoder.size == 64
    assert features.shape == (51, 64) and features.dtype == np.float32
    assert not any(p.requires_grad for p in encoder.network.parameters())


def test_builtin_over_a_whole_sound_is_builtin_over_its_windows():
    torch.manual_seed(0)
    encoder = BuiltinEncoder().eval()
    mel = torch.randn(1, 1, 80, 40)
    windows = mel.unfold(3, 16, 1)[0].permute(2, 0, 1, 3)  # (25, 1, 80, 16)
    with torch.no_grad():
        torch.testing.assert_close(encoder.dense(mel)[0].T, encoder(windows))


@pytest.mark.parametrize("residual", [False, True])
def test_a_folded_block_is_the_same_block(residual):
    torch.manual_seed(0)
    block = ConvBlock(4, 4, 3, 1, 1, residual=residual)
    for _ in range(3):
        block(torch.randn(8, 4, 6, 6) * 2 + 1)
    block.eval()
    torch.nn.init.normal_(block.conv_block[1].weight)
    plain = ConvBlock(4, 4, 3, 1, 1, residual=residual, normalise=False)
    weight, bias = block.folded()
    plain.load_state_dict({"conv_block.0.weight": weight, "conv_block.0.bias": bias})
    x = torch.randn(2, 4, 6, 6)
    torch.testing.assert_close(plain(x), block(x), atol=1e-5, rtol=1e-5)


def test_attention_is_a_weighted_mean_of_its_rows():
    torch.manual_seed(0)
    attention = AudioAttNet()
    same = torch.randn(5, 1, 32).expand(5, 8, 32)
    torch.testing.assert_close(attention(same), same[:, 0])
    rows = torch.randn(5, 8, 32)
    low, high = rows.min(1).values, rows.max(1).values
    found = attention(rows)
    assert (found >= low - 1e-6).all() and (found <= high + 1e-6).all()


@pytest.mark.parametrize("count", [1, 3, 8, 30])
def test_a_track_is_what_its_windows_give_with_zeros_around(count):
    torch.manual_seed(0)
    adaptor = SpeechAdaptor(6)
    features = torch.randn(count, 6)
    padded = torch.cat([torch.zeros(4, 6), features, torch.zeros(3, 6)])
    windows = torch.stack([padded[i : i + 8] for i in range(count)])
    torch.testing.assert_close(feature_windows(features, torch.arange(count)), windows)
    torch.testing.assert_close(adaptor.track(features), adaptor(windows))


def test_layers_of_the_adaptor():
    linear = [m for m in SpeechAdaptor(512).adaptor if isinstance(m, torch.nn.Linear)]
    assert [(m.in_features, m.out_features) for m in linear] == [(512, 256), (256, 128), (128, 32)]
