"""One conversation: the pipecat pipeline between a page's incoming and outgoing messages."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from functools import singledispatchmethod

import numpy as np
from loguru import logger
from pipecat.adapters.llm.schemas.function_schema import FunctionSchema
from pipecat.adapters.llm.schemas.tools_schema import ToolsSchema
from pipecat.pipeline.pipeline import Pipeline
from pipecat.pipeline.worker import PipelineParams, PipelineWorker
from pipecat.processors.aggregators.llm_context import LLMContext, NotGiven
from pipecat.processors.aggregators.llm_response_universal import (
    LLMContextAggregatorPair,
    LLMUserAggregatorParams,
    UserTurnStoppedMessage,
)
from pipecat.processors.filters.function_filter import FunctionFilter
from pipecat.processors.frame_processor import FrameProcessor
from pipecat.services.tts_service import TTSService
from pipecat.turns.user_turn_strategies import UserTurnStrategies
from pipecat.workers.runner import WorkerRunner

from ico3d.chat.activity import Activity
from ico3d.chat.frames import SpeechFrame, TypedFrame, UtteranceEndFrame, Utterances
from ico3d.chat.listener import Captions, PageInput, is_no_sound
from ico3d.chat.memory import forget, recall, remembering, remembers_visits
from ico3d.chat.observing.metrics import Visitor
from ico3d.chat.observing.timing import PipelineClock, TurnObserver
from ico3d.chat.page import Page
from ico3d.chat.parts import Avatar, Parts, make_aside
from ico3d.chat.performing.cueing import Cueing
from ico3d.chat.performing.expression import ExpressionProcessor
from ico3d.chat.performing.face import Face
from ico3d.chat.performing.gestures import Gestures
from ico3d.chat.performing.remote_mouth import RemoteMouth
from ico3d.chat.performing.wording import Wording
from ico3d.chat.pipecat_internals import end_what_is_overtaken
from ico3d.chat.services.voice.clauses import ClauseProcessor
from ico3d.chat.services.voice.markup import speakable
from ico3d.chat.settings.conversation import ChatSettings
from ico3d.chat.speaker import Speaker
from ico3d.chat.supervision.allowance import Allowance
from ico3d.chat.supervision.filler import Filler
from ico3d.chat.supervision.language import AnswerGuard
from ico3d.chat.supervision.voice import endure
from ico3d.chat.tools import extended, functions
from ico3d.chat.tools.mcp import Connections
from ico3d.chat.turns.detector import VoiceDetector
from ico3d.chat.turns.echo import EchoGuard
from ico3d.chat.turns.echo_filter import EchoFilter
from ico3d.chat.turns.strategies import strategies
from ico3d.chat.wire.marks import LONGEST_WORDS
from ico3d.chat.wire.protocol import (
    MICROPHONE_RATE,
    SPEECH_RATE,
    Audio,
    ClientMessage,
    Clock,
    Deaf,
    Error,
    Heard,
    Hello,
    Interrupt,
    Notes,
    Say,
    Talk,
    Text,
)
from ico3d.chat.wire.sentences import HASTY, VOICELESS
from ico3d.chat.workers import at_once
from ico3d.errors import ProtocolError

NOTHING_HEARD = 3.0  # s without a sign of the recogniser after which a turn is given up


class Conversation:
    """The pipeline of one session: handles the page's messages and sends others to the `Page`."""

    def __init__(
        self,
        avatar: Avatar,
        page: Page,
        visitor: Visitor,
        ended: Callable[[], None],
        seed: int,
        allowance: Allowance,
    ):
        """Creates a conversation that has not started.

        Args:
            avatar: What all sessions of the server share.
            page: Receives the messages for the visitor's page.
            visitor: Counts events for the operator's figures.
            ended: Called if the pipeline ends by itself, without `close`.
            seed: Seed of random movements of eyes, brows and body.
            allowance: How much the visitor may ask.
        """
        self._allowance, self._unheard = allowance, False
        self._avatar, self._page, self._ended, self._seed = avatar, page, ended, seed
        self._now = now = asyncio.get_running_loop().time  # for all that waits and measures
        self.activity = Activity(now)
        self._timing = TurnObserver(now, page.send, visitor.turn, visitor.failed)
        self._context = LLMContext()
        self._servers = Connections(avatar.settings.mcp, self._offered)
        self._utterances = Utterances()
        self._input = PageInput()
        self._captions = Captions(page)
        self._wording = Wording(page)
        gestures = self._body()
        self._echo, self._gestures = EchoGuard(), gestures
        self._speaker = Speaker(page, self._utterances, self._echo.sent, gestures, now)
        self._worker: PipelineWorker | None = None
        self._task: asyncio.Task | None = None
        self._dictates = False  # whether the browser recognises speech
        self.remembers = False
        """Whether the page may tell of earlier visits; known once it has started."""
        self._recalled = False  # it has told

    async def start(self) -> Parts:
        """Builds and starts the pipeline, which takes about 0.5 s, mostly in a thread.

        Returns:
            The session's services.

        Raises:
            Ico3dError: If a service cannot be created.
        """
        parts = await make_aside(self._avatar)
        self._dictates = parts.dictation is not None
        self.remembers = remembers_visits(self._avatar.settings.memory, parts.language)
        self._prepare_voice(parts.voice)
        self._worker = PipelineWorker(
            self._pipeline(parts),
            params=PipelineParams(
                audio_in_sample_rate=MICROPHONE_RATE, audio_out_sample_rate=SPEECH_RATE
            ),
            clock=PipelineClock(self._now),
            observers=[self._timing, self.activity, self._allowance],
            enable_rtvi=False,
            enable_turn_tracking=False,
            idle_timeout_secs=None,
        )
        self._worker.set_reached_downstream_filter((TypedFrame,))
        self._worker.add_event_handler("on_frame_reached_downstream", self._all_stopped)
        runner = WorkerRunner(handle_sigint=False, handle_sigterm=False)
        await runner.add_workers(self._worker)
        self._task = asyncio.create_task(runner.run())
        self._task.add_done_callback(self._stopped)
        self._servers.open()
        return parts

    async def close(self) -> None:
        """Stops the pipeline and all of its tasks."""
        if self._worker is None or self._task is None:
            return
        self._task.remove_done_callback(self._stopped)
        await self._worker.cancel()
        await asyncio.gather(self._task, self._servers.close(), return_exceptions=True)

    async def greet(self) -> None:
        """Says the persona's greeting."""
        if self._avatar.persona.greeting.strip():
            await self._input.say(self._avatar.persona.greeting)

    @singledispatchmethod
    async def handle(self, message: ClientMessage) -> None:
        """Handles a message of the page; registered handlers are chosen by the message's type.

        Raises:
            ProtocolError: If the page may not send this message now.
        """
        raise TypeError(f"no handler for {type(message).__name__}")

    @handle.register
    async def _hello(self, _: Hello) -> None:
        raise ProtocolError("hello comes only once.")

    @handle.register
    async def _notes(self, message: Notes) -> None:
        if not self.remembers:
            raise ProtocolError("notes: this server's settings do not allow it.")
        if self._recalled:
            raise ProtocolError("notes come only once.")
        self._recalled = True
        recall(self._context, message.texts)

    @handle.register
    async def _audio(self, message: Audio) -> None:
        if not self._may_ask():  # a turn that has begun ends with the silence
            message = replace(message, pcm=np.zeros_like(message.pcm))
        await self._input.hear(message)

    @handle.register
    async def _text(self, message: Text) -> None:
        question = message.text.strip()
        if not question:
            raise ProtocolError("text: is empty.")
        if self._may_ask():
            self.activity.touch()
            await self._input.ask(question)

    @handle.register
    async def _say(self, message: Say) -> None:
        text = message.text.strip()
        if not self._avatar.settings.embedding.say:
            raise ProtocolError("say: this server's settings do not allow it.")
        if not text:
            raise ProtocolError("say: is empty.")
        if not self._may_ask():
            return
        self._allowance.spend()
        self.activity.touch()
        await self._input.interrupt()
        await self._input.say(text)

    @handle.register
    async def _interrupt(self, message: Interrupt) -> None:
        speaking = self._speaker.is_speaking(message.utterance)
        if speaking:
            self.activity.touch()  # on nothing it would hold a place for ever
        if message.utterance is None or speaking:
            await self._input.interrupt()

    @handle.register
    async def _clock(self, message: Clock) -> None:
        if self._speaker.is_speaking(message.utterance):
            self.activity.touch()
        self._speaker.clock(message)
        self._timing.heard(message.utterance, message.position)

    @handle.register
    async def _talk(self, message: Talk) -> None:
        self.activity.touch()
        await self._input.pass_on(message)  # to the VoiceDetector and the strategies of turns

    @handle.register
    async def _dictated(self, message: Heard | Deaf) -> None:
        if not self._dictates:
            raise ProtocolError("this server listens itself.")
        if isinstance(message, Deaf):
            logger.info(f"the browser does not recognise speech: {message.reason!r}")
        elif not (self._allowance.is_begun or self._may_ask()):
            return
        else:
            self._allowance.begin()
        await self._input.pass_on(message)  # to the BrowserRecognition

    def _may_ask(self) -> bool:
        """Whether the visitor is heard; tells him once if he has asked too much."""
        may = self._allowance.may_ask()
        if not may and not self._unheard:
            self._page.send(HASTY.error(fatal=False))
        self._unheard = not may
        return may

    def hold(self) -> None:
        """Pauses playback estimates, because the connection was lost."""
        self._speaker.hold()

    def release(self) -> None:
        """Resumes, because the page has reconnected."""
        self._speaker.release()

    def _stopped(self, task: asyncio.Task) -> None:
        if not task.cancelled():
            task.exception()  # taken, else asyncio complains of it
        self._ended()

    async def _all_stopped(self, _: PipelineWorker, question: TypedFrame) -> None:
        """Adds a typed question to the context once all that it interrupts has stopped.

        Added any sooner, the question would stand before the words of the interrupted answer.
        """
        self._context.add_message({"role": "user", "content": question.text})
        self._asked(question.text)
        forget(self._context, self._avatar.settings.memory)
        await self._input.answer(question)

    async def _said(self, _: object, __: object, message: UserTurnStoppedMessage) -> None:
        self._asked(message.content or "")

    def _asked(self, question: str) -> None:
        """What the visitor wants to be told may also be something to be shown."""
        if isinstance(self._gestures, Cueing):
            self._gestures.asked(question)

    async def _answered(self, *_: object) -> None:
        forget(self._context, self._avatar.settings.memory)

    def _pipeline(self, parts: Parts) -> Pipeline:
        settings, face = self._avatar.settings, make_face(self._avatar, self._seed)
        turns, run = settings.turns, at_once if face.is_remote else self._avatar.workers.run
        trusted = not self._avatar.services.recognition.provider.stand_in
        chosen = strategies(parts.turn, turns, trusted, self._speaker.hush, self._now)
        self._context.set_tools(self._functions(parts.language, face))
        user, assistant = aggregators(chosen, settings, parts.language, self._context)
        user.add_event_handler("on_user_turn_stopped", self._said)
        assistant.add_event_handler("on_assistant_turn_stopped", self._answered)
        pipeline = Pipeline(
            [
                self._input,
                EchoFilter(self._echo),
                VoiceDetector(parts.vad),
                parts.recognition,
                self._captions,
                user,
                FunctionFilter(is_no_sound, filter_system_frames=True, enable_direct_mode=True),
                parts.language,
                AnswerGuard(
                    parts.recognition,
                    parts.language,
                    settings.patience,
                    self._apology_language(),
                    settings.limits.answer_letters,
                ),
                Filler(settings.patience.tool, self._apology_language()),
                ClauseProcessor(self._language()),
                parts.voice,
                ExpressionProcessor(face, self._utterances, run, self._made),
                self._speaker,
                assistant,
            ]
        )
        return end_what_is_overtaken(pipeline)

    def _body(self) -> Gestures | Cueing | None:
        """Who moves the body: by gestures on its skeleton, else as it was recorded."""
        avatar, moving = self._avatar, self._avatar.settings.gestures
        if avatar.clips is not None:
            return Cueing(avatar.clips, self._page, moving, self._seed)
        if avatar.animation is None:
            return None
        return Gestures(avatar.animation, self._page, self._utterances, moving, self._seed)

    def _apology_language(self) -> str:
        """Language of apologies."""
        return self._avatar.settings.patience.apologies or self._language() or "en"

    def _language(self) -> str | None:
        """The persona's first."""
        return next(iter(self._avatar.persona.languages), None)

    def _made(self, frame: SpeechFrame | UtteranceEndFrame) -> None:
        if isinstance(self._gestures, Cueing):
            self._gestures.read(frame)
        if isinstance(frame, SpeechFrame):
            self._wording.read(frame)

    def _voiceless(self, reason: str) -> None:
        sentence = f"{VOICELESS.text} ({reason})"[:LONGEST_WORDS]
        self._page.send(Error(sentence, fatal=False, code=VOICELESS.code))

    def _functions(self, language: FrameProcessor, face: Face) -> ToolsSchema | NotGiven:
        settings = self._avatar.settings
        moods = face.moods if self._avatar.head.eye_offset is not None else None
        return functions(language, self._gestures, moods, settings.tools, settings.allow)

    def _offered(self, found: list[FunctionSchema]) -> None:
        self._context.set_tools(extended(self._context.tools, found))

    def _prepare_voice(self, voice: FrameProcessor) -> None:
        """Keeps markup and failures from it, and takes the time at which a piece reaches it."""
        if isinstance(voice, TTSService):
            patience = self._avatar.settings.patience
            endure(voice, patience.voice, self._apology_language(), self._voiceless)
            voice.add_text_transformer(speakable)

            async def requested(*_):
                self._timing.clause()

            voice.add_event_handler("on_tts_request", requested)


def make_face(avatar: Avatar, seed: int) -> Face:
    """Creates the face of one session; its mouth may be computed on another machine."""
    settings, remote = avatar.settings.expression, None
    if settings.use == "remote" and avatar.speech is not None:
        remote = RemoteMouth(settings, avatar.speech, avatar.speech_sha256)
    return Face(avatar.head, avatar.speech, seed, remote)


def aggregators(
    strategies: UserTurnStrategies,
    settings: ChatSettings,
    language: FrameProcessor,
    context: LLMContext,
) -> LLMContextAggregatorPair:
    """The pair of processors that keep the conversation's context and decide on turns."""
    params = LLMUserAggregatorParams(
        user_turn_strategies=strategies,
        user_turn_stop_timeout=max(NOTHING_HEARD, 2 * settings.turns.end_silence),
    )
    return LLMContextAggregatorPair(
        context, user_params=params, assistant_params=remembering(settings.memory, language)
    )
