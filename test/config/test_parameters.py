import dataclasses

import pytest
import yaml
from support.paths import ROOT

from lasso_motion_ros.config.igtl import IgtlConfig
from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.parameters import (
    configuration_from_values,
    configuration_values,
    group,
    load_configuration,
    parameter,
    parameter_table,
)
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.config.tracker import METHODS, TrackerConfig
from lasso_motion_ros.config.web import WebConfig
from lasso_motion_ros.core.errors import ConfigurationError

CONFIG = ROOT / "config"
TABLES = [StreamConfig, OverlayConfig, WebConfig]


@dataclasses.dataclass(frozen=True)
class Group:
    """A group of parameters."""

    count: int = parameter(3, "how many", minimum=1, maximum=9)
    share: float = parameter(0.5, "how much", unit="mm", minimum=0.0, maximum=1.0)


@dataclasses.dataclass(frozen=True)
class Small:
    """Parameters of each type."""

    name: str = parameter("one", "which", choices=("one", "two"))
    flag: bool = parameter(True, "whether", read_only=False)
    group: Group = group(Group)


@dataclasses.dataclass(frozen=True)
class OfMethods:
    """Parameters of two methods, and one of both."""

    method: str = parameter("here", "which method", choices=("here", "there"))
    shared: float = parameter(1.0, "of both")
    own: float = parameter(2.0, "of one", method="here")
    far: Group = group(Group, method="there")


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "parameters.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_table_by_hand():
    rows = list(parameter_table(Small))
    assert [row.name for row in rows] == ["name", "flag", "group.count", "group.share"]
    share = rows[-1]
    assert (share.default, share.unit, share.minimum, share.maximum) == (0.5, "mm", 0.0, 1.0)
    assert share.description == "how much"
    assert share.read_only
    assert not rows[1].read_only
    assert rows[0].choices == ("one", "two")


@pytest.mark.parametrize("table", TABLES)
def test_every_parameter_says_what_it_does_and_allows_its_default(table):
    rows = list(parameter_table(table))
    assert len({row.name for row in rows}) == len(rows)
    for row in rows:
        assert row.description
        assert row.checked(row.default) == row.default
        assert type(row.default) in (bool, int, float, str)
        # A unit in the name and in the table must not contradict each other.
        for suffix in ("mm", "px", "deg", "s"):
            if row.name.endswith(f"_{suffix}") and not row.name.endswith(("_mm_s", "_per_s")):
                assert row.unit == suffix, row.name


@pytest.mark.parametrize("table", [Small, OfMethods, *TABLES, TrackerConfig])
def test_values_round_trip(table):
    values = configuration_values(table())
    assert configuration_from_values(table, values) == table()
    applicable = [row.name for row in parameter_table(table) if row.method in ("", values.get("method", ""))]
    assert list(values) == applicable


def test_each_row_says_which_method_it_belongs_to():
    methods = {row.name: row.method for row in parameter_table(OfMethods)}
    assert methods == {"method": "", "shared": "", "own": "here", "far.count": "there", "far.share": "there"}


def test_a_configuration_has_its_own_methods_parameters_only():
    assert configuration_values(OfMethods()) == {"method": "here", "shared": 1.0, "own": 2.0}
    there = configuration_from_values(OfMethods, {"far.count": 5, "method": "there"})
    assert there == OfMethods(method="there", far=Group(count=5))
    assert configuration_values(there) == {"method": "there", "shared": 1.0, "far.count": 5, "far.share": 0.5}


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"far.count": 5}, "^far.count is a parameter of the method there, but method is here$"),
        ({"method": "there", "own": 1.0}, "^own is a parameter of the method here, but method is there$"),
        ({"method": "nowhere", "own": 1.0}, "^method must be one of here, there, found 'nowhere'$"),
        ({"method": "there", "far.cuont": 1}, "^unknown parameter 'far.cuont'; did you mean far.count"),
    ],
)
def test_a_parameter_of_the_other_method_is_refused_by_name(values, text):
    with pytest.raises(ConfigurationError, match=text):
        configuration_from_values(OfMethods, values)


