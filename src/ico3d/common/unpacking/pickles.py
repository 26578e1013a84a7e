"""Reads what a pickle would make of the objects in a file of weights, without making it."""

import io
import math
import pickletools
from typing import Any, cast

from ico3d.errors import ModelError

WIDTHS = {
    **dict.fromkeys(("torch ByteStorage", "torch CharStorage", "torch BoolStorage"), 1),
    **dict.fromkeys(("torch ShortStorage", "torch HalfStorage", "torch BFloat16Storage"), 2),
    **dict.fromkeys(("torch IntStorage", "torch FloatStorage"), 4),
    **dict.fromkeys(("torch LongStorage", "torch DoubleStorage", "torch ComplexFloatStorage"), 8),
    "torch ComplexDoubleStorage": 16,
    "torch.storage UntypedStorage": 1,
}
"""Bytes of a number of each kind."""
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


class Numbers:
    """Numbers that lie in the file.

    Attributes:
        count: How many.
    """

    def __init__(self, count: int) -> None:
        self.count = count


class _Machine:
    """Goes through the steps of a pickle as torch does, with what they would make left out.

    Attributes:
        left: Bytes of numbers that the file may still have.
        sizes: Bytes of those that were named, by their name.
    """

    def __init__(self, size: int) -> None:
        self.left = size
        self.sizes: dict[str, int] = {}
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
            stack[-1] = self.numbers(stack[-1])
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

    def numbers(self, told: Any) -> Numbers:
        """What a pickle says of numbers that lie elsewhere in the file.

        Raises:
            ValueError: If they are more than the file has, or of no kind that is known.
        """
        said = list(cast(tuple[Any, ...], told)) if isinstance(told, tuple) else []
        kind, what, key, place, count, *view = said + [None] * (5 - len(said))
        width = WIDTHS.get(what) if isinstance(what, Name) else None
        named = kind == "storage" and type(key) is str and type(place) is str
        if width is None or not named or type(count) is not int or count < 0 or any(view):
            raise ValueError("it has numbers of no kind that weights have")
        size = count * width
        if key not in self.sizes:
            self.left -= size
        if self.sizes.setdefault(key, size) != size or self.left < 0:
            raise ValueError("it names more numbers than it has")
        return Numbers(count)

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
    if name.startswith("EMPTY"):
        return Bag()
    return {"NEWTRUE": True, "NEWFALSE": False}.get(name, argument)


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
        _axes(inner[0] if len(inner) == 1 else None)
    elif "_rebuild_tensor" in what:
        _check_tensor(*inner)
    return None


def _axes(given: Any) -> tuple[int, ...]:
    """The numbers of a tuple with one for each axis of a tensor.

    Raises:
        ValueError: If it is none.
    """
    axes = cast(tuple[int, ...], given)
    if not isinstance(given, tuple) or len(axes) > MOST_MEMBERS:
        raise ValueError("it has a size of more axes than tensors have")
    if not all(type(axis) is int and axis >= 0 for axis in axes):
        raise ValueError("it has a size of no numbers, not of axes")
    return axes


def _check_tensor(numbers: Any, offset: Any, size: Any, stride: Any, *more: Any) -> None:
    """Refuses a tensor that is larger than its numbers, for which torch would make room.

    Args:
        numbers: The `Numbers`.
        offset: Index of the first one.
        size: Length of each axis.
        stride: How far the next number along each axis is.
        more: Whether it is trained, what is called then, and remarks, of which there may be none.

    Raises:
        ValueError: If it is so.
    """
    sizes, strides = _axes(size), _axes(stride)
    if not isinstance(numbers, Numbers) or type(offset) is not int or len(sizes) != len(strides):
        raise ValueError("it makes a tensor of something else than numbers")
    last = offset + sum((n - 1) * step for n, step in zip(sizes, strides, strict=True))
    inside = 0 <= offset <= numbers.count and math.prod(sizes) <= numbers.count
    if not inside or (0 not in sizes and last >= numbers.count) or any(more[2:]):
        raise ValueError("it has a tensor that is larger than its numbers")


def check_pickles(file: Any, pickles: int, needed: Any, what: str, size: int) -> None:
    """Goes through some pickles one after the other, without making anything of them.

    Args:
        file: Where they lie; what is behind `MOST_BYTES` is not read.
        pickles: How many.
        needed: Expression that the names in them match.
        what: The file, for errors.
        size: Bytes of the whole file, which no numbers in it exceed.

    Raises:
        ModelError: If they make more than weights, or name or call something else.
        ValueError: If they are damaged.
    """
    content = io.BytesIO(file.read(MOST_BYTES))
    left = MOST_STEPS
    for _ in range(pickles):
        machine = _Machine(size)
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
            except (IndexError, KeyError, AttributeError, TypeError) as error:
                raise ValueError("its steps do not fit one another") from error
