"""Speech to text."""

from ico3d.chat.services.provider import Provider, Table
from ico3d.chat.services.recognition import sphinx

PROVIDERS: Table = {
    "pocketsphinx": Provider(
        "pocketsphinx", sphinx.Settings, sphinx.make, sphinx.hindrance, stand_in=True
    ),
}
