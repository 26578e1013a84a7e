import subprocess
import sys

import numpy as np
import onnx
import pytest
import torch
from onnx import numpy_helper

from ico3d.errors import ModelError
from ico3d.speech.encoder import FrozenEncoder, load_encoder
from ico3d.speech.export import export_encoder, export_speech
from ico3d.speech.mel import mel_windows
from ico3d.speech.network import AudioEncoder, SpeechAdaptor
from ico3d.speech.runtime import SpeechModel, StreamingExpressions


def sound(seconds, rate=16000, seed=0):
    samples = np.random.default_rng(seed).normal(0, 0.1, int(rate * seconds))
    return samples.astype(np.float32)


@pytest.fixture(scope="module")
def builtin():
    torch.manual_seed(3)
    encoder = load_encoder()
    adaptor = SpeechAdaptor(encoder.size)
    adaptor.lips.copy_(torch.randn_like(adaptor.lips).mul(0.02).half())
    torch.nn.init.normal_(adaptor.lips_rest)
    return encoder, adaptor, export_speech(adaptor, encoder)


@pytest.fixture(scope="module")
def ave():
    torch.manual_seed(4)
    network = AudioEncoder()
    network(torch.randn(8, 1, 80, 16))  # moves the running means
    return FrozenEncoder("ave", 512, "", network.eval())


def track(encoder, adaptor, samples):
    """What torch says of a sound with silence around."""
    silence = encoder.features(np.zeros(32000, np.float32), 16000)[25:26]
    around = [
        silence.repeat(4, axis=0),
        encoder.features(samples, 16000),
        silence.repeat(3, axis=0),
    ]
    with torch.no_grad():
        return adaptor.track(torch.from_numpy(np.concatenate(around)))[4:-3].numpy()


def test_the_graph_is_the_torch_model(builtin):
    encoder, adaptor, model = builtin
    samples = sound(2.3)
    expected = track(encoder, adaptor, samples)
    found = SpeechModel(model).expressions(samples, 16000)
    assert found.shape == (len(expected), 32) and found.dtype == np.float32
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert np.ptp(found, axis=0).max() > 1e-3
    assert len(model) < 1_000_000


@pytest.mark.parametrize("rows", [1, 2, 7, 8, 60])
def test_any_number_of_rows(builtin, rows):
    encoder, adaptor, model = builtin
    windows = np.random.default_rng(rows).normal(0, 1, (rows, 80, 16)).astype(np.float32)
    with torch.no_grad():
        expected = adaptor.track(encoder.network(torch.from_numpy(windows)[:, None])).numpy()
    np.testing.assert_allclose(SpeechModel(model).run(windows), expected, atol=1e-5)


def test_with_the_users_encoder_the_graph_takes_features(ave, tmp_path):
    adaptor = SpeechAdaptor(512)
    model, encoder = export_speech(adaptor, ave), export_encoder(ave)
    samples = sound(1.0)
    expected = track(ave, adaptor, samples)
    (tmp_path / "ave.onnx").write_bytes(encoder)
    found = SpeechModel(model, tmp_path / "ave.onnx").expressions(samples, 16000)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    with pytest.raises(ModelError, match="not in the bundle"):
        SpeechModel(model)


def test_an_encoder_that_does_not_fit_is_refused(builtin, ave):
    model = export_speech(SpeechAdaptor(512), ave)
    with pytest.raises(ModelError, match="gives 64 features, this avatar needs 512"):
        SpeechModel(model, export_encoder(builtin[0]))
    with pytest.raises(ModelError, match="no usable ONNX model"):
        SpeechModel(b"hello")


@pytest.mark.parametrize(("rate", "piece"), [(16000, 1600), (16000, 37), (24000, 2400)])
def test_pieces_give_the_rows_of_the_whole(builtin, rate, piece):
    model = SpeechModel(builtin[2])
    samples = sound(0.4 if piece == 37 else 2.1, rate)
    stream = StreamingExpressions(model, rate)
    rows = [stream.push(samples[i : i + piece]) for i in range(0, len(samples), piece)]
    rows.append(stream.finish())
    np.testing.assert_allclose(np.concatenate(rows), model.expressions(samples, rate), atol=1e-5)


def test_a_row_waits_for_no_more_than_its_look_ahead(builtin):
    stream = StreamingExpressions(SpeechModel(builtin[2]), 16000)
    samples = sound(1.5)
    known = 0
    for end in range(320, len(samples) + 1, 320):
        known += len(stream.push(samples[end - 320 : end]))
        assert known >= 25 * (end / 16000 - 0.2526)
    assert known + len(stream.finish()) == len(mel_windows(samples, 16000))


def test_an_empty_sound_has_rows_of_silence(builtin):
    stream = StreamingExpressions(SpeechModel(builtin[2]), 16000)
    expected = SpeechModel(builtin[2]).expressions(np.zeros(0, np.float32), 16000)
    np.testing.assert_allclose(stream.finish(), expected, atol=1e-5)


def test_serving_needs_no_torch(builtin, tmp_path):
    (tmp_path / "speech.onnx").write_bytes(builtin[2])
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "import numpy as np\n"
        "from ico3d.speech.runtime import SpeechModel\n"
        "from ico3d.speech.eyes import EyeBehaviour\n"
        f"model = SpeechModel({str(tmp_path / 'speech.onnx')!r})\n"
        "rows = model.expressions(np.zeros(16000, np.float32), 16000)\n"
        "print(rows.shape, EyeBehaviour(0).values(np.zeros(1)).shape)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "(26, 32) (1, 7)"


def test_weights_that_decayed_to_nothing_are_nothing(builtin):
    encoder = builtin[0]
    adaptor = SpeechAdaptor(encoder.size)
    decayed = adaptor.attention.convolutions[0].weight
    with torch.no_grad():
        decayed.mul_(1e-37)
    assert decayed.abs().max() > 0
    model = export_speech(adaptor, encoder)
    for weight in onnx.load_from_string(model).graph.initializer:
        value = numpy_helper.to_array(weight)
        assert not (value.dtype.kind == "f" and ((value != 0) & (abs(value) < 1e-20)).any())
    samples = sound(1.0)
    found = SpeechModel(model).expressions(samples, 16000)
    np.testing.assert_allclose(found, track(encoder, adaptor, samples), atol=1e-5)
