"""Parameters of the node that sends motion and state to an OpenIGTLink server."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.parameters import parameter


@dataclass(frozen=True)
class IgtlConfig:
    """All parameters of the node `lasso_igtl`."""

    to: str = parameter("", "the OpenIGTLink server, HOST:PORT; 3D Slicer listens on port 18944")
    device: str = parameter("LassoMotion", "name of the transform's device; the state's is this with State behind it")
    axes: str = parameter(
        "LPS",
        "where in the patient the world's x, y and z point, a letter each of R, L, A, P, S, I; LPS: supine, head first,"
        " the C-arm's axes",
    )
    state_timeout_s: float = parameter(
        2.5,
        "a state that nobody has renewed for so long is none: STALE is said once, and nothing more is sent",
        unit="s",
        minimum=0.1,
        maximum=60.0,
    )
    world_frame: str = parameter("patient_table", "frame fixed to the table top, in which the motion is given")
