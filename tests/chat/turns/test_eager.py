"""Smart-Turn's early verdict: the same as that on the whole pause, or none."""

import numpy as np
import pytest
from pipecat.audio.turn.base_turn_analyzer import EndOfTurnState
from pipecat.audio.turn.smart_turn.base_smart_turn import BaseSmartTurn
from pipecat.audio.turn.smart_turn.local_smart_turn_v3 import LocalSmartTurnAnalyzerV3
from pipecat.audio.vad.vad_analyzer import VADState

from ico3d.chat.settings.conversation import Turns
from ico3d.chat.turns.detector import EagerSilero
from ico3d.chat.turns.eager import EagerSmartTurn
from ico3d.chat.wire.protocol import MICROPHONE_CHUNK as PIECE
from ico3d.chat.wire.protocol import MICROPHONE_RATE as RATE
from ico3d.measure.talking.questions import spoken

COMPLETE, INCOMPLETE = EndOfTurnState.COMPLETE, EndOfTurnState.INCOMPLETE
PAUSE = Turns().pause


class Scripted(EagerSmartTurn):
    """Has these opinions, one after the other; notes how long what it heard was."""

    def __init__(self, *probabilities):
        super().__init__(PAUSE)
        self.set_sample_rate(RATE)
        self.asked, self._probabilities = [], list(probabilities)

    def _predict_endpoint(self, audio_array):
        self.asked.append(len(audio_array))
        probability = self._probabilities.pop(0)
        return {"prediction": int(probability > 0.5), "probability": probability}


def pieces(seconds):
    return [np.full(PIECE, 7, np.int16).tobytes()] * round(seconds * RATE / PIECE)


def hear(analyzer, speech=0.64, silence=0.0):
    """Speech, and the beginning of a pause, piece by piece."""
    for piece in pieces(speech):
        analyzer.append_audio(piece, True)
        analyzer.listen(0.0)
    for number, piece in enumerate(pieces(silence), start=1):
        analyzer.append_audio(piece, True)  # the VAD is not sure yet
        analyzer.listen(number * PIECE / RATE)


async def verdict(analyzer):
    state, found = await analyzer.analyze_end_of_turn()
    await analyzer.cleanup()
    return state, found.probability


@pytest.mark.parametrize("voice", ["en-us", "en-us+f3"])
@pytest.mark.parametrize(
    "text", ["Tell me about the weather in Paris.", "I would like to know, what the, um"]
)
async def test_the_early_verdict_is_that_on_the_whole_pause(text, voice, monkeypatch):
    sound = np.pad(spoken(text, voice), (RATE // 2, RATE))
    ear, eager, plain = EagerSilero(PAUSE), EagerSmartTurn(PAUSE), LocalSmartTurnAnalyzerV3()
    eager.set_sample_rate(RATE)
    ear.set_sample_rate(RATE)
    plain.set_sample_rate(RATE)
    speaking = False
    for at in range(0, len(sound) - PIECE, PIECE):
        piece = sound[at : at + PIECE].tobytes()
        for analyzer in (eager, plain):
            analyzer.append_audio(piece, speaking)
        state = await ear.analyze_audio(piece)
        speaking = speaking or state == VADState.SPEAKING
        if speaking and state == VADState.QUIET:
            break
        eager.listen(ear.silence)
    else:
        pytest.fail("the voice did not end")
    late, after = await verdict(plain)
    monkeypatch.delattr(BaseSmartTurn, "analyze_end_of_turn")  # nothing is asked any more
    early, before = await verdict(eager)
    await ear.cleanup()
    assert early == late and abs(before - after) < 0.1


async def test_it_is_asked_about_the_pause_to_come():
    analyzer = Scripted(0.9)
    hear(analyzer, 0.64, silence=0.096)
    assert await verdict(analyzer) == (COMPLETE, 0.9)
    assert analyzer.asked == [round(RATE * (0.64 + PAUSE))]


async def test_an_unsure_verdict_is_asked_for_again():
    analyzer = Scripted(0.65, 0.3)
    hear(analyzer, 0.64, silence=0.192)
    assert await verdict(analyzer) == (INCOMPLETE, 0.3)
    assert analyzer.asked == [round(RATE * (0.64 + PAUSE)), round(RATE * (0.64 + 0.192))]


async def test_a_voice_that_goes_on_is_heard_to_its_end():
    analyzer = Scripted(0.9, 0.2)
    hear(analyzer, 0.32, silence=0.096)
    hear(analyzer, 0.32, silence=0.096)
    assert await verdict(analyzer) == (INCOMPLETE, 0.2)
    assert analyzer.asked[-1] == round(RATE * (0.32 + 0.096 + 0.32 + PAUSE))


async def test_a_pause_in_a_word_is_not_asked_about():
    analyzer = Scripted(0.8)
    hear(analyzer, 0.64, silence=0.064)
    assert analyzer.asked == []
    assert await verdict(analyzer) == (COMPLETE, 0.8)


async def test_a_complete_turn_is_forgotten():
    analyzer = Scripted(0.9)
    hear(analyzer, 0.64, silence=0.096)
    await analyzer.analyze_end_of_turn()
    analyzer.listen(0.128)  # nothing is there that could be asked about
    assert await analyzer.analyze_end_of_turn() == (INCOMPLETE, None)
    await analyzer.cleanup()
