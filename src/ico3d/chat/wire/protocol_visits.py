"""Messages about a visit as a whole: how it begins, waits, and ends."""

from dataclasses import dataclass, field
from typing import Annotated

from ico3d.chat.wire.marks import MAX_EXACT, Count, Length, Name, Range, Seconds, Words
from ico3d.chat.wire.protocol_services import Dictation, Offer, Services

MAX_NOTES = 16  # sentences of earlier visits
MAX_NOTE = 200  # characters of one; all of them together are less than a text frame


@dataclass(frozen=True)
class Hello:
    """First message of every connection.

    Attributes:
        version: Protocol version of the page.
        session: Id of the session or place in the queue to go on with; null for a new session.
        last_index: `index` of the last speech message that arrived; -1 for a new session.
        wishes: Services wished for in a new session: keys of offers, by kind; only offered ones are
            used.
    """

    version: Count
    session: Annotated[str, Length(1, 64)] | None
    last_index: Annotated[int, Range(-1, MAX_EXACT)]
    wishes: Annotated[dict[str, Name], Length(0, 3)] = field(default_factory=dict)


@dataclass(frozen=True)
class Notice:
    """A sentence that the page shows once, on what this avatar cannot do.

    Attributes:
        code: Name of the sentence, by which pages translate it.
        text: The sentence in English.
    """

    code: Name
    text: Words


@dataclass(frozen=True)
class Welcome:
    """Answer to `hello`.

    Attributes:
        version: Protocol version of the server.
        session: Id of the session, needed to resume it.
        resumed: True if the session is the one that `hello` named.
        services: The services of the conversation.
        notices: What this avatar cannot do.
        dictation: How the browser is to recognise speech; null if the server does.
        offers: Services to choose from; empty where strangers may be talking.
        remembers: Whether the language model takes `notes` of earlier visits.
    """

    version: Count
    session: Annotated[str, Length(1, 64)]
    resumed: bool
    services: Services
    notices: Annotated[list[Notice], Length(0, 8)]
    dictation: Dictation | None
    offers: Annotated[list[Offer], Length(0, 64)] = field(default_factory=list)
    remembers: bool = False


@dataclass(frozen=True)
class Notes:
    """What the visitor said in earlier visits, as the browser kept it; once in a new session.

    Sent only by pages whose visitor agreed; servers refuse it unless `welcome` has `remembers`.

    Attributes:
        texts: The visitor's own sentences, the oldest first.
    """

    texts: Annotated[list[Annotated[str, Length(1, MAX_NOTE)]], Length(0, MAX_NOTES)]


@dataclass(frozen=True)
class Place:
    """All places are taken: the page is in a queue, and `welcome` follows when it is its turn.

    Attributes:
        session: Id by which the page takes its place in the queue again after a lost connection.
        position: Position in the queue; 1 is the front.
        seconds: Estimate of the time until it is this page's turn; null if nothing is known.
    """

    session: Annotated[str, Length(1, 64)]
    position: Count
    seconds: Seconds | None


@dataclass(frozen=True)
class Error:
    """Something went wrong.

    Attributes:
        message: One sentence for the visitor, in English.
        fatal: True if the session is over and the server closes the connection.
        again: After a fatal error: whether a new session may succeed, so that the page offers one.
        code: Name of the sentence, by which pages translate it; empty for one without.
        values: Numbers in the sentence, by name.
    """

    message: Words
    fatal: bool
    again: bool = False
    code: Annotated[str, Length(0, 64)] = ""
    values: Annotated[dict[str, Seconds], Length(0, 8)] = field(default_factory=dict)
