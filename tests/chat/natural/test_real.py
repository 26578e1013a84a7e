"""The natural conversation with its real weights, where `ico3d demo --natural` has put them."""

import asyncio
import re
import wave
from contextlib import aclosing
from dataclasses import replace

import numpy as np
import pytest
from pipecat.frames.frames import TTSAudioRawFrame, TTSSpeakFrame
from pipecat.pipeline.worker import PipelineParams
from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.tests.utils import run_test

from ico3d.bundle.persona import Persona
from ico3d.chat.frames import PhonemesFrame
from ico3d.chat.natural import needs
from ico3d.chat.services.language import smollm
from ico3d.chat.services.provider import Context
from ico3d.chat.services.recognition import whisper
from ico3d.chat.services.voice import hibari, piper
from ico3d.chat.settings.conversation import read_settings
from ico3d.chat.wire.protocol import SPEECH_RATE, Answer, Speech, Stop, Transcript
from ico3d.common.visemes import visemes
from ico3d.common.weights import cached
from ico3d.measure.talking.page import open_page
from support.chat.listening import NOBODY, listen
from support.chat.serving import serving
from support.needs import needs as needs_package
from support.shared import SPEECH

missing = [need.name for need in (*needs.missing_packages(), *needs.missing_weights())]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing), reason=f"not here: {', '.join(missing)}"),
]
IRIS = Context(Persona("Iris", notes=("who are you => I am Iris.",)), None, None)


