"""Optimising a head: one picture per step (paper, head model and implementation details)."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor
from torch.func import functional_call

from ico3d.capture.box import Box
from ico3d.capture.capture import Capture
from ico3d.errors import CaptureError, SettingsError
from ico3d.head.blending.basis import blend_of, update_basis
from ico3d.head.closeups import CloseUp, CloseUps
from ico3d.head.density import HeadDensity, Sampled, bound_scales
from ico3d.head.expressions import ExpressionTrack, turn_of, turn_values
from ico3d.head.learning_rows import LearningRows
from ico3d.head.loss import HeadLoss
from ico3d.head.model import HeadModel
from ico3d.head.portrait.shoulders import shoulders_of
from ico3d.head.portrait.sight import SHORTENED_EVERY, Sight, sight_of
from ico3d.head.settings import SGD_GAINS, HeadSettings
from ico3d.head.views import Picture, PictureCache, View, poses_digest, staged
from ico3d.speech.network import SpeechAdaptor
from ico3d.splat.density import contributions
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.losses import tensor_psnr
from ico3d.splat.render import render
from ico3d.training.acceleration import accelerated
from ico3d.training.checkpoint import check_shapes
from ico3d.training.epochs import Epochs
from ico3d.training.optimiser import Optimiser, check_moments

CPU = torch.device("cpu")
GEOMETRY = ("means", "quats", "log_scales", "displacement_basis")
"""Parameters that say where and how large Gaussians are."""

LEAST_TOLD = 0.5
"""If any picture has a mask or a plate, at least this share of the pictures must have one."""
FEW_FRAMES = 100
"""Number of training frames for which `rates.basis_weight_decay` is meant."""
SAMPLES = 16
"""Number of views that density control samples."""

ATTENTION_FACTOR = 5
ATTENTION_WEIGHT_DECAY = 1e-4


class HeadTrainer:
    """The `Trainee` of a head: model, optimiser, and the pictures to learn from.

    All random choices of a step depend on the seed and the step's number alone.

    Attributes:
        model: The head.
        track: The expressions of the capture's frames.
        adaptor: Network from speech features to speech values; None for heads without speech.
        pictures: Reads the recorded pictures.
        views: The views to learn from, frame by frame.
        poses: Hash of the capture's head poses, which identifies the canonical head space.
        turn: How far the head turns in the training frames; None if the model ignores that.
        seen_moves: (M,) coefficients of the displacements by frame, where landmarks were seen.
    """

    def __init__(
        self,
        capture: Capture,
        model: HeadModel,
        track: ExpressionTrack,
        adaptor: SpeechAdaptor | None,
        settings: HeadSettings,
        seed: int,
        moves: Mapping[int, Tensor] | None = None,
    ):
        """Finds the recorded views of the training frames.

        Raises:
            CaptureError: If there is no picture to train on, or too few pictures have a mask.
            SettingsError: If the model is to be compiled and there is no compiler.
        """
        self.model, self.track, self.adaptor = model, track, adaptor
        self._capture, self.seen_moves = capture, moves or {}
        self._settings, self._seed = settings, seed
        self.pictures = PictureCache(capture, settings.cache_gib, settings.cache_dir)
        self.views = self.pictures.views(capture.split.train, LEAST_TOLD)
        if not self.views:
            raise CaptureError(f"{capture.path} has no picture among its training frames.")
        self._epochs = Epochs([seed], len(self.views))
        few = FEW_FRAMES / len(capture.split.train)
        self._weight_decay = settings.rates.basis_weight_decay * few**4
        self.poses = poses_digest(capture)
        frames = sorted({view.frame for view in self.views})
        self.turn = turn_of(capture, frames) if model.shape.turns else None
        self._turns = self._turn_values(frames)
        self._rows = LearningRows(model.shape, track, frames, settings.even_rows)
        self._shoulders = shoulders_of(capture, model.shape.neck, self.pictures)
        self._sight = sight_of(self.views) if settings.shared_depth else None
        self._close_ups = CloseUps(capture, self.views if settings.close_ups else [], seed)
        self._loss = HeadLoss(settings, model.device)
        self._optimiser = Optimiser(settings.optimiser)
        self._density = HeadDensity(settings.density, seed)
        self._decode = accelerated(
            model.decode, model.device, settings.mixed_precision, settings.compile
        )
        model.basis.requires_grad_(False)

    @property
    def settings(self) -> HeadSettings:
        """The settings in effect: the perceptual weight is 0 if VGG's weights are not installed."""
        return self._loss.settings

    @property
    def used(self) -> dict:
        """What takes effect, where the settings alone do not tell."""
        settings = self.settings
        looked = settings.steps > settings.loss.perceptual_from
        return {
            "optimiser": settings.optimiser,
            "sh_degree": min((settings.steps - 1) // settings.sh_every, settings.sh_degree),
            "perceptual": settings.loss.perceptual if looked else 0.0,
            "mixed_precision": settings.mixed_precision and self.model.device.type == "cuda",
        }

    def step(self, index: int) -> Mapping[str, float]:
        """Renders one picture and updates the parameters; returns the loss and other numbers."""
        each = 1 + self._settings.close_ups
        self.pictures.expect(range(each * index, each * self._settings.steps), self._view)
        view = self.pictures.readable(self.views, self._epochs.at(index))
        picture = self.pictures.picture(view, self.model.device)
        background, target = self._staged(view, picture, index)
        expression = self.expression(view)  # (B,)
        features = self._features(expression)  # (N, w)
        moves = self.moves(view, expression)
        gaussians = self.model.gaussians(self._decode(features, expression), moves)
        gaussians = self.posed(gaussians.up_to_degree(index // self._settings.sh_every), view)
        absgrad = self._settings.density.absgrad
        rendering = render(gaussians, [view.camera], background, absgrad=absgrad)
        loss = self._loss(rendering, target, picture, index)
        loss.backward()
        self._density.observe(rendering.info, index)
        self._update(expression, features, index)
        for number in range(self._settings.close_ups if self._close_ups else 0):
            place = self._close_ups.place(self._settings.close_ups * index + number)
            seen = self.pictures.readable(self._close_ups.views, place)
            self.look_closer(self._close_ups.about(seen), index)
        self._density.adapt(self.model, self._optimiser, self._sampled, index)
        psnr = tensor_psnr(rendering.rgb[0], target)
        return {"loss": float(loss.detach()), "psnr": psnr, "gaussians": len(self.model)}

    def expression(self, view: View) -> Tensor:
        """The expression (B,) of a view's frame and how the head is turned, on its device."""
        expression = self.track.at(view.frame)
        if self.turn is not None:
            expression = torch.cat([expression, self._turns[view.frame]])  # (B + 3,)
        return expression.to(self.model.device)

    def moves(self, view: View, expression: Tensor) -> Tensor:
        """Coefficients (M,) of the displacements in a view's frame: seen, or else told."""
        if (seen := self.seen_moves.get(view.frame)) is not None:
            return seen
        return self.model.moves(expression.detach())

    def posed(self, gaussians: Gaussians, view: View) -> Gaussians:
        """The head's Gaussians with the shoulders where they are in a view's frame."""
        found = self._shoulders
        return gaussians if found is None else found.posed(gaussians, view.frame)

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self.model)

    def grow(self, count: int) -> None:
        """Splits Gaussians at random until there are `count`."""
        self._density.grow(self.model, self._optimiser, count)

    def tensors(self) -> dict[str, Tensor]:
        """Parameters, moments, and the statistics of density control."""
        named = {f"model.{name}": value for name, value in self.model.state_dict().items()}
        if self.adaptor is not None:
            state = self.adaptor.state_dict()
            named |= {f"adaptor.{name}": value for name, value in state.items()}
        named |= {f"moments.{name}": value for name, value in self._optimiser.moments.items()}
        return named | {f"density.{name}": t for name, t in self._density.tensors().items()}

    def place(self, name: str) -> torch.device:
        """The device of the tensor `name`: that of the head, but the CPU for the small adaptor."""
        about_adaptor = name.startswith(("adaptor.", "moments.adaptor."))
        return CPU if about_adaptor else self.model.device

    def state(self) -> dict:
        """The weight of the perceptual term and the hash of the head poses."""
        return {"perceptual_weight": self.settings.loss.perceptual, "space": self._space()}

    def restore(self, tensors: dict[str, Tensor], state: dict) -> None:
        """Restores what `tensors` and `state` returned.

        Raises:
            SettingsError: If the head poses have changed: the Gaussians would lie in another space.
            ValueError, KeyError: If the tensors are of another head.
        """
        if state.get("space") != self._space():
            raise SettingsError(
                "the run was begun by an earlier version, or the recording's points, masks or head "
                "poses have changed since: train in an empty folder."
            )
        self._loss.go_on(state.get("perceptual_weight", self.settings.loss.perceptual))
        own, moments = _below("model.", tensors), _below("moments.", tensors)
        shape, count = self.model.shape, len(own["means"])
        check_shapes(lambda: HeadModel(shape, count), own)
        self.model.resize(count)
        self.model.load_state_dict(own)
        if self.adaptor is not None:
            self.adaptor.restore(_below("adaptor.", tensors))
        check_moments(moments, self._trained(), self._basis_moments())
        self._optimiser.moments = moments
        self._density.restore(_below("density.", tensors))

    def _basis_moments(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the basis's moments that are its own (`update_basis`)."""
        rows, count, _ = self.model.basis.shape
        own: dict[str, tuple[int, ...]] = {"basis.steps": (rows,)}
        rmsprop = self._settings.basis_optimiser == "rmsprop"
        return own | ({"basis.second": (rows, count)} if rmsprop else {})

    def _trained(self) -> dict[str, Tensor]:
        """All parameters, by the names that the optimiser has for them."""
        named: dict[str, Tensor] = dict(self.model.named_parameters())
        if self.adaptor is not None:
            named |= {f"adaptor.{name}": p for name, p in self.adaptor.named_parameters()}
        return named

    def _space(self) -> dict:
        """What weights and places in the folder's checkpoint are relative to."""
        shape = self.model.shape
        box = [*map(float, shape.box_center), float(shape.box_size)]
        return {"box": box, "poses": self.poses}

    def _view(self, number: int) -> View:
        """The view that is taken up as this number: each step's picture, then its close-ups."""
        index, place = divmod(number, 1 + self._settings.close_ups)
        if place and self._close_ups:
            chosen = self._close_ups.place(self._settings.close_ups * index + place - 1)
            return self._close_ups.views[chosen]
        return self.views[self._epochs.at(index)]

    def _staged(
        self, view: View, picture: Picture, index: int, box: Box | None = None
    ) -> tuple[Tensor, Tensor]:
        """The background to render over, and the recorded picture over that background.

        Where there is no clean plate, it is a random colour: no Gaussian can pass for background.
        """
        rng = np.random.default_rng([self._seed, index, 1])
        plate = self.pictures.background(view, picture.image.device)
        if plate is not None and box is not None:
            plate = plate[box.cut]
        return staged(picture, plate, torch.from_numpy(rng.random(3)))

    def _features(self, expression: Tensor) -> Tensor:
        """Blended features that keep their gradient: the basis learns from it."""
        features = self.model.blended(expression)
        if not features.requires_grad:
            features.requires_grad_()
        features.retain_grad()
        return features

    def _update(self, expression: Tensor, features: Tensor, index: int) -> None:
        """One optimiser step on everything."""
        rates = self._rates(index)
        weights = self.model.row_weights(expression)
        assert features.grad is not None
        self._update_basis(weights, features.grad, rates["basis"])
        before = None if self._sight is None else self.model.means.detach().clone()  # (N, 3)
        for name, parameter in self.model.named_parameters():
            if parameter.grad is not None:
                rate = rates[name if name in GEOMETRY else "mlp"]
                self._optimiser.update(name, parameter, parameter.grad, rate)
                parameter.grad = None
        if self._sight is not None and before is not None:
            self._keep_together(self._sight, before, index)
        bound_scales(self.model)
        self._update_adaptor(rates["adaptor"])

    @torch.no_grad()
    def _keep_together(self, sight: Sight, before: Tensor, index: int) -> None:
        """Takes back what a step did along the line of sight and may not do there."""
        model = self.model
        model.means.data = sight.together(model.means.data, before)
        if index % SHORTENED_EVERY == 0:
            model.log_scales.data = sight.shortened(model.log_scales.data, model.quats.data)

    def look_closer(self, close_up: CloseUp, index: int) -> None:
        """One step on the basis of the Gaussians that a close-up shows, and on nothing else."""
        model, part = self.model, close_up.part
        picture = self.pictures.picture(part, model.device, close_up.box)
        background, target = self._staged(part, picture, index, close_up.box)
        expression = self.expression(part).detach()  # (B,)
        chosen = close_up.shown(model.means).to(model.device)  # (n,)
        weights = model.row_weights(expression)
        features = blend_of(model.basis, weights, chosen).requires_grad_()  # (n, w)
        fixed = {name: value.detach() for name, value in model.named_parameters()}
        for name, axis in model.gaussian_axes.items():
            if name in GEOMETRY:
                fixed[name] = fixed[name].index_select(axis, chosen)  # (n, ...)
        gaussians: Gaussians = functional_call(
            model, fixed, (expression, features, self.moves(part, expression))
        )
        rendering = render(gaussians, [part.camera], background)
        self._loss(rendering, target, picture, index).backward()
        assert features.grad is not None
        self._update_basis(weights, features.grad, self._rates(index)["basis"], chosen)

    def _rates(self, index: int) -> dict[str, float]:
        """The learning rates of a step."""
        groups = self._settings.rates.by_parameter(self.model.shape.has_mlp)
        rates = {name: rate.at(index / self._settings.steps) for name, rate in groups.items()}
        rates["means"] *= self.model.shape.box_size
        if self._settings.optimiser == "sgd":
            rates = {name: rate * SGD_GAINS[name] for name, rate in rates.items()}
        return rates | {"displacement_basis": self._settings.rates.displacement * rates["means"]}

    def _turn_values(self, frames: Sequence[int]) -> dict[int, Tensor]:
        """The values (3,) of the head's rotation by frame; one by one they cost a step 0.5 ms."""
        if self.turn is None:
            return {}
        values = turn_values(self.turn, self._capture, frames)  # (T, 3)
        return dict(zip(frames, values, strict=True))

    def _update_basis(
        self, weights: Tensor, gradient: Tensor, rate: float, chosen: Tensor | None = None
    ) -> None:
        """One step on the basis, or on that of the chosen Gaussians."""
        means = self.model.means if chosen is None else self.model.means[chosen]
        for rows, learning in self._rows.parts(means, self._close_ups):
            part = weights * rows.to(weights)  # (R,)
            if learning is None:
                self._update_rows(part, gradient, rate, chosen)
            else:
                places = torch.nonzero(learning)[:, 0].to(gradient.device)  # (n,)
                others = places if chosen is None else chosen[places]
                self._update_rows(part, gradient[places], rate, others)

    def _update_rows(
        self, weights: Tensor, gradient: Tensor, rate: float, chosen: Tensor | None
    ) -> None:
        """One step on the rows of the basis whose weight is not 0."""
        update_basis(
            self._optimiser,
            self.model.basis,
            weights,
            gradient,
            rate * self._rows.factors.to(weights),
            self._weight_decay,
            self._settings.basis_optimiser == "rmsprop",
            chosen,
        )

    def _update_adaptor(self, rate: float) -> None:
        """The adaptor's step; its attention learns faster and decays (as in SyncTalk)."""
        if self.adaptor is None:
            return
        for name, parameter in self.adaptor.named_parameters():
            if parameter.grad is None:
                continue
            attends = name.startswith("attention")
            self._optimiser.update(
                f"adaptor.{name}",
                parameter,
                parameter.grad,
                rate * (ATTENTION_FACTOR if attends else 1),
                ATTENTION_WEIGHT_DECAY if attends else 0.0,
            )
            parameter.grad = None

    @torch.no_grad()
    def _sampled(self, index: int) -> Sampled:
        """The head in some training frames."""
        rng = np.random.default_rng([self._seed, index, 2])
        chosen = rng.choice(len(self.views), size=min(SAMPLES, len(self.views)), replace=False)
        opacities, given = [], []
        for view in (self.views[i] for i in chosen):
            expression = self.expression(view)  # (B,)
            drawn = self.model(expression, moves=self.moves(view, expression))
            gaussians = self.posed(drawn, view)
            opacities.append(gaussians.opacities)
            given.append(contributions(gaussians, [view.camera])[0])
        return Sampled(torch.stack(opacities).amax(0), torch.stack(given).amax(0))


def _below(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names start with the prefix, without it."""
    return {
        name.removeprefix(prefix): tensor
        for name, tensor in tensors.items()
        if name.startswith(prefix)
    }
