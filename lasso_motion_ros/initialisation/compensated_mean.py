"""The mean of a few successive pairs, motion-compensated: a first pair with less noise, and less of what stands still.

The later ones come to lie on the first, block by block, by as much as what moves in each block has moved until then. A
ring's lines and electrodes stay where the first pair shows them; noise, ribs and wires are smeared.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.initialisation.block_motion import BLOCK_M, BlockMotion, Blocks
from lasso_motion_ros.initialisation.laid_image import CELL_MM, Image, LaidImage
from lasso_motion_ros.initialisation.laid_pair import LaidPair

Array = npt.NDArray[np.float64]
Motions = dict[Plane, list[BlockMotion]]

_CELL_M = 1e-3 * CELL_MM
_REACH = round(BLOCK_M / _CELL_M)  # of a block's weights, from its middle: to the middles of those beside it
_ASIDE = 1.0 - np.abs(np.arange(-_REACH, _REACH + 1)) / _REACH
_TENT = np.outer(_ASIDE, _ASIDE).astype(np.float32)
_SAMPLED = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP


def motions_of(pairs: Sequence[LaidPair]) -> Motions:
    """Per plane, how the blocks of the first of some pairs have moved until each of the others."""
    first = pairs[0]
    motions: Motions = {}
    for plane in PLANES:
        blocks = Blocks.of(first.laid[plane], first.bands[plane])
        motions[plane] = [blocks.until(later.laid[plane], later.bands[plane]) for later in pairs[1:]]
    return motions


def compensated_mean(pairs: Sequence[LaidPair], motions: Mapping[Plane, Sequence[BlockMotion]]) -> LaidPair:
    """The first of some pairs as the mean of all.

    Args:
        pairs: successive pairs.
        motions: from `motions_of`.
    """
    laid = {p: _mean([one.laid[p] for one in pairs], motions[p]) for p in PLANES}
    return replace(pairs[0], laid=laid)


def _mean(images: Sequence[LaidImage], motions: Sequence[BlockMotion]) -> LaidImage:
    """The first of one plane's images as the mean of all."""
    first = images[0]
    height, width = first.values.shape
    # As far as blocks beyond the edge reach.
    total = np.pad(first.values, _REACH)
    weights = np.pad(np.ones_like(first.values), _REACH)
    for image, motion in zip(images[1:], motions, strict=True):
        # Another exposure is another level of the logarithm.
        values = image.values + np.float32(_level(first) - _level(image))
        for place, moved in zip(motion.places, motion.moved, strict=True):
            column, row = np.rint((place - (first.left, first.top)) / _CELL_M).astype(int).tolist()
            if not (0 <= column < width and 0 <= row < height):
                continue
            at = (
                _CELL_M * np.array([column, row]) + (first.left, first.top) + moved - (image.left, image.top)
            ) / _CELL_M
            to = np.array([[1.0, 0.0, at[0] - _REACH], [0.0, 1.0, at[1] - _REACH]])
            weight = _TENT * _sampled(image.inside, to)
            part = slice(row, row + 2 * _REACH + 1), slice(column, column + 2 * _REACH + 1)
            total[part] += weight * _sampled(values, to)
            weights[part] += weight
    inner = slice(_REACH, _REACH + height), slice(_REACH, _REACH + width)
    return replace(first, values=total[inner] / weights[inner])


def _level(image: LaidImage) -> float:
    return float((image.values * image.inside).sum() / max(float(image.inside.sum()), 1.0))


def _sampled(values: Image, to: Array) -> Image:
    return np.asarray(cv2.warpAffine(values, to, _TENT.shape, flags=_SAMPLED, borderMode=cv2.BORDER_CONSTANT))
