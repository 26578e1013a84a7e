"""HuBERT made small and random, in the format of the published one."""

import json
import subprocess
import sys

import numpy as np
import pytest
import torch

from ico3d.errors import MissingModelError, ModelError
from ico3d.speech.blocks import SIZE, sound_blocks
from ico3d.speech.encoder import load_encoder
from ico3d.speech.export import export_speech, make_servable
from ico3d.speech.network import SpeechAdaptor
from ico3d.speech.runtime import SpeechModel, StreamingExpressions
from support.needs import needs
from support.users_weights import write_hubert

pytestmark = [pytest.mark.slow, needs("transformers")]


def sound(seconds, rate=16000, seed=0):
    random = np.random.default_rng(seed)
    times = np.arange(int(seconds * rate)) / rate
    loud = 0.1 * (1.1 + np.sin(2 * np.pi * 1.5 * times))
    return (loud * random.normal(0, 1, len(times))).astype(np.float32)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_hubert(tmp_path_factory.mktemp("models"))


@pytest.fixture(autouse=True)
def users(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(folder[0].parent))
    monkeypatch.setenv("HOME", str(tmp_path))


@pytest.fixture(scope="module")
def served(folder, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ICO3D_MODELS", str(folder[0].parent))
        patch.setenv("HOME", str(tmp_path_factory.mktemp("home")))
        encoder = load_encoder("hubert")
        adaptor = SpeechAdaptor(encoder.size, encoder.vectors)
        graph, file = export_speech(adaptor, encoder), make_servable(encoder)
    return encoder, adaptor, graph, file


def test_features_are_what_transformers_says_of_the_same_windows(folder):
    encoder = load_encoder("hubert")
    assert (encoder.size, encoder.vectors, encoder.input) == (64, 2, "sound")
    samples = sound(3.3)
    features = encoder.features(samples, 16000)
    assert features.shape == (83, 64) and features.dtype == np.float32
    # row 47 is in window 9, which sees rows 25 … 55 and two vectors for each
    part = torch.from_numpy(samples[25 * 640 : 25 * 640 + SIZE].copy())
    import transformers

    processor = transformers.Wav2Vec2FeatureExtractor(do_normalize=True)
    inputs = processor(part.numpy(), sampling_rate=16000, return_tensors="pt").input_values
    with torch.no_grad():
        vectors = folder[1].hubert(inputs).last_hidden_state[0]  # (60, 32)
    assert vectors.shape == (60, 32)
    np.testing.assert_allclose(features[47], vectors[44:46].flatten().numpy(), atol=1e-4)


def test_windows_have_sound_in_their_middle_and_silence_where_none_is():
    samples = np.ones(16000, np.float32)
    samples[::2] = -1
    blocks, count = sound_blocks(samples, 16000)
    assert count == 26 and blocks.shape == (6, SIZE)
    assert not blocks[0, : 20 * 640].any() and blocks[0, 20 * 640 :].all()
    np.testing.assert_allclose(blocks[0, 20 * 640 :], samples[: SIZE - 20 * 640], atol=1e-6)
    assert blocks[5, : 15 * 640].any() and not blocks[5, 20 * 640 :].any()  # rows 25 … 30


@pytest.mark.parametrize("seconds", [0, 0.01, 0.2, 1.0, 2.0])
def test_there_is_a_row_for_every_frame(served, seconds):
    rows = load_encoder("hubert").features(sound(seconds), 16000)
    assert len(rows) == int(seconds * 25) + 1
    model = SpeechModel(served[2], served[3])
    assert len(model.expressions(sound(seconds), 16000)) == len(rows)


def test_what_is_served_is_what_torch_trains(served):
    encoder, adaptor, graph, file = served
    samples = sound(2.3)
    with torch.no_grad():
        expected = adaptor.track(torch.from_numpy(encoder.features(samples, 16000))).numpy()
    model = SpeechModel(graph, file)
    found = model.expressions(samples, 16000)
    np.testing.assert_allclose(found[4:-3], expected[4:-3], atol=1e-5)
    assert np.ptp(found, axis=0).max() > 1e-3


@pytest.mark.parametrize("slice_ms", [100, 160, 200])
@pytest.mark.parametrize("rate", [16000, 24000])
def test_slices_give_what_the_whole_gives(served, slice_ms, rate):
    model = SpeechModel(served[2], served[3])
    samples = sound(2.1, rate)
    stream, piece = StreamingExpressions(model, rate), rate * slice_ms // 1000
    rows = [stream.push(samples[at : at + piece]) for at in range(0, len(samples), piece)]
    rows.append(stream.finish())
    whole = model.expressions(samples, rate)
    np.testing.assert_allclose(np.concatenate(rows), whole, atol=1e-5)


def test_a_row_waits_for_no_more_than_its_look_ahead(served):
    stream = StreamingExpressions(SpeechModel(served[2], served[3]), 16000)
    samples, known = sound(2.0), 0
    for end in range(320, len(samples) + 1, 320):
        known += len(stream.push(samples[end - 320 : end]))
        assert known >= 25 * (end / 16000 - 0.53)


def test_the_future_beyond_the_look_ahead_changes_nothing(served):
    model = SpeechModel(served[2], served[3])
    samples = sound(2.0)
    other = np.concatenate([samples[: 30 * 640], sound(0.8, seed=9)])
    before, after = (model.expressions(s, 16000) for s in (samples, other))
    np.testing.assert_allclose(before[:17], after[:17], atol=1e-5)  # 30 − 3 − 5 − 5
    assert np.abs(before[25:30] - after[25:30]).max() > 1e-4


def test_a_server_needs_no_torch(served, tmp_path):
    (tmp_path / "speech.onnx").write_bytes(served[2])
    code = (
        "import sys; sys.modules['torch'] = sys.modules['transformers'] = None\n"
        "import numpy as np\n"
        "from ico3d.speech.runtime import SpeechModel\n"
        f"model = SpeechModel({str(tmp_path / 'speech.onnx')!r}, {str(served[3])!r})\n"
        "print(model.expressions(np.zeros(16000, np.float32), 16000).shape)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "(26, 32)"


def test_what_is_not_hubert_is_one_sentence(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    with pytest.raises(MissingModelError, match="ico3d weights fetch hubert"):
        load_encoder("hubert")
    other = tmp_path / "hubert-large-ls960-ft"
    other.mkdir()
    config = json.loads((folder[0] / "config.json").read_text())
    (other / "config.json").write_text(json.dumps(config))
    with pytest.raises(ModelError, match="holds no weights"):
        load_encoder("hubert")
    state = torch.load(folder[0] / "pytorch_model.bin", weights_only=True)
    lacking = {k: v for k, v in state.items() if "layers.1.attention.k_proj" not in k}
    torch.save(lacking, other / "pytorch_model.bin")
    with pytest.raises(ModelError, match=r"it lacks .*k_proj"):
        load_encoder("hubert")
    (other / "pytorch_model.bin").write_text("hello")
    with pytest.raises(ModelError, match="does not hold HuBERT"):
        load_encoder("hubert")
