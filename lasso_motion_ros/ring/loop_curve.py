"""The loop's curve: the one that both images, the clicks and the shape of a lasso make likeliest.

A curve that follows the strongest line beside it follows the noise where there is more noise than wire. So no line is
looked for: of all curves near a circle the one of highest posterior probability is taken. Three things speak:

- *The images.* An electrode lies at one arc length in both planes. Each point of the arc is one with some probability;
  then both planes are darker there by what electrodes are in that plane, else by nothing. Noise is one standard
  deviation, since working images are given in units of it. So a faint ring pulls the curve faintly, and what one plane
  alone shows pulls it hardly at all.
- *The clicks*, as far as people set them beside the wire; some are far off (Student's distribution).
- *The shape.* A lasso is a circle that its vein squeezes, open or longer than a turn: it leaves the circle by slow
  waves, the faster the smaller, and by a screw and a spiral from end to end.

The maximum is found by Gauss–Newton steps with damping (Levenberg and Marquardt), first on blurred images, then on
sharp ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.curves import quarter_turn
from lasso_motion_ros.geometry.frames import PLANES, Plane, Seed
from lasso_motion_ros.ring.loop_model import circle_centre, epipolar_directions
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.ring.working_image import Image, WorkingImage, reduction_factor

Array = npt.NDArray[np.float64]


CLICK_SIGMA_MM = 0.5  # of a person's clicks beside the loop


@dataclass(frozen=True)
class _Tuning:
    """What electrodes, clicks and lassos are like, and how the steps are damped."""

    electrodes: float = 0.4  # of the arc
    amplitudes: tuple[float, float] = (0.5, 3.0)  # of an electrode, in units of the noise
    amplitude_quantile: float = 0.6  # of what the image shows along the curve
    odds: tuple[float, float] = (0.05, 20.0)  # what one plane may say against or for an electrode
    coarse_amplitude: float = 1.0  # in an image that is blurred to an electrode's width
    # Values further apart along the arc have noise of their own, and, in the coarse image, of which the fine one knows
    # nothing.
    coarse_independent_mm: float = 4.0
    fine_independent_mm: float = 1.0
    blurs_px: tuple[float, ...] = (2.0, 0.0)  # of the coarse image; with the last comes the fine one
    blurred_gain: float = 1.483  # so that what is left of the noise is no more than one standard deviation
    click_freedom: float = 3.0  # of Student's distribution
    # Standard deviations of the waves, from two a turn on, along the radius and along the axis.
    radial_mm: tuple[float, ...] = (0.4, 0.18, 0.07, 0.04, 0.02)
    axial_mm: tuple[float, ...] = (0.55, 0.22, 0.11, 0.07, 0.05)
    ramp_mm: float = 0.8  # from end to end
    free_mm: float = 100.0  # of what a circle is free in: place, tilt and size
    shift_mm: float = 1.5  # of the planes against each other, beside what the clicks say
    begin: float = 0.05  # of the shape's weight, when a start is described
    margin_px: int = 8
    beyond: float = 1.5  # of the circle's radius: how far its surroundings are looked at
    steps: int = 12
    largest_step_mm: float = 1.0
    settled: float = 0.003  # of the logarithm of the probability
    damping: tuple[float, float, float] = (1e-3, 0.1, 1e3)  # least, first, most


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class LikeliestCurve:
    """What was found.

    Attributes:
        points: (N, 3) of the curve, world metres, one for each of the start's.
        shifts: per plane, (2,) pixels by which its images lie off its calibration.
        log_odds: natural logarithm of how much likelier the images are with this curve than with none, less what its
            shape and the clicks beside it cost.
    """

    points: Array
    shifts: dict[Plane, Array]
    log_odds: float


def likeliest_curve(
    start: Array,
    images: SeedImages,
    shifts: Mapping[Plane, Array],
    clicks: Seed,
    click_sigma_mm: float = CLICK_SIGMA_MM,
) -> LikeliestCurve:
    """The likeliest curve near a start.

    Args:
        start: (N, 3) world metres along a loop, in order, within a millimetre or two of it.
        images: of the pair.
        shifts: per plane, (2,) pixels by which its images lie off its calibration, about.
        clicks: a person's, or other places along it.
        click_sigma_mm: how far those lie beside it, standard deviation.
    """
    fit = _Fit(start, images, shifts, clicks, click_sigma_mm)
    for blur_px in TUNING.blurs_px:
        fit.look(blur_px, fine=blur_px == TUNING.blurs_px[-1])
        fit.climb()
    return fit.outcome()


@dataclass(frozen=True, eq=False)
class _Layer:
    """One image of a plane, as it is looked at.

    Attributes:
        sampled: (3, h, w) its values and their slopes in x and y.
        corner: (2,) its first pixel, working pixels.
        amplitude: of an electrode in it.
    """

    sampled: Image
    corner: Array
    amplitude: float

    def at(self, pixels: Array) -> tuple[Array, Array]:
        """(N,) values at pixels (N, 2), and (N, 2) their slopes; nothing outside."""
        # `cv2.remap` goes in steps of a thirty-second of a pixel before OpenCV 5, on which a search gets stuck.
        places = (pixels - self.corner).T[::-1]
        value, across, down = (
            map_coordinates(channel, places, np.float64, order=1, mode="grid-constant") for channel in self.sampled
        )
        return value, np.column_stack([across, down])


_Seen = tuple[Array, Array]
"""(N, 2) working pixels of a curve, and (N, 2, P) how they depend on the parameters."""


class _View:
    """One plane: its images, and how its pixels depend on the parameters.

    Args:
        image: the working image.
        base: (N, 3) of the circle, metres.
        waves: (N, 3, P) metres by which each parameter moves a point.
        around: (K, 3) world points that tell what is looked at.
        clicks: (C, 2) working pixels.
        unit: millimetres per working pixel.
    """

    def __init__(
        self, image: WorkingImage, base: Array, waves: Array, around: Array, clicks: Array, unit: float
    ) -> None:
        matrix = image.projection.matrix
        # Homogeneous pixels are linear in the parameters.
        self.fixed = base @ matrix[:, :3].T + matrix[:, 3]
        self.moving = np.einsum("ij,njp->nip", matrix[:, :3], waves)
        self.clicks, self.unit = clicks, unit
        seen = image.projection.project(around)
        self._evidence, self._evidence_corner = image.evidence_about(seen)
        height, width = image.values.shape
        left, top = np.clip(np.floor(seen.min(axis=0)).astype(int) - TUNING.margin_px, 0, (width - 1, height - 1))
        right, bottom = np.clip(np.ceil(seen.max(axis=0)).astype(int) + TUNING.margin_px, (left, top), (width, height))
        self._fine, self._fine_corner = image.values[top : bottom + 1, left : right + 1], np.array([left, top], float)

    def coarse(self, blur_px: float) -> _Layer:
        """The image blurred to an electrode's width, and further."""
        shown = self._evidence
        if blur_px > 0.0:
            shown = cv2.GaussianBlur(shown, (0, 0), blur_px) * np.float32(TUNING.blurred_gain)
        return _Layer(_with_slopes(shown), self._evidence_corner, TUNING.coarse_amplitude)

    def fine(self, parameters: Array) -> _Layer:
        """The working image itself; the amplitude is what it shows along the curve."""
        layer = _Layer(_with_slopes(self._fine), self._fine_corner, 0.0)
        shown, _ = layer.at(self.pixels(parameters)[0])
        amplitude = float(np.clip(np.quantile(shown, TUNING.amplitude_quantile), *TUNING.amplitudes))
        return _Layer(layer.sampled, layer.corner, amplitude)

    def pixels(self, parameters: Array) -> _Seen:
        """Where it sees a curve."""
        seen = self.fixed + self.moving @ parameters
        depth = seen[:, 2:]
        pixels = seen[:, :2] / depth
        return pixels, (self.moving[:, :2] - pixels[:, :, None] * self.moving[:, 2:]) / depth[:, :, None]


