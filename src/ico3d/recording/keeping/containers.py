"""Which files are taken for videos, by how they begin.

What else FFmpeg opens, such as play lists that name other files, is not taken.
"""

SUFFIXES = (".webm", ".mp4", ".avi")
HEAD = 16
"""Bytes by which a kind of file is known."""


def suffix_of(head: bytes) -> str:
    """Suffix of a kind of video file; empty for anything else.

    Args:
        head: The first `HEAD` bytes of the file.
    """
    if head.startswith(b"\x1a\x45\xdf\xa3"):
        return ".webm"  # Matroska, which has the same head, is read alike
    if head[4:8] in (b"ftyp", b"moov", b"wide"):
        return ".mp4"
    if head.startswith(b"RIFF") and head[8:12] == b"AVI ":
        return ".avi"
    return ""