def test_methods_share_the_stream_and_differ_in_the_rest():
    rows = {row.name: row.method for row in parameter_table(StreamConfig)}
    assert set(rows.values()) == {"", *METHODS}
    assert all(method in METHODS for method in rows.values() if method)
    assert {name for name, method in rows.items() if not method} >= {
        "method",
        "polarity",
        "path.cost_floor",
        "sync.jitter_s",
    }
    assert rows["search.near_mm"] == rows["posture"] == "appearance"
    assert rows["features.roi_px"] == "brost2009"


def test_what_is_not_named_keeps_its_default():
    config = configuration_from_values(Small, {"group.count": 5})
    assert config == Small(group=Group(count=5))
    assert configuration_values(config) == {"name": "one", "flag": True, "group.count": 5, "group.share": 0.5}


def test_an_integer_serves_as_a_number():
    config = configuration_from_values(Small, {"group.share": 1})
    assert config.group.share == 1.0
    assert isinstance(config.group.share, float)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"group.cuont": 3}, r"unknown parameter 'group.cuont'; did you mean group.count\?"),
        ({"zzzzzzz": 3}, "unknown parameter 'zzzzzzz'$"),
        ({"group": 3}, "unknown parameter 'group'"),
        ({"group.count": 2.0}, r"group.count must be a int, found 2.0"),
        ({"group.count": True}, "group.count must be a int, found True"),
        ({"group.share": True}, "group.share must be a float, found True"),
        ({"group.share": "0.5"}, "group.share must be a float, found '0.5'"),
        ({"group.share": None}, "group.share must be a float, found None"),
        ({"flag": 1}, "flag must be a bool, found 1"),
        ({"name": 1}, "name must be a str, found 1"),
        ({"group.count": 0}, "group.count must be at least 1, found 0"),
        ({"group.count": 10}, "group.count must be at most 9, found 10"),
        ({"group.share": -0.1}, "group.share must be at least 0.0 mm, found -0.1"),
        ({"group.share": 1.1}, "group.share must be at most 1.0 mm, found 1.1"),
        ({"group.share": float("nan")}, "group.share must be a finite number, found nan"),
        ({"group.share": float("inf")}, "group.share must be a finite number, found inf"),
        ({"name": "three"}, "name must be one of one, two, found 'three'"),
    ],
)
def test_refused_values(values, text):
    with pytest.raises(ConfigurationError, match=text):
        configuration_from_values(Small, values)


@pytest.mark.parametrize("edge", [{"group.count": 1}, {"group.count": 9}, {"group.share": 0.0}, {"group.share": 1.0}])
def test_both_ends_of_a_range_are_allowed(edge):
    assert configuration_values(configuration_from_values(Small, edge)).items() >= edge.items()


@pytest.mark.parametrize("section", ["/**", "node", "/node", "/**/node"])
def test_file_is_ros_parameter_yaml(write, section):
    path = write(f"{section}:\n  ros__parameters:\n    name: two\n    group:\n      count: 4\n    group.share: 0.25\n")
    expected = Small(name="two", group=Group(count=4, share=0.25))
    assert load_configuration(path, Small, "node") == expected
    assert load_configuration(str(path), Small, "node") == expected


def test_other_nodes_are_passed_over_and_later_sections_win(write):
    path = write(
        "/**:\n  ros__parameters: {name: two, group.count: 4}\n"
        "node:\n  ros__parameters: {group.count: 5}\n"
        "other:\n  ros__parameters: {whatever: 1}\n"
    )
    assert load_configuration(path, Small, "node") == Small(name="two", group=Group(count=5))