@pytest.mark.skipif(not SPEECH.is_dir(), reason="the recordings are not here")
@pytest.mark.parametrize(
    ("recording", "words"),
    [
        ("arctic_a0024", "it was my reports from the north which chiefly induced people to buy"),
        ("new-home-in-the-stars-16k", "we must find a new home in the stars"),
        (
            "jfk_16k",
            "and so my fellow americans ask not what your country can do for you ask what you can "
            "do for your country",
        ),
    ],
)
async def test_whisper_recognises_every_word_of_people(recording, words):
    with wave.open(str(SPEECH / f"{recording}.wav")) as file:
        pcm = np.frombuffer(file.readframes(file.getnframes()), np.int16)
    service = whisper.make(whisper.Settings("tiny.en"), NOBODY)
    frames, errors = await listen(service, pcm[: len(pcm) // 8 * 8])
    assert not errors and len(frames) == 1
    assert re.sub(r"[^a-z ]", "", frames[0].text.lower()) == words


@pytest.mark.skipif(not SPEECH.is_dir(), reason="the recordings are not here")
@pytest.mark.parametrize("noise", [3e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("pauses", [(0.3, 0.2), (0.6, 0.5)])
@pytest.mark.parametrize(
    ("recording", "part", "words"),
    [
        ("arctic_a0024", slice(None), "it was my reports from the north which chiefly induced"),
        ("new-home-in-the-stars-16k", slice(None), "we must find a new home in the stars"),
        ("jfk_16k", slice(52800), "and so my fellow americans"),
        ("jfk_16k", slice(126400, None), "ask what you can do for your country"),
    ],
)
def test_people_in_a_quiet_room_are_heard_at_once(
    recording, part, words, pauses, noise, monkeypatch
):
    from faster_whisper import WhisperModel

    passes, transcribe = [], WhisperModel.transcribe

    def counted(model, *sound, **options):
        passes.append(options)
        return transcribe(model, *sound, **options)

    monkeypatch.setattr(WhisperModel, "transcribe", counted)
    with wave.open(str(SPEECH / f"{recording}.wav")) as file:
        pcm = np.frombuffer(file.readframes(file.getnframes()), np.int16)[part]
    before, after = (np.zeros(int(16000 * seconds), np.float32) for seconds in pauses)
    sound = np.concatenate([before, pcm.astype(np.float32) / 32768, after])
    sound += noise * np.random.default_rng(0).standard_normal(len(sound)).astype(np.float32)
    folder = whisper.find(whisper.Settings("tiny.en"))
    segments, _ = whisper.load(folder, "cpu", "int8").transcribe(
        sound, temperature=0.0, language="en"
    )
    said = re.sub(r"[^a-z ]", "", " ".join(s.text for s in segments).lower()).strip()
    assert said.startswith(words) and len(said) < 2 * len(words)
    assert len(passes) == 1  # nothing looked like a loop


def model():
    return smollm.make(smollm.Settings(), IRIS)


async def answered(question):
    context = LLMContext([{"role": "user", "content": question}])
    async with aclosing(model().answers(context)) as sentences:
        return [sentence async for sentence in sentences]


async def test_notes_come_first_then_what_the_model_is_sure_of_and_inventions_never():
    assert await answered("Who are you?") == ["I am Iris."]
    assert await answered("What is the capital of France?") == ["The capital of France is Paris."]
    (unsure,) = await answered("What did we talk about yesterday?")
    assert unsure.startswith("I do not know that.")


async def test_the_model_streams_and_stops_when_nobody_reads_on():
    from ico3d.chat.services.language.ctranslate import load
    from ico3d.common.weights import model_of

    loaded = load(model_of(smollm.WEIGHTS))
    turns = [("user", "Count from one to one hundred.")]
    stream = loaded.tokens(smollm.beginning("Iris"), turns, 60)
    first = [await anext(stream) for _ in range(3)]
    await stream.aclose()
    assert all(token.log_prob <= 0 for token in first)
    await asyncio.wait_for(run_out(loaded), 20)  # no thread is still busy with the other


async def run_out(loaded):
    async for _ in loaded.tokens([], [("user", "Hello.")], 2):
        pass


async def spoken(voice, text):
    down, up = await run_test(
        voice,
        frames_to_send=[TTSSpeakFrame(text)],
        pipeline_params=PipelineParams(audio_out_sample_rate=SPEECH_RATE),
        start_timeout=60,
    )
    assert not up
    sound = b"".join(frame.audio for frame in down if isinstance(frame, TTSAudioRawFrame))
    return np.frombuffer(sound, np.int16), [f for f in down if isinstance(f, PhonemesFrame)]


def quietest(pcm, around):
    """Least loudness of 20 ms within 60 ms of a time, relative to the loudest of the sound."""
    step = SPEECH_RATE // 100
    power = (pcm[: len(pcm) // step * step].reshape(-1, step).astype(float) ** 2).mean(axis=1)
    level = np.sqrt(np.convolve(power, [0.5, 0.5], "valid"))
    at = round(around * 100)
    return level[max(0, at - 6) : at + 7].min() / level.max()


def check(pcm, told):
    """Durations are those of the sound; where lips close for p it is silent."""
    assert sum(frame.seconds for frame in told) == pytest.approx(len(pcm) / SPEECH_RATE, abs=0.01)
    (frame,) = told
    times = [p.time for p in frame.phonemes]
    assert times == sorted(times) and times[-1] < frame.seconds
    shapes = [shape for p in frame.phonemes for shape in visemes(p.symbol)]
    assert [s for s in shapes if s == "PP"] == ["PP"] * 4
    assert 0.01 < np.abs(pcm).max() / 32767 < 1
    closed = [quietest(pcm, p.time) for p in frame.phonemes if p.symbol == "p"]
    amid = [
        quietest(pcm, t + 0.1)
        for p, t in zip(frame.phonemes, times, strict=True)
        if "aʊ" in p.symbol
    ]
    assert max(closed) < 0.15, closed
    assert all(level > 0.2 for level in amid)


async def test_the_voice_tells_its_speech_sounds_in_time():
    check(*await spoken(hibari.make(hibari.Settings(), IRIS), "Papa paid a pound."))


@needs_package("piper")
@needs_package("onnx")
@pytest.mark.skipif(cached("piper-joe") is None, reason="ico3d weights fetch piper-joe")
async def test_piper_tells_its_speech_sounds_in_time():
    voice = piper.make(piper.Settings("en_US-joe-medium"), IRIS)
    check(*await spoken(voice, "Papa paid a pound."))


async def test_an_interruption_amid_all_three_is_heard_and_answered(bundle):
    settings = read_settings(needs.SETTINGS)
    persona = replace(
        IRIS.persona,
        greeting="Hello.",
        notes=(
            "tell me a story => " + "Once there was a bear who lived in the woods. " * 6,
            "what is your name => I am Iris.",
        ),
    )
    async with serving(bundle, settings, persona=persona) as (url, _):
        page, _ = await open_page(url)
        await page.heard(0)
        page.say(await question("Tell me a story."))
        await page.wait(Speech, where=lambda m: m.utterance == 1, timeout=60)
        page.say(await question("What is your name, please?"))
        await page.wait(Stop, where=lambda m: m.utterance == 1, timeout=60)
        await page.wait(Answer, where=lambda m: m.text == "I am Iris.", timeout=60)
        heard = [m.text.lower() for m in page.messages(Transcript)]
        assert any("story" in text for text in heard) and any("name" in text for text in heard)
        await page.close()


async def question(text):
    """A question in the voice, as a microphone hears it: (S,) int16 at 16 kHz."""
    import soxr

    pcm = (await asyncio.to_thread(hibari.load().speak, text)).pcm
    return soxr.resample(pcm, SPEECH_RATE, 16000)
