"""Who speaks without a pause, as a television does, is recognised piece by piece."""

import asyncio
import io
import time
import wave
from dataclasses import replace

import numpy as np
import pytest
from pipecat.frames.frames import (
    ErrorFrame,
    InputAudioRawFrame,
    TranscriptionFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.pipeline.worker import PipelineParams
from pipecat.processors.frame_processor import FrameDirection
from pipecat.services.stt_service import SegmentedSTTService
from pipecat.tests.utils import SleepFrame, run_test
from pipecat.utils.time import time_now_iso8601

from ico3d.chat.bucket import Bucket
from ico3d.chat.remote.headless import run
from ico3d.chat.services import ChosenService, choose
from ico3d.chat.services.provider import Provider
from ico3d.chat.services.recognition import openai, sphinx, whisper
from ico3d.chat.services.recognition.segments import BLANK, TOO_FAST, Segments
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.turns.eager import EagerSmartTurn
from ico3d.chat.wire.protocol import Answer, Transcript
from ico3d.errors import SettingsError
from ico3d.measure.talking.page import open_page
from support.chat.recognisers import Script, Scripted, silent
from support.chat.serving import serving

pytestmark = pytest.mark.slow

RATE = 16_000
MINUTES = 10
SECOND = np.random.default_rng(0).integers(-3000, 3000, RATE).astype(np.int16).tobytes()


class Counting(SegmentedSTTService):
    """Says of each stretch which one it is."""

    def __init__(self, **rest):
        super().__init__(**rest)
        self.seconds, self.greatest = [], 0

    async def run_stt(self, audio):
        with wave.open(io.BytesIO(audio)) as file:
            self.seconds.append(file.getnframes() / RATE - 0.5)  # pipecat adds silence
        await asyncio.sleep(0)
        yield TranscriptionFrame(str(len(self.seconds)), "", time_now_iso8601())


class Recogniser(Segments, Counting):
    async def process_audio_frame(self, frame, direction):
        await super().process_audio_frame(frame, direction)
        self.greatest = max(self.greatest, len(self._audio_buffer))


async def heard(service, seconds, stops=True):
    """Transcripts and errors of a voice that does not pause."""
    frames = [VADUserStartedSpeakingFrame(start_secs=0.2)]
    for _ in range(seconds):
        frames += [InputAudioRawFrame(SECOND, RATE, 1), SleepFrame(0.002)]
    if stops:
        frames.append(VADUserStoppedSpeakingFrame(stop_secs=0.2))
    frames.append(SleepFrame(0.2))
    params = PipelineParams(audio_in_sample_rate=RATE)
    down, up = await run_test(service, frames_to_send=frames, pipeline_params=params)
    return (
        [frame for frame in down if isinstance(frame, TranscriptionFrame)],
        [frame.error for frame in up if isinstance(frame, ErrorFrame)],
    )


@pytest.mark.parametrize("stops", [True, False])
async def test_ten_minutes_without_a_pause_are_never_kept_at_once(stops):
    service = Recogniser(longest=10.0)
    frames, errors = await heard(service, 60 * MINUTES, stops)
    assert service.greatest <= 31 * 2 * RATE
    assert not errors
    assert len(service.seconds) >= 2 * MINUTES
    assert max(service.seconds) <= 30
    left = 0 if stops else 31
    assert 60 * MINUTES - left <= sum(service.seconds) <= 60 * MINUTES
    assert [frame.text for frame in frames] == [str(n + 1) for n in range(len(frames))]
    finals = [frame.finalized for frame in frames]
    assert finals == [False] * (len(finals) - 1) + [stops]


async def test_a_cut_falls_into_the_quietest_moment():
    loud, pause = np.frombuffer(SECOND, np.int16), np.zeros(RATE // 4, np.int16)
    speech = np.concatenate([np.tile(loud, 27), pause, np.tile(loud, 4)])
    service = Recogniser(longest=10.0)
    frames = [VADUserStartedSpeakingFrame(start_secs=0.2)]
    frames += [InputAudioRawFrame(part.tobytes(), RATE, 1) for part in np.split(speech, 125)]
    frames.append(VADUserStoppedSpeakingFrame(stop_secs=0.2))
    await run_test(
        service, frames_to_send=frames, pipeline_params=PipelineParams(audio_in_sample_rate=RATE)
    )
    assert 27 < service.seconds[0] < 27.25
    assert sum(service.seconds) == pytest.approx(len(speech) / RATE)


async def test_a_recogniser_that_does_not_keep_up_keeps_five_stretches_and_says_so():
    service = Recogniser(longest=10.0)  # nobody takes what it hands over
    service._sample_rate, service._user_speaking = RATE, True
    told, greatest = [], 0
    service.push_error = lambda sentence: _told(told, sentence)
    for _ in range(60 * MINUTES):
        frame = InputAudioRawFrame(SECOND, RATE, 1)
        await service.process_audio_frame(frame, FrameDirection.DOWNSTREAM)
        greatest = max(greatest, service._segment_queue.qsize())
    assert greatest == 5 and service.greatest <= 31 * 2 * RATE
    assert told == [TOO_FAST]


@pytest.mark.parametrize(("seconds", "most"), [(0.3, 7), (0.0, 30)])
async def test_a_button_without_a_pause_keeps_five_stretches_and_says_so(seconds, most):
    """Each release queued half a second of silence: one visitor took a gigabyte in 16 minutes."""
    service = Recogniser(longest=10.0)
    recognise = service.run_stt

    async def slow(audio):
        await asyncio.sleep(seconds)
        async for frame in recognise(audio):
            yield frame

    service.run_stt = slow
    presses = [VADUserStartedSpeakingFrame(start_secs=0.0)]
    presses += [InputAudioRawFrame(SECOND, RATE, 1), VADUserStoppedSpeakingFrame(stop_secs=0.0)]
    frames = [frame for _ in range(200) for frame in (*presses, SleepFrame(0.001))]
    params = PipelineParams(audio_in_sample_rate=RATE)
    frames.append(SleepFrame(6 * seconds + 0.3))
    down, up = await run_test(service, frames_to_send=frames, pipeline_params=params)
    told = [frame for frame in up if isinstance(frame, ErrorFrame)]
    said = [frame for frame in down if isinstance(frame, TranscriptionFrame)]
    assert 5 <= len(service.seconds) <= most and max(service.seconds) <= 1
    assert said[-1].finalized and len(told) >= 1
    assert len(told) == 1 or not seconds


async def test_who_was_too_fast_ends_the_turn_and_is_heard_again():
    service = Recogniser(longest=10.0)
    service._pace = Bucket(10.0, 1, time.monotonic)
    press = [VADUserStartedSpeakingFrame(start_secs=0.0), InputAudioRawFrame(SECOND, RATE, 1)]
    press += [VADUserStoppedSpeakingFrame(stop_secs=0.0)]
    frames = [*press, SleepFrame(0.05), *press, SleepFrame(0.3), *press, SleepFrame(0.1)]
    params = PipelineParams(audio_in_sample_rate=RATE)
    down, up = await run_test(service, frames_to_send=frames, pipeline_params=params)
    said = [frame for frame in down if isinstance(frame, TranscriptionFrame)]
    assert [frame.text for frame in said] == ["1", BLANK, "2"]
    assert all(frame.finalized for frame in said)
    assert [frame.error for frame in up if isinstance(frame, ErrorFrame)] == [TOO_FAST]


async def _told(errors, error):
    errors.append(error)


async def test_the_words_of_all_pieces_are_one_turn(bundle, question):
    pieces = ("What", "is", "your", "name?", "", "", "")

    def adapt(avatar):
        listener = ChosenService(Provider("cut", Script, lambda s, _: Cut(s)), Script(0.3, pieces))
        return silent(replace(avatar, services=replace(avatar.services, recognition=listener)))

    async with serving(bundle, adapt=adapt) as (url, _):
        page, _ = await open_page(url)
        said = np.concatenate([question] * 4)
        page.say(said)
        await page.wait(Transcript, where=lambda m: m.text == "What is your name?")
        _, answer = await page.wait(Answer)
        assert answer.text == "I am Random."
        await asyncio.sleep(0.5)
        assert [m.text for m in page.messages(Answer)] == ["I am Random."]
        finals = [m.text for m in page.messages(Transcript) if m.final]
        assert finals == ["What", "What is", "What is your", "What is your name?"][-len(finals) :]
        assert len(finals) > 1
        await page.close()


class Cut(Segments, Scripted):
    """Cuts what lasts longer than 1.2 s; empty words are those of the end."""

    def __init__(self, script: Script):
        super().__init__(longest=10.0, longest_speech=1.2, script=script)


async def test_pocketsphinx_ends_its_utterances_too(question):
    service = sphinx.SphinxRecognition(longest_speech=1.2)
    params = PipelineParams(audio_in_sample_rate=RATE)
    said = np.concatenate([question] * 3)
    said = said[: len(said) // 320 * 320]
    frames = [VADUserStartedSpeakingFrame(start_secs=0.2)]
    for part in np.split(said, len(said) // 320):
        frames += [InputAudioRawFrame(part.tobytes(), RATE, 1)]
    frames += [VADUserStoppedSpeakingFrame(stop_secs=0.2), SleepFrame(0.1)]
    down, _ = await run_test(service, frames_to_send=frames, pipeline_params=params)
    words = [frame for frame in down if isinstance(frame, TranscriptionFrame)]
    assert len(words) >= 2
    assert [frame.finalized for frame in words] == [False] * (len(words) - 1) + [True]
    assert any(frame.text != BLANK for frame in words)


class SlowDecoder:
    async def start(self):
        pass

    async def decode(self, pcm):
        await asyncio.sleep(3600)

    async def close(self):
        pass


class CountedDecoder(SlowDecoder):
    starts = 0

    async def start(self):
        self.starts += 1


@pytest.mark.parametrize("sounds", [0, 1])
async def test_whoever_only_types_starts_no_decoder(sounds):
    service = sphinx.SphinxRecognition()
    service._decoder = CountedDecoder()
    async for _ in run(service, [InputAudioRawFrame(bytes(640), RATE, 1)] * sounds, 10):
        pass
    assert service._decoder.starts == sounds


async def test_pocketsphinx_keeps_no_more_than_it_can_take():
    service = sphinx.SphinxRecognition()
    service._decoder = SlowDecoder()
    told, greatest = [], 0
    service.push_error = lambda sentence: _told(told, sentence)
    service._hearing = True
    for _ in range(60 * MINUTES):
        async for _ in service.run_stt(SECOND):
            pass
        kept = [len(p) for p in service._sound._queue if isinstance(p, bytes)]
        greatest = max(greatest, sum(kept))
    assert greatest <= 6 * 30 * 2 * RATE
    assert told == [TOO_FAST]


def test_smart_turn_keeps_what_it_looks_at_and_no_more():
    analyzer = EagerSmartTurn(0.2)
    analyzer.set_sample_rate(RATE)
    piece = SECOND[: 2 * 320]  # 20 ms
    for _ in range(50 * 60 * MINUTES):
        analyzer.append_audio(piece, True)
    kept = sum(len(sound) for _, sound in analyzer._audio_buffer)
    assert 8 * RATE <= kept <= 11 * RATE
    for _ in range(50 * 60 * MINUTES // 20):  # nothing but scraps
        analyzer.append_audio(piece[:2], True)
    assert len(analyzer._audio_buffer) <= 1100


@pytest.mark.parametrize("use", ["whisper", "openai", "pocketsphinx"])
@pytest.mark.parametrize("seconds", [1.0, 1000.0])
def test_the_length_has_bounds(use, seconds):
    with pytest.raises(SettingsError, match="longest_speech must be 5 to 300 seconds"):
        choose(ChatSettings(recognition=Choice(use, {"longest_speech": seconds})))
    for settings in (whisper.Settings(), openai.Settings(), sphinx.Settings()):
        assert settings.longest_speech == 30
