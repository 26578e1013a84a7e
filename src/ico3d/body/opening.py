"""Makes motions from their descriptions in model files."""

from ico3d.body.motion.deformation import Deformation
from ico3d.body.motion.encoder import EncoderShape
from ico3d.body.motion.formulas import Polynomial, Still
from ico3d.body.motion.tunable import MlpShape
from ico3d.body.motion.window_model import Motion
from ico3d.body.skinning.skinned import Skinned


def motion_from(about: dict) -> Motion:
    """Makes the motion that `Motion.about` described.

    Raises:
        ValueError: If its kind is unknown.
        KeyError: If a field that is read here is missing.
        TypeError: If another field is missing, unknown, or of a wrong type.
    """
    fields = dict(about)
    kind = fields.pop("kind")
    if kind == "still":
        return Still(**fields)
    if kind == "polynomial":
        return Polynomial(**fields)
    if kind == "skinned":
        names, parents = (tuple(fields.pop(name)) for name in ("names", "parents"))
        return Skinned(names, parents, **fields)
    if kind == "deformation":
        grid = fields.pop("encoder")
        if grid is not None:
            grid = EncoderShape(tuple(grid.pop("space")), **grid)
        middle, half = (tuple(float(x) for x in fields.pop(name)) for name in ("middle", "half"))
        return Deformation(middle, half, MlpShape(**fields.pop("mlp")), grid, **fields)  # type: ignore[arg-type]
    raise ValueError(f"there is no motion of the kind '{kind}'")
