"""The avatar's own sound, come back through a room, is silence to it; a visitor's voice is not."""

import numpy as np
import pytest
import soxr
from pipecat.audio.vad.vad_analyzer import VADState

from ico3d.chat.settings.conversation import Turns
from ico3d.chat.turns.detector import EagerSilero
from ico3d.chat.turns.echo import EchoGuard, similarity
from ico3d.chat.wire.protocol import MICROPHONE_CHUNK as PIECE
from ico3d.common.espeak.speech import synthesize

pytestmark = pytest.mark.slow

NEAR, FAR = 16_000, 24_000  # Hz
EARLY = ((0.004, 0.5), (0.011, 0.35), (0.023, 0.3))  # s and height of first reflections


def speech(text: str, voice: str, rate: int) -> np.ndarray:
    """(S,) in [-1, 1] at a sample rate."""
    made = synthesize(text, voice, 165)
    return np.clip(soxr.resample(made.samples, made.rate, rate), -1, 1)


def echo(sound: np.ndarray, delay: float, gain: float, reverberation: float, seed: int = 0):
    """What comes back of (S,) at 24 kHz, at 16 kHz.

    Args:
        sound: What the loudspeaker plays.
        delay: Seconds from its being due to its being recorded.
        gain: Of the whole path, dB.
        reverberation: Seconds within which it falls by 60 dB.
        seed: Of the room.
    """
    count = int(reverberation * NEAR)
    tail = np.random.default_rng(seed).normal(0, 0.05, count)
    response = tail * 10 ** (-3 * np.arange(count) / count)
    response[0] = 1.0
    for seconds, height in EARLY:
        response[int(seconds * NEAR)] += height
    response *= 10 ** (gain / 20) / np.sqrt((response**2).sum())
    direct = soxr.resample(sound, FAR, NEAR)
    return np.concatenate([np.zeros(int(delay * NEAR)), np.convolve(direct, response)])


def mixed(seconds: float, *sounds: tuple[float, np.ndarray]) -> np.ndarray:
    """(S,) int16 of a quiet room with sounds that begin at some seconds."""
    mixture = np.random.default_rng(1).normal(0, 3e-4, int(seconds * NEAR))
    for begin, sound in sounds:
        at = int(begin * NEAR)
        part = sound[: len(mixture) - at]
        mixture[at : at + len(part)] += part
    return (np.clip(mixture, -1, 1) * 32767).astype(np.int16)


LEAD = 0.5  # s before the avatar speaks
TEXT = "Hello, I am a person made of light. Ask me anything you like, and I will tell you."
AVATAR = speech(TEXT, "en-us+f3", FAR)
QUESTION = speech("What is your name?", "en-us", NEAR)


def guarded(microphone, jitter=0.03):
    """What is left of (S,) int16, and the guard; the page's clock is wrong by up to `jitter` s."""
    random, wrong = np.random.default_rng(2), 0.0
    guard = EchoGuard()
    guard.sent.add(0, (AVATAR * 32767).astype(np.int16))
    left = microphone.copy()
    for at in range(0, len(left) - PIECE + 1, PIECE):
        if at % (5 * PIECE) == 0:
            wrong = random.uniform(-jitter, jitter)
        heard = (at + PIECE) / NEAR - LEAD
        playing = 0 if 0 <= heard < len(AVATAR) / FAR else None
        if guard.is_echo(microphone[at : at + PIECE], playing, heard + wrong):
            left[at : at + PIECE] = 0
    return left, guard


async def voices(sound):
    """Seconds at which Silero hears a voice or is sure of one."""
    ear = EagerSilero(Turns().pause)
    ear.set_sample_rate(NEAR)
    hints, sure = [], []
    for at in range(0, len(sound) - PIECE + 1, PIECE):
        state = await ear.analyze_audio(sound[at : at + PIECE].tobytes())
        hints += [(at + PIECE) / NEAR] if ear.voiced else []
        sure += [(at + PIECE) / NEAR] if state is VADState.SPEAKING else []
    await ear.cleanup()
    return hints, sure


@pytest.mark.parametrize(
    ("delay", "gain", "reverberation"),
    [(0.05, -6, 0.25), (0.15, -12, 0.5), (0.35, -20, 0.3)],
)
async def test_the_avatar_does_not_hear_itself(delay, gain, reverberation):
    seconds = LEAD + len(AVATAR) / FAR + 1.0
    microphone = mixed(seconds, (LEAD, echo(AVATAR, delay, gain, reverberation)))
    assert len((await voices(microphone))[0]) > 50  # it would
    left, guard = guarded(microphone)
    assert await voices(left) == ([], [])
    assert guard.lag == pytest.approx(delay, abs=0.05)


@pytest.mark.parametrize(("gain", "level"), [(-12, 0), (-30, -12), (-50, -12)])
async def test_a_visitor_is_heard_over_it(gain, level):
    begin = LEAD + 2.5
    visitor = QUESTION * 10 ** (level / 20)
    microphone = mixed(4.5, (LEAD, echo(AVATAR, 0.15, gain, 0.3)), (begin, visitor))
    left, _ = guarded(microphone)
    hints, sure = await voices(left)
    first_sound = begin + np.nonzero(np.abs(QUESTION) > 0.02)[0][0] / NEAR
    assert first_sound < hints[0] < first_sound + 0.2
    assert sure[0] < first_sound + 0.4


async def test_in_silence_nothing_is_changed():
    guard = EchoGuard()
    guard.sent.add(0, (AVATAR * 32767).astype(np.int16))
    microphone = mixed(2.0, (0.5, QUESTION))
    pieces = [microphone[at : at + PIECE] for at in range(0, len(microphone) - PIECE, PIECE)]
    assert not any(guard.is_echo(piece, None, 0.0) for piece in pieces)


def test_pieces_of_any_size_are_taken():
    guard = EchoGuard()
    guard.sent.add(0, (AVATAR * 32767).astype(np.int16))
    for count in (1, 7, 320, 1600, 16_000):
        assert guard.is_echo(np.zeros(count, np.int16), 0, 1.0) in (True, False)


def test_similarity_is_one_for_the_same_and_small_for_others():
    random = np.random.default_rng(0)
    a, b = random.random((16, 100)), random.random((16, 100))
    assert similarity(a, 3 * a) == pytest.approx(1.0)
    assert abs(similarity(a, b)) < 0.1
    assert similarity(a, np.zeros_like(a)) == 0.0
    many = random.random((5, 16, 100))
    assert similarity(many, b) == pytest.approx([similarity(one, b) for one in many])


async def test_where_no_echo_comes_back_that_is_learnt_within_a_second():
    begin = LEAD + 1.1
    left, _ = guarded(mixed(4.5, (begin, QUESTION / 2)))
    hints, _ = await voices(left)
    assert hints[0] < begin + np.nonzero(np.abs(QUESTION) > 0.02)[0][0] / NEAR + 0.15
