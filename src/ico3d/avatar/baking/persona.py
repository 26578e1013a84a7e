"""The persona that goes into a bundle."""

from pathlib import Path

from ico3d.bundle.persona import Persona, read_persona

DEFAULT = Path(__file__).parents[1] / "data" / "persona.json"


def load_persona(path: Path | None) -> Persona:
    """Reads a persona's file; without a path, that of the package.

    Raises:
        BundleError: If the file cannot be read, or an entry makes no sense.
    """
    return read_persona(path or DEFAULT)
