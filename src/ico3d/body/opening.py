"""Makes motions from their descriptions in model files."""

from collections.abc import Iterable

from ico3d.body.motion.deformation import Deformation
from ico3d.body.motion.encoder import EncoderShape
from ico3d.body.motion.formulas import Polynomial, Still
from ico3d.body.motion.tunable import MlpShape
from ico3d.body.motion.window_model import Motion
from ico3d.body.skinning.skinned import Skinned


def motion_from(about: dict) -> Motion:
    """Makes the motion that `Motion.about` described.

    Raises:
        ValueError: If its kind is unknown, or a size is none.
        SettingsError: If a size is too small or too large.
        KeyError: If a field that is read here is missing.
        TypeError: If another field is missing, unknown, or of a wrong type.
    """
    fields = dict(about)
    kind = fields.pop("kind")
    if kind == "still":
        return Still(**fields)
    if kind == "polynomial":
        _check_whole([fields["degree"]])
        return Polynomial(**fields)
    if kind == "skinned":
        names, parents = (tuple(fields.pop(name)) for name in ("names", "parents"))
        _check_whole([*parents, *(fields[name] for name in ("frames", "shapes", "hidden"))])
        if not all(isinstance(name, str) for name in names):
            raise TypeError("names of joints are texts")
        return Skinned(names, parents, **fields)
    if kind == "deformation":
        grid, sizes = fields.pop("encoder"), fields.pop("mlp")
        _check_whole([fields["bands"], *sizes.values()])
        if grid is not None:
            space = tuple(grid.pop("space"))
            _check_whole([*space, *grid.values()])
            grid = EncoderShape(space, **grid)
        middle, half = (tuple(float(x) for x in fields.pop(name)) for name in ("middle", "half"))
        return Deformation(middle, half, MlpShape(**sizes), grid, **fields)  # type: ignore[arg-type]
    raise ValueError(f"there is no motion of the kind '{kind}'")


def _check_whole(values: Iterable[object]) -> None:
    """Raises TypeError at what is no whole number."""
    for value in values:
        if type(value) is not int:
            raise TypeError(f"{value!r:.40} is no whole number")
