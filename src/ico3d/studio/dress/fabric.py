"""Simulates cloth: point masses held by massless springs and pushed away by round limbs.

The method is extended position-based dynamics (Macklin, Müller and Chentanez, "XPBD: position-based
simulation of compliant constrained dynamics", 2016) in many small steps of one iteration each
(Macklin et al., "Small steps in physics simulation", 2019). Collisions of the cloth with itself are
ignored.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ico3d.splat.cpu.compile import kernel

STEPS_PER_SECOND = 3600
GRAVITY = 9.81
DENSITY = 0.22
"""Mass of the cloth, that of a light wool, kilograms per square metre."""
DRAG = 1.6
"""Share of a velocity that air resistance removes per second."""
VISCOSITY = 40.0
"""Share of the velocity difference of neighbouring points that is lost per second."""
FRICTION = 0.3
"""Coulomb's coefficient of friction between cloth and limbs."""
THICKNESS = 0.005
"""Distance in metres that cloth keeps from a limb."""
STRETCH, SHEAR, BEND = 0.0, 0.15, 0.05
"""Compliances, metres per newton: along threads, along diagonals, and of bending.

Bending springs join points that are two threads apart.
"""
DRESSING, SETTLING = 0.6, 1.8
"""Seconds before the first frame: to move from rest to the first pose, and to settle there."""


@dataclass(frozen=True)
class Cloth:
    """N points of a cloth, and the springs between them.

    Attributes:
        points: (N, 3) float64 metres, canonical head space at rest.
        masses: (N,) masses of the points, kilograms.
        pinned: P; the first P points are carried by the body.
        pairs: (E, 2) int32 points that each spring joins.
        lengths: (E,) rest lengths of the springs, metres.
        compliance: (E,) compliances of the springs, metres per newton.
    """

    points: np.ndarray
    masses: np.ndarray
    pinned: int
    pairs: np.ndarray
    lengths: np.ndarray
    compliance: np.ndarray


@dataclass(frozen=True)
class Course:
    """Positions of pinned points and limbs in F frames, in the world, metres.

    Attributes:
        rest: Pinned points (P, 3) and limb ends (C, 2, 3) in the rest pose, in which the cloth is
            put on.
        pins: (F, P, 3) pinned points.
        ends: (F, C, 2, 3) two ends of each limb.
        radii: (C, 2) radius of each limb at its two ends.
        fps: Frames per second.
    """

    rest: tuple[np.ndarray, np.ndarray]
    pins: np.ndarray
    ends: np.ndarray
    radii: np.ndarray
    fps: float


def hung(cloth: Cloth, course: Course) -> np.ndarray:
    """Simulates a cloth through all frames.

    Before the first frame the person moves from rest, where the cloth is put on, to the first pose
    and stands still until the cloth has settled.

    Args:
        cloth: The cloth.
        course: Positions of what carries the cloth and of what the cloth meets.

    Returns:
        (F, N, 3) float64 positions of the points in the world, metres.
    """
    steps = max(1, round(STEPS_PER_SECOND / course.fps))
    step = 1.0 / (steps * course.fps)
    state = cloth.points + (course.rest[0] - cloth.points[: cloth.pinned]).mean(axis=0)
    velocity = np.zeros_like(state)

    def follow(pins: np.ndarray, ends: np.ndarray) -> None:
        springs = cloth.pairs, cloth.lengths, cloth.compliance
        _follow(state, velocity, pins, ends, cloth.masses, *springs, course.radii, step)

    first = course.pins[0], course.ends[0]
    follow(*(_eased(*way, round(DRESSING / step)) for way in zip(course.rest, first, strict=True)))
    follow(*(np.repeat(place[None], round(SETTLING / step), 0) for place in first))
    frames = [state.copy()]
    if len(course.pins) > 1:
        times = np.arange(len(course.pins))
        splines = [CubicSpline(times, values) for values in (course.pins, course.ends)]
        for frame in times[:-1]:
            between = frame + np.arange(1, steps + 1) / steps
            follow(*(spline(between) for spline in splines))
            frames.append(state.copy())
    return np.stack(frames)


def _eased(start: np.ndarray, end: np.ndarray, steps: int) -> np.ndarray:
    """(S, …) a smooth way from one place to another."""
    part = np.linspace(0, 1, steps).reshape(-1, *[1] * start.ndim)
    return start + part * part * (3 - 2 * part) * (end - start)


