"""Counts the words that Whisper tiny.en mishears with short windows and with whole ones.

The thirty questions of `bench/talk/questions.json` are spoken by Hibari, in silence and in white
noise at 10 dB. Needs the extra `natural` and its weights.
"""

import json
import re
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import soxr

from ico3d.chat.services.recognition.short_whisper import ShortWhisper
from ico3d.chat.services.voice import hibari
from ico3d.chat.wire.protocol import MICROPHONE_RATE, SPEECH_RATE
from ico3d.cli import run_script
from ico3d.common.weights import model_of

QUESTIONS = Path(__file__).with_name("questions.json")
NOISE = 10.0  # dB that the speech is louder
AROUND = np.zeros(MICROPHONE_RATE // 5, np.float32)


class WholeWindows(ShortWhisper):
    """Whisper as it comes."""

    def encode(self, features: np.ndarray) -> Any:
        return super(ShortWhisper, self).encode(features)


@dataclass(frozen=True)
class Hearing:
    """Options: none."""

    def run(self) -> None:
        """Prints a row for each kind of windows, in silence and in noise."""
        asked = [entry["ask"] for entry in json.loads(QUESTIONS.read_text())]
        sounds = [spoken(text) for text in asked]
        folder = str(model_of("whisper-tiny.en"))
        for kind in (ShortWhisper, WholeWindows):
            model = kind(folder, "cpu", compute_type="int8", cpu_threads=1)
            for noise in (None, NOISE):
                print(kind.__name__, "silence" if noise is None else f"{noise:g} dB", end=": ")
                print(measured(model, asked, sounds, noise))


def spoken(text: str) -> np.ndarray:
    """A question with a little silence around it, (S,) float32 at 16 kHz."""
    pcm = hibari.load().speak(text).pcm.astype(np.float32) / 32768
    return np.concatenate([AROUND, soxr.resample(pcm, SPEECH_RATE, MICROPHONE_RATE), AROUND])


def measured(model: Any, asked: list[str], sounds: list[np.ndarray], noise: float | None) -> str:
    """Share of the words that differ, and processor seconds for each question."""
    random = np.random.default_rng(1)
    errors = count = 0
    began = time.process_time()
    for text, sound in zip(asked, sounds, strict=True):
        level = 0.0 if noise is None else np.sqrt((sound**2).mean()) * 10 ** (-noise / 20)
        noisy = (sound + random.normal(0, level, len(sound))).astype(np.float32)
        segments, _ = model.transcribe(noisy, temperature=0.0, language="en")
        heard = " ".join(s.text for s in segments if s.no_speech_prob < 0.4)
        errors += distance(words(text), words(heard))
        count += len(words(text))
    return f"{errors / count:.3f} of words, {(time.process_time() - began) / len(sounds):.3f} s"


def words(text: str) -> list[str]:
    """The words of a text in small letters; numbers written out."""
    small = text.lower().replace("17", "seventeen").replace("5", "five")
    return re.sub(r"[^a-z ]", "", small).split()


def distance(a: list[str], b: list[str]) -> int:
    """Words to insert, delete or replace."""
    row = list(range(len(b) + 1))
    for i, x in enumerate(a):
        before, row[0] = row[0], i + 1
        for j, y in enumerate(b):
            before, row[j + 1] = row[j + 1], min(row[j + 1] + 1, row[j] + 1, before + (x != y))
    return row[-1]


if __name__ == "__main__":
    sys.exit(run_script(Hearing))
