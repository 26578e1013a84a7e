"""Everything that reads what may come from anywhere."""

from collections.abc import Sequence

from fuzz.reader import Reader
from fuzz.readers.captures import CAPTURES
from fuzz.readers.files import FILES
from fuzz.readers.models import MODELS
from fuzz.readers.network import NETWORK
from ico3d.errors import SettingsError

READERS = (*CAPTURES, *FILES, *MODELS, *NETWORK)
"""All readers, in the order of the report."""


def chosen(names: Sequence[str]) -> list[Reader]:
    """Readers by their names; all where none is named.

    Raises:
        SettingsError: If there is no reader of a name.
    """
    known = {reader.name: reader for reader in READERS}
    unknown = [name for name in names if name not in known]
    if unknown:
        raise SettingsError(f"there is no reader '{unknown[0]}', only {', '.join(known)}.")
    return [known[name] for name in names or known]
