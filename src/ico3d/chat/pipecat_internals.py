"""All uses of pipecat's undocumented parts.

Each function says what it uses and why. `touches` records the attributes, and a test fails if a
version of pipecat lacks one; for that reason pyproject.toml allows only one minor version.
"""

import asyncio
import copy
import functools
import heapq
import threading
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from typing import Any, TypeVar

from pipecat.frames.frames import (
    Frame,
    InterruptionFrame,
    SystemFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.pipeline.pipeline import Pipeline
from pipecat.processors.frame_processor import FrameDirection, FrameProcessorQueue

Function = TypeVar("Function", bound=Callable)

TOUCHED: list[tuple[str, str]] = []
"""Class (`module:name`) and attribute of pipecat on which a function below relies."""

OVERRIDDEN: tuple[tuple[str, str, str], ...] = (
    (
        "pipecat.services.stt_service:STTService",
        "_handle_vad_user_started_speaking",
        "recognisers that are no segments must know when a voice begins; there is no event for it",
    ),
    (
        "pipecat.services.stt_service:STTService",
        "_handle_vad_user_stopped_speaking",
        "and when it has ended",
    ),
    (
        "pipecat.services.whisper.stt:WhisperSTTService",
        "_load",
        "one model serves all sessions, where pipecat would load one for each",
    ),
)
"""Class of pipecat, method that a class of ico3d overrides, and why."""


def touches(where: str, *names: str) -> Callable[[Function], Function]:
    """Records that a function relies on these attributes of a class (`module:name`)."""
    TOUCHED.extend((where, name) for name in names)
    return lambda function: function


_PROCESSOR = "pipecat.processors.frame_processor:FrameProcessor"
_LANGUAGE = "pipecat.services.llm_service:LLMService"
_RECOGNITION = "pipecat.services.stt_service:STTService"
_SEGMENTS = "pipecat.services.stt_service:SegmentedSTTService"
_VOICE = "pipecat.services.tts_service:TTSService"
_AGGREGATOR = "pipecat.utils.text.simple_text_aggregator:SimpleTextAggregator"
_TURN = "pipecat.audio.turn.smart_turn.base_smart_turn:BaseSmartTurn"
_loading = threading.Lock()  # two sessions that begin at once load a model once


class _InputQueue(FrameProcessorQueue):
    """Frames that arrive at a processor, of which an interruption ends those that it overtakes.

    Pipecat lets it overtake them, and ends only what was taken from here before: what arrived in
    the same moment went on behind it, such as the answer to a question that a newer one replaced.
    """

    async def put(self, item: tuple[Frame, FrameDirection, Any]) -> None:
        """Adds a frame."""
        if isinstance(item[0], InterruptionFrame):
            waiting, self._queue = self._queue, []
            for entry in waiting:
                if isinstance(entry[2][0], SystemFrame) or not entry[2][0].interruptible:
                    heapq.heappush(self._queue, entry)
                else:
                    self.task_done()
        await super().put(item)


@touches(_PROCESSOR, "__input_queue")
def end_what_is_overtaken(pipeline: Pipeline) -> Pipeline:
    """Gives all processors of a pipeline that has not begun an `_InputQueue`."""
    for processor in pipeline.processors:
        setattr(processor, "_FrameProcessor__input_queue", _InputQueue())  # noqa: B010
    return pipeline


@touches(_LANGUAGE, "_push_llm_text")
async def push_text(model: Any, text: str) -> None:
    """Sends a piece of an answer as pipecat's own models do, which also counts it."""
    await model._push_llm_text(text)


@touches(_LANGUAGE, "_check_response_schema")
def check_schema(model: Any, schema: Any) -> None:
    """Raises pipecat's error for a model that does not support a schema of the answer."""
    model._check_response_schema(schema)


@touches("pipecat.services.ai_service:AIService", "_settings")
def settings_of(service: Any) -> Any:
    """The settings of a service, including changes by frames since it was created."""
    return service._settings


@touches(_RECOGNITION, "_user_speaking")
def is_user_speaking(recognition: Any) -> bool:
    """Whether the VAD hears a voice, as the recogniser's base class knows from frames."""
    return recognition._user_speaking


@touches(_SEGMENTS, "_audio_buffer")
def segment(recognition: Any) -> bytearray:
    """The sound (PCM16) of the current voice, in which a place to cut is searched."""
    return recognition._audio_buffer


@touches(_SEGMENTS, "_audio_buffer", "_user_speaking", "_handle_user_stopped_speaking")
async def transcribe_segment(recognition: Any) -> None:
    """Transcribes the sound so far although the voice goes on; pipecat would wait for its end."""
    await recognition._handle_user_stopped_speaking(VADUserStoppedSpeakingFrame())
    recognition._user_speaking = True


@touches(_SEGMENTS, "_audio_buffer")
def keep_segment(recognition: Any, sound: bytearray) -> None:
    """Replaces the buffered sound by a part of it, after the rest was transcribed or dropped."""
    recognition._audio_buffer = sound


@touches(_SEGMENTS, "_audio_buffer", "_user_speaking")
def forget_segment(recognition: Any) -> None:
    """Ends a voice of which nothing is to be transcribed."""
    recognition._audio_buffer.clear()
    recognition._user_speaking = False


@touches("pipecat.services.whisper.stt:WhisperSTTService", "_model")
def use_model(recognition: Any, model: Any) -> None:
    """Gives a Whisper recogniser a model that is already loaded."""
    recognition._model = model


@touches("pipecat.utils.base_object:BaseObject", "_call_event_handler")
async def raise_event(processor: Any, name: str, *args: Any) -> None:
    """Calls a processor's event handlers, for an event in a component of it."""
    await processor._call_event_handler(name, *args)


@touches("pipecat.services.openai.tts:OpenAITTSService", "_client")
@touches("pipecat.services.whisper.base_stt:BaseWhisperSTTService", "_client")
def client_of(service: Any) -> Any:
    """The OpenAI client of a voice or a recogniser, for requests that pipecat does not offer."""
    return service._client


@touches(_VOICE, "_resampler")
def use_resampler(voice: Any, resampler: Any) -> None:
    """Replaces a voice's resampler, which would forget the sound before a pause of 0.2 s."""
    voice._resampler = resampler


@touches(_VOICE, "_stream_audio_frames_from_iterator")
def audio_frames(
    voice: Any, pieces: AsyncIterator[bytes], **options: Any
) -> AsyncGenerator[Frame, None]:
    """Frames of a sound that arrives in pieces of any size, cut and resampled by pipecat."""
    return voice._stream_audio_frames_from_iterator(pieces, **options)


@touches(_VOICE, "_is_yielding_frames_synchronously")
def mark_synchronous(voice: Any) -> None:
    """Tells pipecat that a voice's sound is complete when `run_tts` ends, even if there is none."""
    voice._is_yielding_frames_synchronously = True


def replace_run_tts(voice: Any, run_tts: Callable) -> None:
    """Replaces the method that pipecat calls for each sentence of a voice, to wrap it."""
    voice.run_tts = run_tts


@touches(_AGGREGATOR, "_text")
def aggregated(aggregator: Any) -> str:
    """The text that an aggregator still holds, in order to cut it elsewhere than at sentences."""
    return aggregator._text


@touches(_AGGREGATOR, "_text")
def set_aggregated(aggregator: Any, text: str) -> None:
    """Replaces the text that an aggregator still holds."""
    aggregator._text = text


@touches(_AGGREGATOR, "_check_sentence_with_lookahead")
async def sentence_end(aggregator: Any, char: str) -> Any:
    """Pipecat's decision whether a sentence is complete, given the next character.

    Its rules are written in Rust and panic at some texts, such as an initial before a space that is
    not ASCII; a panic is no `Exception`. Then the sentence goes on.
    """
    try:
        return await aggregator._check_sentence_with_lookahead(char)
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        return None


@touches(_TURN, "_audio_buffer")
def turn_sound(analyzer: Any) -> list[tuple[float, Any]]:
    """The sound of the turn that Smart-Turn holds, to judge it before the pause is over."""
    return analyzer._audio_buffer


@touches(_TURN, "_audio_buffer")
def keep_turn_sound(analyzer: Any, sound: list[tuple[float, Any]]) -> None:
    """Replaces the sound that Smart-Turn holds by its end, as only the end is examined."""
    analyzer._audio_buffer = sound


@touches(_TURN, "_model_executor", "_process_speech_segment")
def judge_turn(analyzer: Any, sound: list[tuple[float, Any]]) -> asyncio.Future:
    """Smart-Turn's verdict on a sound, computed in its own thread."""
    loop = asyncio.get_running_loop()
    return loop.run_in_executor(analyzer._model_executor, analyzer._process_speech_segment, sound)


@touches("pipecat.audio.vad.silero:SileroVADAnalyzer", "_model")
def begin_silero(analyzer: Any, **options: Any) -> None:
    """Does what the constructor of Silero's analyser does, with one loaded model for all of them.

    What the model remembers of a voice stays each analyser's own.
    """
    from pipecat.audio.vad.vad_analyzer import VADAnalyzer

    with _loading:
        loaded = _silero()
    vars(analyzer).update(vars(loaded))
    VADAnalyzer.__init__(analyzer, **options)
    analyzer._model = copy.copy(loaded._model)
    analyzer._model.reset_states()


@touches("pipecat.audio.turn.smart_turn.local_smart_turn_v3:LocalSmartTurnAnalyzerV3", "_session")
def begin_smart_turn(analyzer: Any, **options: Any) -> None:
    """Does what the constructor of Smart-Turn does, with one loaded model, `_session`, for all."""
    from pipecat.audio.turn.smart_turn.base_smart_turn import BaseSmartTurn

    with _loading:
        loaded = _smart_turn()
    vars(analyzer).update(vars(loaded))
    BaseSmartTurn.__init__(analyzer, **options)


@functools.cache
def _silero() -> Any:
    from pipecat.audio.vad.silero import SileroVADAnalyzer

    return SileroVADAnalyzer()


@functools.cache
def _smart_turn() -> Any:
    from pipecat.audio.turn.smart_turn.local_smart_turn_v3 import LocalSmartTurnAnalyzerV3

    return LocalSmartTurnAnalyzerV3()
