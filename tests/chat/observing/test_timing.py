"""Times of a turn, on a clock that the test sets; figures and the log."""

import asyncio
import json
from datetime import UTC, datetime

import numpy as np
import pytest
from loguru import logger
from pipecat.frames.frames import (
    BotStartedSpeakingFrame,
    BotStoppedSpeakingFrame,
    ErrorFrame,
    InterruptionFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
    TranscriptionFrame,
    TTSAudioRawFrame,
    UserStoppedSpeakingFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.observers.base_observer import FramePushed
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from prometheus_client.parser import text_string_to_metric_families

from ico3d.chat.frames import SpeechFrame, TypedFrame
from ico3d.chat.observing.metrics import Monitor, TurnLog
from ico3d.chat.observing.timing import PARTS, TurnObserver
from ico3d.chat.wire.protocol import Metrics
from ico3d.errors import SettingsError
from ico3d.measure.talking.scripted import Script, Voice
from support.full_disk import files_of_at_most


class Watched:
    """An observer with everything it said."""

    def __init__(self):
        self.now = 0  # ms
        self.told, self.turns, self.failures = [], [], []
        self.observer = TurnObserver(
            lambda: self.now / 1000, self.told.append, self.turns.append, self._failed
        )

    def _failed(self, part, cause):
        self.failures.append(part)

    async def see(self, at, *frames, source=None):
        """Frames pushed at a time, ms."""
        self.now = at
        for frame in frames:
            await self.observer.on_push_frame(
                FramePushed(source, None, frame, FrameDirection.DOWNSTREAM, at * 1_000_000)
            )

    async def ask(self, at):
        """A question whose last word ends at `at`: noticed after 200, a turn after 450 ms."""
        await self.see(at - 800, VADUserStartedSpeakingFrame())
        await self.see(at + 200, VADUserStoppedSpeakingFrame(stop_secs=0.2))
        await self.see(at + 280, TranscriptionFrame("who are you", "", ""))
        await self.see(at + 450, UserStoppedSpeakingFrame())

    async def answer(self, at, utterance=0):
        """From the model's start at `at` to its first sound 100 ms later."""
        await self.see(at, LLMFullResponseStartFrame())
        await self.see(at + 20, LLMTextFrame("I "))
        self.now = at + 50
        self.observer.clause()
        await self.see(at + 80, TTSAudioRawFrame(b"", 24000, 1))
        await self.see(at + 95, speech(utterance))
        await self.see(at + 100, BotStartedSpeakingFrame())


def speech(utterance, first=0):
    return SpeechFrame(utterance, first, 0, np.zeros(4800, np.int16), np.zeros((5, 39)))


@pytest.fixture
def watched():
    return Watched()


async def test_the_parts_of_a_turn_add_up(watched):
    await watched.ask(1000)
    await watched.answer(1460)
    values = {"vad": 200, "turn": 250, "token": 30, "clause": 30, "voice": 30, "expression": 15}
    values |= {"send": 5, "total": 560, "recognition": 80}
    assert watched.told == [Metrics("turn", pytest.approx(values))]
    assert sum(values[part] for part in PARTS) == values["total"]
    watched.now = 1900
    watched.observer.heard(0, 0.0)  # nothing yet
    watched.observer.heard(3, 0.25)  # of another one
    watched.observer.heard(0, 0.25)
    watched.observer.heard(0, 0.3)
    assert watched.told[1:] == [Metrics("played", pytest.approx({"voice_to_voice": 650}))]
    await watched.see(1950, speech(0, first=4800))
    await watched.see(2400, BotStoppedSpeakingFrame())
    (turn,) = watched.turns
    assert not turn.typed and not turn.interrupted and turn.seconds == pytest.approx(0.4)


async def test_a_greeting_is_no_turn(watched):
    await watched.answer(100)
    await watched.see(900, BotStoppedSpeakingFrame())
    assert not watched.told and not watched.turns


async def test_a_typed_question_counts_from_its_arrival(watched):
    await watched.see(500, TypedFrame("and now?"))
    await watched.answer(510)
    assert watched.told[0].values["total"] == pytest.approx(110)
    assert watched.told[0].values["vad"] == 0 and "recognition" not in watched.told[0].values


async def test_an_answer_begun_early_costs_nothing_until_it_is_wanted(watched):
    await watched.see(900, VADUserStoppedSpeakingFrame(stop_secs=0.2))
    await watched.see(910, LLMFullResponseStartFrame())
    await watched.see(930, LLMTextFrame("I "))
    await watched.see(1000, UserStoppedSpeakingFrame())
    await watched.see(1040, TTSAudioRawFrame(b"", 24000, 1), speech(0), BotStartedSpeakingFrame())
    values = watched.told[0].values
    assert (values["turn"], values["token"], values["voice"]) == pytest.approx((100, 0, 40))


async def test_an_answer_thrown_away_leaves_no_times(watched):
    await watched.see(900, VADUserStoppedSpeakingFrame(stop_secs=0.2))
    await watched.see(910, LLMFullResponseStartFrame(), LLMTextFrame("Wrong"))
    await watched.see(950, VADUserStartedSpeakingFrame())
    await watched.ask(3000)
    await watched.answer(3460)
    assert watched.told[0].values["token"] == pytest.approx(30)
    assert watched.told[0].values["total"] == pytest.approx(560)


async def test_a_button_says_when_the_words_ended(watched):
    await watched.ask(1000)
    await watched.see(2500, VADUserStartedSpeakingFrame())
    await watched.see(3000, UserStoppedSpeakingFrame())  # before any silence was noticed
    await watched.answer(3010)
    assert watched.told[0].values["total"] == pytest.approx(110)


async def test_an_interruption_ends_a_turn(watched):
    await watched.ask(1000)
    await watched.answer(1460)
    await watched.see(1700, InterruptionFrame())
    await watched.see(1701, BotStoppedSpeakingFrame())
    await watched.ask(4000)
    await watched.answer(4460, utterance=1)
    await watched.see(5000, BotStoppedSpeakingFrame())
    assert [turn.interrupted for turn in watched.turns] == [True, False]
    assert [turn.heard for turn in watched.turns] == [None, None]


async def test_errors_are_counted_by_who_had_them(watched):
    await watched.see(0, ErrorFrame("x"), source=Voice(Script()))
    await watched.see(0, ErrorFrame("x"), source=FrameProcessor())
    assert watched.failures == ["voice", "pipeline"]


def figures(monitor):
    text = monitor.exposition().decode()
    return {
        (sample.name, *sample.labels.values()): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


async def test_the_tasks_of_a_loop_are_counted():
    monitor = Monitor()
    assert figures(monitor)["ico3d_tasks",] == 0
    monitor.watch(asyncio.get_running_loop())
    before = figures(monitor)["ico3d_tasks",]
    task = asyncio.create_task(asyncio.sleep(60))
    assert figures(monitor)["ico3d_tasks",] == before + 1
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    assert figures(monitor)["ico3d_tasks",] == before


async def test_a_page_has_heard_nothing_before_it_was_asked_for(watched):
    await watched.ask(1000)
    await watched.answer(1460)
    watched.observer.heard(0, 1e7)  # what no message to a page may hold
    assert watched.told[1:] == [Metrics("played", {"voice_to_voice": 0.0})]


async def test_turns_become_figures_and_lines(watched, tmp_path):
    path = tmp_path / "turns.jsonl"
    path.write_text('{"before": 1}\n')
    day = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
    monitor = Monitor(TurnLog.open(path), lambda: day)
    first, second = monitor.visitor(), monitor.visitor()
    await watched.ask(1000)
    await watched.answer(1460)
    watched.now = 1860
    watched.observer.heard(0, 0.2)
    await watched.see(2000, InterruptionFrame(), BotStoppedSpeakingFrame())
    second.turn(watched.turns[0])
    second.turn(watched.turns[0])
    first.failed("voice", "500")
    monitor.left("idle")

    kept, line, last = [json.loads(text) for text in path.read_text().splitlines()]
    assert kept == {"before": 1}
    parts = {"vad": 200.0, "turn": 250.0, "token": 30.0, "clause": 30.0, "voice": 30.0}
    parts |= {"expression": 15.0, "send": 5.0, "total": 560.0, "recognition": 80.0}
    assert line == {
        "time": "2026-01-02T03:04:05.000+00:00",
        "session": 2,
        "turn": 1,
        "typed": False,
        "parts_ms": parts,
        "voice_to_voice_ms": 660.0,
        "answer_seconds": 0.2,
        "interrupted": True,
    }
    assert last["turn"] == 2

    found = figures(monitor)
    assert found["ico3d_turn_part_seconds_count", "voice"] == 2
    assert found["ico3d_turn_part_seconds_sum", "total"] == pytest.approx(1.12)
    assert found["ico3d_turn_part_seconds_bucket", "0.4", "total"] == 0
    assert found["ico3d_turn_part_seconds_bucket", "0.6", "total"] == 2
    assert found["ico3d_voice_to_voice_seconds_sum",] == pytest.approx(1.32)
    assert found["ico3d_turns_total", "spoken"] == 2
    assert found["ico3d_interruptions_total",] == 2
    assert found["ico3d_errors_total", "voice"] == 1
    assert found["ico3d_sessions",] == 1 and found["ico3d_sessions_ended_total", "idle"] == 1


def test_a_log_that_cannot_be_written_is_one_sentence(tmp_path):
    with pytest.raises(SettingsError, match=r"--log .* cannot be written"):
        TurnLog.open(tmp_path)


def test_a_log_on_a_full_disk_ends_no_session_and_goes_on_later(tmp_path):
    log, warnings_told = TurnLog.open(tmp_path / "turns.jsonl"), []
    number = logger.add(warnings_told.append, level="WARNING", format="{message}")
    with files_of_at_most(40):
        for turn in range(3):
            log.write({"turn": turn, "padding": "x" * 30})
    log.write({"turn": 3})
    logger.remove(number)
    assert '{"turn": 3}' in (tmp_path / "turns.jsonl").read_text()
    assert sum("--log cannot be written" in told for told in warnings_told) == 1
