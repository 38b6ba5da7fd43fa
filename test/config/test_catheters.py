"""The catalogue of catheters: its own file, what is refused and how it is said, and what an entry's distances mean."""

import pytest

from lasso_motion_ros.config.catheters import KINDS, catalogue, named
from lasso_motion_ros.config.parameters import configuration_from_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import ConfigurationError

GOOD = "{title: A ring, kind: circular, poles: 10, spacing_mm: [2, 6], diameter_mm: 20, source: a paper"


def written(tmp_path, fields):
    path = tmp_path / "catheters.yaml"
    path.write_text(f"catheters:\n  ring: {fields}\n", encoding="utf-8")
    return path


def test_each_entry_has_a_source_and_says_what_is_not_verified():
    entries = catalogue()
    assert {entry.kind for entry in entries.values()} == set(KINDS)
    assert {8, 9, 10, 20} <= {entry.poles for entry in entries.values()}
    for entry in entries.values():
        assert entry.source
        known = (entry.spacing_mm, entry.diameter_mm, entry.electrode_length_mm, entry.electrode_width_mm)
        assert None not in known or entry.unverified, entry.name
    assert entries["lasso_20_2_6_2"].spacing_mm == (2.0, 6.0)
    assert entries["pulseselect"].diameter_mm == (25.0, 25.0)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        (GOOD + ", colour: red}", "ring: unknown field 'colour'"),
        (GOOD + ", diametre_mm: 20}", "did you mean diameter_mm?"),
        ("{title: A ring, kind: circular, source: a paper}", "ring: poles is missing"),
        (GOOD.replace("poles: 10", "poles: 10.5") + "}", "ring: poles must be a whole number from 2 to 64, found 10.5"),
        (GOOD.replace("circular", "square") + "}", "ring: kind must be one of circular, inner_lumen, pulsed_field"),
        (GOOD.replace("[2, 6]", "[2, 6, 2]") + "}", "ring: spacing_mm must be a number or a list of up to 2"),
        (GOOD.replace("[2, 6]", "[2, .nan]") + "}", "ring: spacing_mm must be"),
        (
            GOOD.replace("_mm: 20", "_mm: 0.02") + "}",
            "ring: diameter_mm must be a number or a list of up to 2 from 5 to",
        ),
        (GOOD.replace("_mm: 20", "_mm: [25, 15]") + "}", "ring: diameter_mm must go from the smallest to the largest"),
        (GOOD.replace("a paper", "''") + "}", "ring: source must be a text"),
        (GOOD + ", spacing_is: guessed}", "ring: spacing_is must be one of edge_to_edge"),
        ("20", "ring: expected fields, found 20"),
    ],
)
def test_a_wrong_entry_is_named_with_its_field(tmp_path, fields, said):
    path = written(tmp_path, fields)
    with pytest.raises(ConfigurationError) as caught:
        catalogue(path)
    assert str(path) in str(caught.value)
    assert said in str(caught.value)


def test_a_file_without_entries_is_refused(tmp_path):
    path = tmp_path / "empty.yaml"
    path.write_text("catheters: {}\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match="expected a mapping 'catheters'"):
        catalogue(path)


@pytest.mark.parametrize(
    ("more", "unit_mm", "share"),
    [
        (", spacing_is: centre_to_centre}", (8.0, 8.0), 0.25),
        (", spacing_is: edge_to_edge, electrode_length_mm: 1}", (10.0, 10.0), 0.3),
        (", electrode_length_mm: 1}", (8.0, 10.0), 0.25),  # the source does not say from where to where
        ("}", (8.0, 11.0), 0.25),  # nor how long an electrode is: 1.5 mm at most
    ],
)
def test_the_distance_from_centre_to_centre_is_as_sure_as_its_source(tmp_path, more, unit_mm, share):
    entry = catalogue(written(tmp_path, GOOD + more))["ring"]
    assert entry.unit_mm == unit_mm
    assert entry.share == pytest.approx(share)


def test_a_wrong_name_is_one_line_that_lists_the_names():
    assert named("auto") is None
    for config_type in (TrackerConfig, StreamConfig):
        with pytest.raises(ConfigurationError) as caught:
            configuration_from_values(config_type, {"catheter": "achieve_21"})
        said = str(caught.value)
        assert "\n" not in said
        assert all(name in said for name in catalogue())
        assert "found 'achieve_21'; did you mean achieve_2" in said
    assert configuration_from_values(TrackerConfig, {"catheter": "achieve_20"}).catheter == "achieve_20"
