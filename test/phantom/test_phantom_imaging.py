"""The imaging chain against physics: Beer–Lambert, Poisson, MTF, lag, display."""

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.phantom.imaging import ImagingChain, blurred, collimator_mask
from lasso_motion_ros.phantom.settings import ImagingSettings

PLAIN = ImagingSettings(
    scatter=0.0, detector_blur_px=0.0, electronic_noise=0.0, lag=0.0, brightness_drift=0.0, gamma=1.0, quanta=40.0
)


def chain(**changes: object) -> ImagingChain:
    return ImagingChain(dataclasses.replace(PLAIN, **changes), focal_spot_px=0.0)


def random() -> np.random.Generator:
    return np.random.default_rng(5)


def flat(value: float, side: int = 256) -> np.ndarray:
    return np.full((side, side), value, dtype=np.float32)


def test_beer_lambert() -> None:
    fluence = chain().fluence(flat(np.log(2.0)))
    assert fluence == pytest.approx(0.5, rel=1e-5)


def test_scatter_is_a_share_of_the_primary_and_broad() -> None:
    assert chain(scatter=0.4).fluence(flat(np.log(2.0))) == pytest.approx(0.7, rel=1e-4)
    hot = flat(12.0)
    hot[96:160, 96:160] = 0.0
    fluence = chain(scatter=0.4).fluence(hot)
    assert fluence[128, 40] > 100 * np.exp(-12.0)  # far from the bright square, scatter is all there is
    assert fluence[128, 40] < 0.4


def test_quanta_are_poisson() -> None:
    signal = chain().detect(flat(40.0), random())
    assert signal.mean() == pytest.approx(40.0, abs=0.15)
    assert signal.var() == pytest.approx(40.0, rel=0.02)


def test_noise_is_blurred_with_the_detector() -> None:
    sigma = 1.0
    signal = chain(detector_blur_px=sigma).detect(flat(40.0, 512), random()) - 40.0
    # White noise through a Gaussian keeps 1/(4πσ²) of its variance; neighbours correlate by exp(−1/(4σ²)).
    assert signal.var() == pytest.approx(40.0 / (4 * np.pi * sigma**2), rel=0.03)
    neighbours = (signal[:, 1:] * signal[:, :-1]).mean() / signal.var()
    assert neighbours == pytest.approx(np.exp(-1 / (4 * sigma**2)), abs=0.02)
    # The power spectrum falls with the square of the MTF, exp(−4π²σ²f²).
    power = (np.abs(np.fft.rfft(signal, axis=1)) ** 2).mean(axis=0) / signal.shape[1]
    for cycles in (64, 128):
        frequency = cycles / 512
        expected = 40.0 * np.exp(-4 * np.pi**2 * sigma**2 * frequency**2)
        # One-dimensional spectrum of a two-dimensional blur: the other axis leaves 1/(2√π σ).
        expected /= 2 * np.sqrt(np.pi) * sigma
        assert power[cycles - 2 : cycles + 3].mean() == pytest.approx(expected, rel=0.12)


def test_read_out_noise_adds_after_the_blur() -> None:
    signal = chain(electronic_noise=3.0).detect(flat(40.0), random())
    assert signal.var() == pytest.approx(40.0 + 9.0, rel=0.03)


def test_the_exposure_control_gives_the_quanta_asked_for() -> None:
    imaging = chain(quanta=23.0, bits=12)
    body = flat(3.0)
    body[:32, :32] = 2.0  # a brighter corner, so that the middle's noise stays below white
    picture = imaging.expose(body, 1.0, random())
    assert picture[64:192, 64:192].mean() / 4095 * imaging._white == pytest.approx(23.0, rel=0.01)


def test_lag_leaves_a_share_of_the_last_picture() -> None:
    imaging = chain(lag=0.3, bits=12)
    first = imaging.expose(flat(1.0), 1.0, random()).mean()
    second = imaging.expose(flat(1.0), 0.0, random()).mean()
    third = imaging.expose(flat(1.0), 0.0, random()).mean()
    assert second / first == pytest.approx(0.3, abs=0.01)
    assert third / first == pytest.approx(0.09, abs=0.01)


def test_polarity_and_depth() -> None:
    dark = chain(bits=8).expose(flat(1.0), 1.0, random())
    bright = chain(bits=8, polarity="bright").expose(flat(1.0), 1.0, random())
    assert dark.dtype == np.uint8
    assert dark.astype(int) + bright.astype(int) == pytest.approx(255, abs=1)
    deep = chain(bits=12).expose(flat(1.0), 2.0, random())
    assert deep.dtype == np.uint16
    assert deep.max() == 4095


def test_edge_enhancement_overshoots_at_an_edge() -> None:
    step = flat(0.5)
    step[:, 128:] = 0.2
    plain, sharp = chain(bits=12), chain(bits=12, edge_enhancement=1.0)
    for imaging in (plain, sharp):
        imaging._white = 1.0
    assert np.ptp(sharp.display(step)[128]) > 1.2 * np.ptp(plain.display(step)[128])
    assert sharp.display(step)[128, 10] == plain.display(step)[128, 10]


def test_the_collimator_covers_its_edges() -> None:
    mask = collimator_mask((200, 100), (0.1, 0.2, 0.3, 0.05))
    assert mask[100, 5] == pytest.approx(0.02, abs=0.01)
    assert mask[100, 95] == pytest.approx(0.02, abs=0.01)
    assert mask[20, 50] == pytest.approx(0.02, abs=0.01)
    assert mask[100, 50] == pytest.approx(1.0)
    assert mask[40, 50] == pytest.approx(0.5, abs=0.2)  # penumbra
    assert collimator_mask((20, 20), (0.0, 0.0, 0.0, 0.0)).min() == 1.0
    covered = chain(collimator=(0.2, 0.0, 0.0, 0.0)).fluence(flat(1.0))
    assert covered[128, 10] < 0.03 * covered[128, 200]


def test_blur_keeps_the_mean() -> None:
    noise = random().random((64, 64)).astype(np.float32)
    assert blurred(noise, 2.0).mean() == pytest.approx(noise.mean(), rel=1e-2)
    assert blurred(noise, 0.0) is noise
