"""A CUDA device for machines without one: CPU tensors that pretend, and refuse what CUDA refuses.

While `PretendedCuda` is active, what was moved to or made on "cuda" says so of itself, is computed
with on the CPU, and hands the same down to all that is made of it. Mixing it with tensors that were
not moved, or turning it into numpy without `.cpu()`, is the error that CUDA makes of it. Control
flow, losses and gradients are real, so that whole trainings run.

Where CUDA and gsplat work, `cuda_or_pretended` gives the real ones, and the same tests run there.

`gsplat` stands for the package of that name: its contract, fulfilled by the CPU's rasteriser.
"""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType, SimpleNamespace
from typing import Any

import torch
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode

from ico3d.common.camera import Camera
from ico3d.splat.cpu.backend import draw_gaussians
from ico3d.splat.density import relocated
from ico3d.splat.device import cuda_fault
from ico3d.splat.gaussians import Gaussians

CUDA, CPU = torch.device("cuda", 0), torch.device("cpu")
DEVICE, IS_CUDA, IS_CPU = Tensor.device.__get__, Tensor.is_cuda.__get__, Tensor.is_cpu.__get__
SET_DATA = Tensor.data.__set__
GIVEN_TO_ANY = {
    Tensor.copy_,
    SET_DATA,
    Tensor.__deepcopy__,
    torch._has_compatible_shallow_copy_type,
}
"""What may be given tensors of two devices."""
JOINING = {torch.cat, torch.stack, torch.concat, torch.hstack, torch.vstack}
"""What takes not even a single number of another device."""
_NEW_PARAMETER = nn.Parameter.__new__
PEAK = 123_000_000
"""Bytes that are said to have been the most on the device."""
INDEXING = {Tensor.__getitem__, Tensor.__setitem__}
_GROUPS = (tuple, list, dict)


def is_moved(tensor: Tensor) -> bool:
    """Whether a tensor pretends."""
    return getattr(tensor, "_pretends", False)


def _tensors(values: Iterable) -> list[Tensor]:
    """The tensors in tuples, lists and dictionaries, in order."""
    found: list[Tensor] = []
    for value in values:
        if isinstance(value, Tensor):
            found.append(value)
        elif isinstance(value, _GROUPS) and value:
            found += _tensors(value.values() if isinstance(value, dict) else value)
    return found


def _mark(value: Any, moved: bool) -> Any:
    """The tensors in a value, marked; others are left alone."""
    for tensor in _tensors((value,)):
        tensor._pretends = moved
    return value


class PretendedCuda(TorchFunctionMode):
    """Active within `with`; then torch finds a CUDA device."""

    def __torch_function__(self, func, types, args=(), kwargs=None):
        kwargs = dict(kwargs) if kwargs else {}
        given = _tensors((*args, kwargs) if kwargs else args)
        moved = any(map(is_moved, given))
        if func in _OF_DEVICES:
            return _OF_DEVICES[func](func, args, kwargs, moved)
        if not moved and kwargs.get("device") is None:  # what nobody moved is computed here
            return func(*args, **kwargs)
        if func == Tensor.__deepcopy__:
            moved = is_moved(args[0])
        target = _target(kwargs, moved)
        _check(func, args, kwargs, given, target)
        result = func(*args, **kwargs)
        if func == SET_DATA:
            _mark(args[0], is_moved(args[1]))
        return _marked_new(result, given, target)


def _numpy(func: Callable, args: tuple, kwargs: dict, moved: bool) -> Any:
    """`Tensor.numpy`."""
    if moved:
        raise TypeError("can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu().")
    return func(*args, **kwargs)


def _cpu(func: Callable, args: tuple, kwargs: dict, moved: bool) -> Tensor:
    """`Tensor.cpu`."""
    return _mark(args[0].clone() if moved else args[0], False)


def _moving(func: Callable, args: tuple, kwargs: dict, _: bool) -> Tensor:
    """`Tensor.to` and `Tensor.cuda`."""
    tensor, rest = args[0], list(args[1:])
    moved = True if func == Tensor.cuda else is_moved(tensor)
    if func == Tensor.cuda:
        rest = []
    for index, value in enumerate(rest):
        if isinstance(value, Tensor):
            moved, rest[index] = is_moved(value), value.dtype
        elif isinstance(value, torch.device | str | int) and not isinstance(value, bool):
            moved, rest[index] = torch.device(value).type == "cuda", CPU
    if "other" in kwargs:
        other = kwargs.pop("other")
        moved = is_moved(other)
        rest.insert(0, other.dtype)
    if kwargs.get("device") is not None:
        moved = torch.device(kwargs["device"]).type == "cuda"
        kwargs["device"] = CPU
    result = tensor.to(*rest, **kwargs) if rest or kwargs else tensor
    if moved == is_moved(tensor):
        return _mark(result, moved)
    return _mark(result.clone() if result is tensor else result, moved)


