"""Scenario files: what is accepted, what is refused and how it is said."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pytest

from lasso_motion_ros.core.errors import ScenarioError
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.scenario import (
    LISTED,
    available_scenarios,
    load_scenario,
    scenario_directory,
    scenario_from_values,
)
from lasso_motion_ros.phantom.settings import EVENT_KINDS, Event, Scenario


def test_the_packages_scenarios_are_seven_with_231_pairs() -> None:
    scenarios = [load_scenario(name) for name in available_scenarios()]
    assert len(scenarios) >= 7
    assert sum(scenario.pairs for scenario in scenarios) == 231
    assert all(scenario.description for scenario in scenarios)
    assert {event.kind for scenario in scenarios for event in scenario.events} == set(EVENT_KINDS)
    assert scenario_directory().is_dir()


def test_the_easiest_scenario_is_within_reach_of_the_published_method() -> None:
    easiest = load_scenario("01_clear_view")
    assert easiest.rate_hz >= 3.0
    assert 10.0 <= easiest.breathing.amplitude_mm <= 14.0
    assert easiest.imaging.quanta >= 40.0


def test_defaults_and_nesting() -> None:
    assert scenario_from_values({}) == Scenario()
    scenario = scenario_from_values(
        {
            "pairs": 5,
            "geometry": {"plane_a": {"cranial_deg": 10}},
            "events": [{"kind": "drop", "first": 2, "plane": "b"}],
        }
    )
    # A group's own default stays where only a part of it is given.
    assert (scenario.geometry.plane_a.lao_deg, scenario.geometry.plane_a.cranial_deg) == (-30.0, 10.0)
    assert scenario.events[0].end == 2


@pytest.mark.parametrize(
    ("values", "key", "expected"),
    [
        ({"pars": 3}, "pars", "pairs"),
        ({"nothing_like_it": 3}, "nothing_like_it", "expected one of"),
        ({"lasso": {"diametre_mm": 3}}, "lasso.diametre_mm", "did you mean diameter_mm"),
        ({"pairs": 3.5}, "pairs", "a whole number"),
        ({"pairs": True}, "pairs", "a whole number"),
        ({"pairs": 0}, "pairs", "at least 1"),
        ({"rate_hz": "fast"}, "rate_hz", "a number"),
        ({"rate_hz": True}, "rate_hz", "a number"),
        ({"rate_hz": float("nan")}, "rate_hz", "finite"),
        ({"plane_b_offset": 0.6}, "plane_b_offset", "at most 0.5"),
        ({"geometry": {"size_px": 500}}, "geometry.size_px", "one of 128, 256, 512, 1024"),
        ({"geometry": {"mirrored": 1}}, "geometry.mirrored", "true or false"),
        ({"geometry": {"source_object_mm": 1200}}, "geometry.source_object_mm", "less than"),
        ({"geometry": []}, "geometry", "a mapping"),
        ({"lasso": {"centre_mm": [1, 2]}}, "lasso.centre_mm", "a list of 3 numbers"),
        ({"lasso": {"centre_mm": [1, 2, "x"]}}, "lasso.centre_mm[2]", "a number"),
        ({"lasso": {"normal": [0, 0, 0]}}, "lasso.normal", "not zero"),
        ({"breathing": {"amplitude_mm": 41}}, "breathing.amplitude_mm", "at most 40 mm"),
        ({"imaging": {"polarity": "grey"}}, "imaging.polarity", "one of dark, bright"),
        ({"imaging": {"collimator": [0.45, 0, 0.45, 0]}}, "imaging.collimator", "a fifth"),
        ({"events": {}}, "events", "a list"),
        ({"events": [{"kind": "hide"}]}, "events[0].first", "in every event"),
        ({"incidents": [{"kind": "cough"}]}, "incidents[0].start_s", "in every incident"),
        ({"incidents": [{"kind": "shift", "start_s": 1.0}]}, "incidents[0].direction", "not zero"),
        ({"ablation_work": {"nearest_mm": 9.0}}, "ablation_work.farthest_mm", "at least ablation_work.nearest_mm"),
        ({"events": [{"kind": "vanish", "first": 2}]}, "events[0].kind", "one of hide"),
        ({"events": [{"kind": "hide", "first": 3, "last": 2}]}, "events[0].last", "at least first"),
        ({"pairs": 5, "events": [{"kind": "hide", "first": 5}]}, "events[0].first", "less than pairs"),
        (["a list"], "scenario", "a mapping"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, values: object, key: str, expected: str) -> None:
    import yaml

    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(values))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    text = str(caught.value)
    assert str(path) in text
    assert f"{key}:" in text
    assert expected in text
    assert "\n" not in text


def test_files_that_are_no_scenario(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no such file, nor one of the scenarios 01_clear_view"):
        load_scenario(tmp_path / "missing.yaml")
    broken = tmp_path / "broken.yaml"
    broken.write_text("pairs: [1, 2")
    with pytest.raises(ScenarioError, match="cannot be read as YAML"):
        load_scenario(broken)
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ScenarioError, match="cannot be read"):
        load_scenario(binary)
    empty = tmp_path / "empty.yaml"
    empty.write_text("")
    assert load_scenario(empty).name == "empty"


def settings(group: type) -> Iterator[dataclasses.Field]:
    """The settings of a group and of the groups within it."""
    for entry in dataclasses.fields(group):
        value = getattr(group(), entry.name)
        if dataclasses.is_dataclass(value):
            yield from settings(type(value))
        elif entry.name not in LISTED:
            yield entry


def test_every_setting_is_documented() -> None:
    entries = [*settings(Scenario), *settings(Event), *settings(Incident)]
    assert {"turns", "lao_deg", "kind", "quanta", "dwell_s", "vessel"} <= {entry.name for entry in entries}
    assert [entry.name for entry in entries if not entry.metadata["description"]] == []
