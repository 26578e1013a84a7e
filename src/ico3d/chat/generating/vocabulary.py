"""One walk over the types of messages, in the words of whoever reads them."""

import types
import typing
from collections.abc import Callable, Sequence
from dataclasses import dataclass, is_dataclass
from typing import Any, Literal

import numpy as np

from ico3d.common.typed import Kind, kind_of


@dataclass(frozen=True)
class Vocabulary:
    """How something that is generated writes the types of messages.

    Attributes:
        array: An array, of its annotation with its marks.
        maybe: A type or null, of how the type is written.
        words: One of the given texts.
        items: A list, of how its items are written, and its annotation.
        fixed: A list of known length, of how each of its items is written.
        record: An object with any keys, of how its values are written, and its annotation.
        part: A dataclass.
        plain: A number, a text or a truth value, of its annotation.
    """

    array: Callable[[Kind], str]
    maybe: Callable[[str], str]
    words: Callable[[Sequence[str]], str]
    items: Callable[[str, Kind], str]
    fixed: Callable[[Sequence[str]], str]
    record: Callable[[str, Kind], str]
    part: Callable[[type], str]
    plain: Callable[[Kind], str]

    def written(self, annotation: Any) -> str:
        """A type annotation in this vocabulary."""
        kind = kind_of(annotation)
        bare, origin, arguments = kind.bare, kind.origin, kind.arguments
        if bare is np.ndarray:
            return self.array(kind)
        if origin in (types.UnionType, typing.Union):
            return self.maybe(self.written(kind.optional))
        if origin is Literal:
            return self.words(arguments)
        if origin is list:
            return self.items(self.written(arguments[0]), kind)
        if origin is tuple:
            return self.fixed([self.written(argument) for argument in arguments])
        if origin is dict:
            return self.record(self.written(arguments[1]), kind)
        if is_dataclass(bare):
            return self.part(typing.cast(type, bare))
        return self.plain(kind)
