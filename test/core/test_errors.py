import inspect

from lasso_motion_ros.core import errors


def test_one_base_catches_every_error():
    classes = [c for _, c in inspect.getmembers(errors, inspect.isclass)]
    assert len(classes) > 5
    assert all(issubclass(c, errors.LassoMotionError) for c in classes)


def test_text_is_what_the_user_sees():
    assert str(errors.SeedError("plane A: 3 clicks")) == "plane A: 3 clicks"
