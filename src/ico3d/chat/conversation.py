"""One conversation: the pipecat pipeline between a page's messages and the page."""

import asyncio
from dataclasses import dataclass

from pipecat.audio.turn.smart_turn.base_smart_turn import SmartTurnParams
from pipecat.audio.turn.smart_turn.local_smart_turn_v3 import LocalSmartTurnAnalyzerV3
from pipecat.pipeline.pipeline import Pipeline
from pipecat.pipeline.worker import PipelineParams, PipelineWorker
from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.processors.aggregators.llm_response_universal import (
    LLMContextAggregatorPair,
    LLMUserAggregatorParams,
)
from pipecat.processors.frame_processor import FrameProcessor
from pipecat.services.tts_service import TTSService
from pipecat.turns.user_turn_strategies import UserTurnStrategies
from pipecat.workers.runner import WorkerRunner

from ico3d.bundle.animation import Animation
from ico3d.bundle.manifest import HeadInfo, Persona
from ico3d.chat import protocol
from ico3d.chat.activity import Activity
from ico3d.chat.expression import ExpressionProcessor
from ico3d.chat.face import Face
from ico3d.chat.frames import Utterances
from ico3d.chat.gestures import Gestures
from ico3d.chat.listener import Captions, PageInput
from ico3d.chat.monitor import Visitor
from ico3d.chat.page import Page
from ico3d.chat.protocol import MICROPHONE_RATE, SPEECH_RATE
from ico3d.chat.services import Chosen
from ico3d.chat.services.provider import Context
from ico3d.chat.settings import ChatSettings, Turns
from ico3d.chat.speaker import Speaker
from ico3d.chat.timing import Clock, TurnObserver
from ico3d.chat.turns.detector import Ear, VoiceDetector
from ico3d.chat.turns.echo import EchoGuard
from ico3d.chat.turns.echo_filter import EchoFilter
from ico3d.chat.turns.strategies import strategies
from ico3d.speech.runtime import SpeechModel

NOTHING_HEARD = 1.5  # s without words after which a turn that was only noise is over


@dataclass(frozen=True)
class Avatar:
    """What all sessions of a server share, read only.

    Attributes:
        head: The head's sizes.
        speech: Sound to mouth; null for heads driven by blendshapes.
        persona: Who the avatar is.
        services: Who listens, thinks and speaks.
        settings: Services and timing.
        animation: How its body moves; None for a head alone.
    """

    head: HeadInfo
    speech: SpeechModel | None
    persona: Persona
    services: Chosen
    settings: ChatSettings
    animation: Animation | None


@dataclass(frozen=True)
class Parts:
    """What takes a while to make; made in a thread."""

    ear: Ear
    turn: LocalSmartTurnAnalyzerV3
    recognition: FrameProcessor
    language: FrameProcessor
    voice: FrameProcessor


