"""Parameters of the node behind the page."""

from __future__ import annotations

from dataclasses import dataclass, field

from lasso_motion_ros.config.parameters import parameter
from lasso_motion_ros.config.stream import SyncConfig


@dataclass(frozen=True)
class WebConfig:
    """All parameters of the node behind the page."""

    host: str = parameter("127.0.0.1", "address that the page is served on; the default lets this machine in only")
    port: int = parameter(8080, "TCP port of the page; 0: any that is free", minimum=0, maximum=65535)
    allowed_hosts: str = parameter("", "further host names by which browsers may ask for the page, separated by blanks")
    tracker: str = parameter("lasso_tracker", "name of the tracker node, whose services are called")
    overlay: str = parameter("lasso_overlay", "name of the overlay node, whose style is changed")
    answer_wait_s: float = parameter(
        0.15, "a pair waits this long for the tracker's answer before it is shown", unit="s", minimum=0.0, maximum=5.0
    )
    world_frame: str = parameter("patient_table", "frame fixed to the table top; the frame of motion and catheter")
    sync: SyncConfig = field(default_factory=SyncConfig)
