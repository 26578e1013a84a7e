"""The kinds of trials of `ico3d bench chat`."""

from typing import Literal

Kind = Literal["questions", "interruptions", "assent", "share"]
"""Answered questions, interrupted answers, "uh-huh" during answers, the server's own share."""
