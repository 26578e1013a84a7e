"""Asks a running server a question, and saves the answer's sound and captions.

    ico3d demo &
    python examples/04_talk_from_a_script.py --question "Who are you?" --out answer

Messages: docs/protocol.md. Takes the extra `chat`.
"""

import wave
from pathlib import Path

import tyro
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import decode_server, encode


def answered(server: Connection, question: str) -> tuple[bytes, list[str]]:
    """The answer's sound, and a line with seconds for each caption."""
    server.send(encode(protocol.Hello(protocol.VERSION, session=None, last_index=-1)))
    sound, captions, thought = b"", [], False
    for message in map(decode_server, server):
        if isinstance(message, protocol.Error):
            raise SystemExit(message.message)
        elif isinstance(message, protocol.Welcome):
            server.send(encode(protocol.Text(question)))
        elif isinstance(message, protocol.State):
            thought = thought or message.state == "thinking"  # all before is the greeting
        elif thought and isinstance(message, protocol.Answer):
            captions.append(f"{message.first_sample / protocol.SPEECH_RATE:.2f} {message.text}")
        elif thought and isinstance(message, protocol.Speech):
            sound += message.pcm.tobytes()
            # what has come counts as played, so that the rest is sent at once
            played = (message.first_sample + len(message.pcm)) / protocol.SPEECH_RATE
            server.send(encode(protocol.Clock(message.utterance, played, body_time=0.0)))
        elif thought and isinstance(message, protocol.End):
            return sound, captions
    raise SystemExit("the server ended the conversation.")


def main(question: str, out: Path = Path("answer"), url: str = "http://127.0.0.1:8765") -> None:
    """Writes OUT.wav and OUT.txt, the sound and the captions of the answer."""
    address = url.replace("http", "ws", 1).rstrip("/") + "/ws"
    with connect(address, max_size=protocol.MAX_BINARY_FRAME) as server:
        sound, captions = answered(server, question)
    with wave.open(str(out.with_suffix(".wav")), "wb") as file:
        file.setparams((1, 2, protocol.SPEECH_RATE, 0, "NONE", "not compressed"))
        file.writeframes(sound)
    out.with_suffix(".txt").write_text("\n".join(captions) + "\n", "utf-8")


if __name__ == "__main__":
    tyro.cli(main)
