"""Optimises one window, with one picture per step (paper, dynamic 3D body Gaussians)."""

from collections.abc import Mapping, Sequence

from torch import Tensor

from ico3d.body.companion import Companion
from ico3d.body.motion.deformation import GRID, Deformation
from ico3d.body.motion.encoder import space_smoothness, time_change, time_smoothness
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.unfolding import Unfolding
from ico3d.body.planning.windows import Window
from ico3d.body.settings import BodySettings, Method
from ico3d.body.skinning.skinned import Skinned, without_residual
from ico3d.body.training.density import density_control
from ico3d.body.training.on_bones import OnBones
from ico3d.body.training.picture_step import Learner, WindowTrainee
from ico3d.body.training.views import BodyViews
from ico3d.capture.pictures import View
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.losses import tensor_psnr


class BodyTrainer(WindowTrainee):
    """A `Trainee` of all of a window's model, with density control."""

    def __init__(
        self,
        model: WindowModel,
        window: Window,
        pictures: BodyViews,
        method: Method,
        settings: BodySettings,
        extent: float,
        seed: int,
        companion: Companion | None = None,
    ):
        """Makes a trainee before its first step.

        Args:
            model: The window's model, which is changed in place.
            window: Frames of the window.
            pictures: Recorded pictures of these frames.
            method: How Gaussians are moved, which decides the density control.
            settings: Settings of the body.
            extent: Half the longest edge of the person's bounding box, metres.
            seed: Seed of all randomness.
            companion: Other Gaussians that are in the pictures; None for none.
        """
        fixed: tuple[str, ...] = ()
        self._bones: OnBones | None = None
        if isinstance(model.motion, Skinned):
            fixed = model.motion.fixed
            self._bones = OnBones(model, pictures.body_track())
        for name, tensor in {**model.gaussians, **model.shared}.items():
            tensor.requires_grad_(name not in fixed)
        super().__init__(Learner(model, window, pictures, settings, extent, seed, companion))
        if model.camera_colors is not None:
            model.camera_colors.requires_grad_(settings.color_correction)
        self._settings = settings
        # A copy, as training changes the joints in place.
        self._joints = model.shared["rig_joints"].detach().clone() if fixed else None  # (J, 3)
        self._steps = settings.steps_of(len(window))
        self._strategy = density_control(method, settings, self._steps, seed, extent)
        deforms = isinstance(model.motion, Deformation)
        self._warmup = settings.warmup_steps if deforms else 0
        self._by_frame: dict[int, list[View]] = {}
        for view in self._learner.views:
            self._by_frame.setdefault(view.frame, []).append(view)
        self._center = self._by_frame.get(window.center, [])
        self._unfolding: Unfolding | None = None
        if deforms and settings.unfolding:
            self._unfolding = Unfolding(
                window, tuple(self._by_frame), self._warmup, self._steps, settings.unfolding, seed
            )
        self._first = window.first

    def step(self, index: int) -> Mapping[str, float]:
        """Renders one recorded view, learns from the difference, and controls density."""
        learner = self._learner
        still = self._is_still(index)
        self._unfold(index)
        learner.expect(range(index, self._steps), self._views)
        view = learner.view(self._views(index), index)
        example = learner.example(view, index)
        gaussians = self.model.canonical() if still else self._moved(view, index)
        gaussians = gaussians.up_to_degree(index // self._settings.sh_every)
        rendering = learner.draw(gaussians, view, example)
        loss = learner.loss(rendering, example) + self._penalties()
        loss.backward()
        self._strategy.observe(rendering.info.first(len(gaussians)), index)
        progress = index / self._steps
        learner.update(progress)
        if self._bones is not None:
            self._bones.limit_sizes(self.model)
        rate = self._settings.rates.by_parameter()["means"].at(progress)
        self._strategy.adapt(learner.population, index, rate)
        if self._bones is not None:
            self._bones.rehang(self.model, index)
        learner.prune(index, self._steps)
        return {
            "loss": loss.item(),
            "psnr": tensor_psnr(rendering.rgb[0], example.target, example.mask),
            "gaussians": len(self.model),
        }

    def _is_still(self, index: int) -> bool:
        """Whether a step learns from the window's middle frame, without motion."""
        return index < self._warmup and bool(self._center)

    def _views(self, index: int) -> Sequence[View]:
        """The views among which a step chooses."""
        if self._is_still(index):
            return self._center
        if self._unfolding is None or index < self._warmup:
            return self._learner.views
        return self._by_frame[self._unfolding.frame(index)]

    def _unfold(self, index: int) -> None:
        """Lets frames that join at a step begin with the features of their neighbours."""
        motion = self.model.motion
        if self._unfolding is None or not isinstance(motion, Deformation):
            return
        for frame, neighbour in self._unfolding.joining(index):
            rows = frame - self._first, neighbour - self._first
            motion.continue_time(self.model.shared, *rows)

    def _moved(self, view: View, index: int) -> Gaussians:
        """Gaussians at the time of a view; on a skeleton at random without residual shapes."""
        tau, motion = self._learner.tau(view), self.model.motion
        if not isinstance(motion, Skinned):
            return self.model.at(tau)
        values = {**self.model.gaussians, **self.model.shared}
        pose = motion.pose_at(values, tau)
        dropped = self._learner.random(index, 4).random() < self._settings.skinning.dropout
        return motion.drawn(values, without_residual(pose) if dropped else pose)

    def tensors(self) -> dict[str, Tensor]:
        """Parameters, moments of the optimiser, and the state of density control."""
        gathered = {f"density.{name}": t for name, t in self._strategy.tensors().items()}
        return self._learner.tensors() | gathered

    def restore(self, tensors: dict[str, Tensor], state: dict) -> None:
        """Restores the state that `tensors` returned; `state` is not used."""
        del state
        self._learner.restore(tensors)
        prefix = "density."
        gathered = {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}
        self._strategy.restore(gathered)

    def _penalties(self) -> Tensor:
        """Terms of density control and of the regularisers of planes and joints in the loss."""
        weights, model = self._settings.loss, self.model
        total = self._strategy.penalty(self._learner.population)
        planes = {n.removeprefix(GRID): p for n, p in model.shared.items() if n.startswith(GRID)}
        if weights.smoothness and planes:
            total = total + weights.smoothness * (
                space_smoothness(planes) + time_smoothness(planes)
            )
        if weights.stillness and planes:
            total = total + weights.stillness * time_change(planes)
        if weights.joints and self._joints is not None:
            moved = model.shared["rig_joints"] - self._joints  # (J, 3)
            total = total + weights.joints * moved.square().sum()
        return total
