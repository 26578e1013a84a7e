"""Bodies on disk."""

import json
import math

import pytest
import torch

from ico3d.body.model_folder import ABOUT, TrainedBody, load_window, save_window
from ico3d.body.motion.formulas import Still
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.errors import ModelError
from ico3d.training.checkpoint import load_tensors, save_tensors
from support.bodies.skinned_model import trained_like
from support.bodies.window_parts import ENCODED, canonical
from support.bundles.random_skinned import random_skinned


@pytest.fixture
def body(tmp_path):
    """Two windows: one that is deformed, one that is still; saved."""
    alpha = torch.rand(5, 2, generator=torch.Generator().manual_seed(3))
    shared = ENCODED.initial(torch.Generator().manual_seed(4))
    models = [
        WindowModel(ENCODED, {**canonical(), "alpha": alpha}, shared),
        WindowModel(Still(), canonical(3), {}),
    ]
    made = TrainedBody(models, (Window(0, 4), Window(4, 6)), 15.0, "swings++", {"who": "nobody"})
    for number, model in enumerate(models):
        save_window(tmp_path / f"{number}.safetensors", model)
    made.save(tmp_path, ["0.safetensors", "1.safetensors"])
    return made


def test_round_trip(body, tmp_path):
    """The same windows, bit by bit."""
    loaded = TrainedBody.load(tmp_path)
    assert (loaded.windows, loaded.fps, loaded.method) == (body.windows, 15.0, "swings++")
    for frame in (0, 1.3, 4, 5, 6):
        a, b = (some.gaussians(frame / 15) for some in (body, loaded))
        assert torch.equal(a.means, b.means) and torch.equal(a.colors, b.colors)


def test_times_find_their_window(body):
    """A shared frame belongs to the earlier window; times beyond the clip are its ends."""
    assert [body.window_at(frame / 15) for frame in (0, 3.9, 4, 4.1, 6, 99)] == [0, 0, 0, 1, 1, 1]
    assert body.seconds == 6 / 15
    torch.testing.assert_close(body.gaussians(99.0).means, body.window_gaussians(1, 1.0).means)
    torch.testing.assert_close(body.gaussians(-1.0).means, body.window_gaussians(0, 0.0).means)


def test_no_body_and_damaged_ones(body, tmp_path):
    """One sentence that names the file."""
    with pytest.raises(ModelError, match="no body"):
        TrainedBody.load(tmp_path / "elsewhere")
    whole = (tmp_path / "1.safetensors").read_bytes()
    (tmp_path / "1.safetensors").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ModelError, match=r"1\.safetensors"):
        TrainedBody.load(tmp_path)
    about = json.loads((tmp_path / ABOUT).read_text())
    about["windows"][0]["file"] = "../../elsewhere.safetensors"
    (tmp_path / ABOUT).write_text(json.dumps(about))
    with pytest.raises(ModelError, match="outside of its folder"):
        TrainedBody.load(tmp_path)


def test_how_cameras_differ_in_colour_is_kept(tmp_path):
    """Bit by bit; a model without that stays without."""
    maps = torch.randn(4, 3, 4)
    for colors in (maps, None):
        save_window(tmp_path / "w.safetensors", WindowModel(Still(), canonical(), {}, colors))
        found = load_window(tmp_path / "w.safetensors").camera_colors
        assert found is colors is None or torch.equal(found, maps)


def test_a_window_of_something_else_is_refused(tmp_path):
    """A file of the right kind with other tensors."""
    model = WindowModel(Still(), canonical(), {})
    model.gaussians["superfluous"] = torch.zeros(5)
    save_window(tmp_path / "w.safetensors", model)
    with pytest.raises(ModelError, match="superfluous"):
        load_window(tmp_path / "w.safetensors")


@pytest.mark.parametrize("named", ["1.safetensors", "./other.safetensors"])
def test_each_window_has_a_file_of_its_own(body, tmp_path, named):
    """Else a short list would fill the memory with one file."""
    (tmp_path / "other.safetensors").symlink_to("1.safetensors")
    about = json.loads((tmp_path / ABOUT).read_text())
    about["windows"][0]["file"] = named
    (tmp_path / ABOUT).write_text(json.dumps(about))
    with pytest.raises(ModelError, match="names a file for more than one window"):
        TrainedBody.load(tmp_path)


@pytest.mark.parametrize("named", ["a" * 5000, "\0", "\ud800", 1])
def test_names_that_no_file_can_have(body, tmp_path, named):
    about = json.loads((tmp_path / ABOUT).read_text())
    about["windows"][0]["file"] = named
    (tmp_path / ABOUT).write_text(json.dumps(about))
    with pytest.raises(ModelError):
        TrainedBody.load(tmp_path)


@pytest.mark.parametrize(
    "changes",
    [
        {"fps": 0},
        {"fps": math.nan},
        {"fps": 10**400},
        {"windows": []},
        {"windows": [{"first": 4, "last": 2, "file": "0.safetensors"}]},
        {"method": "levitation"},
        {"method": []},
        {"windows": [{"first": 0, "last": 10**9, "file": "0.safetensors"}]},
        {"summary": []},
        {"summary": {"continued": [{"cameras": ["c"], "frames": [[0]]}]}},
    ],
    ids=lambda changes: f"{changes}"[:30],
)
def test_what_no_body_tells_of_itself_is_refused(body, tmp_path, changes):
    about = json.loads((tmp_path / ABOUT).read_text())
    (tmp_path / ABOUT).write_text(json.dumps(about | changes))
    with pytest.raises(ModelError, match="holds no body"):
        TrainedBody.load(tmp_path)