_OF_DEVICES: dict[Callable, Callable] = {
    DEVICE: lambda func, args, kwargs, moved: CUDA if moved else func(*args),
    IS_CUDA: lambda func, args, kwargs, moved: moved,
    IS_CPU: lambda func, args, kwargs, moved: not moved,
    Tensor.numpy: _numpy,
    Tensor.__array__: _numpy,
    Tensor.cpu: _cpu,
    Tensor.to: _moving,
    Tensor.cuda: _moving,
}
"""What asks for a tensor's device or changes it: function, arguments, whether any pretends."""


def _target(kwargs: dict, moved: bool) -> bool:
    """Whether the result is on CUDA; `device` is replaced by the one that computes."""
    if kwargs.get("device") is not None:
        moved = torch.device(kwargs["device"]).type == "cuda"
        kwargs["device"] = CPU
    return moved


def _check(func: Callable, args: tuple, kwargs: dict, given: list[Tensor], target: bool) -> None:
    """Raises what CUDA raises."""
    generator = kwargs.get("generator")
    if target and generator is not None:
        raise RuntimeError("Expected a 'cuda' device type for generator but found 'cpu'")
    if not any(map(is_moved, given)) or func in GIVEN_TO_ANY:
        return
    if func in INDEXING and is_moved(args[0]):
        given = [args[0], *(v for v in args[2:] if isinstance(v, Tensor))]  # places may be here
    numbers_too = func not in JOINING and is_moved(args[0] if _changes(func) else _widest(given))
    for tensor in given:
        if not is_moved(tensor) and not (numbers_too and tensor.dim() == 0):
            raise RuntimeError(
                "Expected all tensors to be on the same device, but found at least two devices, "
                f"cuda:0 and cpu! ({getattr(func, '__name__', func)})"
            )


def _changes(func: Callable) -> bool:
    """Whether a function changes its first argument."""
    name = getattr(func, "__name__", "")
    return (name.endswith("_") and not name.endswith("__")) or name.startswith("__i")


def _widest(given: list[Tensor]) -> Tensor:
    return max(given, key=lambda tensor: (tensor.dim() > 0, is_moved(tensor)))


def _marked_new(result: Any, given: list[Tensor], moved: bool) -> Any:
    """What a function made, on its device; what it was given stays where it is."""
    known = {id(tensor) for tensor in given}
    if isinstance(result, Tensor):  # mostly
        if id(result) not in known:
            result._pretends = moved
        return result
    if isinstance(result, Iterator):
        return iter([_marked_new(part, given, moved) for part in result])
    for leaf in _tensors((result,)):
        if id(leaf) not in known:
            leaf._pretends = moved
    return result


