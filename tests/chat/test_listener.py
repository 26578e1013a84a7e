"""What stands behind the recogniser: no turn is longer than a question that is typed."""

from pipecat.frames.frames import (
    InterimTranscriptionFrame,
    TranscriptionFrame,
    UserStartedSpeakingFrame,
    UserStoppedSpeakingFrame,
    VADUserStartedSpeakingFrame,
)
from pipecat.processors.frame_processor import FrameDirection

from ico3d.chat.listener import Captions
from ico3d.chat.page import Page
from ico3d.chat.wire.protocol import MAX_QUESTION


async def passed(*frames):
    """The texts that get past the captions, in order."""
    captions, texts = Captions(Page()), []

    async def push(frame, direction):
        if isinstance(frame, TranscriptionFrame | InterimTranscriptionFrame):
            texts.append(frame.text)

    captions.push_frame = push
    for frame in frames:
        await captions.process_frame(frame, FrameDirection.DOWNSTREAM)
    return texts


def said(letter, count=900, final=True):
    kind = TranscriptionFrame if final else InterimTranscriptionFrame
    return kind(letter * count, "", "")


async def test_all_words_of_a_turn_are_no_longer_than_a_question():
    early = [VADUserStartedSpeakingFrame(), said("a"), UserStartedSpeakingFrame()]
    turn = [*early, said("b", final=False), said("b"), said("c"), said("d"), said("e", final=False)]
    texts = await passed(*turn, UserStoppedSpeakingFrame(), UserStartedSpeakingFrame(), said("f"))
    assert texts[:3] == ["a" * 900, "b" * 900, "b" * 900]
    assert texts[3] == "c" * (MAX_QUESTION - 2 * 901)
    assert texts[4:6] == [" ", " "]  # which still end a turn
    assert texts[6] == "f" * 900  # a turn with room again


async def test_words_that_become_no_turn_take_no_room():
    voice = [VADUserStartedSpeakingFrame(), said("a", 1500)]
    assert await passed(*voice, *voice) == ["a" * 1500] * 2
