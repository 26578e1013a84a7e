"""Clones the voice of a recording, where its owner agreed and OpenVoice is installed."""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.bundle.people.provenance import OPENVOICE, ClonedVoice
from ico3d.bundle.people.voice import VOICE, voice_from_bytes, voice_to_bytes
from ico3d.capture.video import read_sound
from ico3d.common.files import read_small, write_atomic
from ico3d.common.people.stated import is_stated
from ico3d.common.sound import wav_bytes
from ico3d.creating.events import Tell, Voiced
from ico3d.creating.looking.advice import Advice
from ico3d.creating.settings import CreateSettings
from ico3d.creating.workplace import Workplace
from ico3d.errors import BundleError, MissingModelError, SettingsError

RATE = 22_050
"""Samples per second that OpenVoice listens to."""
HEARD = "heard.wav"
"""The person's speech, beside the avatar for as long as OpenVoice listens to it."""
MOST_VOICE = 1 << 16
"""Bytes of a voice's file, which has 256 numbers."""
LATER = " The same command clones the voice once that is mended."


@dataclass(frozen=True)
class Cloned:
    """A voice that was cloned for an avatar.

    Attributes:
        tone: (256,) float32 tone colour.
        about: From which recording it is, and who agreed to it.
    """

    tone: np.ndarray
    about: ClonedVoice


def clone(settings: CreateSettings, place: Workplace, tell: Tell) -> Cloned | None:
    """The voice of the video, if its owner agreed; what was cloned once is not cloned again.

    Args:
        settings: The video, and what its person agreed to.
        place: Where the voice is kept meanwhile.
        tell: Told whether there is a voice, or why not. Without consent nothing is told.

    Returns:
        The voice; None where there is none, and the avatar is made without it.

    Raises:
        CaptureError: If the video's sound claims more than is accepted.
        StorageError: If the disk is full.
    """
    if not is_stated(settings.voice_consent):
        place.drop_voice()
        return None
    about = ClonedVoice(OPENVOICE, settings.video.name, settings.voice_consent)
    known = place.voice(settings)
    if known is None:
        if lacking := hindrance():
            return _without(Advice("voice-lacking", detail=lacking + LATER), tell)
        try:
            known = _made(settings, place)
        except (BundleError, MissingModelError, SettingsError) as error:
            return _without(Advice("voice-failed", detail=f"{error}{LATER}"), tell)
    if known["fault"]:
        return _without(Advice(**known["fault"]), tell)
    tell(Voiced(known["seconds"]))
    file = place.voice_file(VOICE)
    try:
        return Cloned(voice_from_bytes(read_small(file, most=MOST_VOICE)), about)
    except OSError as error:
        raise BundleError(f"{file} is no voice: delete it and run the same command.") from error


def awaits_voice(settings: CreateSettings, place: Workplace) -> bool:
    """Whether a voice can be cloned now that could not be when the avatar was made."""
    wanted = is_stated(settings.voice_consent) and place.voice(settings) is None
    return wanted and not hindrance()


def hindrance() -> str:
    """A sentence on what is missing to clone a voice; empty if nothing is."""
    if importlib.util.find_spec("pipecat") is None:
        return "pipecat is not installed: pip install 'ico3d[chat,openvoice]'."
    from ico3d.chat.services.voice.openvoice import cloning_hindrance

    return cloning_hindrance()


def _made(settings: CreateSettings, place: Workplace) -> dict:
    """Clones the voice and keeps it; what is known of it."""
    from ico3d.chat.services.voice.openvoice import tone_colour
    from ico3d.creating.voice.stretches import clean_speech

    place.drop_voice()
    speech = clean_speech(read_sound(settings.video, RATE))
    if not speech.fault:
        tone = heard(speech.samples, tone_colour, place.voice_file(HEARD))
        write_atomic(place.voice_file(VOICE), voice_to_bytes(tone))
    return place.note_voice(settings, speech.seconds, speech.fault)


def heard(samples: np.ndarray, tell: Callable[[Path], np.ndarray], file: Path) -> np.ndarray:
    """What `tell` says of a sound at `RATE`, which is a file only meanwhile.

    The file lies where a killed process leaves nothing of the person's voice unseen.
    """
    write_atomic(file, wav_bytes(samples, RATE))
    try:
        return tell(file)
    finally:
        file.unlink(missing_ok=True)


def _without(why: Advice, tell: Tell) -> None:
    tell(Voiced(0.0, why))
