"""The processor between voice and page, which adds a face to every piece of sound."""

import asyncio
import time
from collections.abc import Callable

import numpy as np
from pipecat.frames.frames import (
    AggregatedTextFrame,
    Frame,
    InterruptionFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    TTSAudioRawFrame,
    TTSStoppedFrame,
    TTSTextFrame,
)
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from pipecat.utils.text.base_text_aggregator import TextType

from ico3d.chat.frames import PhonemesFrame, SpeechFrame, UtteranceEndFrame, Utterances
from ico3d.chat.performing.face import ROW, Face
from ico3d.chat.performing.sentence import MOST, Piece, Sentence
from ico3d.chat.wire.protocol import EXPRESSION_FPS
from ico3d.chat.workers import Run, at_once

STEP = 3 * MOST * ROW  # samples that go through the model at once: the first face comes early


class ExpressionProcessor(FrameProcessor):
    """Turns audio frames of the voice into `SpeechFrame`s of numbered utterances.

    An utterance is one answer of the language model, or a text that is spoken outside of an answer.
    """

    def __init__(
        self,
        face: Face,
        utterances: Utterances | None = None,
        run: Run = at_once,
        made: Callable[[SpeechFrame | UtteranceEndFrame], None] | None = None,
    ):
        """Creates the processor of one session.

        Args:
            face: The face of the session.
            utterances: Numbers of answers; by default only this processor counts them.
            run: Runs slow work before the time at which its result is due; by default in any
                thread.
            made: Called with each piece when it is made, long before it is sent.
        """
        super().__init__()
        self._face, self._utterances, self._run = face, utterances or Utterances(), run
        self._made = made
        self._in_answer = False
        self._utterance: int | None = None
        self._opened = time.monotonic()  # when the session began; eyes run on its time
        self._reset()

    def _reset(self) -> None:
        self._utterance = None
        self._sentence: Sentence | None = None
        self._text: str | None = None  # of the sentence that comes next
        self._told: PhonemesFrame | None = None  # of the sound that comes next
        self._next_row = 0
        self._start = 0.0

    async def cleanup(self):
        """Closes the face."""
        await super().cleanup()
        await asyncio.to_thread(self._face.close)

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Replaces audio, detects the ends of sentences and answers, and passes other frames on."""
        await super().process_frame(frame, direction)
        if isinstance(frame, TTSAudioRawFrame):
            await self._speak(frame)
            return
        if isinstance(frame, InterruptionFrame):
            self._in_answer = False
            self._reset()
        elif isinstance(frame, LLMFullResponseStartFrame):
            self._in_answer = True
        elif isinstance(frame, LLMFullResponseEndFrame):
            self._in_answer = False
            await self._end_utterance()
        elif isinstance(frame, TTSStoppedFrame):
            await self._end_sentence()
            if not self._in_answer:
                await self._end_utterance()
        elif isinstance(frame, TTSTextFrame):
            if frame.text_type == TextType.SENTENCE:  # single words come in the middle of sound
                await self._end_sentence()
        elif isinstance(frame, PhonemesFrame):
            self._told = frame
        elif isinstance(frame, AggregatedTextFrame) and frame.will_be_spoken:
            await self._end_sentence()
            self._text = frame.text
            self._face.moods.hear(frame.text)
        await self.push_frame(frame, direction)

    async def _speak(self, frame: TTSAudioRawFrame) -> None:
        if self._utterance is None:
            self._utterance = self._utterances.begin()
            self._start = time.monotonic()
        if self._sentence is None:
            self._sentence = Sentence(self._face, self._next_row, self._start - self._opened)
        told, self._told = self._told, None
        if told is not None:
            self._sentence.tell(told.phonemes, told.seconds)
        pcm = np.frombuffer(frame.audio, np.int16)
        for at in range(0, len(pcm), STEP):
            due = self._due(self._sentence)
            await self._push(await self._run(due, self._sentence.push, pcm[at : at + STEP]))

    async def _end_sentence(self) -> None:
        if self._sentence is None:
            return
        sentence, self._sentence = self._sentence, None
        await self._push(await self._run(self._due(sentence), sentence.finish), last=True)
        self._next_row = sentence.next_row

    def _due(self, sentence: Sentence) -> float:
        """When the next piece is heard, at the soonest."""
        return self._start + sentence.next_row / EXPRESSION_FPS

    async def _end_utterance(self) -> None:
        await self._end_sentence()
        if self._utterance is not None:
            samples = self._next_row * ROW
            self._utterances.made(self._utterance, samples, complete=True)
            self._face.moods.forget()
            await self._hand_on(UtteranceEndFrame(self._utterance, samples))
        self._reset()

    async def _push(self, pieces: list[Piece], last: bool = False) -> None:
        for number, piece in enumerate(pieces):
            text, self._text = self._text, None
            row = piece.first_row
            assert self._utterance is not None
            self._utterances.made(self._utterance, row * ROW + len(piece.pcm))
            ends = last and number == len(pieces) - 1
            face = piece.pcm, piece.expressions
            await self._hand_on(SpeechFrame(self._utterance, row * ROW, row, *face, text, ends))

    async def _hand_on(self, frame: SpeechFrame | UtteranceEndFrame) -> None:
        if self._made is not None:
            self._made(frame)
        await self.push_frame(frame)
