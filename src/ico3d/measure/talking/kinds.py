"""What `ico3d bench chat` tries."""

from typing import Literal

Kind = Literal["questions", "interruptions", "assent", "share"]
"""Questions that are answered, answers that are broken off, "uh-huh", the server's own time."""
