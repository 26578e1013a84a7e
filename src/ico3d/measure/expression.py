"""Measures speed, accuracy and stillness of the mouth for every installed speech encoder."""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from threadpoolctl import threadpool_limits

from ico3d.bundle.format import SPEECH, Bundle
from ico3d.capture.sound import check_claim
from ico3d.common.sound import file_claim
from ico3d.common.weights import cached
from ico3d.errors import SettingsError
from ico3d.measure.alignment import aligned, transcripts
from ico3d.measure.lips import lip_correlation, lip_lag_ms
from ico3d.speech.articulation import ARTICULATION, articulation_track
from ico3d.speech.encoder import FrozenEncoder, load_encoder
from ico3d.speech.export import export_encoder, export_speech
from ico3d.speech.mel import FPS, RATE
from ico3d.speech.network import AudioEncoder, SpeechAdaptor
from ico3d.speech.runtime import SpeechModel, StreamingExpressions, open_speech
from ico3d.speech.training.augment import recorded
from ico3d.speech.training.corpus import utterance

SLICE, STEP = RATE * 160 // 1000, RATE * 600 // 1000
"""Samples per piece: in short slices, and as the server takes a voice."""
SPOKEN, SECONDS = 40, 3.0
"""Number of synthetic utterances that the lip reading is fitted on, and their length in seconds."""
FORGOTTEN = 0.3
"""Seconds after the end of speech from which on the mouth must rest."""
TIMED = 2.0
"""Seconds of processor time for measuring speed; the result is the median of its rounds."""

_DAMPING = 1e-2
Hears = Callable[[np.ndarray, int], np.ndarray]
"""Function from samples (S,) and their rate to rows (T, C) at 25 per second."""


@dataclass(frozen=True)
class Recording:
    """A recording of a person who speaks.

    Attributes:
        name: Name of the file.
        samples: (S,) at 16 kHz in [-1, 1].
        opening: (T,) how far the lips are open at i/25 s, 0 to 1, by forced alignment.
    """

    name: str
    samples: np.ndarray
    opening: np.ndarray


@dataclass(frozen=True)
class Subject:
    """A speech model to measure.

    Attributes:
        model: The model as a server runs it; an encoder without an avatar has a random adaptor.
        hears: What the lip reading is fitted on: an encoder's features, or an avatar's expressions.
            None for random weights, which can only be timed.
    """

    model: SpeechModel
    hears: Hears | None


def read_recordings(folder: Path) -> list[Recording]:
    """Reads and aligns the recordings of a folder (see `transcripts`).

    Raises:
        MissingExtraError: If pocketsphinx or soundfile is not installed.
        SettingsError: If a recording cannot be read or aligned.
    """
    import soundfile

    found = []
    for path, words in transcripts(folder).items():
        claim = file_claim(path)
        if (claim.rate, claim.channels) != (RATE, 1):
            raise SettingsError(f"{path} is not mono at {RATE} Hz.")
        check_claim(path, claim)
        samples, _ = soundfile.read(path, dtype="int16")  # (S,)
        phonemes, end = aligned(samples, words)
        times = np.arange(int(len(samples) / RATE * FPS) + 1) / FPS
        track = articulation_track(phonemes, end, times)  # (T, 5)
        opening = track[:, ARTICULATION.index("opening")]
        found.append(Recording(path.name, samples.astype(np.float32) / 32768, opening))
    return found


def subjects(avatar: Bundle, untrained: tuple[str, ...]) -> dict[str, Callable[[], Subject]]:
    """Functions that load each speech model that can be measured on this machine, by name.

    Args:
        avatar: A bundle whose head is driven by speech.
        untrained: Encoders to time with random weights if their own are not installed.
    """
    made: dict[str, Callable[[], Subject]] = {
        "avatar": lambda: _avatar(avatar),
        "builtin": lambda: _encoder(load_encoder("builtin")),
    }
    for name, random in (("ave", random_ave), ("hubert", random_hubert)):
        if cached(name) is not None:
            made[name] = lambda name=name: _encoder(load_encoder(name))
        elif name in untrained:
            made[f"{name} (random)"] = lambda random=random: _encoder(random(), trained=False)
    return made


