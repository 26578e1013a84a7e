"""What the docstrings of dataclasses say, for the pages and the TypeScript made of them."""

from docstring_parser import Docstring, DocstringStyle, parse


def summary(kind: type) -> str:
    """The first sentence of a class."""
    return _parsed(kind).short_description or ""


def about(kind: type) -> str:
    """All that is said of a class before its attributes, in one line."""
    told = _parsed(kind)
    return _joined(f"{told.short_description or ''} {told.long_description or ''}")


def notes(kind: type) -> dict[str, str]:
    """What each attribute of a class is, by name, in one line each."""
    return {param.arg_name: _joined(param.description or "") for param in _parsed(kind).params}


def _parsed(kind: type) -> Docstring:
    return parse(kind.__doc__ or "", DocstringStyle.GOOGLE)


def _joined(text: str) -> str:
    return " ".join(text.split())
