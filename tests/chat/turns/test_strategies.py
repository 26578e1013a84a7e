"""Turns in a real pipecat pipeline, from scripted voices and words."""

import asyncio

import pytest
from pipecat.audio.turn.base_turn_analyzer import BaseTurnAnalyzer, BaseTurnParams, EndOfTurnState
from pipecat.frames.frames import (
    BotStartedSpeakingFrame,
    BotStoppedSpeakingFrame,
    Frame,
    InputAudioRawFrame,
    InterruptionFrame,
    LLMContextFrame,
    LLMFullResponseEndFrame,
    LLMTextFrame,
    STTMetadataFrame,
    TranscriptionFrame,
    UserStartedSpeakingFrame,
    UserStoppedSpeakingFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.pipeline.pipeline import Pipeline
from pipecat.pipeline.worker import PipelineWorker
from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.processors.aggregators.llm_response_universal import (
    LLMContextAggregatorPair,
    LLMUserAggregatorParams,
)
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from pipecat.workers.runner import WorkerRunner

from ico3d.bundle.manifest import Persona
from ico3d.chat.frames import PageFrame, VoiceFrame
from ico3d.chat.services.language.notes import Notes
from ico3d.chat.services.language.persona import PersonaModel
from ico3d.chat.settings.conversation import Turns
from ico3d.chat.turns.strategies import strategies
from ico3d.chat.wire.protocol import Talk

PERSONA = Persona("Ada", "", ("who are you => I am Ada.", "who are you and what => Many things."))


class Verdicts(BaseTurnAnalyzer):
    """Says what the test wants: whether a pause ends the turn, and when the silence does."""

    def __init__(self):
        super().__init__()
        self.complete = False  # what it makes of a pause
        self.silence = False  # it has lasted long enough

    speech_triggered = property(lambda self: False)
    params = property(lambda self: BaseTurnParams())

    def append_audio(self, buffer: bytes, is_speech: bool) -> EndOfTurnState:
        return EndOfTurnState.COMPLETE if self.silence else EndOfTurnState.INCOMPLETE

    async def analyze_end_of_turn(self):
        return (EndOfTurnState.COMPLETE if self.complete else EndOfTurnState.INCOMPLETE), None

    def listen(self, silence: float) -> None:
        pass

    def clear(self):
        self.silence = False


class Tap(FrameProcessor):
    """Notes what passes, in order."""

    def __init__(self):
        super().__init__()
        self.seen: list[Frame] = []

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        await super().process_frame(frame, direction)
        self.seen.append(frame)
        await self.push_frame(frame, direction)

    def of(self, *kinds) -> list[str]:
        return [type(frame).__name__ for frame in self.seen if isinstance(frame, kinds)]

    @property
    def answer(self) -> str:
        return "".join(f.text for f in self.seen if isinstance(f, LLMTextFrame)).strip()


class Stage:
    """A conversation without sound: voices and words in, answers out."""

    def __init__(self, turns=Turns(), trusted=True):  # noqa: B008
        self.analyzer, self.context, self.hushed = Verdicts(), LLMContext(), []
        self.asked, self.said = Tap(), Tap()  # before and behind the language model
        now = asyncio.get_running_loop().time
        chosen = strategies(self.analyzer, turns, trusted, self.hushed.append, now)
        user, assistant = LLMContextAggregatorPair(
            self.context,
            user_params=LLMUserAggregatorParams(
                user_turn_strategies=chosen, user_turn_stop_timeout=0.5, empty_user_turn=None
            ),
        )
        model = PersonaModel(Notes(PERSONA))
        self.worker = PipelineWorker(
            Pipeline([user, self.asked, model, self.said, assistant]),
            enable_rtvi=False,
            enable_turn_tracking=False,
            idle_timeout_secs=None,
        )

    async def play(self, *frames: Frame, wait: float = 0.1) -> None:
        for frame in frames:
            await self.worker.queue_frame(frame)
            await asyncio.sleep(0.01)  # system frames overtake others
        await asyncio.sleep(wait)

    async def pause(self, words: str, complete: bool) -> None:
        """A voice, its end, and what it said."""
        self.analyzer.complete = complete
        await self.play(
            VADUserStartedSpeakingFrame(),
            VADUserStoppedSpeakingFrame(stop_secs=0.2),
            TranscriptionFrame(words, "", "now", finalized=True),
        )

    async def silence(self) -> None:
        self.analyzer.silence = True
        await self.play(InputAudioRawFrame(bytes(640), 16_000, 1))

    @property
    def messages(self) -> list[tuple[str, str]]:
        return [(m["role"], m["content"]) for m in self.context.get_messages()]

    @property
    def questions(self) -> list[bool]:
        """For each request to the language model, whether it was a guess."""
        return [f.speculation for f in self.asked.seen if isinstance(f, LLMContextFrame)]


@pytest.fixture
async def stage(request):
    stage = Stage(**getattr(request, "param", {}))
    runner = WorkerRunner(handle_sigint=False, handle_sigterm=False)
    await runner.add_workers(stage.worker)
    task = asyncio.create_task(runner.run())
    await stage.play(STTMetadataFrame(service_name="words", ttfs_p99_latency=0.3))
    yield stage
    await stage.worker.cancel()
    await task


async def test_an_answer_is_ready_when_a_doubtful_pause_proves_to_be_the_end(stage):
    await stage.pause("Who are you?", complete=False)
    assert stage.questions == [True]
    assert stage.said.answer == ""  # held: no voice has got it
    assert stage.messages == []
    await stage.silence()
    assert stage.said.answer == "I am Ada."
    assert stage.questions == [True]  # asked once
    kinds = (UserStoppedSpeakingFrame, LLMTextFrame)
    assert stage.said.of(*kinds) == ["UserStoppedSpeakingFrame", "LLMTextFrame"]
    assert stage.messages[0] == ("user", "Who are you?")


async def test_an_answer_to_half_a_question_leaves_no_trace(stage):
    await stage.pause("Who are you", complete=False)
    assert stage.questions == [True]
    await stage.pause("and what?", complete=True)
    assert stage.questions == [True, False]
    assert stage.said.answer == "Many things."
    assert stage.messages[0] == ("user", "Who are you and what?")
    assert "I am Ada." not in str(stage.messages)


async def test_each_pause_of_a_turn_is_answered_anew(stage):
    await stage.pause("Well,", complete=False)
    await stage.pause("who are you?", complete=False)
    await stage.silence()
    assert stage.questions == [True, True]
    assert stage.said.answer == "I am Ada."
    assert stage.messages[0] == ("user", "Well, who are you?")
    assert len([role for role, _ in stage.messages if role == "user"]) == 1


async def test_a_certain_end_is_no_guess(stage):
    await stage.pause("Who are you?", complete=True)
    assert stage.questions == [False]
    assert stage.said.answer == "I am Ada."


@pytest.mark.parametrize("stage", [{"turns": Turns(speculate=False)}], indirect=True)
async def test_guessing_can_be_turned_off(stage):
    await stage.pause("Who are you?", complete=False)
    assert stage.questions == []
    await stage.silence()
    assert stage.questions == [False]
    assert stage.said.answer == "I am Ada."


def voice(at, seconds, **how):
    return VoiceFrame(at, seconds, **how)


async def test_uh_huh_is_no_turn_and_leaves_no_trace(stage):
    await stage.play(BotStartedSpeakingFrame(), voice(0.0, 0.3, voiced=True))
    assert stage.hushed == [True]
    await stage.pause("Uh-huh.", complete=True)
    assert stage.hushed == [True, False]
    kinds = (UserStartedSpeakingFrame, InterruptionFrame, LLMContextFrame)
    assert stage.asked.of(*kinds) == [] and stage.messages == []
    await stage.play(BotStoppedSpeakingFrame())
    await stage.pause("Who are you?", complete=True)
    assert stage.messages[0] == ("user", "Who are you?")


async def test_a_voice_that_goes_on_interrupts_and_is_answered(stage):
    await stage.play(
        BotStartedSpeakingFrame(),
        voice(0.0, 0.2, voiced=True),
        VADUserStartedSpeakingFrame(),
        voice(0.2, 0.3, voiced=True),
    )
    assert stage.hushed == [True]  # what is stopped is not resumed
    assert stage.asked.of(InterruptionFrame) == ["InterruptionFrame"]
    stage.analyzer.complete = True
    await stage.play(
        BotStoppedSpeakingFrame(),
        VADUserStoppedSpeakingFrame(stop_secs=0.2),
        TranscriptionFrame("Who are you?", "", "now", finalized=True),
    )
    assert stage.said.answer == "I am Ada."


async def test_one_word_interrupts_when_it_is_understood(stage):
    await stage.play(BotStartedSpeakingFrame(), voice(0.0, 0.3, voiced=True))
    await stage.pause("Why?", complete=True)
    assert stage.asked.of(InterruptionFrame) == ["InterruptionFrame"]
    await stage.play(BotStoppedSpeakingFrame(), wait=0.6)
    assert stage.messages[0] == ("user", "Why?")


async def test_silence_of_the_microphone_resumes(stage):
    await stage.play(BotStartedSpeakingFrame(), voice(0.0, 0.1, voiced=True), wait=0.4)
    assert stage.hushed == [True, False]


async def test_who_speaks_when_the_avatar_ends_has_the_floor(stage):
    await stage.play(
        BotStartedSpeakingFrame(),
        voice(0.0, 0.2, voiced=True),
        VADUserStartedSpeakingFrame(),
        BotStoppedSpeakingFrame(),
    )
    assert stage.asked.of(UserStartedSpeakingFrame) == ["UserStartedSpeakingFrame"]


async def test_the_button_alone_says_when_a_turn_ends(stage):
    stage.analyzer.complete = True
    await stage.play(
        BotStartedSpeakingFrame(),
        PageFrame(Talk(True)),
        VADUserStartedSpeakingFrame(start_secs=0.0),
        BotStoppedSpeakingFrame(),
        TranscriptionFrame("Who are", "", "now", finalized=True),
        InputAudioRawFrame(bytes(640), 16_000, 1),
    )
    assert stage.asked.of(InterruptionFrame) == ["InterruptionFrame"]
    assert stage.questions == []
    await stage.play(
        PageFrame(Talk(False)),
        VADUserStoppedSpeakingFrame(stop_secs=0.0),
        TranscriptionFrame("you?", "", "now", finalized=True),
    )
    assert stage.said.answer == "I am Ada."
    assert stage.messages[0] == ("user", "Who are you?")


async def test_letting_go_ends_a_turn_whose_words_came_already(stage):
    await stage.play(
        PageFrame(Talk(True)),
        VADUserStartedSpeakingFrame(start_secs=0.0),
        TranscriptionFrame("Who are you?", "", "now"),
        PageFrame(Talk(False)),
        VADUserStoppedSpeakingFrame(stop_secs=0.0),
        wait=0.4,
    )
    assert stage.said.answer == "I am Ada."


async def test_an_empty_turn_ends_by_itself_and_the_next_one_works(stage):
    await stage.play(
        PageFrame(Talk(True)),
        VADUserStartedSpeakingFrame(start_secs=0.0),
        PageFrame(Talk(False)),
        VADUserStoppedSpeakingFrame(stop_secs=0.0),
        wait=0.7,
    )
    assert stage.asked.of(UserStoppedSpeakingFrame) == ["UserStoppedSpeakingFrame"]
    await stage.pause("Who are you?", complete=True)
    assert stage.said.answer == "I am Ada."


async def test_what_is_said_ends_with_its_response(stage):
    await stage.pause("Who are you?", complete=True)
    assert stage.said.of(LLMFullResponseEndFrame) == ["LLMFullResponseEndFrame"]
