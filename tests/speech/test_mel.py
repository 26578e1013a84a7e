from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.speech import mel
from ico3d.speech.mel import mel_spectrogram, mel_windows, window_count, window_start
from ico3d.speech.stream import WindowStream


def noise(count, seed=0):
    return np.random.default_rng(seed).uniform(-0.5, 0.5, count).astype(np.float32)


def slow_mel(samples):
    """The front end by its definition: a DFT sum and triangles, one row at a time."""
    y = np.array([samples[0], *(samples[1:] - 0.97 * samples[:-1])], float)
    y = np.concatenate([y[400:0:-1], y, y[-2:-402:-1]])
    n = np.arange(800)
    window = np.sin(np.pi * n / 800) ** 2
    dft = np.exp(-2j * np.pi * np.outer(np.arange(401), n) / 800)
    hertz = np.arange(401) * 20.0

    def to_mel(f):
        return f * 3 / 200 if f < 1000 else 15 + 27 * np.log(f / 1000) / np.log(6.4)

    def to_hertz(m):
        return m * 200 / 3 if m < 15 else 1000 * 6.4 ** ((m - 15) / 27)

    edges = [to_hertz(m) for m in np.linspace(to_mel(55), to_mel(7600), 82)]
    rows = []
    for start in range(0, len(y) - 799, 200):
        magnitude = np.abs(dft @ (y[start : start + 800] * window))
        row = []
        for low, middle, high in zip(edges, edges[1:], edges[2:], strict=False):
            triangle = np.interp(hertz, [low, middle, high], [0, 2 / (high - low), 0])
            decibel = 20 * np.log10(max(1e-5, triangle @ magnitude)) - 20
            row.append(min(4, max(-4, 8 * (decibel + 100) / 100 - 4)))
        rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("count", [801, 3000, 3210])
def test_the_front_end_is_its_definition(count):
    samples = noise(count)
    found = mel_spectrogram(samples)
    assert found.shape == (1 + count // 200, 80)
    np.testing.assert_allclose(found, slow_mel(samples), atol=2e-6)


def test_silence_is_the_lowest_value():
    np.testing.assert_array_equal(mel_spectrogram(np.zeros(1600)), -4)


def test_ten_times_louder_is_twenty_decibels_more():
    quiet = mel_spectrogram(0.1 * noise(8000))
    loud = mel_spectrogram(noise(8000))
    np.testing.assert_allclose(loud - quiet, 8 * 20 / 100, atol=1e-5)


def test_a_tone_is_in_the_filter_around_its_frequency():
    edges = mel._hertz(np.linspace(mel._mel(55.0), mel._mel(7600.0), 82))
    for index in (5, 30, 70):
        tone = 0.5 * np.sin(2 * np.pi * edges[index + 1] * np.arange(8000) / 16000)
        assert mel_spectrogram(tone)[20].argmax() == index


@given(st.integers(16, 10**5))
def test_windows_reach_the_end_of_the_sound_and_not_more(rows):
    count = window_count(rows)
    assert abs(count - (int((rows - 16) / 80 * 25) + 2)) <= 1  # the float formula rounds
    assert window_start(count - 2) + 16 <= rows < window_start(count - 1) + 16 + 4


def test_windows_are_the_rows_they_are_said_to_be():
    samples = noise(16000)
    rows, windows = mel_spectrogram(samples), mel_windows(samples, 16000)
    assert windows.shape == (26, 80, 16) and windows.dtype == np.float32
    for index, window in enumerate(windows):
        item = min(max(index - 2, 0), 21)
        start = min(int(3.2 * item), len(rows) - 16)
        np.testing.assert_array_equal(window, rows[start : start + 16].T)


@pytest.mark.parametrize("frame", [5, 10, 17, 30])
def test_a_click_is_in_the_middle_of_its_frames_window(frame):
    samples = np.zeros(2 * 16000, np.float32)
    samples[frame * 640] = 0.9
    loud = mel_windows(samples, 16000)[frame].max(0) > -3.9
    assert 4 <= np.flatnonzero(loud).mean() <= 8  # rows 0 … 15, the frame begins at row 6.4


@pytest.mark.parametrize("count", [0, 1, 300, 401, 2999, 3000, 3001])
def test_a_short_sound_has_rows_too(count):
    windows = mel_windows(noise(count), 16000)
    assert windows.shape == (6, 80, 16)
    assert np.isfinite(windows).all()


@settings(max_examples=25)
@given(st.integers(0, 20000), st.lists(st.integers(0, 4000), max_size=8))
def test_pieces_give_the_windows_of_the_whole(count, pieces):
    samples = noise(count)
    stream = WindowStream(16000)
    cuts = np.minimum(np.cumsum([0, *pieces]), count)
    found = [stream.push(samples[a:b]) for a, b in pairwise(cuts)]
    found += [stream.push(samples[cuts[-1] :]), stream.finish()]
    np.testing.assert_allclose(np.concatenate(found), mel_windows(samples, 16000), atol=1e-6)


@pytest.mark.parametrize("rate", [22050, 24000, 48000])
def test_pieces_at_another_rate_give_the_windows_of_the_whole(rate):
    samples = noise(rate)
    stream = WindowStream(rate)
    found = [stream.push(piece) for piece in np.array_split(samples, 9)] + [stream.finish()]
    np.testing.assert_allclose(np.concatenate(found), mel_windows(samples, rate), atol=1e-5)
    assert len(mel_windows(samples, rate)) == 26


def test_windows_come_as_soon_as_their_sound_is_there():
    samples = noise(16000)
    stream = WindowStream(16000)
    known = 0
    for end in range(160, 16001, 160):
        known += len(stream.push(samples[end - 160 : end]))
        if end >= 3400:  # the first window is complete
            assert known >= 25 * (end / 16000 - 0.1326)
