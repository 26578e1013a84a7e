"""Describes failures without quoting anything that was said: kinds and causes only.

Messages of exceptions are not used, because servers quote the refused request in their errors, and
with it the visitor's question or the answer.
"""

import re
from typing import TYPE_CHECKING

from ico3d.errors import Ico3dError, ServiceError

if TYPE_CHECKING:  # the log is set up before pipecat is imported
    from pipecat.frames.frames import ErrorFrame

DEEPEST = 4  # causes behind an exception that are named
_STATUS = re.compile(r"\b(?:error code|status(?: code)?|http)\b\D{0,3}([45]\d\d)\b", re.IGNORECASE)
_CODE = re.compile(r"[a-z]+(_[a-z]+)+")  # such as model_not_found


class ReportedError(ServiceError):
    """An error in a service's own words, which may quote what was said."""


def cause(error: BaseException) -> str:
    """The sentence of an ico3d error; of others, the exception types in the chain.

    Status codes and error numbers are named, too.
    """
    kinds: list[str] = []
    behind: BaseException | None = error
    while behind is not None and len(kinds) < DEEPEST:
        if isinstance(behind, Ico3dError) and not isinstance(behind, ReportedError):
            return " from ".join([*kinds, str(behind).rstrip(".")])
        if not isinstance(behind, ReportedError):
            kinds.append(_kind(behind))
        behind = behind.__cause__ or (None if behind.__suppress_context__ else behind.__context__)
    return " from ".join(dict.fromkeys(kinds))


def cause_of(frame: "ErrorFrame") -> str:
    """The cause of an error that a processor of the pipeline reported."""
    known = cause(frame.exception) if frame.exception else ""
    status = _STATUS.search(frame.error)
    if status and status[1] not in known:
        known = f"{status[1]} {known}".strip()
    return known or "it reported an error (--verbose shows it, with what was said)"


def _kind(error: BaseException) -> str:
    """Such as `401 AuthenticationError (invalid_api_key)` or `ConnectionRefusedError (111)`."""
    status = getattr(error, "status_code", None)
    code = error.errno if isinstance(error, OSError) else getattr(error, "code", None)
    known = isinstance(code, int) or (isinstance(code, str) and _CODE.fullmatch(code))
    number = f"{status} " if isinstance(status, int) else ""
    return f"{number}{type(error).__name__}" + (f" ({code})" if known else "")
