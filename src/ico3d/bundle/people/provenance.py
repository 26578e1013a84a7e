"""Where an avatar comes from: whose likeness it is, who agreed, who made it of what."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from ico3d.common.people.stated import NOT_STATED, is_stated
from ico3d.common.typed import plain
from ico3d.errors import BundleError

SYNTHETIC = "synthetic"
"""Kind of a recording that shows nobody: the person was modelled, and filmed inside a computer."""
OPENVOICE = "openvoice-v2"
"""The engine of cloned voices."""
LONGEST_TEXT, LONGEST_IN_ALL, MOST_SOURCES, MOST_PARTS = 2_000, 10_000, 1_000, 16
"""Letters of each text and of all texts, and numbers of entries; pages allow as much
(`viewer/src/bundle/texts.ts`), for laying out a text takes the square of its length."""


@dataclass(frozen=True)
class Part:
    """What of an avatar comes from a source of its own.

    Attributes:
        name: `head` or `body`.
        kind: Kind of that source's recordings; `synthetic` where nobody was recorded.
        likeness: Whose likeness the part is.
        build: The build of a body that was changed; empty where it is as recorded.
        outfit: The outfit of a body that was changed; empty where it is as recorded.
    """

    name: str
    kind: str
    likeness: str
    build: str = ""
    outfit: str = ""


@dataclass(frozen=True)
class ClonedVoice:
    """A person's voice, imitated: what of it the bundle says beside its file.

    Attributes:
        engine: What the voice was made for, and can be spoken by: `OPENVOICE`.
        recording: The recording from which it was cloned.
        consent: What the voice's owner agreed to, and how.
    """

    engine: str
    recording: str
    consent: str


@dataclass(frozen=True)
class Provenance:
    """Origin of an avatar.

    Attributes:
        kind: Kind of the recordings, such as `portrait`; `synthetic` where nobody was recorded.
        sources: What the avatar was made from.
        consent: What the person agreed to, and how.
        licence: Licence under which the avatar may be used.
        likeness: Whose likeness the avatar is.
        made_by: Who made the avatar.
        made_on: Day on which it was baked, such as 2026-11-24.
        parts: What comes from whom, where the head of one person was put on the body of another;
            empty elsewhere.
        voice: The voice that was cloned for the avatar; null where it has none of its own.
    """

    kind: str
    sources: tuple[str, ...]
    consent: str
    licence: str
    likeness: str = NOT_STATED
    made_by: str = NOT_STATED
    made_on: str = NOT_STATED
    parts: tuple[Part, ...] = ()
    voice: ClonedVoice | None = None

    @property
    def is_synthetic(self) -> bool:
        """Whether the avatar is nobody's likeness, so that nobody has to agree."""
        return self.kind == SYNTHETIC

    @property
    def has_consent(self) -> bool:
        """Whether it is said that the person agreed, or that there is no such person."""
        return self.is_synthetic or is_stated(self.consent)


REQUIRED = ("kind", "sources", "consent", "licence")
"""Entries that a bundle must have.

The other entries are newer; they are written only where they are stated, so that older programs
read what they know.
"""
NEWER: dict[str, Any] = {
    "likeness": NOT_STATED,
    "made_by": NOT_STATED,
    "made_on": NOT_STATED,
    "parts": [],
    "voice": None,
}


def provenance_to_json(provenance: Provenance) -> dict[str, Any]:
    """A provenance as a bundle stores it."""
    told = {key: v for key, v in plain(provenance).items() if v != NEWER.get(key)}
    if "parts" in told:
        told["parts"] = [{k: v for k, v in part.items() if v} for part in told["parts"]]
    return told


def with_newer(value: Any) -> Any:
    """Adds what older bundles do not state to the parsed JSON of a provenance."""
    if not isinstance(value, dict):
        return value
    told = NEWER | cast(dict[str, Any], value)
    if isinstance(told["parts"], list):
        parts = cast(list[Any], told["parts"])
        told["parts"] = [_with_look(part) for part in parts]
    return told


def _with_look(part: Any) -> Any:
    """Adds to the parsed JSON of a part what is not said of those that are as recorded."""
    unsaid = {"build": "", "outfit": ""}
    return unsaid | cast(dict[str, Any], part) if isinstance(part, dict) else part


def check_texts(provenance: Provenance) -> None:
    """Checks that all texts are as long as a page can show.

    Raises:
        BundleError: If one is longer, or there are too many.
    """
    texts = list(_texts(plain(provenance)))
    few = len(provenance.sources) <= MOST_SOURCES and len(provenance.parts) <= MOST_PARTS
    few = few and sum(map(len, texts)) <= LONGEST_IN_ALL
    if not few or any(len(text) > LONGEST_TEXT for text in texts):
        raise BundleError(
            f"manifest.json: provenance must have at most {MOST_SOURCES} sources, {MOST_PARTS} "
            f"parts, and texts of at most {LONGEST_TEXT} letters, {LONGEST_IN_ALL} in all."
        )


def _texts(told: Any) -> Iterator[str]:
    """All texts of what JSON can hold."""
    if isinstance(told, str):
        yield told
    elif isinstance(told, dict):
        for value in cast(dict[str, Any], told).values():
            yield from _texts(value)
    elif isinstance(told, list | tuple):
        for value in cast(list[Any], told):
            yield from _texts(value)


def check_consent(provenance: Provenance, path: Path | str) -> None:
    """Refuses to show somebody of whom nobody says that they agreed.

    Args:
        provenance: That of the bundle.
        path: The bundle, for the sentence.

    Raises:
        BundleError: If the bundle shows a person and states no consent.
    """
    if not provenance.has_consent:
        raise BundleError(
            f"{path} does not say that the person it shows agreed to it: bake it again with "
            "--consent, or, if you know that they agreed, serve it with --without-consent."
        )
