"""Text to speech."""

from ico3d.chat.services.provider import Provider, Table
from ico3d.chat.services.voice import espeak

PROVIDERS: Table = {
    "espeak-ng": Provider("espeak-ng", espeak.Settings, espeak.make, stand_in=True),
}