@kernel(fast=False)
def _follow(state, velocity, pins, ends, masses, pairs, lengths, compliance, radii, step):
    """Steps through S places of pins (S, P, 3) and limbs (S, C, 2, 3); changes the first two."""
    pinned = pins.shape[1]
    inverse = 1.0 / masses
    inverse[:pinned] = 0.0
    before = ends[0].copy()
    kept = max(0.0, 1.0 - DRAG * step)
    for s in range(pins.shape[0]):
        old = state.copy()
        for i in range(state.shape[0]):
            if i < pinned:
                for axis in range(3):  # rows as a whole would take ten times as long to compile
                    state[i, axis] = pins[s, i, axis]
                continue
            for axis in range(3):
                velocity[i, axis] *= kept
            velocity[i, 1] -= GRAVITY * step
            for axis in range(3):
                state[i, axis] += velocity[i, axis] * step
        hold(state, pairs, lengths, compliance, inverse, step)
        for c in range(ends.shape[1]):
            _push(state, old, pinned, before[c], ends[s, c], radii[c])
        for i in range(state.shape[0]):
            for axis in range(3):
                velocity[i, axis] = (state[i, axis] - old[i, axis]) / step
        _calm(velocity, pairs, masses, VISCOSITY * step)
        before = ends[s]


@kernel(fast=False)
def hold(state, pairs, lengths, compliance, inverse, step):
    """Brings pairs of points back to their distance, one after the other, in place.

    Args:
        state: (N, 3) float64 places, metres.
        pairs: (E, 2) int32 points that each spring joins.
        lengths: (E,) lengths at rest, metres.
        compliance: (E,) compliances, metres per newton.
        inverse: (N,) inverse masses, per kilogram; 0 for what is held.
        step: Seconds.
    """
    for e in range(pairs.shape[0]):
        i, j = pairs[e, 0], pairs[e, 1]
        x, y, z = (
            state[i, 0] - state[j, 0],
            state[i, 1] - state[j, 1],
            state[i, 2] - state[j, 2],
        )
        weight = inverse[i] + inverse[j]
        if weight == 0.0:
            continue
        length = np.sqrt(x * x + y * y + z * z)
        pull = (lengths[e] - length) / ((weight + compliance[e] / (step * step)) * length)
        a, b = inverse[i] * pull, inverse[j] * pull
        state[i, 0] += a * x
        state[i, 1] += a * y
        state[i, 2] += a * z
        state[j, 0] -= b * x
        state[j, 1] -= b * y
        state[j, 2] -= b * z


@kernel(fast=False)
def _calm(velocity, pairs, masses, part):
    """Brings the velocities of neighbours nearer to each other; their momentum stays."""
    for e in range(pairs.shape[0]):
        i, j = pairs[e, 0], pairs[e, 1]
        share = part / (masses[i] + masses[j])
        for axis in range(3):
            lost = share * (velocity[j, axis] - velocity[i, axis])
            velocity[i, axis] += lost * masses[j]
            velocity[j, axis] -= lost * masses[i]


@kernel(fast=False)
def _push(state, old, pinned, was, now, radii):
    """Pushes points out of a limb, on which they slide with friction."""
    ax, ay, az = now[0]
    dx, dy, dz = now[1, 0] - ax, now[1, 1] - ay, now[1, 2] - az
    mx, my, mz = was[0, 0] - ax, was[0, 1] - ay, was[0, 2] - az
    tx, ty, tz = was[1, 0] - now[1, 0], was[1, 1] - now[1, 1], was[1, 2] - now[1, 2]
    first, grows = radii[0] + THICKNESS, radii[1] - radii[0]
    widest = max(first, first + grows)
    low, high = min(ay, ay + dy) - widest, max(ay, ay + dy) + widest
    square = 1.0 / max(1e-12, dx * dx + dy * dy + dz * dz)
    for i in range(pinned, state.shape[0]):
        if state[i, 1] < low or state[i, 1] > high:
            continue
        px, py, pz = state[i, 0] - ax, state[i, 1] - ay, state[i, 2] - az
        part = min(1.0, max(0.0, (px * dx + py * dy + pz * dz) * square))
        px, py, pz = px - part * dx, py - part * dy, pz - part * dz
        reach = first + part * grows
        distance = px * px + py * py + pz * pz
        if distance >= reach * reach:
            continue
        distance = max(1e-9, np.sqrt(distance))
        nx, ny, nz = px / distance, py / distance, pz / distance
        deep = reach - distance
        # How far the point slid along the limb's surface, which moved itself.
        sx = state[i, 0] - old[i, 0] + mx + part * (tx - mx)
        sy = state[i, 1] - old[i, 1] + my + part * (ty - my)
        sz = state[i, 2] - old[i, 2] + mz + part * (tz - mz)
        along = sx * nx + sy * ny + sz * nz
        sx, sy, sz = sx - along * nx, sy - along * ny, sz - along * nz
        hold = min(1.0, FRICTION * deep / max(1e-12, np.sqrt(sx * sx + sy * sy + sz * sz)))
        state[i, 0] += deep * nx - hold * sx
        state[i, 1] += deep * ny - hold * sy
        state[i, 2] += deep * nz - hold * sz
