"""Which stretches of a recording are taken for a voice, and what is refused."""

from functools import cache

import numpy as np
import pytest

from support.needs import needs

pytestmark = [needs("pipecat"), needs("espeakng_loader"), pytest.mark.slow]

from ico3d.capture.capture import Sound  # noqa: E402

RATE = 22_050
TEXT = (
    "The quick brown fox jumps over the lazy dog while five young boys watch with pleasure. "
    "Each morning I choose orange juice, toast with cheese, and a large cup of strong coffee. "
)


@cache
def said(times: int) -> np.ndarray:
    """A text as often as that, a second of silence behind each."""
    import soxr

    from ico3d.common.espeak.speech import synthesize

    speech = synthesize(TEXT, "en-us+m3", 150)
    once = 0.5 * soxr.resample(speech.samples, speech.rate, RATE)
    return np.tile(np.concatenate([once, np.zeros(RATE, np.float32)]), times)


def noise(count: int, level: float) -> np.ndarray:
    return np.random.default_rng(0).normal(0, level, count).astype(np.float32)


def music(count: int) -> np.ndarray:
    """Chords, two a second."""
    time = np.arange(count) / RATE
    step = 2 ** (np.floor(time * 2) % 5 / 12)
    tones = (np.sin(2 * np.pi * pitch * step * time) for pitch in (220, 277, 330, 440))
    return (0.1 * sum(tones) * np.exp(-3 * (time * 2 % 1))).astype(np.float32)


def taken(samples):
    from ico3d.creating.voice.stretches import clean_speech

    return clean_speech(Sound(samples.astype(np.float32), RATE))


def test_clean_speech_is_taken_without_its_pauses():
    samples = said(3)
    speech = taken(samples)
    assert not speech.fault
    assert 0.7 * len(samples) / RATE < speech.seconds < len(samples) / RATE - 2
    assert np.abs(speech.samples).max() <= 0.98 and np.isfinite(speech.samples).all()


def test_the_cleaner_half_is_taken():
    soft, loud = noise(len(said(2)), 1e-4), noise(len(said(2)), 0.2)
    speech = taken(np.concatenate([said(2) + soft, said(2) + loud]))
    clean = taken(said(2) + soft)
    assert not speech.fault and speech.seconds == pytest.approx(clean.seconds, abs=1.0)


def test_stretches_are_equally_loud():
    from ico3d.creating.voice.stretches import LEVEL, loudness

    samples = np.concatenate([0.1 * said(2), said(2)])
    speech = taken(samples)
    halves = np.array_split(speech.samples, 2)
    levels = [loudness(half) for half in halves]
    assert not speech.fault and levels == pytest.approx([LEVEL, LEVEL], abs=1.0)


def test_no_more_is_taken_than_is_needed():
    assert taken(said(8)).seconds == pytest.approx(60, abs=0.7)


def test_short_breaks_do_not_end_a_stretch():
    from ico3d.creating.voice.stretches import stretches

    heard = np.zeros(100, bool)
    heard[10:30] = heard[33:50] = heard[60:65] = heard[80:100] = True
    assert np.allclose(stretches(heard, 0.03), [(0.3, 1.5), (2.4, 3.0)])
    assert stretches(np.zeros(0, bool), 0.03) == []


@pytest.mark.parametrize(
    ("samples", "code", "most"),
    [
        (lambda: 0 * said(3), "voice-silent", None),
        (lambda: np.zeros(0), "voice-none", None),
        (lambda: said(1)[: 4 * RATE], "voice-short", 4),
        (lambda: music(30 * RATE), "voice-short", 0),
        (lambda: said(3) + noise(len(said(3)), 0.1), "voice-noisy", 0),
        (lambda: said(3) + music(len(said(3))), "voice-noisy", 0),
        (lambda: np.clip(40 * said(3), -1, 1), "voice-noisy", 0),
    ],
)
def test_what_tells_no_voice_is_refused_with_a_reason(samples, code, most):
    speech = taken(samples())
    assert speech.fault is not None and speech.fault.code == code and not len(speech.samples)
    if most is None:
        assert speech.fault.values == {}
    else:
        assert speech.fault.values["least"] == 10 and 0 <= speech.fault.values["n"] <= most


def test_a_video_without_sound():
    from ico3d.creating.voice.stretches import clean_speech

    assert str(clean_speech(None).fault) == (
        "the avatar is made without a voice of its own: the recording has no sound."
    )
