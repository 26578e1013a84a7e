"""Reads the docstrings of dataclasses, for the documentation and TypeScript made from them."""

from docstring_parser import Docstring, DocstringStyle, parse


def summary(kind: type) -> str:
    """The first sentence of a class's docstring."""
    return _parsed(kind).short_description or ""


def about(kind: type) -> str:
    """The part of a class's docstring before its attributes, joined into one line."""
    told = _parsed(kind)
    return _joined(f"{told.short_description or ''} {told.long_description or ''}")


def notes(kind: type) -> dict[str, str]:
    """The description of each attribute in a class's docstring, by name, in one line each."""
    return {param.arg_name: _joined(param.description or "") for param in _parsed(kind).params}


def _parsed(kind: type) -> Docstring:
    return parse(kind.__doc__ or "", DocstringStyle.GOOGLE)


def _joined(text: str) -> str:
    return " ".join(text.split())