def test_a_window_that_cannot_be_drawn_is_refused_when_it_is_read(body, tmp_path):
    """Planes of another size than the window's description says."""
    tensors, about = load_tensors(tmp_path / "0.safetensors")
    about["encoder"]["space"] = [5]
    save_tensors(tmp_path / "0.safetensors", tensors, about)
    with pytest.raises(ModelError, match="does not hold a window of a body"):
        TrainedBody.load(tmp_path)


SKELETAL = trained_like(random_skinned())
DEFORMED = WindowModel(
    ENCODED,
    {**canonical(), "alpha": torch.rand(5, 2)},
    ENCODED.initial(torch.Generator().manual_seed(4)),
)
WINDOWS = {"skinned": SKELETAL, "deformed": DEFORMED}


def of_joint(number: int):
    return lambda tensor: torch.full_like(tensor, number)


def with_column_missing(tensor: torch.Tensor) -> torch.Tensor:
    return tensor[..., :-1].contiguous()


FALSE = {
    "a joint of 2³⁰": ("skinned", "skin_joints", of_joint(2**30)),
    "one too many": ("skinned", "skin_joints", of_joint(len(SKELETAL.motion.names))),
    "a joint of −1": ("skinned", "skin_joints", of_joint(-1)),
    "a caster's joint": ("skinned", "caster_joints", of_joint(-(2**30))),
    "wide joints": ("skinned", "skin_joints", torch.Tensor.long),
    "joints with parts": ("skinned", "skin_joints", torch.Tensor.float),
    "a sphere too few": ("skinned", "caster_weights", lambda tensor: tensor[1:].contiguous()),
    "not a number": ("skinned", "skin_logits", lambda tensor: tensor * torch.nan),
    "wide numbers": ("deformed", "means", torch.Tensor.double),
    "places out of this world": ("skinned", "means", lambda tensor: tensor + 1e30),
    "a shallow plane": ("deformed", "grid.xy0", with_column_missing),
} | {
    f"a narrow {name}": (kind, name, with_column_missing)
    for kind, model in WINDOWS.items()
    for name, tensor in {**model.gaussians, **model.shared}.items()
    if tensor.dim() > 1
}


@pytest.mark.parametrize("false", FALSE)
def test_tensors_that_are_not_their_motions_are_refused_before_a_kernel_reads_them(tmp_path, false):
    """Kernels look at no bounds: the number of a joint that is not there ended the process."""
    kind, name, change = FALSE[false]
    file = tmp_path / "w.safetensors"
    save_window(file, WINDOWS[kind])
    assert len(load_window(file)) == len(WINDOWS[kind])
    tensors, about = load_tensors(file)
    (stored,) = [known for known in tensors if known.partition(".")[2] == name]
    tensors[stored] = change(tensors[stored])
    save_tensors(file, tensors, about)
    with pytest.raises(ModelError, match=f"does not hold a window of a body: .*'?{name[:6]}"):
        load_window(file)


def deformed(**changes) -> dict:
    own = {"middle": [0, 0, 0], "half": [1, 1, 1], "mlp": {"inputs": 4}, "encoder": None}
    return own | {"bands": 0} | changes


HUGE = {
    "bands": ("deformation", deformed(bands=10**8), "does not take 800000004 to 10"),
    "depth": ("deformation", deformed(mlp={"inputs": 4, "depth": 10**8}), "must be 1 to 1,024"),
    "inputs": (
        "deformation",
        deformed(bands=10**8, mlp={"inputs": 4 + 8 * 10**8}),
        "must be 1 to 1,024",
    ),
    "scales": (
        "deformation",
        deformed(encoder={"space": [2] * 10**6, "time": 1, "channels": 1}),
        "at most 16 scales",
    ),
    "degree": (
        "polynomial",
        {"degree": 10**9, "turning": False, "detached": False},
        "must be 1 to 8",
    ),
}


@pytest.mark.parametrize("huge", HUGE)
def test_a_description_of_a_huge_motion_is_refused_before_anything_is_built_of_it(tmp_path, huge):
    """A file of 1 kB took 8.5 GB."""
    kind, fields, said = HUGE[huge]
    file = tmp_path / "w.safetensors"
    names = {f"gaussians.{name}": tensor for name, tensor in canonical(2).items()}
    names |= {"gaussians.alpha": torch.zeros(2, 2)}
    for layer in range(3):
        names |= {f"shared.mlp.{part}{layer}": torch.zeros(1) for part in ("weight", "bias")}
    save_tensors(file, names, {"kind": kind, **fields})
    with pytest.raises(ModelError, match=f"does not hold a window of a body: .*{said}"):
        load_window(file)


@pytest.mark.parametrize(
    "changes",
    [
        {"frames": 1.5},
        {"frames": 0},
        {"shapes": -1},
        {"hidden": 10**9},
        {"names": [1] * 5},
        {"names": ["a"] * 5},
        {"parents": "abcde"},
        {"parents": [-1, 1, 2, 3, 4]},
        {"parents": [4, 3, 2, 1, 0]},
        {"parents": [-1, 0, 3 * 10**9, 0, 0]},
    ],
)
def test_a_skeleton_that_is_none_is_refused(tmp_path, changes):
    file = tmp_path / "w.safetensors"
    save_window(file, SKELETAL)
    tensors, about = load_tensors(file)
    save_tensors(file, tensors, about | changes)
    with pytest.raises(ModelError, match="does not hold a window of a body"):
        load_window(file)
