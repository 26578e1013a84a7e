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


def spoken_texts(persona: Persona) -> list[str]:
    """What somebody can say: the answers and facts of the notes.

    A persona without notes says what the package's persona says.
    """
    parts = (note.partition("=>") for note in persona.notes)
    texts = ((answer if arrow else fact).strip() for fact, arrow, answer in parts)
    return [text for text in texts if text] or spoken_texts(load_persona(None))