def test_what_all_nodes_are_given_may_be_anothers(write, caplog):
    path = write(
        "/**:\n  ros__parameters: {nmae: two, frame_rate: 7, group.count: 4}\nnode:\n  ros__parameters: {name: two}\n"
    )
    assert load_configuration(path, Small, "node") == Small(name="two", group=Group(count=4))
    assert [record.getMessage() for record in caplog.records] == [
        f"{path}: passed over in section /**: unknown parameter 'nmae'; did you mean name?",
        f"{path}: passed over in section /**: unknown parameter 'frame_rate'",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected ROS parameter YAML"),
        ("- 1\n- 2\n", "expected ROS parameter YAML"),
        ("name: two\n", "section 'name' has no ros__parameters"),
        ("node:\n  name: two\n", "section 'node' has no ros__parameters"),
        ("node: {ros__parameters: {name: 1}}\n", "name must be a str"),
        ("node: {ros__parameters: {nmae: one}}\n", r"unknown parameter 'nmae'; did you mean name\?"),
        ("node: {ros__parameters: {group: {name: 1}}}\n", "unknown parameter 'group.name'"),
        ("/**: {ros__parameters: {nmae: one}}\nnode: {ros__parameters: {nmae: one}}\n", "unknown parameter 'nmae'"),
        ("/**: {ros__parameters: {name: three}}\n", "name must be one of one, two, found 'three'"),
        ("node: [unclosed\n", "cannot be read as YAML"),
        ("node: !!python/object/apply:os.getcwd []\n", "cannot be read as YAML"),  # safe loading only
    ],
)
def test_refused_files_are_named(write, text, message):
    path = write(text)
    with pytest.raises(ConfigurationError, match=message) as caught:
        load_configuration(path, Small, "node")
    assert str(caught.value).startswith(f"{path}: ")


def test_a_file_that_is_not_there_or_not_text(tmp_path):
    with pytest.raises(ConfigurationError, match=r"none\.yaml: cannot be read"):
        load_configuration(tmp_path / "none.yaml", Small)
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_configuration(binary, Small)


@pytest.mark.parametrize(
    "path", sorted(set(CONFIG.glob("*.yaml")) - {CONFIG / "catheters.yaml"}), ids=lambda path: path.name
)
def test_every_file_of_the_product_loads(path):
    table, node = {
        "overlay": (OverlayConfig, "lasso_overlay"),
        "web": (WebConfig, "lasso_web"),
        "igtl": (IgtlConfig, "lasso_igtl"),
    }.get(path.stem, (StreamConfig, "lasso_tracker"))
    assert isinstance(load_configuration(path, table, node), table)


def test_the_published_methods_file_names_the_parameters_of_its_method_only():
    (section,) = yaml.safe_load((CONFIG / "brost2009.yaml").read_text(encoding="utf-8")).values()
    named = section["ros__parameters"]
    assert named["method"] == "brost2009"
    assert set(named) == {"method", "polarity", "path", "model", "features", "registration"}
    defaults = configuration_values(TrackerConfig(method="brost2009"))
    for name in ("path", "model", "features", "registration"):
        assert {f"{name}.{key}" for key in named[name]} == {n for n in defaults if n.startswith(f"{name}.")}
    # As published: 400 × 400 of 1024 × 1024, ± 5 px.
    assert named["features"]["roi_px"] == 400
    assert named["registration"]["normal_search_px"] == 5
    # What the paper does not have is off.
    assert named["registration"]["tie_break"] == named["features"]["clipped_share"] == 0.0
    assert named["features"]["distance"] == "exact"
    assert named["model"]["candidate"] == "circular"


def test_a_file_of_the_published_method_may_set_the_stream_but_not_the_other_method(write):
    text = "lasso_tracker:\n  ros__parameters: {method: brost2009, sync.jitter_s: 0.01}\n"
    assert load_configuration(write(text), StreamConfig).sync.jitter_s == 0.01
    path = write(text.replace("sync.jitter_s: 0.01", "search: {near_mm: 5.0}"))
    with pytest.raises(ConfigurationError) as caught:
        load_configuration(path, StreamConfig)
    expected = "search.near_mm is a parameter of the method appearance, but method is brost2009"
    assert str(caught.value) == f"{path}: {expected}"
