"""The end of a server that is asked to end: nobody new comes in, and what is being said is said."""

import asyncio
import signal
from types import FrameType

import uvicorn

from ico3d.chat.serving.sessions import Session, Sessions

LONGEST = 25.0
"""Seconds that answers may take to their end: container managers kill after 30 at the earliest."""
QUIET = 0.5  # s without question or answer after which a conversation is over: a pause is shorter


class Ending:
    """Ends each conversation once its answer is over."""

    def __init__(self, sessions: Sessions):
        """Turns new and waiting visitors away."""
        self._sessions, self._now = sessions, asyncio.get_running_loop().time
        self._began = self._now()
        self._quiet_since: dict[str, float] = {}
        sessions.line.close()

    def is_over(self) -> bool:
        """Ends the conversations that are quiet, after `LONGEST` all.

        Returns:
            Whether none was left: the last page's connection still needs a moment for its sentence.
        """
        late = self._now() - self._began >= LONGEST
        present = self._sessions.present()
        for session in present:
            if late or self._is_quiet(session):
                self._sessions.dismiss(session)
        return not present

    def _is_quiet(self, session: Session) -> bool:
        if not session.page.is_attached:
            return True  # by the time it came back, there would be no server
        if session.parts is None or session.page.state != "idle":
            self._quiet_since.pop(session.id, None)
            return False
        return self._now() - self._quiet_since.setdefault(session.id, self._now()) >= QUIET


class PatientServer(uvicorn.Server):
    """A server that on SIGTERM ends its conversations first; on a second one it ends at once."""

    def __init__(self, config: uvicorn.Config, sessions: Sessions | None):
        """Serves visitors, if there are any, until a signal comes."""
        super().__init__(config)
        self._sessions = sessions
        self._asked = False
        self._ending: Ending | None = None

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Notes SIGTERM, for a handler of signals must touch nothing of the event loop."""
        if sig == signal.SIGTERM and self._sessions is not None and not self._asked:
            self._asked = True
        else:
            super().handle_exit(sig, frame)

    async def on_tick(self, counter: int) -> bool:
        """Looks ten times a second whether the last conversation has ended."""
        if self._asked and self._sessions is not None:
            if self._ending is None:
                open_ones = len(self._sessions)
                print(f"Asked to end: {open_ones} conversations finish their answers.", flush=True)
                self._ending = Ending(self._sessions)
            self.should_exit |= self._ending.is_over()
        return await super().on_tick(counter)
