"""Fits a camera's height, pitch, roll and focal length to the boxes of people who stand on the ground.

Of each box, the logarithms of width and height are compared with those of a body of usual stature at the same place.
What moves all of them together (a crew's stature and breadth, boxes drawn loosely) and all boxes of one person
together is solved for with them, under its prior, so that many pictures of the same people do not count as many
people. Someone who stoops or is half hidden looks small and never large: such heights are outliers on one side.
Pitch bends the problem: it is solved at several pitches and their posteriors are mixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.pose import poses_of_plane
from standoff.core.types import IntArray
from standoff.stages.ground.upright_body import log_sizes

STATURE_M = 1.78
"""Sole to the top of the hat of somebody 1.75 m tall, less what people bend a little while they work."""

BODY_M = 0.43
"""Depth of a body. With this capsule the mean box of people who stand, walk and work is met within 3 % from all
heights between 15 and 75 degrees (measured on the simulator's meshes)."""

_ARMS = 0.30
"""Arms and stride widen a box by a third, as a logarithm; how sure that is, is `_GLOBAL_SIGMA`'s third."""

_GLOBAL_SIGMA = np.array([0.08 / STATURE_M, 0.15, 0.15, 1.0])
"""Standard errors of what all people share: log stature (a crew's mean), log depth, log width, and how many
pixels too large a detector draws."""

_PERSON_SIGMA = np.array([0.07 / STATURE_M, 0.15])
"""Standard errors of what one person keeps: log stature, log breadth."""

_NOISE = np.array([0.18, 0.07])
"""Standard errors of one box's log width and log height beside the detector's pixels: stride, arms; posture."""

_STRIDE = 0.13
"""Standard error of the log height of a box seen straight from above, by stride and posture; less from the side."""

_NOISE_PX = 1.0

_OUTLIERS, _OUTLIER_LOG = 0.2, 0.3
"""Share of heights, and of widths, that are no standing person's, and how far off they are: an exponential tail."""

_REPEATS = 0.3
"""A picture half a second later repeats most of what this one said: someone who stoops still does."""

_ROLL_SIGMA = np.deg2rad(2.0)
_LOG_HEIGHT, _LOG_HEIGHT_SIGMA = np.log(20.0), 0.8
_PITCH, _PITCH_SIGMA = np.deg2rad(50.0), np.deg2rad(20.0)
_STEEPEST, _FLATTEST = np.deg2rad(88.0), np.deg2rad(8.0)

K1_STEP = 0.01
"""How far from the likely k1 the second half of `BoxRows` is."""

_STEPS = np.array([1e-4, 1e-4, 1e-4, 1e-4, K1_STEP])
"""How far each is changed to find derivatives: by pitch, roll, log height, log focal length and k1."""

_FAR_OFF = 0.5
"""Logarithm of how far an expected size may be from the observed one before it is not believed any more."""

_ROUNDS, _FIRST_ROUNDS = 2, 8


@dataclass(frozen=True, slots=True, eq=False)
class BoxRows:
    """Boxes of people, ready to be fitted.

    Attributes:
        centre: (2, N, 2) middles in normalised coordinates of the likely focal length, at the likely k1 and a step on.
        log_size: (2, N, 2) logarithms of width and height, the same way.
        size_px: (N, 2) width and height.
        person: (N,) 0 to K - 1.
        view_of: (N,) picture of each box.
        now_to_view: (V, 3, 3) signed homographies of the ground, in normalised coordinates.
    """

    centre: FloatArray
    log_size: FloatArray
    size_px: FloatArray
    person: IntArray
    view_of: IntArray
    now_to_view: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """What the sizes say: mean and covariance of pitch, roll, log height, log focal factor and k1's offset.

    Attributes:
        mean: (5,) radians downwards, radians, log of metres, log, 1.
        covariance: (5, 5).
        standing: Share of the heights that a standing person explains.
        scatter: Robust standard error of the heights' residuals, as a logarithm.
    """

    mean: FloatArray
    covariance: FloatArray
    standing: float
    scatter: float


def poses(parameters: FloatArray, now_to_view: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (P, V, 3, 3) rotations and (P, V, 3) positions of V pictures under P hypotheses (P, 5)."""
    rotation, position_m = _aimed(parameters)
    if len(now_to_view) == 1 and np.array_equal(now_to_view[0], np.eye(3)):
        return rotation[:, None], position_m[:, None]
    plane = np.concatenate([rotation[..., :2], -(rotation @ position_m[..., None])], axis=-1)
    focal = np.ones((len(parameters), 3))
    focal[:, :2] = np.exp(parameters[:, 3])[:, None]
    moved = now_to_view[None] * focal[:, None, None, :] / focal[:, None, :, None]
    return poses_of_plane(moved @ plane[:, None])


def _aimed(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (P, 3, 3) rotations of `View.aimed` with heading 0, and (P, 3) positions above the origin."""
    sin, cos = np.sin(parameters[:, 0]), np.cos(parameters[:, 0])
    zero = np.zeros_like(sin)
    forward = np.stack([zero, cos, -sin], axis=-1)
    down = np.stack([zero, -sin, -cos], axis=-1)
    right = np.array([1.0, 0.0, 0.0])
    turn_sin, turn_cos = np.sin(parameters[:, 1])[:, None], np.cos(parameters[:, 1])[:, None]
    rotation = np.stack([turn_cos * right + turn_sin * down, turn_cos * down - turn_sin * right, forward], axis=-2)
    return rotation, np.stack([zero, zero, np.exp(parameters[:, 2])], axis=-1)


def fit(rows: BoxRows, focal_sigma: float, k1_sigma: float, last: Posterior | None) -> Posterior:
    """Return the posterior of the camera's pose and lens.

    Args:
        rows: Boxes of people.
        focal_sigma: Prior standard error of the log focal length.
        k1_sigma: Prior standard error of the first radial coefficient.
        last: The posterior of a moment ago, where to begin; None: from anywhere.
    """
    prior_sigma = np.array([_ROLL_SIGMA, _LOG_HEIGHT_SIGMA, focal_sigma, k1_sigma, *_GLOBAL_SIGMA])
    if last is None:
        pitches = np.linspace(_FLATTEST + 0.05, _STEEPEST - 0.05, 9)
        last = _mixed(rows, _Nodes(rows, pitches, None, prior_sigma).solved(_FIRST_ROUNDS))
        last = _around(rows, last, prior_sigma)
    return _around(rows, last, prior_sigma)


def _around(rows: BoxRows, last: Posterior, prior_sigma: FloatArray) -> Posterior:
    """Solve again at pitches around an earlier posterior's, as far apart as that one is sure."""
    sigma = float(np.clip(np.sqrt(last.covariance[0, 0]), np.deg2rad(1.0), np.deg2rad(15.0)))
    pitches = np.unique(np.clip(last.mean[0] + sigma * np.linspace(-2.4, 2.4, 7), _FLATTEST, _STEEPEST))
    return _mixed(rows, _Nodes(rows, pitches, last.mean, prior_sigma).solved(_ROUNDS))


class _Nodes:
    """The same fit at M pitches at once."""

    def __init__(self, rows: BoxRows, pitches: FloatArray, start: FloatArray | None, prior_sigma: FloatArray) -> None:
        self._rows = rows
        self._prior = 1.0 / prior_sigma**2
        self.parameters = np.zeros((len(pitches), 5))
        if start is not None:
            self.parameters[:] = start
        else:
            self.parameters[:, 2] = _LOG_HEIGHT
        self.parameters[:, 0] = pitches
        self.shared = np.zeros((len(pitches), len(_GLOBAL_SIGMA)))
        self._people = int(rows.person.max()) + 1
        self._of_person = np.eye(self._people)[rows.person]
        self.personal = np.zeros((len(pitches), self._people, 2))

    def solved(self, rounds: int) -> _Nodes:
        for _ in range(rounds):
            self._step()
        self._weigh()
        return self

    def _residuals(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (P, N, 2) log size observed less predicted, without what people share, and (P, N) heights' shares."""
        rows = self._rows
        rotation, position_m = poses(parameters, rows.now_to_view)
        focal, k1 = parameters[:, 3, None, None], parameters[:, 4, None, None] / K1_STEP
        centre = (rows.centre[0] + k1 * (rows.centre[1] - rows.centre[0])) * np.exp(-focal)
        observed = rows.log_size[0] + k1 * (rows.log_size[1] - rows.log_size[0]) - focal
        predicted, share = log_sizes(rotation, position_m, rows.view_of, centre, STATURE_M, BODY_M)
        return observed - predicted, share

    def _linearised(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (M, N, 2) residuals, their (M, N, 2, 8) falls with what is shared, (M, N, 2, 2) with what is not."""
        nodes = len(self.parameters)
        shifted = self.parameters[:, None] + np.concatenate([np.zeros((1, 5)), np.diag(_STEPS)[1:]])
        residual, share = self._residuals(shifted.reshape(-1, 5))
        residual = residual.reshape(nodes, 5, -1, 2)
        share = share.reshape(nodes, 5, -1)[:, 0]
        one, zero = np.ones_like(share), np.zeros_like(share)
        shared = np.empty((*share.shape, 2, 8))
        shared[..., :4] = -np.moveaxis((residual[:, 1:] - residual[:, :1]) / _STEPS[1:, None, None], 1, -1)
        # By the size that is expected: by the observed one, boxes drawn too large would count for more.
        off = np.clip(residual[:, 0].mean(axis=0), -_FAR_OFF, _FAR_OFF)
        pixel = np.exp(off) / self._rows.size_px
        pixels = np.broadcast_to(pixel, (nodes, *pixel.shape))
        shared[..., 0, 4:] = np.stack([zero, zero, one, pixels[..., 0]], axis=-1)
        shared[..., 1, 4:] = np.stack([share, one - share, zero, pixels[..., 1]], axis=-1)
        personal = np.stack([np.stack([zero, one], axis=-1), np.stack([share, one - share], axis=-1)], axis=-2)
        # The logarithm of a noisy size is too small by half its variance on average.
        left = residual[:, 0] - np.array([_ARMS, 0.0]) + (_NOISE_PX * pixel) ** 2 / 2.0
        left -= (shared[..., 4:] @ self.shared[:, None, :, None])[..., 0]
        left -= (personal @ self.personal[:, self._rows.person][..., None])[..., 0]
        # The same at all pitches: else those that explain less would be preferred for promising less.
        steep = (1.0 - share).mean(axis=0)
        stride = np.stack([np.zeros_like(steep), _STRIDE * steep], axis=-1)
        self._noise = np.sqrt(_NOISE**2 + (_NOISE_PX * pixel) ** 2 + stride**2)
        return left, shared, personal

    def _standing(self, left: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (M, N, 2) probabilities that a size is a standing person's, and log densities of the residuals."""
        usual = (1.0 - _OUTLIERS) * np.exp(-0.5 * (left / self._noise) ** 2) / (np.sqrt(2.0 * np.pi) * self._noise)
        tail = np.exp(-np.abs(left) / _OUTLIER_LOG) / (2.0 * _OUTLIER_LOG)
        # Nobody looks much taller than they are; a box of two people does, one time in ten.
        side = np.stack([np.ones(left.shape[:2]), np.where(left[..., 1] < 0, 1.8, 0.2)], axis=-1)
        density = usual + _OUTLIERS * tail * side
        return usual / density, np.log(density)

    def _normal(self) -> tuple[FloatArray, ...]:
        left, shared, personal = self._linearised()
        standing, log_density = self._standing(left)
        weight = _REPEATS * standing / self._noise**2
        weighted = shared * weight[..., None]
        both = self._of_person.T
        flat, flat_weighted = shared.reshape(len(left), -1, 8), weighted.reshape(len(left), -1, 8)
        hess = np.swapaxes(flat_weighted, 1, 2) @ flat + np.diag(self._prior)
        cross = both @ (np.swapaxes(weighted, 2, 3) @ personal).reshape(len(left), -1, 16)
        own = both @ (np.swapaxes(personal * weight[..., None], 2, 3) @ personal).reshape(len(left), -1, 4)
        own = own.reshape(len(left), -1, 2, 2) + np.diag(1.0 / _PERSON_SIGMA**2)
        values = np.concatenate([self.parameters[:, 1:], self.shared], axis=1)
        prior_mean = np.zeros(8)
        prior_mean[1] = _LOG_HEIGHT
        slope = (
            np.einsum("mna,mn->ma", flat_weighted, left.reshape(len(left), -1)) - (values - prior_mean) * self._prior
        )
        own_slope = both @ np.einsum("mnra,mnr->mna", personal * weight[..., None], left)
        own_slope = own_slope - self.personal / _PERSON_SIGMA**2
        cross = cross.reshape(len(left), -1, 8, 2)
        cost = -2.0 * _REPEATS * log_density.sum(axis=(1, 2)) + ((values - prior_mean) ** 2 * self._prior).sum(axis=1)
        cost += ((self.personal / _PERSON_SIGMA) ** 2).sum(axis=(1, 2))
        return hess, cross, own, slope, own_slope, cost, left, standing

    def _step(self) -> None:
        hess, cross, own, slope, own_slope, *_ = self._normal()
        solve = np.linalg.inv(own)
        reduced = hess - (cross @ solve @ np.swapaxes(cross, 2, 3)).sum(axis=1)
        step = np.linalg.solve(reduced, (slope - np.einsum("mkab,mkbc,mkc->ma", cross, solve, own_slope))[..., None])[
            ..., 0
        ]
        step[:, 1] = np.clip(step[:, 1], -0.7, 0.7)
        own_step = np.einsum("mkab,mkb->mka", solve, own_slope - np.einsum("mkab,ma->mkb", cross, step))
        self.parameters[:, 1:] += step[:, :4]
        self.shared += step[:, 4:]
        self.personal += own_step

    def _weigh(self) -> None:
        hess, cross, own, _, _, cost, left, standing = self._normal()
        reduced = hess - (cross @ np.linalg.inv(own) @ np.swapaxes(cross, 2, 3)).sum(axis=1)
        self.covariance = np.linalg.inv(reduced)[:, :4, :4]
        volume = np.linalg.slogdet(reduced)[1] + np.linalg.slogdet(own)[1].sum(axis=1)
        pitch = self.parameters[:, 0]
        log_posterior = -0.5 * (cost + volume + ((pitch - _PITCH) / _PITCH_SIGMA) ** 2)
        weight = np.exp(log_posterior - log_posterior.max()) * np.gradient(pitch)
        self.weight = weight / weight.sum()
        self.left, self.standing = left, standing


def _mixed(rows: BoxRows, nodes: _Nodes) -> Posterior:
    """Return mean and covariance of the mixture over pitches."""
    weight = nodes.weight
    mean = weight @ nodes.parameters
    off = nodes.parameters - mean
    covariance = np.einsum("m,ma,mb->ab", weight, off, off)
    covariance[1:, 1:] += np.einsum("m,mab->ab", weight, nodes.covariance)
    best = int(weight.argmax())
    heights = nodes.left[best, :, 1]
    scatter = 1.4826 * float(np.median(np.abs(heights - np.median(heights))))
    return Posterior(mean, covariance, float(nodes.standing[best, :, 1].mean()), scatter)
