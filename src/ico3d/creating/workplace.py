"""The folder beside an avatar in which it is made, so that nothing is done twice."""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ico3d.avatar.embodying.look import UNCHANGED
from ico3d.avatar.forgetting.removal import remove
from ico3d.bundle.manifest import MANIFEST
from ico3d.bundle.packaged import bundle_path
from ico3d.bundle.people.voice import VOICE as TONE
from ico3d.common.files import own_file, read_object, write_atomic
from ico3d.common.people.stated import is_stated
from ico3d.common.typed import plain
from ico3d.creating.looking.advice import Advice
from ico3d.creating.settings import CreateSettings, QualityName
from ico3d.errors import SettingsError, StorageError
from ico3d.training.notes.state import begun, ended, note

ABOUT, DONE = "about.json", "done.json"
VOICE, VOICE_ABOUT = "voice", "cloned_voice.json"
"""Folder of the cloned voice, and what is known of it, by which `ico3d forget` finds it."""


@dataclass(frozen=True)
class Workplace:
    """Where the steps leave what they made.

    Attributes:
        folder: The folder, NAME.work beside NAME.ico3d.
        video: Hash of the video.
    """

    folder: Path
    video: str

    def capture(self, tracking: str) -> Path:
        """The tracked video."""
        return self.folder / f"capture-{tracking}"

    def head(self, quality: QualityName) -> Path:
        """The trained head."""
        return self.folder / f"head-{quality}"

    def file(self, name: str) -> Path:
        """Another file."""
        return self.folder / name

    def is_done(self, settings: CreateSettings) -> bool:
        """Whether the avatar is there as these settings want it."""
        return os.path.isfile(settings.out) and self.read(DONE) == _wanted(settings, settings.out)

    def note_done(self, settings: CreateSettings) -> None:
        """Remembers that the avatar was written."""
        self.write(DONE, _wanted(settings, settings.out))

    def voice(self, settings: CreateSettings) -> dict | None:
        """What is known of the voice that was cloned by the same consent; None where none was."""
        known = self.read(f"{VOICE}/{VOICE_ABOUT}") or {}
        whole = isinstance(known.get("fault"), dict) or os.path.isfile(self.voice_file(TONE))
        return known if whole and known.get("consent") == settings.voice_consent else None

    def voice_file(self, name: str) -> Path:
        """A file about the cloned voice."""
        return self.file(VOICE) / name

    def note_voice(self, settings: CreateSettings, seconds: float, fault: Advice | None) -> dict:
        """Notes from how many seconds of speech a voice was cloned, or why it cannot be."""
        known = {
            "likeness": settings.out.stem,
            "consent": settings.voice_consent,
            "seconds": seconds,
            "fault": fault and {"code": fault.code, "values": dict(fault.values)},
        }
        self.write(f"{VOICE}/{VOICE_ABOUT}", known)
        return known

    def drop_voice(self) -> None:
        """Removes a cloned voice to which nobody agrees any more."""
        remove([self.file(VOICE)])

    def read(self, name: str) -> dict | None:
        """A note that `write` left, or None."""
        return read_object(self.file(name)) or None

    def write(self, name: str, values: dict) -> None:
        """Leaves a note."""
        write_atomic(self.file(name), json.dumps(values, indent=1).encode())


@contextmanager
def workplace(settings: CreateSettings) -> Iterator[Workplace]:
    """The workplace of an avatar, for one process at a time; what killed ones left is cleared away.

    Raises:
        SettingsError: If the avatar's name is no bundle's, if its file or folder belongs to
            something else, or another process makes it just now.
        StorageError: If the folder cannot be written.
    """
    out, folder = settings.out, settings.out.with_suffix(".work")
    if out.suffix != ".ico3d":
        raise SettingsError(f"{out} must end in .ico3d: that is the avatar's file.")
    if os.path.exists(out) and not os.path.isfile(folder / ABOUT):
        raise SettingsError(f"{out} exists already: choose another name, or remove it.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = own_file(folder / "lock")
    except OSError as error:
        raise StorageError(f"{folder} cannot be written ({error.strerror or error}).") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise SettingsError.of("busy", f"{out}: ") from error
        place = Workplace(folder, _digest(settings.video))
        _check_same(place, settings)
        remove(list(folder.glob(".capture-*")))
        begun(folder)
        yield place
        ended(folder)
        note(folder, done=True)


def _check_same(place: Workplace, settings: CreateSettings) -> None:
    """A folder belongs to one recording, and to what its person agreed to."""
    now = {
        "video": settings.video.name,
        "sha256": place.video,
        "consent": settings.consent,
        "licence": settings.licence,
    }
    before = place.read(ABOUT)
    if before is None:
        place.write(ABOUT, now)
        return
    different = [key for key in now if key != "video" and before.get(key) != now[key]]
    if different:
        what = {"sha256": "of another video"}.get(different[0], f"with another {different[0]}")
        raise SettingsError(
            f"{place.folder} holds an avatar {what} ({before.get('video')}): choose another name, "
            "or remove that folder."
        )


def _wanted(settings: CreateSettings, bundle: Path) -> dict:
    """What tells one avatar of a video from another."""
    persona, body, voice = settings.persona, settings.body, settings.voice_consent
    return {
        "quality": settings.quality,
        "persona": None if persona is None else _digest(persona),
        "bundle": _digest(bundle),
        **({} if body is None else {"body": _bundle_digest(bundle_path(body))}),
        **({"voice": voice} if is_stated(voice) else {}),
        **({} if settings.look == UNCHANGED else {"look": plain(settings.look)}),
        **({"made_by": settings.made_by} if settings.made_by else {}),
    }


def _bundle_digest(bundle: Path) -> str:
    """SHA-256 that tells bundles apart; of one that is a folder, of the list of what is in it."""
    return _digest(bundle / MANIFEST if os.path.isdir(bundle) else bundle)


def _digest(file: Path) -> str:
    """SHA-256 of a file.

    Raises:
        SettingsError: If it cannot be read.
    """
    try:
        with file.open("rb") as opened:
            return hashlib.file_digest(opened, "sha256").hexdigest()
    except OSError as error:
        raise SettingsError(f"{file} cannot be read ({error.strerror}).") from error