def _avatar(bundle: Bundle) -> Subject:
    speech = bundle.manifest.speech
    if speech is None:
        raise SettingsError(f"the head of '{bundle.manifest.name}' is not driven by speech.")
    model = open_speech(bundle.read(SPEECH), speech.encoder, speech.sha256, speech.input)
    return Subject(model, model.expressions)


def _encoder(encoder: FrozenEncoder, trained: bool = True) -> Subject:
    torch.manual_seed(0)
    adaptor = SpeechAdaptor(encoder.size, encoder.vectors)
    graph = export_speech(adaptor, encoder)
    outside = None if encoder.name == "builtin" else export_encoder(encoder)
    return Subject(SpeechModel(graph, outside), encoder.features if trained else None)


def random_ave() -> FrozenEncoder:
    """SyncTalk's encoder with random weights."""
    torch.manual_seed(0)
    network = AudioEncoder().eval().requires_grad_(False)
    return FrozenEncoder("ave", AudioEncoder.size, "", network)


def random_hubert() -> FrozenEncoder:
    """HuBERT large (315 million weights) with random weights.

    Raises:
        MissingExtraError: If transformers is not installed.
    """
    from ico3d.errors import MissingExtraError
    from ico3d.speech.hubert import VECTORS, Hubert

    try:
        from transformers import HubertConfig, HubertModel
    except ImportError:
        raise MissingExtraError("transformers", "hubert", "the speech encoder 'hubert'") from None
    config = HubertConfig(
        hidden_size=1024,
        num_hidden_layers=24,
        num_attention_heads=16,
        intermediate_size=4096,
        conv_bias=True,
        feat_extract_norm="layer",
        do_stable_layer_norm=True,
    )
    network = Hubert(HubertModel(config)).eval().requires_grad_(False)
    return FrozenEncoder("hubert", network.size, "", network, "sound", VECTORS)


def measure(subject: Subject, recordings: list[Recording]) -> dict:
    """The figures of one speech model.

    Returns:
        `real_time_factor`: seconds of sound per second of processor time, in the server's steps;
        `real_time_factor_slices`: the same for slices of 160 ms; `streaming_difference`: largest
        difference between slices and the whole sound; `silence_opening`: distance of the mouth from
        rest (distance of expressions, divided by its median during speech) in digital silence, in
        white noise of -60 dB, and from 0.3 s after speech; `lip_correlation` and `lip_lag_ms` by
        file: a linear reading of the lips' opening, fitted on synthetic voices, against forced
        alignment; None for random weights.
    """
    _, stepped = _timed(subject.model, recordings, STEP)
    streams, sliced = _timed(subject.model, recordings, SLICE)
    wholes = [subject.model.expressions(recording.samples, RATE) for recording in recordings]
    pairs = list(zip(streams, wholes, strict=True))
    figures: dict = {
        "real_time_factor": stepped,
        "real_time_factor_slices": sliced,
        "streaming_difference": max(float(np.abs(a - b).max()) for a, b in pairs),
        "silence_opening": _silences(subject.model, recordings, np.concatenate(wholes)),
        "lip_correlation": None,
        "lip_lag_ms": None,
    }
    if subject.hears is None:
        return figures
    read = reading(subject.hears)
    tracks = {r.name: (read(subject.hears(r.samples, RATE)), r.opening) for r in recordings}
    tracks = {name: (a[: len(b)], b[: len(a)]) for name, (a, b) in tracks.items()}
    figures["lip_correlation"] = {name: lip_correlation(*pair) for name, pair in tracks.items()}
    figures["lip_lag_ms"] = {name: lip_lag_ms(*pair, FPS) for name, pair in tracks.items()}
    return figures


