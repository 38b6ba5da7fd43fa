"""Memory of images, kept by the process from one pair to the next."""

from __future__ import annotations

import ctypes

# Options of mallopt(3), and what they are set to: the largest threshold that the GNU library takes.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_LARGEST_BLOCK_BYTES = 32 * 2**20
_LARGEST_REST_BYTES = 64 * 2**20


def keep_freed_memory() -> None:
    """Have the C library use freed images' memory again, instead of giving it back to the system.

    Every image is copied twice before it is a message. In memory that is fresh from the system each page is cleared on
    its first use, which for two images of 1024², 16 bits, is a tenth of all that a pair costs. At most some 64 MB that
    are not in use are kept. Does nothing where the C library is not the GNU one.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    mallopt(_MMAP_THRESHOLD, _LARGEST_BLOCK_BYTES)
    mallopt(_TRIM_THRESHOLD, _LARGEST_REST_BYTES)
