import numpy as np
import pytest
import torch

from ico3d.measure.lips import lip_lag_ms
from ico3d.speech.lip_reading import MOST_VALUES, SIZE, read_lips
from ico3d.speech.network import AudioAttNet, SpeechAdaptor, feature_windows


def smooth(random, count, columns):
    """Features (count, columns) that change within some 100 ms, as those of speech do."""
    noise = random.normal(size=(count + 4, columns))
    rows = sum(noise[i : i + count] for i in range(5)) / np.sqrt(5)
    return np.asarray(rows, np.float32)


def test_a_fresh_attention_looks_at_the_row_itself():
    torch.manual_seed(0)
    rows = torch.randn(5, 8, 32)
    torch.testing.assert_close(AudioAttNet()(rows), rows[:, 4], atol=0.15, rtol=0)


def test_a_fresh_adaptor_is_not_late():
    torch.manual_seed(0)
    features = smooth(np.random.default_rng(0), 300, 16)
    adaptor = SpeechAdaptor(16)
    with torch.no_grad():
        each = adaptor.adaptor(torch.from_numpy(features)).numpy()
        track = adaptor.track(torch.from_numpy(features)).numpy()
    assert abs(lip_lag_ms(track[:, 0], each[:, 0], 25)) < 4
    assert track[:, 0].std() > 0.9 * each[:, 0].std()


def test_lips_that_features_tell_linearly_are_read_exactly():
    random = np.random.default_rng(0)
    features = smooth(random, 600, 6)
    opening = 3e-3 * features[:, 0] - 2e-3 * np.roll(features[:, 1], 1) + 0.01  # metres
    frames = np.arange(4, 400)
    adaptor = SpeechAdaptor(6)
    read_lips(adaptor, features, frames.astype(float), opening[frames, None])
    with torch.no_grad():
        track = adaptor.track(torch.from_numpy(features)).numpy()[400:-4]  # never heard
    heard = opening[400:-4]
    assert abs(np.corrcoef(track[:, 0], heard)[0, 1]) > 0.999
    assert track[:, 0].std() == pytest.approx(SIZE, rel=0.1)
    assert np.abs(adaptor.lips[1:].numpy()).max() == 0  # an opening is one value


def test_frames_between_rows_and_windows_agree_with_the_track():
    features = smooth(np.random.default_rng(1), 200, 5)
    opening = features[:, :2]
    adaptor = SpeechAdaptor(5)
    positions = np.arange(10, 180) + 0.5
    between = 0.5 * (opening[10:180] + opening[11:181])
    read_lips(adaptor, features, positions, between)
    sound = torch.from_numpy(features)
    with torch.no_grad():
        track = adaptor.track(sound)
        torch.testing.assert_close(adaptor(feature_windows(sound, torch.arange(200))), track)
    found = 0.5 * (track[10:180] + track[11:181])[:, :2].numpy()
    design = np.c_[found, np.ones(170)]
    weights, *_ = np.linalg.lstsq(design, between, rcond=None)
    np.testing.assert_allclose(design @ weights, between, atol=0.12)


def test_noise_is_hardly_read():
    """The damping is chosen on stretches that were left out, where noise tells nothing."""
    random = np.random.default_rng(2)
    features = smooth(random, 300, 30)
    opening = features[:, :1] + 2 * random.normal(size=(300, 1))
    adaptor = SpeechAdaptor(30)
    read_lips(adaptor, features[:250], np.arange(250.0), opening[:250])
    with torch.no_grad():
        track = adaptor.track(torch.from_numpy(features))[250:, 0].numpy()
    assert abs(np.corrcoef(track, features[250:, 0])[0, 1]) > 0.7


def test_lips_that_never_move_change_nothing():
    torch.manual_seed(0)
    adaptor = SpeechAdaptor(6)
    before = {name: value.clone() for name, value in adaptor.state_dict().items()}
    read_lips(adaptor, np.ones((50, 6), np.float32), np.arange(40.0), np.full((40, 3), 0.01))
    for name, value in adaptor.state_dict().items():
        torch.testing.assert_close(value, before[name])


def test_no_more_values_than_are_meant_for_lips():
    random = np.random.default_rng(3)
    features = smooth(random, 400, 40)
    adaptor = SpeechAdaptor(40)
    read_lips(adaptor, features, np.arange(400.0), features[:, :30])
    assert int(adaptor.lips.any(1).sum()) == MOST_VALUES


def test_an_adaptor_of_an_earlier_version_reads_no_lips():
    state = SpeechAdaptor(6).state_dict()
    earlier = {name: value for name, value in state.items() if not name.startswith("lips")}
    adaptor = SpeechAdaptor(6)
    adaptor.lips += 1
    adaptor.restore(earlier)
    assert not adaptor.lips.any()
    torch.testing.assert_close(adaptor.adaptor[0].weight, state["adaptor.0.weight"])
    with pytest.raises(RuntimeError):
        SpeechAdaptor(7).restore(earlier)
