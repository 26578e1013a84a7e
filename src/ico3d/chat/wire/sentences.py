"""Sentences that the server says to visitors, with codes by which pages translate them.

The page's own words for a code are those of the key `server.CODE` in `viewer/src/words/texts.json`.
"""

from dataclasses import dataclass

from ico3d.chat.wire.protocol import Error, Notice


@dataclass(frozen=True)
class Sentence:
    """A sentence for visitors.

    Attributes:
        code: Its name; it stays when the wording changes.
        text: The sentence in English, with numbers as `{name}`.
    """

    code: str
    text: str

    def error(self, fatal: bool, again: bool = False, **values: float) -> Error:
        """The message that tells the sentence as an error, with its numbers."""
        text = self.text.format_map({name: f"{value:g}" for name, value in values.items()})
        return Error(text, fatal, again, self.code, dict(values))

    def notice(self) -> Notice:
        """The sentence as a notice of `welcome`."""
        return Notice(self.code, self.text)


IDLE = Sentence("idle", "Nothing was said for {minutes} min, so this conversation has ended.")
FAULT = Sentence("fault", "The conversation broke off because of a fault in the server.")
FULL = Sentence(
    "full", "all places are taken, and so are those in the queue: try again in a minute."
)
UNREADY = Sentence(
    "unready",
    "the avatar cannot talk now: something on the server does not start. Try again later.",
)
ELSEWHERE = Sentence("elsewhere", "the page has another connection.")
OUTDATED = Sentence(
    "outdated",
    "this page speaks version {page} of the protocol, the server version {server}: "
    "reload the page.",
)
STILL_LIPS = Sentence(
    "still-lips",
    "This avatar is driven by blendshapes, not by sound: its lips do not move while it speaks.",
)
ENDING = Sentence("ending", "This server is about to restart: try again in a moment.")
VOICELESS = Sentence("voiceless", "The avatar has lost its voice; its captions go on.")
LONG = Sentence(
    "long", "This conversation has lasted {minutes} min, as long as this server allows."
)
HASTY = Sentence(
    "hasty", "so many questions are not answered in so short a time: wait a little, then ask again."
)
CROWDED = Sentence(
    "crowded",
    "too many conversations were begun from this address: try again in a minute.",
)


LIMITS = (LONG, HASTY, CROWDED)
STATES = (IDLE, FAULT, FULL, UNREADY, ELSEWHERE, OUTDATED, STILL_LIPS, ENDING, VOICELESS)
SENTENCES = (*STATES, *LIMITS)
