"""The package's exceptions: one base, so that a command can turn any of them into one plain line."""


class LassoMotionError(Exception):
    """Something the user can mend: the text says what was found, what was expected, and where."""


class GeometryError(LassoMotionError):
    """A projection matrix, or a pair of them, from which no geometry can be recovered."""


class EllipseError(LassoMotionError):
    """Points through which no ellipse can be laid."""


class ReconstructionError(LassoMotionError):
    """Two outlines that no 3-D ellipse explains."""


class SeedError(LassoMotionError):
    """Clicks that fit no loop in these images."""


class TrackingError(LassoMotionError):
    """The tracker was asked for something its state does not allow."""


class ConfigurationError(LassoMotionError):
    """A parameter that is unknown, of the wrong type or out of its range."""


class MessageError(LassoMotionError):
    """A message whose content breaks the contract (encoding, size, calibration, units)."""


class RecordingError(LassoMotionError):
    """A recording that cannot be read or written, or that lacks what is needed."""


class ScenarioError(LassoMotionError):
    """A phantom scenario that is not valid."""


class SurfaceError(LassoMotionError):
    """A surface file that cannot be read, or that is larger than is sensible."""


class VolumeError(LassoMotionError):
    """A medical volume that cannot be read, or in which there is nothing to show."""
