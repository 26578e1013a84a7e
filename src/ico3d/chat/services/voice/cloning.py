"""Tone colours of people's voices, taken from recordings only with consent."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from ico3d.common.files import read_object, write_atomic
from ico3d.common.sound import REQUEST, fault, file_claim
from ico3d.errors import SettingsError

KEY = "embedding"


@dataclass(frozen=True)
class Recording:
    """A recording of a voice that may be used.

    Attributes:
        path: Path of the WAV file.
        digest: SHA-256 of the file, under which consent and embedding are stored.
    """

    path: Path
    digest: str

    def kept(self, suffix: str) -> Path:
        """Path of a stored file about this recording."""
        return Path.home() / ".cache" / "ico3d" / "voices" / f"{self.digest}{suffix}"

    def embedding(self, extract: Callable[[str], np.ndarray]) -> np.ndarray:
        """The embedding (float32) that `extract` computes from the file, once; then stored."""
        cached = self.kept(".safetensors")
        try:
            return load(cached.read_bytes())[KEY]
        except (OSError, SafetensorError, KeyError):
            embedding = np.ascontiguousarray(extract(str(self.path)), np.float32)
        write_atomic(cached, save({KEY: embedding}))
        return embedding


def permitted_recording(path: Path, consent: str, consent_by: str) -> Recording:
    """A recording of a voice whose owner has consented.

    Args:
        path: WAV file of the voice.
        consent: The owner's statement; may be empty if one is stored for this very recording.
        consent_by: The owner's name.

    Raises:
        SettingsError: If the recording cannot be read, claims more than is accepted, or there is no
            consent.
    """
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        wrong = fault(file_claim(path), REQUEST)
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read ({error.strerror}).") from error
    except RuntimeError as error:
        raise SettingsError(f"{path}: is no sound ({error}).") from error
    if wrong:
        raise SettingsError(f"{path}: the voice to speak with {wrong}.")
    recording = Recording(path, digest)
    record_consent(recording, consent.strip(), consent_by.strip())
    return recording


def record_consent(recording: Recording, statement: str, by: str) -> None:
    """Stores a consent: who stated what, when, about which recording.

    Raises:
        SettingsError: If there is neither a given nor a stored consent.
    """
    record = recording.kept(".json")
    kept = read_consent(record)
    if kept and (not statement or (statement, by) == (kept["statement"], kept["by"])):
        return
    if not (statement and by):
        raise SettingsError(
            f"{recording.path}: cloning a voice needs the consent of its owner: state it in the "
            'settings file under [voice] as consent = "…" and the name as consent_by = "…".'
        )
    values = {
        "statement": statement,
        "by": by,
        "at": datetime.now(UTC).isoformat(timespec="seconds"),
        "recording": recording.path.name,
        "sha256": recording.digest,
    }
    text = json.dumps(values, ensure_ascii=False, indent=2) + "\n"
    write_atomic(record, text.encode())


def read_consent(record: Path) -> dict[str, str] | None:
    """A stored consent; None if there is none that can be read."""
    values = read_object(record)
    return values if values.get("statement") and values.get("by") else None
