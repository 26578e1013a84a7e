"""What is said to an avatar under test: recordings of people, or synthetic voices."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.sound import check_claim
from ico3d.chat.wire.protocol import MICROPHONE_RATE
from ico3d.common.espeak.speech import synthesize
from ico3d.common.sound import WAV_ERRORS, open_claim, open_wav
from ico3d.errors import CaptureError

QUESTIONS = ("Who are you?", "What can you do?", "Tell me about yourself.", "How do you work?")
OBJECTIONS = ("Wait, that is not what I meant at all.", "Stop it, I want to ask something else.")
ASSENT = ("Uh-huh.", "Aha.")
VOICES = ("en-us", "en-us+f3", "en-us+m3", "en-us+m7")
QUIET = 0.05  # of the loudest moment: quieter than this, speech has not begun or is over
MOMENT = 320  # samples: 20 ms
OBJECTION = 2.0  # s of a recording that interrupt
SLOW = 150  # words per minute


@dataclass(frozen=True)
class Sayings:
    """Sounds to say, (S,) int16 at 16 kHz each, trimmed of silence.

    Attributes:
        questions: Questions that the avatar is to answer.
        objections: Sentences said over an answer that has to stop.
        assent: "Uh-huh", said over an answer that has to go on.
    """

    questions: list[np.ndarray]
    objections: list[np.ndarray]
    assent: list[np.ndarray]


def sayings(folder: Path | None) -> Sayings:
    """Recordings of a folder as questions and objections; without a folder, synthetic voices.

    Raises:
        CaptureError: If a recording cannot be used, or the folder has no recordings.
    """
    assent = [spoken(text, voice) for text in ASSENT for voice in VOICES]
    if folder is None:
        questions = [spoken(*pair) for pair in zip(QUESTIONS, VOICES, strict=True)]
        return Sayings(questions, [spoken(t, v) for t in OBJECTIONS for v in VOICES], assent)
    files = sorted(folder.glob("*.wav"))
    if not files:
        raise CaptureError(f"{folder}: has no recordings (NAME.wav).")
    questions = [read_recording(path) for path in files]
    most = int(OBJECTION * MICROPHONE_RATE)
    return Sayings(questions, [question[:most] for question in questions], assent)


def read_recording(path: Path) -> np.ndarray:
    """Reads a recorded question, (S,) int16.

    Raises:
        CaptureError: If the file is no PCM16 mono WAV of 16 kHz, or contains only silence.
    """
    try:
        with path.open("rb") as content, open_wav(content) as file:
            form = (file.getnchannels(), file.getsampwidth(), file.getframerate())
            if form != (1, 2, MICROPHONE_RATE):
                raise CaptureError(f"{path}: must be PCM16, mono, 16 kHz.")
            check_claim(path, open_claim(file, path.stat().st_size))
            data = file.readframes(file.getnframes())
    except (OSError, *WAV_ERRORS) as error:
        raise CaptureError(f"{path}: cannot be read as WAV ({error}).") from error
    samples = np.frombuffer(data, np.int16)
    if not samples.any():
        raise CaptureError(f"{path}: is silent.")
    return audible(samples)


def audible(samples: np.ndarray) -> np.ndarray:
    """Samples (S,) without the quiet parts before and after speech."""
    padded = np.pad(samples.astype(np.float32), (0, -len(samples) % MOMENT))
    level = np.sqrt((padded.reshape(-1, MOMENT) ** 2).mean(axis=1))  # RMS by moment
    loud = np.nonzero(level > QUIET * level.max())[0]
    return samples[MOMENT * loud[0] : MOMENT * (loud[-1] + 1)]


def broken_off(samples: np.ndarray) -> np.ndarray:
    """Samples (S,) up to the end of the loudest moment after the first half second.

    Where a voice fades into the room's echo, its end is ambiguous; here it is not.
    """
    begin = MICROPHONE_RATE // 2 // MOMENT
    whole = samples[: len(samples) // MOMENT * MOMENT].astype(np.float32)
    power = (whole.reshape(-1, MOMENT) ** 2).mean(axis=1)  # by moment
    return samples[: MOMENT * (begin + int(power[begin:].argmax()) + 1)]


def spoken(text: str, voice: str) -> np.ndarray:
    """A text, spoken by a synthetic voice, (S,) int16 at 16 kHz."""
    import soxr

    speech = synthesize(text, voice, rate=SLOW)
    samples = soxr.resample(speech.samples, speech.rate, MICROPHONE_RATE)  # (S,)
    return audible((np.clip(samples, -1, 1) * 32767).astype(np.int16))
