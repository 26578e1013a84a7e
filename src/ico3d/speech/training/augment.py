"""Varies synthetic speech as recordings vary: voice, microphone, room, noise (numpy)."""

import functools

import numpy as np

from ico3d.speech.mel import RATE

_COLOURS = 5


def recorded(sound: np.ndarray, other: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """An utterance as it might sound when recorded by some microphone in some room.

    Args:
        sound: (S,) speech at 16 kHz; the timing is kept.
        other: (S',) speech of somebody else at 16 kHz, for the background.
        random: Source of all random choices.

    Returns:
        (S,) float32 within [-1, 1].
    """
    sound = np.asarray(sound, np.float32)
    sound = sound / np.float32(np.sqrt(np.mean(sound**2)) + 1e-9)
    if random.random() < 0.6:
        sound = sound + _breath(sound, random)
    sound = _equalised(sound, random)
    if random.random() < 0.5:
        sound = _reverberant(sound, random)
    if random.random() < 0.3:
        sound = sound + _background(other, len(sound), random)
    if random.random() < 0.85:
        sound = sound + _coloured(len(sound), random) * 10 ** (-random.uniform(8, 60) / 20)
    gain = 10 ** (random.uniform(-42, -12) / 20)
    return np.clip(gain * sound, -1, 1).astype(np.float32)


def _breath(sound: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Noise that follows the speech's envelope: formant voices are too clean."""
    half = RATE // 200  # 5 ms
    energy = np.cumsum(np.pad(sound, (half + 1, half)).astype(np.float64) ** 2)
    mean = (energy[2 * half + 1 :] - energy[: -2 * half - 1]) / (2 * half + 1)  # (S,)
    envelope = np.sqrt(np.maximum(mean, 0)).astype(np.float32)
    return random.uniform(0, 0.25) * envelope * _coloured(len(sound), random)


def _equalised(sound: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """A random smooth frequency response, sometimes with band limits."""
    spectrum = np.fft.rfft(sound)
    hertz = np.linspace(0, RATE / 2, len(spectrum))
    octaves = np.log2(np.maximum(hertz, 50) / 1000)  # -4.3 … 3
    decibel = random.uniform(-4, 3) * octaves
    for cycles in (0.15, 0.3, 0.6):
        phase = random.uniform(0, 2 * np.pi)
        decibel += random.uniform(0, 6) * np.sin(2 * np.pi * cycles * octaves + phase)
    if random.random() < 0.3:
        decibel -= 24 * np.maximum(0, np.log2(np.maximum(hertz, 1) / random.uniform(3000, 7000)))
    if random.random() < 0.4:
        decibel -= 18 * np.maximum(0, np.log2(random.uniform(80, 350) / np.maximum(hertz, 1)))
    shaped = np.fft.irfft(spectrum * (10 ** (decibel / 20)).astype(np.float32), len(sound))
    return shaped / (np.sqrt(np.mean(shaped**2)) + 1e-9)


def _reverberant(sound: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """The sound and its decaying echoes; the direct part stays where it is."""
    decay = random.uniform(0.08, 0.5)  # s to -60 dB
    times = np.arange(int(decay * RATE)) / RATE
    echoes = random.standard_normal(len(times), np.float32)
    echoes *= (10 ** (-3 * times / decay)).astype(np.float32)
    echoes *= random.uniform(0.05, 0.6) / np.sqrt(np.sum(echoes**2))
    echoes[0] = 1.0
    size = 1 << (len(sound) + len(echoes)).bit_length()  # fast to transform
    wet = np.fft.irfft(np.fft.rfft(sound, size) * np.fft.rfft(echoes, size), size)
    return wet[: len(sound)]


def _background(other: np.ndarray, count: int, random: np.random.Generator) -> np.ndarray:
    """Quieter speech of somebody else."""
    other = np.resize(np.roll(other, random.integers(len(other))), count)
    level = np.sqrt(np.mean(other**2)) + 1e-9
    return other / level * 10 ** (-random.uniform(8, 30) / 20)


def _coloured(count: int, random: np.random.Generator) -> np.ndarray:
    """(count,) noise of unit power, white to brown, from a random place of a long recording."""
    track = _noises()[random.integers(_COLOURS)]
    begin = random.integers(len(track) - count)
    return track[begin : begin + count]


@functools.cache
def _noises() -> np.ndarray:
    """(5, 2²¹) noise whose spectrum falls ever more steeply."""
    random = np.random.default_rng(0)
    tracks = []
    for steepness in np.linspace(0, 1, _COLOURS):
        spectrum = np.fft.rfft(random.standard_normal(1 << 21).astype(np.float32))
        hertz = np.maximum(np.linspace(0, RATE / 2, len(spectrum)), 30)
        noise = np.fft.irfft(spectrum * (hertz**-steepness).astype(np.float32))
        tracks.append(noise / np.sqrt(np.mean(noise**2)))
    return np.stack(tracks)