class _Fit:
    """The search for the maximum; arguments as of `likeliest_curve`."""

    def __init__(
        self,
        start: Array,
        images: SeedImages,
        shifts: Mapping[Plane, Array],
        clicks: Seed,
        click_sigma_mm: float = CLICK_SIGMA_MM,
    ) -> None:
        self._click_variance = click_sigma_mm**2
        self._projections, self._shifts, self._share_of_a = images.projections, dict(shifts), images.share_of_a
        self._centre = circle_centre(start)
        axes = np.linalg.svd(start - start.mean(axis=0), full_matrices=False)[2]
        flat = (start - self._centre) @ axes.T
        angles = np.unwrap(np.arctan2(flat[:, 1], flat[:, 0]))
        outward = np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)]) @ axes
        radius = float(np.linalg.norm(flat[:, :2], axis=1).mean())
        base = self._centre + radius * outward
        waves, radial, axial = _waves(angles)
        self._normal = epipolar_directions(images.projections, self._centre)[2]
        moved = np.concatenate([waves[:, None] * outward[:, :, None], waves[:, None] * axes[2][:, None]], axis=2)
        self._base, self._moved = base, 1e-3 * moved
        self._precision = np.concatenate([radial, axial, [TUNING.shift_mm]]) ** -2.0
        self._parameters = np.zeros(len(self._precision))
        for part, (direction, sigmas) in enumerate(((outward, radial), (np.broadcast_to(axes[2], base.shape), axial))):
            beside = 1e3 * np.einsum("nj,nj->n", start - base, direction)
            normal = waves.T @ waves + np.diag((TUNING.begin / sigmas) ** 2)
            first = part * waves.shape[1]
            self._parameters[first : first + waves.shape[1]] = np.linalg.solve(normal, waves.T @ beside)
        self._spacing_mm = 1e3 * np.linalg.norm(np.gradient(start, axis=0), axis=1)
        self._views = self._seen(
            images, clicks, np.concatenate([base, self._centre + TUNING.beyond * radius * outward])
        )
        self._layers: list[tuple[float, list[_Layer]]] = []

    def _seen(self, images: SeedImages, clicks: Seed, around: Array) -> list[_View]:
        views = []
        for plane, image in images.working(self._centre, self._shifts).items():
            lift = 1e-3 * self._share(plane) * np.broadcast_to(self._normal[:, None], (len(self._base), 3, 1))
            unit = image.projection.millimetres_per_pixel(self._centre)
            factor = reduction_factor(images.frames[plane].projection.shifted(*self._shifts[plane]), self._centre)
            seen = (clicks.points(plane) - 0.5 * (factor - 1)) / factor
            views.append(_View(image, self._base, np.concatenate([self._moved, lift], axis=2), around, seen, unit))
        return views

    def _share(self, plane: Plane) -> float:
        """What a plane's images take of a shift between the planes."""
        return self._share_of_a if plane == PLANES[0] else self._share_of_a - 1.0

    def look(self, blur_px: float, *, fine: bool) -> None:
        """Look at the images, as sharp as that."""
        self._layers = [(TUNING.coarse_independent_mm, [view.coarse(blur_px) for view in self._views])]
        if fine:
            self._layers.append((TUNING.fine_independent_mm, [view.fine(self._parameters) for view in self._views]))

    def climb(self) -> None:
        """Go to the maximum."""
        least, damping, most = TUNING.damping
        if has_kernels():
            from lasso_motion_ros.ring.kernels import curve as kernels

            parameters = self._parameters.copy()
            steps = TUNING.steps, least, damping, most, TUNING.largest_step_mm, TUNING.settled
            kernels.climb(parameters, *[*self._seen_by_kernels(), self._moved, *steps])
            self._parameters = parameters
            return
        here, gradient, normal = self._probability(self._parameters)
        for _ in range(TUNING.steps):
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
            longest_mm = 1e3 * float(np.linalg.norm(self._moved @ step[:-1], axis=1).max())
            step *= min(1.0, TUNING.largest_step_mm / max(longest_mm, 1e-9))
            there, its_gradient, its_normal = self._probability(self._parameters + step)
            if there > here:
                gained, here, gradient, normal = there - here, there, its_gradient, its_normal
                self._parameters = self._parameters + step
                damping = max(damping / 3.0, least)
                if gained < TUNING.settled:
                    break
            elif (damping := 4.0 * damping) > most:
                break

    def outcome(self) -> LikeliestCurve:
        """What the parameters mean."""
        points = self._base + self._moved @ self._parameters[:-1]
        shifts = {}
        for plane, projection in self._projections.items():
            lift = 1e-3 * self._share(plane) * self._parameters[-1] * self._normal
            shifts[plane] = self._shifts[plane] + projection.jacobian(self._centre) @ lift
        return LikeliestCurve(points, shifts, self._probability(self._parameters)[0])

    def _probability(self, parameters: Array) -> tuple[float, Array, Array]:
        """Logarithm of a curve's probability, (P,) its gradient, and (P, P) about its negative second derivatives."""
        if has_kernels():
            from lasso_motion_ros.ring.kernels import curve as kernels

            gradient, normal = np.empty(len(parameters)), np.empty((len(parameters), len(parameters)))
            value = kernels.probability(parameters, *[*self._seen_by_kernels(), gradient, normal])
            return value, gradient, normal
        value = -0.5 * float(self._precision @ parameters**2)
        gradient, normal = -self._precision * parameters, np.diag(self._precision)
        seen = [view.pixels(parameters) for view in self._views]
        for independent_mm, layers in self._layers:
            value += _of_images(layers, seen, self._spacing_mm / independent_mm, gradient, normal)
        for view, one in zip(self._views, seen, strict=True):
            value += _of_clicks(view.clicks, self._click_variance, view.unit, one, gradient, normal)
        return value, gradient, normal

    def _seen_by_kernels(self) -> list[Any]:
        """What `kernels.curve.probability` asks for after the parameters."""
        views, layers = self._views, [one for _, one in self._layers]
        (coarse_a, coarse_b), (fine_a, fine_b) = layers[0], layers[-1]
        return [
            self._precision,
            np.ascontiguousarray([view.fixed.T for view in views]),
            np.ascontiguousarray([view.moving.transpose(1, 2, 0) for view in views]),
            *(np.ascontiguousarray(view.clicks, np.float64) for view in views),
            np.array([view.unit for view in views]),
            *(layer.sampled for layer in (coarse_a, coarse_b, fine_a, fine_b)),
            np.array([[layer.corner for layer in one] for one in layers], np.float64),
            np.array([[layer.amplitude for layer in one] for one in layers], np.float64),
            np.stack([self._spacing_mm / independent_mm for independent_mm, _ in self._layers]),
            TUNING.electrodes,
            *TUNING.odds,
            TUNING.click_freedom,
            self._click_variance,
        ]


