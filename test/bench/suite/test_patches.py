"""Patches into the tracker: each names something that is there, and it comes back; no other file patches anything."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from support.suite_inputs import small

import lasso_motion_ros
from lasso_motion_ros.bench.suite import patches
from lasso_motion_ros.bench.suite.ideas import IDEAS
from lasso_motion_ros.bench.suite.patches import PACKAGE, PATCHES, patched
from lasso_motion_ros.ring.working_image import working_image


def named(dotted: str) -> object:
    """What stands under a name below the package."""
    parts = (PACKAGE + dotted).split(".")
    for count in range(len(parts) - 1, 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            found = getattr(found, part)
        return found
    raise AssertionError(dotted)


@pytest.mark.parametrize("idea", PATCHES)
def test_what_carries_an_idea_is_there_and_comes_back(idea: str) -> None:
    assert idea in IDEAS
    replaced = PATCHES[idea]
    before = {name: named(name) for name in replaced}
    with patched(idea):
        for name, value in replaced.items():
            assert named(name) is value
            assert before[name] is not value
            # What replaces a constant is of its kind.
            assert callable(value) or not isinstance(before[name], float | tuple) or type(value) is type(before[name])
    assert {name: named(name) for name in replaced} == before


def test_an_idea_without_a_patch_patches_nothing() -> None:
    with patched("speed"):
        pass


def test_without_the_local_contrast_the_working_image_is_another() -> None:
    sequence = small()
    frame = sequence.pairs[0].a
    assert frame is not None
    assert sequence.truth.loop is not None
    centre = sequence.truth.loop.mean(axis=0)
    images = []
    for idea in ("local", "speed"):
        with patched(idea):
            images.append(working_image(frame, centre, bright=False, shift=np.zeros(2)).values)
    assert np.abs(images[0] - images[1]).mean() > 0.05


def test_no_other_file_of_the_package_patches_anything() -> None:
    package = Path(lasso_motion_ros.__file__).parent
    patching = [file for file in package.rglob("*.py") if "unittest" in file.read_text(encoding="utf-8")]
    assert patching == [Path(patches.__file__)]
