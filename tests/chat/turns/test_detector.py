"""What real Silero hears of synthetic and real voices, measured in the microphone's own time."""

import wave

import numpy as np
import pytest
import soxr

from ico3d.chat.frames import VoiceFrame
from ico3d.chat.settings.conversation import Turns
from ico3d.chat.turns.detector import EagerSilero, Timbre
from ico3d.chat.turns.floor import Floor, Verdict
from ico3d.chat.turns.phrases import phrases
from ico3d.chat.wire.protocol import MICROPHONE_CHUNK as PIECE
from ico3d.chat.wire.protocol import MICROPHONE_RATE as RATE
from ico3d.common.espeak.speech import synthesize
from support.shared import SPEECH

pytestmark = pytest.mark.slow

VOICES = ("en-us", "en-us+f3", "en-us+m3", "en-us+m7")
FADE = 0.02  # s that the page takes to fall silent


def said(text, voice="en-us", rate=150):
    """(S,) in [-1, 1] without the silence around it."""
    speech = synthesize(text, voice, rate)
    samples = soxr.resample(speech.samples, speech.rate, RATE)
    return audible(samples)


def audible(samples, share=0.02):
    loud = np.nonzero(np.abs(samples) > share * np.abs(samples).max())[0]
    return samples[loud[0] : loud[-1] + 1]


EAR = EagerSilero(Turns().pause)
EAR.set_sample_rate(RATE)


async def test_an_ear_hears_nothing_of_what_another_hears():
    """Visitors share the loaded model; what it remembers of a voice is their own."""
    voice = np.pad(said("where do you live?"), RATE // 5)
    other = np.random.default_rng(0).normal(0, 0.1, len(voice))
    windows = [
        (np.clip(sound, -1, 1) * 32767).astype(np.int16)[: 512 * (len(sound) // 512)]
        for sound in (voice, other)
    ]
    pieces = [sound.reshape(-1, 512) for sound in windows]
    alone, first, second = (EagerSilero(0.2) for _ in range(3))
    for ear in (alone, first, second):
        ear.set_sample_rate(RATE)
    heard = [alone.voice_confidence(piece.tobytes()) for piece in pieces[0]]
    among = []
    for piece, disturbing in zip(*pieces, strict=True):
        among.append(first.voice_confidence(piece.tobytes()))
        second.voice_confidence(disturbing.tobytes())
    assert max(heard) > 0.9 and among == heard


async def verdicts(sound, phase=0):
    """Verdicts on a voice over the avatar's, with seconds from its first audible sample."""
    noise = np.random.default_rng(0).normal(0, 3e-4, RATE + phase + len(sound) + RATE)
    noise[RATE + phase : RATE + phase + len(sound)] += sound
    pcm = (np.clip(noise, -1, 1) * 32767).astype(np.int16)
    EAR.set_params(EAR.params)  # forgets the voice before
    timbre, now = Timbre(), [0.0]
    floor = Floor(Turns(), phrases(), False, lambda: now[0])
    found = []
    for at in range(0, len(pcm) - PIECE + 1, PIECE):
        now[0] = (at + PIECE) / RATE
        if at >= RATE // 2:  # by then Silero has forgotten the voice before
            floor.avatar(True)
        await EAR.analyze_audio(pcm[at : at + PIECE].tobytes())
        if EAR.voiced or floor.is_paused:
            timbre.hear(pcm[at : at + PIECE] / 32768)
        frame = VoiceFrame(at / RATE, PIECE / RATE, EAR.voiced, timbre.is_plain, timbre.is_fading)
        if verdict := floor.hear(frame):
            found.append((verdict, now[0] - (RATE + phase) / RATE))
            if verdict is Verdict.YIELD:
                break
    return found


@pytest.mark.parametrize("voice", VOICES)
async def test_a_question_ducks_within_250_and_stops_within_600_ms(voice):
    for phase, text in enumerate(("What is your name?", "Tell me about yourself.", "Who are you?")):
        found = await verdicts(said(text, voice), phase * 213)
        (first, ducked), (last, stopped) = found[0], found[-1]
        assert (first, last) == (Verdict.PAUSE, Verdict.YIELD)
        assert len(found) == 2
        assert ducked + FADE < 0.2  # leaves 50 ms for wire and machine
        assert stopped + FADE < 0.55


@pytest.mark.parametrize("voice", VOICES)
@pytest.mark.parametrize("text", ["uh-huh", "aha"])
async def test_uh_huh_pauses_and_resumes(voice, text):
    for rate in (130, 180):
        found = await verdicts(said(text, voice, rate))
        assert [verdict for verdict, _ in found] == [Verdict.PAUSE, Verdict.RESUME]


async def test_humming_pauses_and_resumes():
    seconds = np.arange(int(0.6 * RATE)) / RATE
    pitch = 2 * np.pi * np.cumsum(110 + 15 * np.sin(2 * np.pi * seconds / 0.6)) / RATE
    hum = sum(np.sin(n * pitch) * 10 ** (-(n - 1) * 0.5) for n in range(1, 8))  # lips closed
    hum *= np.hanning(len(hum)) ** 0.3 * (1 - 0.7 * np.exp(-(((seconds - 0.25) / 0.04) ** 2)))
    found = [verdict for verdict, _ in await verdicts(0.2 * hum)]
    assert found in ([], [Verdict.PAUSE, Verdict.RESUME])


async def test_a_cough_stops_nothing():
    noise = np.random.default_rng(1).normal(0, 0.2, 4800) * np.hanning(4800)
    found = [verdict for verdict, _ in await verdicts(noise)]
    assert found in ([], [Verdict.PAUSE, Verdict.RESUME])


@pytest.mark.skipif(not SPEECH.is_dir(), reason="needs ../shared/speech")
@pytest.mark.parametrize(
    "name", ["new-home-in-the-stars-16k.wav", "arctic_a0024.wav", "jfk_16k.wav"]
)
async def test_real_people_interrupt(name):
    with wave.open(str(SPEECH / name)) as file:
        pcm = np.frombuffer(file.readframes(file.getnframes()), np.int16) / 32768
    found = await verdicts(audible(pcm, 0.05)[: 2 * RATE])
    assert found[0][0] is Verdict.PAUSE and found[0][1] + FADE < 0.25
    assert found[-1][0] is Verdict.YIELD and found[-1][1] + FADE < 0.6


def test_timbre_tells_one_sound_from_words():
    for voice in VOICES:
        for text, plain in (("aha", True), ("uh", True), ("What is that", False)):
            timbre = Timbre()
            timbre.hear(said(text, voice)[: int(0.4 * RATE)])
            assert timbre.is_plain == plain, (voice, text, timbre.spread)