class Conversation:
    """A running pipeline. What the page says goes in here; what it shall hear goes to `Page`."""

    def __init__(self, avatar: Avatar, page: Page, visitor: Visitor):
        """A conversation that has not started."""
        self._avatar = avatar
        self._now = now = asyncio.get_running_loop().time  # for all that waits and measures
        self.activity = Activity(now)
        self._clock = Clock(now)
        self._timing = TurnObserver(now, page.send, visitor.turn, visitor.failed)
        self._utterances = Utterances()
        self._input = PageInput()
        self._captions = Captions(page)
        gestures = avatar.animation and Gestures(
            avatar.animation, page, self._utterances, avatar.settings.gestures
        )
        self._echo = EchoGuard()
        self._speaker = Speaker(page, self._utterances, self._echo.sent, gestures, now)
        self._worker: PipelineWorker | None = None
        self._task: asyncio.Task | None = None

    async def start(self) -> None:
        """Builds and starts the pipeline (about 0.5 s, most of it in a thread)."""
        parts = await asyncio.to_thread(make_parts, self._avatar)
        self._watch_voice(parts.voice)
        self._worker = PipelineWorker(
            self._pipeline(parts),
            params=PipelineParams(
                audio_in_sample_rate=MICROPHONE_RATE, audio_out_sample_rate=SPEECH_RATE
            ),
            clock=self._clock,
            observers=[self._timing, self.activity],
            enable_rtvi=False,
            enable_turn_tracking=False,
            idle_timeout_secs=None,
        )
        runner = WorkerRunner(handle_sigint=False, handle_sigterm=False)
        await runner.add_workers(self._worker)
        self._task = asyncio.create_task(runner.run())

    async def close(self) -> None:
        """Ends the pipeline and everything it started."""
        if self._worker is None or self._task is None:
            return
        await self._worker.cancel()
        await self._task

    async def greet(self) -> None:
        """Says the persona's first words."""
        if self._avatar.persona.greeting.strip():
            await self._input.say(self._avatar.persona.greeting)

    async def hear(self, pcm: bytes) -> None:
        """Sound from the microphone."""
        await self._input.hear(pcm)

    async def ask(self, text: str) -> None:
        """A typed question."""
        self.activity.touch()
        await self._input.ask(text)

    async def talk(self, pressed: bool) -> None:
        """The button of push to talk."""
        self.activity.touch()
        await self._input.talk(pressed)

    async def interrupt(self, utterance: int | None) -> None:
        """Silence, if that utterance (any, for null) is being said or prepared."""
        self.activity.touch()
        if utterance is None or self._speaker.is_speaking(utterance):
            await self._input.broadcast_interruption()

    def clock(self, message: protocol.Clock) -> None:
        """Where the page is."""
        self.activity.touch()  # it comes only while something plays
        self._speaker.clock(message)
        self._timing.heard(message.utterance, message.position)

    def hold(self) -> None:
        """The connection dropped."""
        self._speaker.hold()

    def release(self) -> None:
        """The page is back."""
        self._speaker.release()

    def _pipeline(self, parts: Parts) -> Pipeline:
        turns = self._avatar.settings.turns
        trusted = not self._avatar.services.recognition.provider.stand_in
        chosen = strategies(parts.turn, turns, trusted, self._speaker.hush, self._now)
        user, assistant = aggregators(chosen, turns)
        face = Face(self._avatar.head, self._avatar.speech)
        return Pipeline(
            [
                self._input,
                EchoFilter(self._echo, self._speaker.heard, self._now),
                VoiceDetector(parts.ear),
                parts.recognition,
                self._captions,
                user,
                parts.language,
                parts.voice,
                ExpressionProcessor(face, self._utterances),
                self._speaker,
                assistant,
            ]
        )

    def _watch_voice(self, voice: FrameProcessor) -> None:
        """Takes the time at which the first clause reaches the voice."""
        if isinstance(voice, TTSService):

            async def requested(*_):
                self._timing.clause()

            voice.add_event_handler("on_tts_request", requested)


def make_parts(avatar: Avatar) -> Parts:
    """Loads the models of one session."""
    turns, services = avatar.settings.turns, avatar.services
    context = Context(avatar.persona, avatar.head, avatar.animation)
    return Parts(
        Ear(turns.pause),
        LocalSmartTurnAnalyzerV3(params=SmartTurnParams(stop_secs=turns.end_silence - turns.pause)),
        services.recognition.make(context),
        services.language.make(context),
        services.voice.make(context),
    )


def aggregators(strategies: UserTurnStrategies, turns: Turns) -> LLMContextAggregatorPair:
    """The two halves that keep the conversation's context and decide on turns."""
    params = LLMUserAggregatorParams(
        user_turn_strategies=strategies,
        user_turn_stop_timeout=max(NOTHING_HEARD, 2 * turns.end_silence),
    )
    return LLMContextAggregatorPair(LLMContext(), user_params=params)
