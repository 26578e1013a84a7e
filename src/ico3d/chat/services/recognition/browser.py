"""Speech recognition by the visitor's browser (Web Speech API); the page sends transcripts.

The sound is sent to the server, too, which decides when somebody speaks and has finished.
"""

import asyncio
from collections.abc import AsyncGenerator
from dataclasses import dataclass

from pipecat.frames.frames import (
    ErrorFrame,
    Frame,
    InterimTranscriptionFrame,
    ManuallySwitchServiceFrame,
    TranscriptionFrame,
    UserStartedSpeakingFrame,
    UserStoppedSpeakingFrame,
    VADUserStartedSpeakingFrame,
    VADUserStoppedSpeakingFrame,
)
from pipecat.pipeline.service_switcher import ServiceSwitcher
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from pipecat.services.settings import STTSettings
from pipecat.services.stt_service import STTService
from pipecat.utils.time import time_now_iso8601

from ico3d.chat.frames import message_in
from ico3d.chat.pipecat_internals import is_user_speaking, raise_event
from ico3d.chat.services.choosing import ChosenService, chosen
from ico3d.chat.services.provider import IN_FILE, Context, Table
from ico3d.chat.services.recognition.room import Room
from ico3d.chat.services.recognition.segments import blank
from ico3d.chat.settings.conversation import BEST, Choice
from ico3d.chat.wire.protocol import Deaf, Heard

SETTLED = 0.5  # s without news in silence after which partial words are taken for final ones
SLOWEST = 1.5  # s that a browser may take for its first words
LATE = 3.0  # s after a voice in which its words may still come
PACE = 0.1  # s between partial words that are passed on: faster than anybody reads


@dataclass(frozen=True)
class Settings:
    """Options of recognition by the browser.

    Attributes:
        language: BCP 47 tag of the spoken language, such as `de-DE`; empty for the browser's
            language.
        fallback: Recogniser for browsers without recognition: name of another provider, with its
            default options; `best`; or empty for none.
    """

    language: str = ""
    fallback: str = BEST


