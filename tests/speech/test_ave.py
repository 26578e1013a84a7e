"""SyncTalk's encoder from its file to expressions, against a plain reading of its description."""

import subprocess
import sys
import warnings

import numpy as np
import pytest
import torch

from ico3d.cli import main
from ico3d.errors import MissingModelError
from ico3d.speech.encoder import load_encoder
from ico3d.speech.export import export_speech, make_servable
from ico3d.speech.network import SpeechAdaptor
from ico3d.speech.runtime import StreamingExpressions, open_speech
from support.users_weights import write_ave

pytestmark = pytest.mark.slow

# channels in and out, kernel, stride, padding, residual
LAYERS = [
    (1, 32, 3, (1, 1), 1, False),
    (32, 32, 3, (1, 1), 1, True),
    (32, 32, 3, (1, 1), 1, True),
    (32, 64, 3, (3, 1), 1, False),
    (64, 64, 3, (1, 1), 1, True),
    (64, 64, 3, (1, 1), 1, True),
    (64, 128, 3, (3, 3), 1, False),
    (128, 128, 3, (1, 1), 1, True),
    (128, 128, 3, (1, 1), 1, True),
    (128, 256, 3, (3, 2), 1, False),
    (256, 256, 3, (1, 1), 1, True),
    (256, 512, 3, (1, 1), 0, False),
    (512, 512, 1, (1, 1), 0, False),
]


def speech(seconds=1.7, rate=16000):
    times = np.arange(int(seconds * rate)) / rate
    tone = np.sin(2 * np.pi * 140 * times + 3 * np.sin(2 * np.pi * 5 * times))
    noise = np.random.default_rng(2).normal(0, 0.2, len(times))
    return (0.2 * (tone + noise) * (1 + np.sin(2 * np.pi * 3 * times))).astype(np.float32)


def slow_mel(x):
    """(M, 80): pre-emphasis, centred spectra of 800 samples every 200, slaney mels, decibels."""
    y = np.array([x[0], *(x[i] - 0.97 * x[i - 1] for i in range(1, len(x)))])
    y = np.pad(y, 400, mode="reflect")
    hann = np.array([0.5 - 0.5 * np.cos(2 * np.pi * n / 800) for n in range(800)])
    count = 1 + len(x) // 200
    power = np.array(
        [abs(np.fft.fft(y[200 * m : 200 * m + 800] * hann)[:401]) for m in range(count)]
    )

    def mel(f):
        return f * 3 / 200 if f < 1000 else 15 + 27 * np.log(f / 1000) / np.log(6.4)

    def hertz(m):
        return m * 200 / 3 if m < 15 else 1000 * 6.4 ** ((m - 15) / 27)

    edges = [hertz(m) for m in np.linspace(mel(55), mel(7600), 82)]
    filters = np.zeros((80, 401))
    for band in range(80):
        low, middle, high = edges[band : band + 3]
        for k in range(401):
            f = 20.0 * k
            rise, fall = (f - low) / (middle - low), (high - f) / (high - middle)
            filters[band, k] = max(0, min(rise, fall)) * 2 / (high - low)
    decibel = 20 * np.log10(np.maximum(1e-5, power @ filters.T)) - 20
    return np.clip(8 * (decibel + 100) / 100 - 4, -4, 4)


def slow_windows(mel):
    """(T, 80, 16): rows int(3.2 i) … + 16, clamped; the first and the last twice more."""
    count = int((len(mel) - 16) / 80 * 25) + 2
    windows = []
    for i in range(count):
        start = int(3.2 * i)
        windows.append(mel[-16:] if start + 16 > len(mel) else mel[start : start + 16])
    return np.array([windows[0]] * 2 + windows + [windows[-1]] * 2).transpose(0, 2, 1)


def slow_encoder(state, window):
    """(512,) of one window (80, 16): sums over every output, one position after the other."""
    x = window[None]
    for n, (inputs, outputs, kernel, (down, across), pad, residual) in enumerate(LAYERS):
        weight, bias = state[f"{n}.conv_block.0.weight"], state[f"{n}.conv_block.0.bias"]
        assert weight.shape == (outputs, inputs, kernel, kernel)
        padded = np.pad(x, ((0, 0), (pad, pad), (pad, pad)))
        rows = (padded.shape[1] - kernel) // down + 1
        columns = (padded.shape[2] - kernel) // across + 1
        y = np.zeros((outputs, rows, columns))
        for r in range(rows):
            for c in range(columns):
                part = padded[:, r * down : r * down + kernel, c * across : c * across + kernel]
                y[:, r, c] = weight.reshape(outputs, -1) @ part.ravel() + bias
        mean, var = (state[f"{n}.conv_block.1.running_{k}"][:, None, None] for k in ("mean", "var"))
        scale, shift = (state[f"{n}.conv_block.1.{k}"][:, None, None] for k in ("weight", "bias"))
        y = (y - mean) / np.sqrt(var + 1e-5) * scale + shift
        x = np.maximum(0, y + x if residual else y)
    return x.ravel()


