"""What recordings state of people who were computed."""

from pathlib import Path

from ico3d.avatar.baking.telling.about import About, provenance_of
from ico3d.avatar.baking.telling.statement import Statement
from ico3d.bundle.persona import Persona

MAKER = Statement(made_by="a test")
MADE = ("--made-by", MAKER.made_by)
"""Words of ico3d bake."""


def origin(kind: str, licence: str = "CC0-1.0") -> dict:
    """The provenance of a recording, complete."""
    told = {"likeness": "a test", "consent": "none needed", "licence": licence}
    return {"kind": kind, "sources": ["a seed"], **told}


def about(persona: Persona, *recordings: dict, name: str = "", notices: str = "") -> About:
    """What a bundle tells, given what its recordings state; the persona's name by default."""
    parts = {f"recording {i}": recording for i, recording in enumerate(recordings)}
    provenance = provenance_of(parts, MAKER, Path("a.ico3d"))
    return About(name or persona.name, persona, provenance, notices)
