"""What a service answers: what was done, or why not."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from std_srvs.srv import SetBool, Trigger

from lasso_motion_ros.core.errors import LassoMotionError

Response = TypeVar("Response", Trigger.Response, SetBool.Response)


def answered(response: Response, action: Callable[[], str]) -> Response:
    """A response, filled in.

    Args:
        response: of the service's call.
        action: does it, and returns in words what was done; LassoMotionError says why not.
    """
    try:
        response.message = action()
        response.success = True
    except LassoMotionError as error:
        response.success, response.message = False, str(error)
    return response
