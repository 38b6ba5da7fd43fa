"""Later stamps for serialised messages, so that a recording played again continues the stream."""

from __future__ import annotations

import struct

from msg_adapters.messages import NANOSECONDS

STAMP_OFFSET = 4
"""Where the stamp of a message that begins with a header stands: behind CDR's own four bytes."""
HEADER = "std_msgs/Header"


def is_stamped(message_class: type) -> bool:
    """Whether a message of this class begins with a header, or is one."""
    fields: dict[str, str] = message_class.get_fields_and_field_types()  # type: ignore[attr-defined]
    first = next(iter(fields.values()), "")
    return first == HEADER or (first == "builtin_interfaces/Time" and message_class.__name__ == "Header")


def with_later_stamp(data: bytes, later_ns: int) -> bytes:
    """A serialised message that begins with a header, its stamp moved; a stamp of 0 means none and stays.

    Args:
        data: CDR, either byte order.
        later_ns: nanoseconds.
    """
    form = "<iI" if data[1] & 1 else ">iI"
    sec, nanosec = struct.unpack_from(form, data, STAMP_OFFSET)
    if not (sec or nanosec):
        return data
    later = divmod(sec * NANOSECONDS + nanosec + later_ns, NANOSECONDS)
    return data[:STAMP_OFFSET] + struct.pack(form, *later) + data[STAMP_OFFSET + 8 :]
