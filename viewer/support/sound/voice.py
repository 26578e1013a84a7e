"""A WAV file for the fake microphone: questions and pauses.

Run: python voice.py OUT.wav PART…

A part is a number (seconds of silence), a WAV file, or words for espeak-ng.
"""

import sys
import wave

import numpy as np
import soundfile
import soxr

from ico3d.common.espeak.speech import synthesize

RATE = 48_000  # what Chromium's fake device runs at
LEVEL = 0.2  # of full scale, as people before a laptop; browsers amplify it, and more would clip


def sound(part: str) -> np.ndarray:
    """One part as mono float samples."""
    if part.replace(".", "", 1).isdigit():
        return np.zeros(int(float(part) * RATE), np.float32)
    if part.endswith(".wav"):
        samples, rate = soundfile.read(part, dtype="float32")
    else:
        spoken = synthesize(part)
        samples, rate = spoken.samples, spoken.rate
    samples = soxr.resample(samples, rate, RATE)
    return LEVEL * samples / np.abs(samples).max()


def main() -> None:
    """Does what the file's docstring says."""
    out, *parts = sys.argv[1:]
    samples = np.concatenate([sound(part) for part in parts])
    with wave.open(out, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes(np.int16(samples * 32767).tobytes())


if __name__ == "__main__":
    main()
