"""Kernels that Numba compiles, where the extra `fast` is installed; without it the plain numpy versions run.

Each kernel does what the plain function beside its call does, to the rounding; the tests compare the two. Kernels are
compiled for the types that they are declared with, as soon as they are imported, and never later, so that no pair waits
for a compiler. What was compiled is kept on disk: beside the package's byte code, under ~/.cache/numba where that
cannot be written, or in the folder that the environment's NUMBA_CACHE_DIR names.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from importlib.util import find_spec
from typing import Any, TypeVar

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.core.signals import deferred

LOG = logging.getLogger(__name__)

Function = TypeVar("Function", bound=Callable[..., Any])

_PLAIN: ContextVar[bool] = ContextVar("plain", default=False)
# Sums in any order, and products added in one step; not numbers and infinities stay what they are.
_FASTMATH = {"reassoc", "contract", "nsz"}


def has_kernels() -> bool:
    """Whether the compiled kernels run.

    Raises:
        ConfigurationError: Numba is installed, but cannot be used.
    """
    return _numba() is not None and not _PLAIN.get()


def arithmetic() -> str:
    """Which versions run, for people to read.

    Raises:
        ConfigurationError: Numba is installed, but cannot be used.
    """
    numba = _numba()
    if numba is None:
        return "plain numpy: the extra `fast` is not installed"
    return "plain numpy, as asked for" if _PLAIN.get() else f"compiled by Numba {numba.__version__}"


@contextmanager
def plain() -> Iterator[None]:
    """Run the plain versions in this thread, for comparison."""
    token = _PLAIN.set(True)
    try:
        yield
    finally:
        _PLAIN.reset(token)


def compiled(*signatures: str, is_exact: bool = False) -> Callable[[Function], Function]:
    """Decorator of a kernel: compiled at once, for these types.

    Args:
        signatures: as Numba writes them, `float64(float64[:, ::1])`; of several the first that fits is taken.
        is_exact: sums and products are rounded one by one, in their order, as Python does.
    """
    numba = _numba()
    if numba is None:
        raise ImportError("kernels are imported only where has_kernels() says so")

    def decorate(function: Function) -> Function:
        options = {"error_model": "numpy", "fastmath": False if is_exact else _FASTMATH, "nogil": True}
        try:
            with deferred():  # LLVM calls back
                made = numba.njit(list(signatures), cache=True, **options)(function)
        except RuntimeError as error:
            if "cannot cache" not in str(error):
                raise
            warnings.warn(
                f"{error}: it is compiled anew at every start; NUMBA_CACHE_DIR may name a folder that can be written",
                stacklevel=2,
            )
            with deferred():
                return numba.njit(list(signatures), **options)(function)  # type: ignore[no-any-return]
        if made.stats.cache_misses:
            _say_that_it_takes_time()
        return made  # type: ignore[no-any-return]

    return decorate


@cache
def _say_that_it_takes_time() -> None:
    """Once: whoever waits for the first start wants to know for what."""
    LOG.warning("compiling for this machine, as at each first start with the extra `fast`: up to a minute")


@cache
def _numba() -> Any:
    """The module; None where it is not installed."""
    if find_spec("numba") is None:
        return None
    try:
        import numba
    except Exception as error:  # whatever a broken installation raises
        raise ConfigurationError(
            f"the extra `fast` is installed but does not work: {type(error).__name__}: {error}; "
            "install it again, or remove it: python -m pip uninstall numba"
        ) from error
    return numba
