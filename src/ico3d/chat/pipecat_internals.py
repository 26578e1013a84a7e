"""Every place at which this program reaches into pipecat beyond what pipecat documents.

Each function says in one sentence what is touched and why. `touches` records it, and a test fails
when a version of pipecat no longer has it; pyproject.toml allows one minor version for that reason.
"""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from typing import Any, TypeVar

from pipecat.frames.frames import Frame, VADUserStoppedSpeakingFrame

Function = TypeVar("Function", bound=Callable)

TOUCHED: list[tuple[str, str]] = []
"""Class (`module:name`) and attribute of pipecat that a function below relies on."""

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
"""Class, method that a class of ours overrides, and why."""


def touches(where: str, *names: str) -> Callable[[Function], Function]:
    """Records that a function relies on these attributes of a class (`module:name`)."""
    TOUCHED.extend((where, name) for name in names)
    return lambda function: function


_LANGUAGE = "pipecat.services.llm_service:LLMService"
_RECOGNITION = "pipecat.services.stt_service:STTService"
_SEGMENTS = "pipecat.services.stt_service:SegmentedSTTService"
_VOICE = "pipecat.services.tts_service:TTSService"
_AGGREGATOR = "pipecat.utils.text.simple_text_aggregator:SimpleTextAggregator"
_TURN = "pipecat.audio.turn.smart_turn.base_smart_turn:BaseSmartTurn"


@touches(_LANGUAGE, "_push_llm_text")
async def push_text(model: Any, text: str) -> None:
    """Sends a piece of an answer as pipecat's own models do, which also counts it."""
    await model._push_llm_text(text)


@touches(_LANGUAGE, "_check_response_schema")
def check_schema(model: Any, schema: Any) -> None:
    """Refuses a schema of the answer in pipecat's words, for a model that cannot heed one."""
    model._check_response_schema(schema)


@touches("pipecat.services.ai_service:AIService", "_settings")
def settings_of(service: Any) -> Any:
    """The settings of a service as frames may have changed them since it was made."""
    return service._settings


@touches(_RECOGNITION, "_user_speaking")
def is_user_speaking(recognition: Any) -> bool:
    """Whether the VAD hears a voice; a recogniser has followed its frames already."""
    return recognition._user_speaking


@touches(_SEGMENTS, "_audio_buffer")
def segment(recognition: Any) -> bytearray:
    """The sound (PCM16) of the voice so far, to look for a place at which it can be cut."""
    return recognition._audio_buffer


@touches(_SEGMENTS, "_audio_buffer", "_user_speaking", "_handle_user_stopped_speaking")
async def transcribe_segment(recognition: Any) -> None:
    """Has the sound so far transcribed while the voice goes on: pipecat waits for its end."""
    await recognition._handle_user_stopped_speaking(VADUserStoppedSpeakingFrame())
    recognition._user_speaking = True


@touches(_SEGMENTS, "_audio_buffer")
def keep_segment(recognition: Any, sound: bytearray) -> None:
    """Goes on with a part of the sound, where the rest was transcribed or given up."""
    recognition._audio_buffer = sound


@touches("pipecat.services.whisper.stt:WhisperSTTService", "_model")
def use_model(recognition: Any, model: Any) -> None:
    """Lets a Whisper recogniser use a model that is loaded already."""
    recognition._model = model


@touches("pipecat.utils.base_object:BaseObject", "_call_event_handler")
async def raise_event(processor: Any, name: str, *args: Any) -> None:
    """Tells a processor's listeners of an event that happened to a part of it."""
    await processor._call_event_handler(name, *args)


@touches("pipecat.services.openai.tts:OpenAITTSService", "_client")
@touches("pipecat.services.whisper.base_stt:BaseWhisperSTTService", "_client")
def client_of(service: Any) -> Any:
    """The OpenAI client of a voice or a recogniser, to ask with it as pipecat does not."""
    return service._client


@touches(_VOICE, "_resampler")
def use_resampler(voice: Any, resampler: Any) -> None:
    """Replaces a voice's resampler, which forgets the sound before a pause of 0.2 s."""
    voice._resampler = resampler


@touches(_VOICE, "_stream_audio_frames_from_iterator")
def audio_frames(
    voice: Any, pieces: AsyncIterator[bytes], **options: Any
) -> AsyncGenerator[Frame, None]:
    """Sound that comes in pieces of any size as frames, cut and resampled by pipecat."""
    return voice._stream_audio_frames_from_iterator(pieces, **options)


@touches(_VOICE, "_is_yielding_frames_synchronously")
def mark_synchronous(voice: Any) -> None:
    """Says that a voice's sound is complete when `run_tts` ends, also of one that made none."""
    voice._is_yielding_frames_synchronously = True


def replace_run_tts(voice: Any, run_tts: Callable) -> None:
    """Puts something around the method that pipecat calls for each sentence of a voice."""
    voice.run_tts = run_tts


@touches(_AGGREGATOR, "_text")
def aggregated(aggregator: Any) -> str:
    """The text that an aggregator has not given out yet, to cut it at more than sentences."""
    return aggregator._text


@touches(_AGGREGATOR, "_text")
def set_aggregated(aggregator: Any, text: str) -> None:
    """Replaces the text that an aggregator has not given out yet."""
    aggregator._text = text


@touches(_AGGREGATOR, "_check_sentence_with_lookahead")
async def sentence_end(aggregator: Any, char: str) -> Any:
    """Pipecat's verdict on whether a sentence is complete with the next letter seen."""
    return await aggregator._check_sentence_with_lookahead(char)


@touches(_TURN, "_audio_buffer")
def turn_sound(analyzer: Any) -> list[tuple[float, Any]]:
    """What Smart-Turn heard in this turn, to judge it before the pause is over."""
    return analyzer._audio_buffer


@touches(_TURN, "_audio_buffer")
def keep_turn_sound(analyzer: Any, sound: list[tuple[float, Any]]) -> None:
    """Replaces what Smart-Turn heard by its end, which is all that it looks at."""
    analyzer._audio_buffer = sound


@touches(_TURN, "_model_executor", "_process_speech_segment")
def judge_turn(analyzer: Any, sound: list[tuple[float, Any]]) -> asyncio.Future:
    """Smart-Turn's verdict on a sound, in the thread in which it judges all others."""
    loop = asyncio.get_running_loop()
    return loop.run_in_executor(analyzer._model_executor, analyzer._process_speech_segment, sound)
