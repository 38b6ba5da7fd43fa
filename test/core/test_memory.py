import subprocess
import sys

import pytest

from lasso_motion_ros.core.memory import keep_freed_memory

FAULTS = """
import resource
from lasso_motion_ros.core.memory import keep_freed_memory
if {keep}:
    keep_freed_memory()
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(4):
    held = [bytearray(2 << 20) for _ in range(4)]
    del held
before = faults()
for _ in range(16):
    held = [bytearray(2 << 20) for _ in range(4)]
    del held
print(faults() - before)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="of the GNU library")
def test_memory_of_images_is_not_asked_for_afresh():
    def faults(keep):
        program = FAULTS.format(keep=keep)
        return int(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout)

    assert faults(True) < 0.1 * faults(False) + 50


def test_another_library_is_left_alone(monkeypatch):
    monkeypatch.setattr("ctypes.CDLL", lambda name: object())
    keep_freed_memory()