def _timed(
    model: SpeechModel, recordings: list[Recording], size: int
) -> tuple[list[np.ndarray], float]:
    """The rows of each recording, and how many times as fast as the sound they came."""
    _streamed(model, np.zeros(size, np.float32))  # what the first run does once
    streams, spent = [], []
    while sum(spent) < TIMED:
        before = time.process_time()
        streams = [_streamed(model, recording.samples, size) for recording in recordings]
        spent.append(time.process_time() - before)
    seconds = sum(len(recording.samples) for recording in recordings) / RATE
    return streams, seconds / float(np.median(spent))


def _streamed(model: SpeechModel, samples: np.ndarray, size: int = SLICE) -> np.ndarray:
    """(T, 32) of a sound that arrives in slices."""
    stream = StreamingExpressions(model, RATE)
    rows = [stream.push(samples[at : at + size]) for at in range(0, len(samples), size)]
    return np.concatenate([*rows, stream.finish()])


def _silences(model: SpeechModel, recordings: list[Recording], spoken: np.ndarray) -> dict:
    """How far the mouth is from rest where nobody speaks."""
    rest = model.silent_expression
    usual = float(np.median(np.linalg.norm(spoken - rest, axis=1)))
    noise = np.random.default_rng(0).normal(0, 1e-3, 2 * RATE)
    worst = {
        "digital": _streamed(model, np.zeros(2 * RATE, np.float32)),
        "noise": _streamed(model, noise.astype(np.float32)),
        "after_speech": np.concatenate([_after(model, r.samples) for r in recordings]),
    }
    distances = {name: np.linalg.norm(rows - rest, axis=1) for name, rows in worst.items()}
    return {name: float(values.max()) / usual for name, values in distances.items()}


def _after(model: SpeechModel, samples: np.ndarray) -> np.ndarray:
    """Rows from a moment after a sound's end on, digital silence following it."""
    rows = _streamed(model, np.concatenate([samples, np.zeros(RATE, np.float32)]))
    return rows[int((len(samples) / RATE + FORGOTTEN) * FPS) + 1 :]


def reading(hears: Hears) -> Callable[[np.ndarray], np.ndarray]:
    """Fits a linear reading of the lips' opening, (T, C) to (T,), on synthetic voices.

    Raises:
        MissingExtraError: If espeak-ng or soxr is not installed.
    """
    random = np.random.default_rng(0)
    spoken = [utterance(random, SECONDS, held_out=False) for _ in range(SPOKEN)]
    rows, wanted = [], []
    for number, (sound, phonemes) in enumerate(spoken):
        found = hears(recorded(sound, spoken[number - 1][0], random), RATE)  # (T, C)
        track = articulation_track(phonemes, SECONDS, np.arange(len(found)) / FPS)
        rows.append(found)
        wanted.append(track[:, ARTICULATION.index("opening")])
    x, y = np.concatenate(rows).astype(np.float64), np.concatenate(wanted)
    mean, deviation = x.mean(0), x.std(0) + 1e-9
    z = (x - mean) / deviation
    weights = np.linalg.solve(
        z.T @ z + _DAMPING * len(z) * np.eye(z.shape[1]), z.T @ (y - y.mean())
    )
    return lambda rows: (rows - mean) / deviation @ weights + y.mean()


@threadpool_limits.wrap(limits=1, user_api="blas")  # as in a server
def bench(folder: Path, avatar: Bundle, untrained: tuple[str, ...]) -> dict[str, dict]:
    """Measures all speech models on the recordings of a folder, with a progress bar.

    Returns:
        The figures of `measure` by name of the model.
    """
    from rich.progress import track

    recordings = read_recordings(folder)
    figures = {}
    for name, make in track(subjects(avatar, untrained).items(), "listening", transient=True):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of licences: nothing is kept
            figures[name] = measure(make(), recordings)
    return figures