class BrowserRecognition(STTService):
    """Turns the page's words into transcripts of the pipeline.

    Words that arrive while nobody speaks are dropped, because browsers also recognise the avatar's
    voice.
    """

    def __init__(self):
        """Creates the recogniser of one session."""
        settings = STTSettings(model="browser", language=None)
        super().__init__(ttfs_p99_latency=SLOWEST, settings=settings)
        self._partial: Heard | None = None
        self._taken = -1  # the last result whose words are final here
        self._understood = False  # whether there were final words since the voice began
        self._voice_until = -LATE  # the event loop's clock
        self._room, self._in_turn = Room(), False
        self._timer: asyncio.Task | None = None
        self._telling: asyncio.Task | None = None  # of partial words, when it is time
        self._told = -PACE  # when partial words were passed on

    async def run_stt(self, audio: bytes) -> AsyncGenerator[Frame | None, None]:
        """Yields nothing: this recogniser does not use sound."""
        yield None

    async def cleanup(self):
        """Cancels what waits."""
        await super().cleanup()
        await self._stop_timer()
        if self._telling is not None:
            await self.cancel_task(self._telling)

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Handles the page's words and passes all other frames on."""
        if heard := message_in(frame, Heard):
            await self._hear(heard)
            return
        await super().process_frame(frame, direction)
        if isinstance(frame, UserStartedSpeakingFrame):
            self._in_turn = True
        elif isinstance(frame, UserStoppedSpeakingFrame):
            self._in_turn = False
            self._room.clear()
        elif isinstance(frame, VADUserStoppedSpeakingFrame):
            self._voice_until = self._now()
            await self._restart_timer()

    async def _handle_vad_user_started_speaking(self, frame: VADUserStartedSpeakingFrame):
        await super()._handle_vad_user_started_speaking(frame)
        self._understood = False
        if not self._in_turn:
            self._room.clear()  # what was said before has become no turn
        await self._stop_timer()

    async def _hear(self, heard: Heard) -> None:
        belongs = is_user_speaking(self) or self._now() - self._voice_until < LATE
        if heard.result <= self._taken or not belongs or not heard.text.strip():
            return
        if heard.final:
            await self._take(heard)
            return
        self._partial = heard
        if self._telling is None:
            wait = self._told + PACE - self._now()
            if wait > 0:
                self._telling = self.create_task(self._tell_later(wait), "tell")
            else:
                await self._tell()
        if not is_user_speaking(self):
            await self._restart_timer()

    async def _tell_later(self, wait: float) -> None:
        await asyncio.sleep(wait)
        self._telling = None
        await self._tell()

    async def _tell(self) -> None:
        """Passes the newest partial words on, unless they are final by now."""
        self._told = self._now()
        words = self._room.fit(self._partial.text) if self._partial else ""
        if words:
            await self.push_frame(InterimTranscriptionFrame(words, "", time_now_iso8601()))

    async def _take(self, heard: Heard) -> None:
        self._taken, self._partial, self._understood = heard.result, None, True
        speaking, words = is_user_speaking(self), self._room.take(heard.text)
        if not speaking:
            await self._stop_timer()
        if words:
            said = TranscriptionFrame(words, "", time_now_iso8601(), finalized=not speaking)
            await self.push_frame(said)
        elif not speaking:
            await self.push_frame(blank())  # the turn may end without the words that are too many

    async def _settle(self) -> None:
        await asyncio.sleep(SETTLED)
        if self._partial is not None:
            self._timer = None  # it shall not stop itself
            await self._take(self._partial)
            return
        if not self._understood:
            await asyncio.sleep(SLOWEST - SETTLED)
        await self.push_frame(blank())  # nothing more is on its way

    async def _restart_timer(self) -> None:
        await self._stop_timer()
        self._timer = self.create_task(self._settle(), "settle")

    async def _stop_timer(self) -> None:
        if self._timer is not None:
            timer, self._timer = self._timer, None
            await self.cancel_task(timer)

    @staticmethod
    def _now() -> float:
        return asyncio.get_running_loop().time()


class BrowserOrServer(ServiceSwitcher):
    """The browser's recogniser until the page says that the browser has none."""

    def __init__(self, server: FrameProcessor):
        """Takes the recogniser to which to switch."""
        super().__init__([BrowserRecognition(), server])
        self._server = server
        server.add_event_handler("on_error", self._failed)

    async def _failed(self, _: FrameProcessor, error: ErrorFrame) -> None:
        """Whoever listens for errors knows this processor only."""
        await raise_event(self, "on_error", error)

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Switches to the server's recogniser when the page asks for it."""
        if message_in(frame, Deaf):
            frame = ManuallySwitchServiceFrame(service=self._server)
        await super().process_frame(frame, direction)


def hindrance(settings: Settings) -> str:
    """A sentence that keeps `best` from choosing the browser, which must be asked for by name."""
    return (
        "the browser's maker may receive the sound: "
        f'set [recognition] use = "browser"{IN_FILE} if that is wanted.'
    )


def fallback(table: Table, settings: Settings) -> ChosenService | None:
    """The recogniser for browsers that have none, or None.

    Args:
        table: Recognisers that run on the server.
        settings: Options, of which `fallback` is used.

    Raises:
        SettingsError: If the recogniser is unknown, or none works.
    """
    if not settings.fallback:
        return None
    return chosen(table, Choice(settings.fallback), "recognition")


def make(table: Table, settings: Settings, context: Context) -> FrameProcessor:
    """Creates the recogniser of one session, with a fallback on the server.

    Args:
        table: Recognisers that run on the server.
        settings: Options of recognition by the browser.
        context: The avatar.

    Raises:
        SettingsError: If the fallback does not exist.
    """
    listener = fallback(table, settings)
    return BrowserOrServer(listener.make(context)) if listener else BrowserRecognition()
