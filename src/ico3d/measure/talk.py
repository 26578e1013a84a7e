"""Times a conversation from the end of a question to the first sound of the answer."""

import asyncio
import subprocess
import sys
import time
import wave
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.chat.protocol import MICROPHONE_RATE, Interrupt, Metrics, Speech, State
from ico3d.common.espeak import synthesize
from ico3d.errors import BundleError, CaptureError
from ico3d.measure.page import SCHEDULING, Page, open_page

QUESTIONS = ("Who are you?", "What can you do?", "Tell me about yourself.", "How do you work?")
VOICES = ("en-us", "en-us+f3", "en-us+m3", "en-us+m7")
QUIET = 0.02  # of the peak: quieter than this, a question has not begun or is over


@dataclass(frozen=True)
class Turn:
    """One question and the start of its answer, milliseconds.

    Attributes:
        voice_to_voice: From the question's last audible sample to the answer's first sample as
            a page plays it.
        parts: What the server says of the same turn.
    """

    voice_to_voice: float
    parts: dict[str, float]


def summary(turns: list[Turn]) -> dict[str, dict[str, float]]:
    """Median and 95th percentile of the whole and of each part, milliseconds."""
    columns = {"voice_to_voice": [turn.voice_to_voice for turn in turns]}
    for part in turns[0].parts:
        columns[part] = [turn.parts[part] for turn in turns if part in turn.parts]
    return {
        name: {"p50": float(np.percentile(v, 50)), "p95": float(np.percentile(v, 95))}
        for name, v in columns.items()
    }


async def talk(url: str, questions: list[np.ndarray], turns: int, each=lambda turn: None):
    """Asks questions in real time, one after the other.

    Args:
        url: Of the server.
        questions: (S,) int16 at 16 kHz each; they take turns.
        turns: How many answers to time.
        each: Called with every `Turn`.

    Returns:
        The turns.
    """
    page, _ = await open_page(url)
    await page.wait(Speech)
    await silence(page)
    done = []
    for index in range(turns):
        done.append(await ask(page, questions[index % len(questions)]))
        each(done[-1])
        await silence(page)
    await page.close()
    return done


async def ask(page: Page, question: np.ndarray) -> Turn:
    """Asks one question and waits for the start of its answer."""
    since = len(page.log)
    said = page.say(question)
    at, _ = await page.wait(Speech, since)
    _, metrics = await page.wait(Metrics, since, where=lambda m: m.name == "turn")
    return Turn(1000 * (at + SCHEDULING - said), metrics.values)


async def silence(page: Page) -> None:
    """Cuts an answer short and leaves a pause, as a visitor who knows it already."""
    since = len(page.log)
    await page.send(Interrupt(None))
    await page.wait(State, since, where=lambda m: m.state == "idle")
    await asyncio.sleep(0.5)


def made_questions() -> list[np.ndarray]:
    """Questions in several synthetic voices."""
    pairs = zip(QUESTIONS, VOICES, strict=True)
    return [audible(_synthesized(text, voice)) for text, voice in pairs]


def read_question(path: Path) -> np.ndarray:
    """A recorded question.

    Raises:
        CaptureError: If it is no PCM16 mono WAV of 16 kHz.
    """
    try:
        with wave.open(str(path)) as file:
            form = (file.getnchannels(), file.getsampwidth(), file.getframerate())
            data = file.readframes(file.getnframes())
    except (OSError, EOFError, wave.Error) as error:
        raise CaptureError(f"{path}: cannot be read as WAV ({error}).") from error
    if form != (1, 2, MICROPHONE_RATE):
        raise CaptureError(f"{path}: must be PCM16, mono, 16 kHz.")
    return audible(np.frombuffer(data, np.int16))


def audible(samples: np.ndarray) -> np.ndarray:
    """(S,) without the silence before and after, so that its end is the end of speech."""
    level = np.abs(samples.astype(np.float32))
    loud = np.nonzero(level > QUIET * level.max())[0]
    return samples[loud[0] : loud[-1] + 1]


def _synthesized(text: str, voice: str) -> np.ndarray:
    import soxr

    speech = synthesize(text, voice, rate=150)
    samples = soxr.resample(speech.samples, speech.rate, MICROPHONE_RATE)  # (S,)
    return (np.clip(samples, -1, 1) * 32767).astype(np.int16)


@contextmanager
def serving(bundle: Path) -> Iterator[str]:
    """Runs `ico3d serve` as a process of its own; yields its URL.

    Raises:
        BundleError: If it does not start.
    """
    command = [sys.executable, "-m", "ico3d.cli", "serve", str(bundle), "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        first = process.stdout.readline()
        urls = [word for word in first.split() if word.startswith("http")]
        if not urls:
            raise BundleError(f"{bundle}: the server did not start.")
        _wait_until_ready(urls[0])
        yield urls[0]
    finally:
        process.terminate()
        process.wait(10)


def _wait_until_ready(url: str) -> None:
    import urllib.error
    import urllib.request

    end = time.monotonic() + 20
    while True:
        try:
            urllib.request.urlopen(f"{url}health", timeout=5).close()
            return
        except urllib.error.URLError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)
