"""Reads what a pickle would make of the objects in a file of weights, without making it."""

import io
import pickletools
from typing import Any, cast

from ico3d.errors import ModelError

MADE = {
    "collections OrderedDict",
    "torch Size",
    "torch device",
    "torch._utils _rebuild_tensor",
    "torch._utils _rebuild_tensor_v2",
    "torch._utils _rebuild_parameter",
}
"""What is called: nothing that copies as much as it is given, or makes as much as it is told."""
MOST_STEPS = 500_000
"""Steps of a pickle: each may make an object of 200 bytes. Models of thousands of tensors have some
ten thousand."""
MOST_BYTES = 16 << 20
"""Bytes of a file's pickles: a tensor has 150."""
MOST_MEMBERS = 64
"""Axes of a tensor, and remarks of a dictionary."""

_KINDS = frozenset(
    [
        "GLOBAL",
        "NONE",
        "NEWFALSE",
        "NEWTRUE",
        "EMPTY_TUPLE",
        "EMPTY_LIST",
        "EMPTY_DICT",
        "EMPTY_SET",
        "BININT",
        "BININT1",
        "BININT2",
        "BINFLOAT",
        "BINUNICODE",
        "SHORT_BINSTRING",
        "LONG1",
    ]
)
"""Steps that put something upon the stack and take nothing from it."""
_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}


class Name(str):
    """What a pickle names."""


class Bag:
    """A dictionary or list, of which only the number of members is known."""

    size = 0


class _Machine:
    """Goes through the steps of a pickle as torch does, with what they would make left out."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self.marks: list[list[Any]] = []
        self.memo: dict[int, Any] = {}

    def since_mark(self) -> list[Any]:
        items, self.stack = self.stack, self.marks.pop()
        return items

    def step(self, name: str, argument: Any) -> None:
        stack = self.stack
        if name in _KINDS:
            stack.append(_made(name, argument))
        elif name in _TUPLES:
            count = _TUPLES[name]
            stack[-count:] = [tuple(stack[-count:])]
        elif name == "TUPLE":
            items = self.since_mark()
            self.stack.append(tuple(items))
        elif name == "MARK":
            self.marks.append(stack)
            self.stack = []
        elif name in ("BINPUT", "LONG_BINPUT"):
            self.memo[argument] = stack[-1]
        elif name in ("BINGET", "LONG_BINGET"):
            stack.append(self.memo[argument])
        elif name == "BINPERSID":
            stack[-1] = None
        elif name not in ("PROTO", "STOP"):
            self.change(name)

    def change(self, name: str) -> None:
        """Puts members into something, or calls something.

        Raises:
            ValueError: If no file of weights does so.
        """
        if name in ("APPEND", "SETITEM"):
            count = 1 if name == "APPEND" else 2
            items = self.stack[-count:]
            del self.stack[-count:]
            self.fill(items, count)
        elif name in ("APPENDS", "SETITEMS"):
            self.fill(self.since_mark(), 1 if name == "APPENDS" else 2)
        elif name == "REDUCE":
            given = self.stack.pop()
            self.stack[-1] = _called(self.stack[-1], given)
        elif name == "BUILD":
            state = self.stack.pop()
            if not isinstance(state, Bag) or state.size > MOST_MEMBERS:
                raise ValueError("it gives an object another state than weights have")
        else:
            raise ValueError(f"it has a step ({name}) that no file of weights has")

    def fill(self, items: list[Any], count: int) -> None:
        """Adds members; a tuple of tuples as a key would be gone through again and again."""
        if count == 2 and any(isinstance(key, tuple) for key in items[::2]):
            raise ValueError("a key is a tuple")
        cast(Bag, self.stack[-1]).size += len(items) // count


def _made(name: str, argument: Any) -> Any:
    if name == "GLOBAL":
        return Name(argument)
    if name == "EMPTY_TUPLE":
        return ()
    return Bag() if name.startswith("EMPTY") else None


def _called(what: Any, given: Any) -> Any:
    """What a call makes.

    Raises:
        ValueError: If no file of weights makes it.
    """
    if not isinstance(what, Name) or what not in MADE or not isinstance(given, tuple):
        raise ValueError(f"it calls {str(what)[:80]!r}, as no file of weights does")
    inner = cast(tuple[Any, ...], given)
    if what == "collections OrderedDict":
        if inner:
            raise ValueError("it copies a dictionary")
        return Bag()
    if what == "torch Size":
        axes = inner[0] if len(inner) == 1 else None
        if not isinstance(axes, tuple) or len(cast(tuple[Any, ...], axes)) > MOST_MEMBERS:
            raise ValueError("it has a size of more axes than tensors have")
    return None


def check_pickles(file: Any, pickles: int, needed: Any, what: str) -> None:
    """Goes through some pickles one after the other, without making anything of them.

    Args:
        file: Where they lie; what is behind `MOST_BYTES` is not read.
        pickles: How many.
        needed: Expression that the names in them match.
        what: The file, for errors.

    Raises:
        ModelError: If they make more than weights, or name or call something else.
        ValueError: If they are damaged.
    """
    content = io.BytesIO(file.read(MOST_BYTES))
    left = MOST_STEPS
    for _ in range(pickles):
        machine = _Machine()
        for opcode, argument, _ in pickletools.genops(content):
            left -= 1
            if left < 0:
                raise ModelError(
                    f"{what} holds more objects than a file of weights: it is not read."
                )
            if "GLOBAL" in opcode.name and not needed.fullmatch(str(argument)):
                named = str(argument)[:80]
                raise ModelError(
                    f"{what} names {named!r}, as no file of weights does: it is not read."
                )
            try:
                machine.step(opcode.name, argument)
            except (IndexError, KeyError, AttributeError) as error:
                raise ValueError("its steps do not fit one another") from error
