"""The components of conversations: those that all sessions share, and those of each session.

Only this module looks up and creates services. That may take seconds, because servers are asked and
models loaded, so while visitors talk it is done in threads.
"""

import asyncio
import contextlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from loguru import logger
from pipecat.audio.turn.smart_turn.base_smart_turn import SmartTurnParams
from pipecat.processors.frame_processor import FrameProcessor

from ico3d.bundle.animation import Animation
from ico3d.bundle.manifest import HeadInfo, Persona
from ico3d.chat.observing.failures import cause
from ico3d.chat.services import Chosen, ChosenService
from ico3d.chat.services.own_voice import Own
from ico3d.chat.services.provider import Context, WarmsUp
from ico3d.chat.settings.conversation import ChatSettings
from ico3d.chat.tools import check_ready
from ico3d.chat.turns.detector import EagerSilero
from ico3d.chat.turns.eager import EagerSmartTurn
from ico3d.chat.wire import protocol
from ico3d.chat.workers import Workers
from ico3d.errors import Ico3dError, ServiceError
from ico3d.motion.clip import Clip
from ico3d.motion.composing.takes import Takes
from ico3d.speech.runtime import SpeechModel

SLOWEST = 120.0  # s for a first answer, for which a server may load its model
AT_ONCE = 8  # conversations whose parts are made side by side

_threads = ThreadPoolExecutor(AT_ONCE, "making")  # the loop's own have conversations to serve


@dataclass(frozen=True)
class Avatar:
    """Everything that the sessions of a server share, read-only.

    Attributes:
        head: Sizes of the baked head.
        speech: Model from sound to mouth; None for heads driven by blendshapes.
        persona: Who the avatar is.
        services: The chosen recogniser, language model and voice.
        settings: Settings of the conversation.
        animation: Procedural motion of the body; None for a head alone.
        speech_sha256: SHA-256 of the file of `speech`, by which a remote module is matched.
        clips: Gestures of a body on a skeleton, by name; None without such a body or gestures.
        own_voice: The voice that was cloned for the avatar; None where none was.
        workers: Threads that compute faces.
    """

    head: HeadInfo
    speech: SpeechModel | None
    persona: Persona
    services: Chosen
    settings: ChatSettings
    animation: Animation | None
    speech_sha256: str = ""
    clips: dict[str, Clip] | None = None
    own_voice: Own | None = None
    workers: Workers = field(default_factory=Workers)


@dataclass(frozen=True)
class Parts:
    """Components of one session that are slow to create.

    Attributes:
        vad: Detector of voices.
        turn: Detector of ends of turns.
        recognition: Recogniser: speech to text.
        language: Language model: question to answer.
        voice: Voice: text to speech.
        services: Names of the three services for the page.
        dictation: How the browser is to recognise speech; None if the server does.
    """

    vad: EagerSilero
    turn: EagerSmartTurn
    recognition: FrameProcessor
    language: FrameProcessor
    voice: FrameProcessor
    services: protocol.Services
    dictation: protocol.Dictation | None


def make_parts(avatar: Avatar) -> Parts:
    """Creates the components of one session, and loads what they share with other sessions.

    Raises:
        Ico3dError: If a service cannot be created, or a tool lacks its key or package.
    """
    check_ready(avatar.settings.tools, avatar.settings.mcp)
    turns, services = avatar.settings.turns, avatar.services
    shown = Takes(avatar.clips or {}).meanings if avatar.settings.gestures else []
    context = Context(avatar.persona, avatar.head, avatar.animation, tuple(shown))
    params = SmartTurnParams(stop_secs=turns.end_silence - turns.pause)
    with _explained("turn-taking"):
        vad, turn = EagerSilero(turns.pause), EagerSmartTurn(turns.pause, params=params)
    made = {}
    for kind in ("recognition", "language", "voice"):
        service: ChosenService = getattr(services, kind)
        with _explained(f"{kind} with {service.provider.title}"):
            made[kind] = service.make(context)
    with _explained("a service"):
        return Parts(
            vad, turn, **made, services=services.described(), dictation=services.dictation()
        )


def warm_up(parts: Parts) -> None:
    """Has a language model on a server answer once, before visitors ask; may take minutes."""
    if not isinstance(parts.language, WarmsUp):
        return
    try:
        asyncio.run(asyncio.wait_for(parts.language.warm_up(), SLOWEST))
    except Exception as error:  # a visitor's question may fare better
        logger.warning(f"language did not answer a first question: {cause(error)}")


async def make_aside(avatar: Avatar) -> Parts:
    """Runs `make_parts` in a thread.

    Raises:
        Ico3dError: If a service cannot be created.
    """
    return await asyncio.get_running_loop().run_in_executor(_threads, make_parts, avatar)


@contextlib.contextmanager
def _explained(what: str) -> Iterator[None]:
    """Whatever goes wrong within becomes one sentence that names what it is about."""
    try:
        yield
    except Ico3dError:
        raise
    except Exception as error:
        said = str(error).strip().partition("\n")[0].rstrip(".")
        raise ServiceError(f"{what} cannot start ({type(error).__name__}: {said}).") from error
