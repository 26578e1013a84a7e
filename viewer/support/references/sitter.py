"""What a camera sees of the packaged avatar, a synthetic person, while she talks: Motion JPEG.

Run: python sitter.py SPEECH.wav OUT.mjpeg [WIDTH HEIGHT]

Chromium's fake camera plays the file again and again.
"""

import json
import sys
import tempfile
from pathlib import Path

import av

from ico3d.cli import main as ico3d

CLOSE = {"cameras": [{"eye": [0, 1.42, 0.85], "target": [0, 1.42, 0], "fov_y": 30}]}
"""Where the camera stands: before the face."""
RATE = 5


def main() -> int:
    """Does what the file's docstring says; the exit status."""
    speech, out, *size = sys.argv[1:]
    width, height = map(int, size or (320, 240))
    with tempfile.TemporaryDirectory() as folder:
        path, film = Path(folder, "path.json"), Path(folder, "film.mp4")
        path.write_text(json.dumps(CLOSE))
        sized = ["--size", str(width), str(height), "--fps", str(RATE)]
        words = ["render", "demo", str(film), "--audio", speech, "--path", str(path), *sized]
        if status := ico3d([*words, "--no-ai-mark"]):
            return status
        with av.open(str(film)) as film_file, av.open(out, "w", format="mjpeg") as written:
            stream = written.add_stream("mjpeg", RATE)
            stream.width, stream.height, stream.pix_fmt = width, height, "yuvj420p"
            for frame in film_file.decode(video=0):
                written.mux(stream.encode(frame.reformat(format="yuvj420p")))
            written.mux(stream.encode(None))
    return 0


if __name__ == "__main__":
    sys.exit(main())
