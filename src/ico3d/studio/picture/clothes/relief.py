"""Relief of cloth: heights in metres, as functions of place, that tilt normals and shade valleys.

A `Weave` says where on the cloth a spot lies. Heights are read at three neighbouring spots of one
triangle, and their differences tilt the normal (Mikkelsen, "Bump mapping unparametrized surfaces on
the GPU").
"""

import math
from typing import NamedTuple

from ico3d.splat.cpu.compile import kernel, subroutine
from ico3d.studio.picture.textures import smoothstep, visible

WALE, ROW = 0.0030, 0.0024
"""Width of a column of stitches with the valley beside it, and height of a stitch, metres.

As fine as a summer jumper's: pictures of a face show columns, those of a whole person folds alone,
which Gaussians learn without the smears and the moiré of coarse ribs.
"""
RAISED, RIBBED = 0.00025, 0.0010
"""Height of a column of stitches and of a rib at an edge, metres."""
TWILL = 0.0021
"""Distance between two diagonal lines of denim, metres."""


class Weave(NamedTuple):
    """A place on cloth.

    Attributes:
        u: Metres across the threads.
        v: Metres along the threads.
        x: Place in the pattern of folds, across limbs.
        y: Place in the pattern of folds, along limbs.
        z: Place in the pattern of folds, across limbs.
        hem: Distance from the nearest finished edge, in widths of its hem.
        cosine: Of the turn about that edge.
        sine: Of the turn about that edge.
        ribs: Number of ribs around that edge.
        seam: Distance from the nearest seam, metres.
        fold: Depth of the folds, metres.
    """

    u: float
    v: float
    x: float
    y: float
    z: float
    hem: float
    cosine: float
    sine: float
    ribs: float
    seam: float
    fold: float


@subroutine()
def moved(weave, step, length):
    """The place `length` times a `step` further; both are a `Weave`."""
    return Weave(
        weave.u + length * step.u,
        weave.v + length * step.v,
        weave.x + length * step.x,
        weave.y + length * step.y,
        weave.z + length * step.z,
        weave.hem + length * step.hem,
        weave.cosine + length * step.cosine,
        weave.sine + length * step.sine,
        weave.ribs,
        weave.seam + length * step.seam,
        weave.fold + length * step.fold,
    )


@kernel()
def folds(w):
    """Height of the folds: waves across the limb that lean, swell and end, and finer slanting ones.

    Sums of sines, because their slopes change smoothly: the eye sees every kink of a shaded slope.
    """
    if w.fold < 1e-5:
        return 0.0
    lean = math.sin(1.9 * w.x + 0.35 * w.y + 1.4 * w.z + 1.0)
    drift = math.sin(-2.3 * w.x + 0.55 * w.y + 2.1 * w.z + 2.2)
    swell = 0.5 + 0.5 * math.sin(3.1 * w.x + 0.8 * w.y - 2.6 * w.z + 1.2 * lean + 4.0)
    first = 0.5 + 0.5 * math.sin(6.2832 * w.y + 1.9 * lean + 1.1 * drift)
    slant = 9.3 * w.y + 4.6 * w.x + 2.3 * drift
    second = 0.5 + 0.5 * math.sin(slant)
    swell = swell * swell * (3.0 - 2.0 * swell)
    return w.fold * (first * first * (0.06 + 1.14 * swell) + 0.35 * second * (1.0 - swell))


@subroutine()
def ribbed(w):
    """How much a place on knitwear is of the ribs at its edges, 0 to 1."""
    return 1.0 - smoothstep(0.88, 1.12, w.hem)


@subroutine()
def knit_height(w, pixel):
    """Height of ribs at the edges of knitwear, and of stitches; seams are shallow hollows."""
    height = 0.0
    rib = ribbed(w)
    if rib > 0.0:
        round_ = 0.5 + 0.5 * math.cos(w.ribs * math.atan2(w.sine, w.cosine))
        height += rib * RIBBED * visible(0.0055, 1.8 * pixel) * round_ * (2.0 - round_)
        height -= 0.0012 * rib * smoothstep(0.8, 1.0, w.hem)
        height += 0.0020 * (1.0 - smoothstep(0.0, 0.12, w.hem))
    if rib < 1.0:
        height += (1.0 - rib) * RAISED * visible(WALE, 1.8 * pixel) * stitch(w.u, w.v, pixel)
    return height - 0.0005 * (1.0 - smoothstep(0.0, 0.006, w.seam))


@kernel()
def stitch(u, v, pixel):
    """Height of round columns of stitches that lean towards one another, 0 to 1."""
    column = u / WALE - math.floor(u / WALE) - 0.5
    round_ = 0.5 + 0.5 * math.cos(6.2832 * column)
    phase = 6.2832 * (v / ROW - 2.0 * abs(column))
    row = 0.17 * visible(ROW, 2.4 * pixel) * math.cos(phase)
    return round_ * (2.0 - round_) * (0.83 + row)


@subroutine()
def denim_height(w, pixel):
    """Height of a turned hem of denim, of felled seams and the diagonal weave."""
    height = -0.0008 * smoothstep(0.92, 1.0, w.hem) * (1.0 - smoothstep(1.0, 1.1, w.hem))
    height += 0.0010 * (1.0 - smoothstep(0.009, 0.011, w.seam))
    height -= 0.0012 * (1.0 - smoothstep(0.0, 0.0016, w.seam))
    return height + 0.00022 * visible(TWILL, 2.0 * pixel) * math.sin(twill(w.u, w.v))


@subroutine()
def twill(u, v):
    """Phase of the diagonal weave."""
    return 6.2832 * (0.89 * v + 0.45 * u) / TWILL
