"""What a bundle says of the person it shows: as the recordings state it, and as is said anew."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ico3d.avatar.baking.telling.statement import Statement
from ico3d.bundle.people.provenance import SYNTHETIC, Provenance
from ico3d.bundle.persona import Persona
from ico3d.common.people.stated import BETWEEN, NOBODY, NOT_STATED, is_stated
from ico3d.errors import BundleError, SettingsError

ASKED = {
    "likeness": "whose likeness it is (--likeness)",
    "consent": "what that person agreed to, and how (--consent)",
    "licence": "under which licence it may be used (--licence)",
    "made_by": "who makes it (--made-by)",
}
"""What must be said of an avatar that shows a person, and the options that say it."""


@dataclass(frozen=True)
class About:
    """What a bundle tells besides what it shows.

    Attributes:
        name: The avatar's name.
        persona: Who the avatar is.
        provenance: Whose likeness it is, who agreed, who made it of what.
        notices: Text of LICENSES.txt; no such file where it is empty.
    """

    name: str
    persona: Persona
    provenance: Provenance
    notices: str = ""


def provenance_of(
    parts: Mapping[str, Mapping[str, Any]], statement: Statement, out: Path
) -> Provenance:
    """The provenance of an avatar, complete.

    Args:
        parts: What each of its recordings states (`Capture.provenance`), by what the recording is
            called in errors.
        statement: What is said anew; it takes the place of what the recordings state.
        out: The bundle to be written, for errors.

    Raises:
        BundleError: If a recording does not say what it is.
        SettingsError: If the avatar shows a person, and something of `ASKED` is stated nowhere.
    """
    known = _together([_recorded(part, where) for where, part in parts.items()])
    provenance = replace(
        known,
        likeness=statement.likeness or known.likeness,
        consent=statement.consent or known.consent,
        licence=statement.licence or known.licence,
        made_by=statement.made_by or known.made_by,
        made_on=datetime.now(UTC).date().isoformat(),
    )
    missing = [ask for name, ask in ASKED.items() if not is_stated(getattr(provenance, name))]
    if missing and not provenance.is_synthetic:
        *first, last = missing
        listed = f"{', '.join(first)} and {last}" if first else last
        raise SettingsError(f"{out} would show a person, and has to say {listed}.")
    return provenance


def _recorded(about: Mapping[str, Any], where: str) -> Provenance:
    """What a recording states, in the form of the manifest."""
    try:
        nobody = NOBODY if about["kind"] == SYNTHETIC else NOT_STATED
        return Provenance(
            kind=str(about["kind"]),
            sources=tuple(map(str, about["sources"])),
            consent=str(about["consent"]),
            licence=str(about["licence"]),
            likeness=str(about.get("likeness", nobody)),
        )
    except KeyError as error:
        raise BundleError(f"{where}: its provenance lacks {error}.") from error


def _together(parts: list[Provenance]) -> Provenance:
    """The provenance of a person made from several recordings; what they share is said once."""

    def once(values: Iterable[str]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(values))

    return Provenance(
        kind=", ".join(once(part.kind for part in parts)),
        sources=once(source for part in parts for source in part.sources),
        consent=BETWEEN.join(once(part.consent for part in parts)),
        licence=BETWEEN.join(once(part.licence for part in parts)),
        likeness=BETWEEN.join(once(part.likeness for part in parts)),
    )