def _of_images(layers: list[_Layer], seen: list[_Seen], weights: Array, gradient: Array, normal: Array) -> float:
    """Logarithm of how much likelier one image of each plane is with electrodes along a curve than with none.

    Args:
        layers: the planes'.
        seen: likewise, as of `_View.pixels`.
        weights: (N,) how much the points of the curve count.
        gradient: (P,) to which its own is added,
        normal: (P, P) and about its negative second derivatives.
    """
    low, high = TUNING.odds
    odds, slopes = np.ones(len(weights)), np.zeros((len(weights), len(gradient)))
    for layer, (pixels, along) in zip(layers, seen, strict=True):
        shown, steep = layer.at(pixels)
        one = np.exp(layer.amplitude * (shown - 0.5 * layer.amplitude))
        held = np.clip(one, low, high)
        odds = odds * held
        rising = np.where(one == held, layer.amplitude, 0.0)[:, None] * steep
        slopes += np.einsum("ni,nip->np", rising, along)
    whole = 1.0 - TUNING.electrodes + TUNING.electrodes * odds
    slopes *= (TUNING.electrodes * odds / whole)[:, None]
    gradient += weights @ slopes
    normal += (slopes * weights[:, None]).T @ slopes
    return float(weights @ np.log(whole))


def _of_clicks(clicks: Array, variance: float, unit: float, seen: _Seen, gradient: Array, normal: Array) -> float:
    """Logarithm of how likely one plane's clicks (C, 2) are beside a curve; arguments as of `_View`, `_of_images`."""
    pixels, along = seen
    freedom = TUNING.click_freedom
    apart = clicks[:, None] - pixels
    nearest = np.clip((apart**2).sum(axis=2).argmin(axis=1), 1, len(pixels) - 2)
    tangents = pixels[nearest + 1] - pixels[nearest - 1]
    normals = quarter_turn(tangents / np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-9))
    beside = unit * np.einsum("cj,cj->c", clicks - pixels[nearest], normals)
    squared = beside**2 / variance
    weight = (freedom + 1.0) / ((freedom + squared) * variance)
    rows = unit * np.einsum("cj,cjp->cp", normals, along[nearest])
    gradient += rows.T @ (weight * beside)
    normal += (rows * weight[:, None]).T @ rows
    return -0.5 * (freedom + 1.0) * float(np.log1p(squared / freedom).sum())


def _waves(angles: Array) -> tuple[Array, Array, Array]:
    """(N, M) how a loop may leave its circle at angles (N,), of amplitude 1; (M,) mm, radially, and along the axis."""
    columns, radial, axial = [np.ones_like(angles)], [TUNING.free_mm], [TUNING.free_mm]
    sizes = [(TUNING.free_mm, TUNING.free_mm), *zip(TUNING.radial_mm, TUNING.axial_mm, strict=True)]
    for count, (outward_mm, upward_mm) in enumerate(sizes, 1):
        columns += [np.cos(count * angles), np.sin(count * angles)]
        radial += [outward_mm] * 2
        axial += [upward_mm] * 2
    columns.append((angles - angles.mean()) / (2.0 * np.pi))
    return np.column_stack(columns), np.array([*radial, TUNING.ramp_mm]), np.array([*axial, TUNING.ramp_mm])


def _with_slopes(values: Image) -> Image:
    """(3, h, w) values (h, w) and their slopes in x and y."""
    if values.size == 0:
        return np.zeros((3, 1, 1), np.float32)
    across = cv2.Sobel(values, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
    down = cv2.Sobel(values, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
    return np.stack([values, across, down])
