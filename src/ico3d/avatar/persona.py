"""The persona that goes into a bundle."""

from pathlib import Path

from ico3d.bundle.decode import decode, parse_json
from ico3d.bundle.limits import MAX_MANIFEST_BYTES
from ico3d.bundle.manifest import Persona
from ico3d.errors import BundleError

DEFAULT = Path(__file__).parent / "data" / "persona.json"


def load_persona(path: Path | None) -> Persona:
    """Reads a persona: JSON with `name`, `greeting` and `notes` ("question | question => answer").

    Args:
        path: The file; the one of the package where None.

    Raises:
        BundleError: If it cannot be read, or a note is not of that form.
    """
    path = path or DEFAULT
    try:
        with path.open("rb") as file:
            data = file.read(MAX_MANIFEST_BYTES)
    except OSError as error:
        raise BundleError(f"{path}: cannot be read ({error.strerror}).") from error
    persona = decode(Persona, parse_json(data, str(path)), str(path))
    for number, note in enumerate(persona.notes, 1):
        questions, arrow, answer = note.partition("=>")
        if not arrow or not answer.strip() or not all(q.strip() for q in questions.split("|")):
            raise BundleError(f"{path}: note {number} is not 'question | question => answer'.")
    return persona
