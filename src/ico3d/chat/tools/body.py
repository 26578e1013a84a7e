"""Functions by which the language model moves the avatar: gestures and moods."""

from collections.abc import Callable, Sequence
from typing import Any

from pipecat.adapters.llm.schemas.function_schema import FunctionSchema
from pipecat.frames.frames import (
    Frame,
    FunctionCallResultProperties,
    FunctionCallsStartedFrame,
    InterruptionFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
)
from pipecat.processors.frame_processor import FrameProcessor
from pipecat.services.llm_service import FunctionCallParams

from ico3d.chat.performing.cueing import Cueing
from ico3d.chat.performing.gestures import Gestures
from ico3d.chat.performing.moods import FACES, Moods
from ico3d.chat.settings.tools import OWN

GESTURE, MOOD = OWN
BESIDE = "Call it in the same message as the words that it goes with; never speak of it."


class Said:
    """Whether a response of the language model contains words beside function calls.

    After such a response the model is not asked to continue when a gesture is done, because it
    would repeat everything. Gestures and moods that were requested before an interruption are
    dropped when the interruption passes the language model; at a later processor, new requests
    could already have been made.
    """

    def __init__(self, forget: Sequence[Callable[[], None]]):
        """Starts without a response; the functions `forget` are called at an interruption."""
        self._words = self._others = False
        self._forget = forget

    def watch(self, language: FrameProcessor) -> None:
        """Follows the frames that a language model sends."""
        language.add_event_handler("on_before_push_frame", self._see)

    async def _see(self, _: FrameProcessor, frame: Frame) -> None:
        if isinstance(frame, LLMFullResponseStartFrame):
            self._words = self._others = False
        elif isinstance(frame, LLMTextFrame):
            self._words = self._words or bool(frame.text.strip())
        elif isinstance(frame, InterruptionFrame):
            for forget in self._forget:
                forget()
        elif isinstance(frame, FunctionCallsStartedFrame):
            self._others = any(call.function_name not in OWN for call in frame.function_calls)

    def properties(self) -> FunctionCallResultProperties | None:
        """What pipecat is to do after a gesture: nothing if there were words, else the default."""
        if self._words and not self._others:
            return FunctionCallResultProperties(run_llm=False)
        return None


def gesture_function(gestures: Gestures | Cueing, said: Said) -> FunctionSchema:
    """The function `gesture(name)`."""

    async def call(params: FunctionCallParams) -> None:
        await _try(params, gestures.names, gestures.request, said)

    what = f"Makes a gesture with the hands while the next words are spoken. {BESIDE}"
    return _with_name(GESTURE, what, gestures.names, call)


def mood_function(moods: Moods, said: Said) -> FunctionSchema:
    """The function `mood(name)`."""

    async def call(params: FunctionCallParams) -> None:
        await _try(params, list(FACES), moods.set, said)

    what = f"Shows a mood on the face until the answer ends. {BESIDE}"
    return _with_name(MOOD, what, list(FACES), call)


def _with_name(function: str, what: str, names: list[str], call: Any) -> FunctionSchema:
    properties = {"name": {"type": "string", "enum": names}}
    return FunctionSchema(function, what, properties, ["name"], call)


async def _try(params: FunctionCallParams, names: list[str], do: Any, said: Said) -> None:
    name = params.arguments.get("name")
    if name in names:
        do(name)
        result = {"done": name}
    else:
        result = {"error": f"There is no such {params.function_name}, only {', '.join(names)}."}
    await params.result_callback(result, properties=said.properties())
