"""Kernels that Numba compiles, where the extra `fast` is installed; without it the plain numpy versions run.

Each kernel does what the plain function beside its call does, to the rounding; the tests compare the two. Kernels are
compiled for the types that they are declared with, as soon as they are imported, and never later, so that no pair waits
for a compiler. What was compiled is kept on disk: beside the package's byte code, under ~/.cache/numba where that
cannot be written, or in the folder that the environment's NUMBA_CACHE_DIR names.

A process that cannot wait while they are compiled holds them back (`hold_back`): the plain versions run in all its
threads until they are there.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from functools import cache
from importlib.util import find_spec
from typing import Any, TypeVar

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.core.signals import deferred

LOG = logging.getLogger(__name__)

Function = TypeVar("Function", bound=Callable[..., Any])

_REMEDY = "NUMBA_CACHE_DIR may name a folder that can be written"

# Asked for by this thread: plain, or compiled although they are held back. None: as the process does.
_PLAIN: ContextVar[bool | None] = ContextVar("plain", default=None)
# Why all threads of this process run the plain versions; empty where they do not.
_held_back = ""
# Sums in any order, and products added in one step; not numbers and infinities stay what they are.
_FASTMATH = {"reassoc", "contract", "nsz"}


class NotKept(Exception):  # noqa: N818 - not an error: it has to be compiled
    """A kernel was to be loaded, but would have to be compiled.

    Attributes:
        folder: where it would be kept; None where no folder can be written.
    """

    def __init__(self, folder: str | None) -> None:
        super().__init__(
            f"what is compiled can be kept nowhere: {_REMEDY}" if folder is None else f"not compiled yet into {folder}"
        )
        self.folder = folder


def has_kernels() -> bool:
    """Whether the compiled kernels run.

    Raises:
        ConfigurationError: Numba is installed, but cannot be used.
    """
    return not _is_plain() and _numba() is not None


def arithmetic() -> str:
    """Which versions run, for people to read.

    Raises:
        ConfigurationError: Numba is installed, but cannot be used.
    """
    numba = _numba()
    if numba is None:
        return "plain numpy: the extra `fast` is not installed"
    if _is_plain():
        return "plain numpy, as asked for" if _PLAIN.get() else f"plain numpy: {_held_back}"
    return f"compiled by Numba {numba.__version__}"


def hold_back(why: str) -> None:
    """Let the plain versions run in all threads of this process.

    Args:
        why: in words, for `arithmetic`; "" lets the kernels run.
    """
    global _held_back  # noqa: PLW0603 - threads that know nothing of each other do the same arithmetic
    _held_back = why


def plain() -> AbstractContextManager[None]:
    """Run the plain versions in this thread, for comparison."""
    return _asked_for(True)


def compiled_here() -> AbstractContextManager[None]:
    """Run the kernels in this thread although they are held back, to try them."""
    return _asked_for(False)


@contextmanager
def _asked_for(is_plain: bool) -> Iterator[None]:
    token = _PLAIN.set(is_plain)
    try:
        yield
    finally:
        _PLAIN.reset(token)


def _is_plain() -> bool:
    asked = _PLAIN.get()
    return bool(_held_back) if asked is None else asked


@contextmanager
def kept_only() -> Iterator[None]:
    """Kernels that are imported in this block are loaded from the disk, or raise NotKept: none is compiled."""
    from numba.core import event

    class Refusal(event.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            raise NotKept(event.data["dispatcher"].stats.cache_path)

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Refusal()):
        yield


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
            with deferred():
                made = numba.njit(list(signatures), **options)(function)
            warnings.warn(f"{error}: it is compiled anew at every start; {_REMEDY}", stacklevel=2)
            return made  # type: ignore[no-any-return]
        if made.stats.cache_misses:
            say_that_it_takes_time()
        return made  # type: ignore[no-any-return]

    return decorate


@cache
def say_that_it_takes_time() -> None:
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