def slow_expressions(adaptor, features, silence):
    """(T, 32): three layers, then the learnt mean over rows [i − 4, i + 4), silence around."""
    leaky = lambda x: np.where(x > 0, x, 0.02 * x)  # noqa: E731
    state = {name: value.double().numpy() for name, value in adaptor.state_dict().items()}
    rows = np.concatenate([silence[None]] * 4 + [features] + [silence[None]] * 3)
    for n in (0, 2, 4):
        rows = rows @ state[f"adaptor.{n}.weight"].T + state[f"adaptor.{n}.bias"]
        rows = leaky(rows) if n < 4 else rows
    out = []
    for i in range(len(features)):
        x = rows[i : i + 8]  # (8, 32)
        y = x.T
        for n in range(0, 10, 2):
            weight = state[f"attention.convolutions.{n}.weight"]  # (out, in, 3)
            padded = np.pad(y, ((0, 0), (1, 1)))
            y = sum(weight[:, :, k] @ padded[:, k : k + 8] for k in range(3))
            y = leaky(y + state[f"attention.convolutions.{n}.bias"][:, None])
        scores = state["attention.scores.weight"] @ y[0] + state["attention.scores.bias"]
        share = np.exp(scores - scores.max())
        out.append((share / share.sum()) @ x)
    return np.array(out)


@pytest.fixture(scope="module")
def users(tmp_path_factory):
    """A file in the published format in the user's folder, its tensors, an adaptor."""
    home = tmp_path_factory.mktemp("home")
    network = write_ave(home)
    numbers = {name: value.double().numpy() for name, value in network.state_dict().items()}
    return home, numbers, SpeechAdaptor(512)


@pytest.fixture(scope="module")
def at_home(users):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ICO3D_MODELS", str(users[0]))
        patch.setenv("HOME", str(users[0]))
        yield users


@pytest.fixture(scope="module")
def served(at_home):
    """The model as a server opens it, and its graph and encoder."""
    _, _, adaptor = at_home
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        encoder = load_encoder("ave")
        make_servable(encoder)
        graph = export_speech(adaptor, encoder)
        return open_speech(graph, "ave", encoder.sha256, "features"), graph, encoder


def test_all_of_it_is_what_a_slow_reading_says(at_home, served):
    _, state, adaptor = at_home
    samples = speech(0.9)
    windows = slow_windows(slow_mel(samples.astype(float)))
    features = np.array([slow_encoder(state, window) for window in windows])
    model, _, encoder = served
    np.testing.assert_allclose(encoder.features(samples, 16000), features, rtol=1e-3, atol=1e-4)
    assert np.ptp(features, axis=0).max() > 0.1
    silence = slow_encoder(state, np.full((80, 16), -4.0))
    expected = slow_expressions(adaptor, features, silence)
    np.testing.assert_allclose(model.expressions(samples, 16000), expected, atol=1e-4)


@pytest.mark.parametrize("slice_ms", [100, 160, 200])
@pytest.mark.parametrize("rate", [16000, 24000])
def test_slices_give_what_the_whole_gives(served, slice_ms, rate):
    model = served[0]
    samples = speech(1.7, rate)
    stream, piece = StreamingExpressions(model, rate), rate * slice_ms // 1000
    rows = [stream.push(samples[at : at + piece]) for at in range(0, len(samples), piece)]
    rows.append(stream.finish())
    whole = model.expressions(samples, rate)
    np.testing.assert_allclose(np.concatenate(rows), whole, atol=1e-5)


def test_slices_give_what_torch_gives_inside(served, at_home):
    model, _, encoder = served
    samples = speech(1.7)
    with torch.no_grad():
        expected = at_home[2].track(torch.from_numpy(encoder.features(samples, 16000))).numpy()
    found = model.expressions(samples, 16000)
    np.testing.assert_allclose(found[4:-3], expected[4:-3], atol=1e-5)


def test_a_server_needs_no_torch_and_tells_the_licence_once(served, at_home, tmp_path):
    (tmp_path / "speech.onnx").write_bytes(served[1])
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "import numpy as np\n"
        "from pathlib import Path\n"
        "from ico3d.speech.runtime import open_speech\n"
        "for _ in range(2):\n"
        f"    model = open_speech(Path({str(tmp_path / 'speech.onnx')!r}).read_bytes(),\n"
        f"        'ave', {served[2].sha256!r}, 'features')\n"
        "print(model.expressions(np.zeros(16000, np.float32), 16000).shape)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "(26, 32)"
    assert done.stderr.count("CC BY-NC 4.0") == 1


def test_an_encoder_that_is_not_here_is_one_sentence(served, tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    _, graph, encoder = served
    with warnings.catch_warnings(), pytest.raises(MissingModelError) as caught:
        warnings.simplefilter("ignore")
        open_speech(graph, "ave", encoder.sha256, "features")
    assert str(caught.value) == (
        f"this avatar listens with the speech encoder 'ave', which is not here as "
        f"'ave-{encoder.sha256[:12]}.onnx': make it with ico3d weights onnx ave where torch is "
        f"installed, and put it into {tmp_path}/.cache/ico3d/models."
    )


def test_the_verb_makes_the_same_file(at_home, served, capsys):
    assert main(["weights", "onnx", "ave"]) == 0
    name = f"ave-{served[2].sha256[:12]}.onnx"
    assert f"ave is servable here: {at_home[0] / '.cache' / 'ico3d' / 'models' / name}" in (
        capsys.readouterr().out
    )
