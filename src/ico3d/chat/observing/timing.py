"""Measures the parts of a turn by watching the pipeline's frames."""

from collections.abc import Callable
from dataclasses import dataclass, field

from pipecat.clocks.base_clock import BaseClock
from pipecat.frames.frames import (
    BotStartedSpeakingFrame,
    BotStoppedSpeakingFrame,
    ErrorFrame,
    Frame,
    InterruptionFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
    TranscriptionFrame,
    TTSAudioRawFrame,
    UserStoppedSpeakingFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.observers.base_observer import BaseObserver, FramePushed
from pipecat.processors.frame_processor import FrameDirection
from pipecat.services.llm_service import LLMService
from pipecat.services.stt_service import STTService
from pipecat.services.tts_service import TTSService

from ico3d.chat.frames import SpeechFrame, TypedFrame, UtteranceEndFrame
from ico3d.chat.observing.failures import cause_of
from ico3d.chat.wire.protocol import SPEECH_RATE, Metrics

PARTS = ("vad", "turn", "token", "clause", "voice", "expression", "send")
"""Parts between the visitor's last word and the sending of the first sound, in order."""


@dataclass
class Turn:
    """One question and its answer; times are seconds of the pipeline's clock.

    Attributes:
        asked: Time at which the visitor's words ended.
        typed: Whether the question was typed.
        marks: Time at which each part ended; a part that ended before it was needed took no time.
        utterance: Number of the answer, or None.
        heard: Time at which the answer's first sample was heard, or None.
        seconds: Duration of the answer, as far as it was synthesised.
        interrupted: Whether the answer was stopped.
    """

    asked: float
    typed: bool
    marks: dict[str, float] = field(default_factory=dict)
    utterance: int | None = None
    heard: float | None = None
    seconds: float = 0.0
    interrupted: bool = False

    def parts(self) -> dict[str, float]:
        """Milliseconds of each part, in total, and of recognition, which ran in parallel."""
        before, values = self.asked, {}
        for part in PARTS:
            at = max(before, self.marks.get(part, before))
            values[part] = 1000 * (at - before)
            before = at
        values["total"] = 1000 * (before - self.asked)
        if "recognition" in self.marks and "vad" in self.marks:
            values["recognition"] = 1000 * (self.marks["recognition"] - self.marks["vad"])
        return values

    def voice_to_voice(self) -> float | None:
        """Milliseconds from the question's end until the answer was heard; None if it was not."""
        return None if self.heard is None else 1000 * (self.heard - self.asked)


class PipelineClock(BaseClock):
    """A pipecat clock with another source of time."""

    def __init__(self, now: Callable[[], float]):
        """`now` returns seconds."""
        self._now = now

    def get_time(self) -> int:
        """The time in nanoseconds."""
        return int(self._now() * 1e9)

    def start(self):
        """Does nothing: the source of time runs already."""


class TurnObserver(BaseObserver):
    """Takes the time from the end of the visitor's words to the first sound of the answer.

    The parts in order: `vad` until silence is noticed; `turn` until the turn is considered over
    (the recogniser finishes in parallel: `recognition`); `token` until the language model's first
    word; `clause` until the voice gets the first clause; `voice` until the first sound;
    `expression` until its face; `send` until both are sent. pipecat's own latency observer needs
    services that report metrics and does not know faces; this one only watches frames.
    """

    def __init__(
        self,
        now: Callable[[], float],
        report: Callable[[Metrics], None],
        done: Callable[[Turn], None],
        failed: Callable[[str, str], None],
    ):
        """Creates the observer of one session.

        Args:
            now: Returns the time of the pipeline's clock in seconds.
            report: Receives the metrics for the page.
            done: Receives every turn whose answer is over.
            failed: Receives the name of a part that reported an error, and the cause.
        """
        super().__init__(observe_every_push=False)
        self._now, self._report, self._done, self._failed = now, report, done, failed
        self._silence: tuple[float, float] | None = None  # s: last word, and when it was noticed
        self._words: float | None = None  # s: the last transcript
        self._asked: Turn | None = None  # waits for its first sound
        self._turn: Turn | None = None  # is being answered
        self._marks: dict[str, float] = {}  # of the answer that is being made
        self._made: tuple[int, float] = (-1, 0.0)  # utterance and seconds of its sound

    async def on_push_frame(self, data: FramePushed):
        """Watches a frame when it is first pushed."""
        frame, at = data.frame, data.timestamp / 1e9
        if isinstance(frame, ErrorFrame):
            self._failed(part_of(data.source), cause_of(frame))
        elif data.direction == FrameDirection.DOWNSTREAM:
            self._look(frame, at)

    def clause(self) -> None:
        """Registers that the voice was given a text."""
        self._mark("clause", self._now())

    def heard(self, utterance: int, position: float) -> None:
        """Registers that the page has played `position` seconds of an utterance."""
        turn = self._turn
        if turn and turn.utterance == utterance and turn.heard is None and position > 0:
            # a page may claim any position, but nothing is heard before it is asked for
            turn.heard = max(self._now() - position, turn.asked)
            self._report(Metrics("played", {"voice_to_voice": 1000 * (turn.heard - turn.asked)}))

    def _look(self, frame: Frame, at: float) -> None:
        if isinstance(frame, VADUserStartedSpeakingFrame):
            self._silence = None
        elif isinstance(frame, VADUserStoppedSpeakingFrame):
            self._silence, self._words = (at - frame.stop_secs, at), None
        elif isinstance(frame, TranscriptionFrame):
            self._words = at
        elif isinstance(frame, UserStoppedSpeakingFrame):
            self._spoken(at)
        elif isinstance(frame, TypedFrame):
            self._asked = Turn(at, typed=True)
        elif isinstance(frame, LLMFullResponseStartFrame):
            self._marks = {part: time for part, time in self._marks.items() if time >= at}
        elif isinstance(frame, LLMTextFrame):
            self._mark("token", at)
        elif isinstance(frame, TTSAudioRawFrame):
            self._mark("voice", at)
        elif isinstance(frame, SpeechFrame):
            self._mark("expression", at)
            self._made = frame.utterance, (frame.first_sample + len(frame.pcm)) / SPEECH_RATE
        elif isinstance(frame, UtteranceEndFrame):
            self._made = frame.utterance, frame.samples / SPEECH_RATE
        else:
            self._look_at_answer(frame, at)

    def _look_at_answer(self, frame: Frame, at: float) -> None:
        if isinstance(frame, BotStartedSpeakingFrame):
            self._answered(at)
        elif isinstance(frame, InterruptionFrame) and self._turn:
            self._turn.interrupted = True
        elif isinstance(frame, BotStoppedSpeakingFrame):
            self._over()

    def _mark(self, part: str, at: float) -> None:
        self._marks.setdefault(part, at)

    def _spoken(self, at: float) -> None:
        self._asked = Turn(at, typed=False)
        if self._silence is None:
            return  # push to talk: the button said when the words ended
        self._asked.asked, noticed = self._silence
        self._asked.marks = {"vad": noticed, "turn": at}
        if self._words is not None:
            self._asked.marks["recognition"] = self._words

    def _answered(self, at: float) -> None:
        self._over()
        turn, self._asked = self._asked, None
        if turn is None:
            return  # nobody asked: a greeting
        turn.marks |= self._marks | {"send": at}
        turn.utterance = self._made[0]
        self._turn = turn
        self._report(Metrics("turn", turn.parts()))

    def _over(self) -> None:
        turn, self._turn = self._turn, None
        if turn is None:
            return
        utterance, seconds = self._made
        turn.seconds = seconds if utterance == turn.utterance else turn.seconds
        self._done(turn)


def part_of(source: object) -> str:
    """The part of the conversation to which a processor belongs, for counting errors."""
    kinds = {STTService: "recognition", LLMService: "language", TTSService: "voice"}
    return next((name for kind, name in kinds.items() if isinstance(source, kind)), "pipeline")
