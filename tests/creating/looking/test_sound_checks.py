import tracemalloc

import numpy as np

from ico3d.capture.capture import Sound
from ico3d.creating.looking.sound_checks import BLOCK, WINDOW, loudness, sound_advice

RATE = 16_000


def _speech(gain: float = 0.2, floor: float = 1e-4) -> np.ndarray:
    """Ten seconds of a tone that pauses every other second, over noise."""
    time = np.arange(10 * RATE) / RATE
    noise = np.random.default_rng(0).normal(0, floor, len(time))
    return (gain * np.sin(900 * time) * (time % 2 < 1.2) + noise).astype(np.float32)


def _said(samples: np.ndarray) -> list[tuple]:
    return [
        (one.level, one.text.split(":")[0], one.spans) for one in sound_advice(Sound(samples, RATE))
    ]


def test_clear_speech_needs_nothing():
    assert _said(_speech()) == []


def test_without_sound_nothing_can_be_made():
    (found,) = sound_advice(None)
    assert found.level == "refused" and "no sound" in found.text
    (found,) = _said(0 * _speech())
    assert found[0] == "refused" and "silent" in found[1]


def test_clipping_is_told_with_its_seconds():
    samples = _speech()
    samples[6 * RATE : 7 * RATE] = np.clip(9 * samples[6 * RATE : 7 * RATE], -1, 1)
    ((level, text, spans),) = _said(samples)
    assert (level, text) == ("better", "the sound is clipped")
    assert len(spans) == 1 and 5.9 < spans[0][0] < 6.2 and 6.8 < spans[0][1] < 7.1


def test_a_quiet_voice_and_a_noisy_room_are_told():
    assert [text for _, text, _ in _said(_speech(0.01, 1e-5))] == ["the voice is quiet"]
    (noisy,) = _said(_speech(0.2, 0.1))
    assert noisy[1].startswith("noise is nearly as loud")


def test_clipping_is_found_in_every_block_of_a_long_sound():
    samples = np.tile(_speech(), 8)
    at = int((BLOCK + 0.5) * WINDOW * RATE)
    samples[at : at + 3] = 1.0
    ((_, text, spans),) = _said(samples)
    assert text == "the sound is clipped" and abs(spans[0][0] - at / RATE) < WINDOW


def test_a_long_sound_is_not_copied():
    sound = Sound(np.tile(_speech(), 12), RATE)
    tracemalloc.start()
    try:
        assert list(sound_advice(sound)) == []
        assert tracemalloc.get_traced_memory()[1] < sound.samples.nbytes
    finally:
        tracemalloc.stop()


def test_loudness_is_in_decibels_of_full_scale():
    np.testing.assert_allclose(loudness(np.full((3, 1600), 0.1, np.float32)), -20, atol=1e-5)
