"""A Fast DDS profile whose shared-memory segment holds whole X-ray images.

Fast DDS gives a participant 512 KiB of shared memory. A 1024² mono16 image has 2 MiB, so by default it is sent in
pieces through a full segment, and a best-effort subscriber loses half of the images (rmw_fastrtps issue 739). The
*publisher's* segment counts. `config/fastdds.xml` is the same profile as a file, for publishers that are not ours.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from collections.abc import MutableMapping
from dataclasses import dataclass
from pathlib import Path

MIB = 1024 * 1024


@dataclass(frozen=True)
class _Tuning:
    """How much shared memory is asked for.

    Attributes:
        preferred_segment_bytes: of each participant.
        smallest_segment_bytes: with less, images are lost.
        sharers: processes that need room side by side: player, tracker, overlay, and a viewer.
    """

    preferred_segment_bytes: int = 32 * MIB
    smallest_segment_bytes: int = 8 * MIB
    sharers: int = 4


TUNING = _Tuning()

PROFILE_VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
PROFILE_IN_CURRENT_DIRECTORY = "DEFAULT_FASTRTPS_PROFILES.xml"
SHARED_MEMORY = Path("/dev/shm")  # noqa: S108 - where Fast DDS keeps its segments

TOO_SMALL = (
    "{directory} has {free_mib} MiB free, images need {needed_mib} MiB a process: images may be lost; "
    "give the container more (docker run --shm-size=256m)"
)

NO_PROFILE = (
    "the profile for images cannot be written into the folder for temporary files ({reason}): images may be lost"
)

_PROFILE = """\
<?xml version="1.0" encoding="UTF-8"?>
<!-- Room for whole X-ray images in shared memory. Export FASTRTPS_DEFAULT_PROFILES_FILE=<this file> for every process
     that publishes images; the nodes of lasso_motion_ros load it by themselves. -->
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <profiles>
    <transport_descriptors>
      <transport_descriptor>
        <transport_id>lasso_motion_shared_memory</transport_id>
        <type>SHM</type>
        <segment_size>{segment_bytes}</segment_size>
      </transport_descriptor>
      <transport_descriptor>
        <transport_id>lasso_motion_udp</transport_id>
        <type>UDPv4</type>
      </transport_descriptor>
    </transport_descriptors>
    <participant profile_name="lasso_motion" is_default_profile="true">
      <rtps>
        <userTransports>
          <transport_id>lasso_motion_shared_memory</transport_id>
          <transport_id>lasso_motion_udp</transport_id>
        </userTransports>
        <useBuiltinTransports>false</useBuiltinTransports>
      </rtps>
    </participant>
  </profiles>
</dds>
"""


def profile_xml(segment_bytes: int = TUNING.preferred_segment_bytes) -> str:
    """The profile as text.

    Args:
        segment_bytes: size of each participant's shared-memory segment.
    """
    return _PROFILE.format(segment_bytes=segment_bytes)


def segment_bytes_for(free_bytes: int) -> int | None:
    """The segment to ask for, so that several participants find room.

    Args:
        free_bytes: what is free in shared memory.

    Returns:
        Bytes between 8 and 32 MiB, or None where not even the smallest fits.
    """
    if free_bytes < TUNING.smallest_segment_bytes + MIB:
        return None
    share = free_bytes // TUNING.sharers // MIB * MIB
    return max(TUNING.smallest_segment_bytes, min(TUNING.preferred_segment_bytes, share))


def use_image_profile(environment: MutableMapping[str, str] | None = None) -> str | None:
    """Make this process, and the children that inherit its environment, use the profile.

    To be called before the first participant exists. A profile that the user has chosen stays in force.

    Args:
        environment: the variables to set; None means this process's own.

    Returns:
        None when all is well, otherwise one line that says why images may be lost.
    """
    environment = os.environ if environment is None else environment
    if any(environment.get(name) for name in PROFILE_VARIABLES) or Path(PROFILE_IN_CURRENT_DIRECTORY).is_file():
        return None
    if not SHARED_MEMORY.is_dir():
        return None  # not Linux: Fast DDS keeps its segments elsewhere and its own default holds
    free = shutil.disk_usage(SHARED_MEMORY).free
    segment = segment_bytes_for(free)
    if segment is None:
        needed_mib = TUNING.smallest_segment_bytes // MIB
        return TOO_SMALL.format(directory=SHARED_MEMORY, free_mib=free // MIB, needed_mib=needed_mib)
    try:
        descriptor, path = tempfile.mkstemp(prefix="lasso_motion_fastdds_", suffix=".xml")
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(profile_xml(segment))
    except OSError as error:
        return NO_PROFILE.format(reason=error.strerror)
    atexit.register(Path(path).unlink, missing_ok=True)
    environment[PROFILE_VARIABLES[0]] = path
    return None