@contextmanager
def pretended_cuda(monkeypatch, **changes: Any) -> Iterator[None]:
    """CUDA and gsplat that work; `changes` are what is otherwise about gsplat's module."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    monkeypatch.setattr(torch.cuda, "synchronize", lambda *_: None)
    stream = SimpleNamespace(is_capturing=lambda: False)  # Adam asks for it
    monkeypatch.setattr(torch.accelerator, "current_stream", lambda *_: stream)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda *_: "Pretended")
    monkeypatch.setattr(torch.cuda, "reset_peak_memory_stats", lambda *_: None)
    monkeypatch.setattr(torch.cuda, "max_memory_allocated", lambda *_: PEAK)
    monkeypatch.setattr(nn.Parameter, "__new__", _new_parameter)  # no function of torch's
    install_gsplat(monkeypatch, **changes)
    with PretendedCuda():
        yield


@contextmanager
def cuda_or_pretended(monkeypatch) -> Iterator[torch.device]:
    """A CUDA device: a real one where it can be used, else one that is pretended."""
    cuda_fault.cache_clear()
    if cuda_fault() is None:
        yield CUDA
        return
    cuda_fault.cache_clear()
    with pretended_cuda(monkeypatch):
        yield CUDA
    cuda_fault.cache_clear()


def is_on_cuda(tensor: Tensor) -> bool:
    """Whether a tensor lies on the device of `cuda_or_pretended`."""
    return is_moved(tensor) or tensor.device.type == "cuda"


def assert_same_run(ours: Mapping[str, Tensor], theirs: Mapping[str, Tensor]) -> None:
    """Two trainings that differ by an interruption gave the same tensors, on CUDA.

    A real GPU adds gradients in any order, so that Gaussians split elsewhere and their number
    differs after some steps; there, tensors only need the same names and widths, and to be
    finite. `python bench/gpu.py` states how far apart such trainings are.
    """
    pretended = import_module("gsplat").rasterization is rasterization
    assert ours.keys() == theirs.keys()
    for name, value in theirs.items():
        if pretended:
            assert torch.equal(ours[name], value), name
        else:
            assert ours[name].shape[1:] == value.shape[1:], name
            assert bool(ours[name].isfinite().all()), name


def _new_parameter(
    kind: type, data: Tensor | None = None, requires_grad: bool = True
) -> nn.Parameter:
    """A parameter lies where its data do."""
    made = _NEW_PARAMETER(kind, data, requires_grad)
    return made if data is None else _mark(made, is_moved(data))


def install_gsplat(monkeypatch, **changes: Any) -> None:
    """Makes `gsplat` importable, as this module has it, but with these attributes."""
    module, compiled = ModuleType("gsplat"), ModuleType("gsplat.cuda")
    backend = ModuleType("gsplat.cuda._backend")
    backend._C = SimpleNamespace()
    module.__version__, module.rasterization = "1.5.3", rasterization
    module.__path__ = compiled.__path__ = []
    module.__spec__ = SimpleNamespace(name="gsplat")
    for name, value in changes.items():
        setattr(module, name, value)
    relocation = ModuleType("gsplat.relocation")
    relocation.compute_relocation = compute_relocation
    names = {
        "gsplat": module,
        "gsplat.cuda": compiled,
        "gsplat.cuda._backend": backend,
        "gsplat.relocation": relocation,
    }
    for name, value in names.items():
        monkeypatch.setitem(sys.modules, name, value)


def rasterization(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    colors: Tensor,
    viewmats: Tensor,
    Ks: Tensor,
    width: int,
    height: int,
    near_plane: float,
    eps2d: float,
    packed: bool,
    render_mode: str,
    rasterize_mode: str,
    absgrad: bool,
) -> tuple[Tensor, Tensor, dict]:
    """What ico3d uses of gsplat's function, on what pretends only."""
    tensors = (means, quats, scales, opacities, colors, viewmats, Ks)
    if not all(map(is_moved, tensors)):
        raise RuntimeError("gsplat: CUDA tensors are needed")
    with torch._C.DisableTorchFunction():
        matrices = Ks.detach().double().numpy()
        poses = viewmats.detach().double().numpy()
        cameras = [Camera(width, height, k, p) for k, p in zip(matrices, poses, strict=True)]
        drawing = draw_gaussians(
            Gaussians(means, quats, scales, opacities),
            colors,
            cameras,
            viewmats.double(),
            rasterize_mode == "antialiased",
            absgrad,
        )
        picture = drawing.rgb if render_mode == "RGB" else drawing.draw_depth()[..., None]
        info = drawing.info
        if info.absolute is not None:
            info.means2d.absgrad = _mark(info.absolute(), True)
    meta = {"means2d": _mark(info.means2d, True), "radii": _mark(info.radii, True)}
    return _mark(picture, True), _mark(drawing.alpha[..., None], True), meta


def compute_relocation(
    opacities: Tensor, scales: Tensor, ratios: Tensor, binoms: Tensor
) -> tuple[Tensor, Tensor]:
    """gsplat's function of that name, on what pretends only."""
    if not all(map(is_moved, (opacities, scales, ratios, binoms))):
        raise RuntimeError("gsplat: CUDA tensors are needed")
    with torch._C.DisableTorchFunction():
        return _mark(relocated(opacities, scales, ratios), True)


@contextmanager
def drawn(monkeypatch) -> Iterator[list[int]]:
    """Gathers how many Gaussians each picture had that gsplat was asked for meanwhile."""
    pictures: list[int] = []
    gsplat = import_module("gsplat")
    draw = gsplat.rasterization

    def counting(means: Tensor, *arguments: Any, **options: Any) -> tuple[Tensor, Tensor, dict]:
        if len(means) > 1:  # one alone tries the device
            pictures.append(len(means))
        return draw(means, *arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(gsplat, "rasterization", counting)
        yield pictures
