"""The clinic suite: the same for the same seed, as wide as a lab, of every class."""

import dataclasses
import json
from collections import Counter
from functools import cache

import numpy as np
from support.clinic_inputs import STILL

from lasso_motion_ros.bench.suite.clinic_classes import CLASSES
from lasso_motion_ros.bench.suite.clinic_scenarios import ClinicScenario, clinic_scenario, clinic_scenarios
from lasso_motion_ros.bench.suite.random_scenarios import edge_on_deg
from lasso_motion_ros.bench.suite.scenario_changes import path_shutters
from lasso_motion_ros.phantom import Simulator, scenario_motion
from lasso_motion_ros.phantom.scenario import scenario_from_values


@cache
def suite() -> tuple[ClinicScenario, ...]:
    return clinic_scenarios(5)


def of_class(name: str) -> list[ClinicScenario]:
    found = [one for one in suite() if next(iter(one.since)) == name]
    assert found
    return found


def test_a_sequence_depends_on_seed_and_number_only() -> None:
    assert clinic_scenario(5, 3) == suite()[3]
    assert clinic_scenarios(5, 4) == suite()[:4]
    assert clinic_scenario(6, 3).scenario.seed != suite()[3].scenario.seed
    assert len({one.scenario.seed for one in suite()}) == len(suite()) == 120


def test_it_is_large_and_of_every_class() -> None:
    assert sum(one.scenario.pairs for one in suite()) >= 2500
    counts = Counter(name for one in suite() for name in one.since)
    assert set(counts) == set(CLASSES)
    assert min(counts.values()) >= 4
    assert 30 < sum(len(one.since) == 2 for one in suite()) < 90
    sizes = Counter(one.scenario.geometry.size_px for one in suite())
    assert sizes[512] > 3 * sizes[1024] > 0
    for one in suite():
        groups = [CLASSES[name].group for name in one.since if CLASSES[name].group]
        assert len(set(groups)) == len(groups)
        assert all(0 <= first < one.scenario.pairs - 1 for first in one.since.values())


def test_every_sequence_is_a_scenario_that_a_file_could_hold() -> None:
    for one in suite():
        assert scenario_from_values(json.loads(json.dumps(dataclasses.asdict(one.scenario)))) == one.scenario
        assert one.scenario.exact_place


def test_hearts_move_the_ring_any_way_and_strongly_where_plane_b_is_late_too() -> None:
    ways = np.array([one.scenario.heart.direction for one in suite()])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    np.testing.assert_allclose(np.linalg.eigvalsh(ways.T @ ways / len(ways)), 1.0 / 3.0, atol=0.1)
    late = [one.scenario for one in of_class("b_late")]
    assert max(one.heart.amplitude_mm for one in late) > 2.0


def test_lassos_are_as_wide_as_catalogues() -> None:
    lassos = [one.scenario.lasso for one in suite()]
    for name, low, high in (("electrodes", 8, 20), ("diameter_mm", 16.0, 30.0), ("turns", 0.86, 1.24)):
        values = [getattr(lasso, name) for lasso in lassos]
        assert min(values) <= low
        assert max(values) >= high
    assert {lasso.pair_spacing for lasso in lassos} == {0.25, 0.35, 0.5}
    assert len({lasso.electrodes for lasso in lassos}) > 5


def test_what_the_classes_put_in() -> None:
    assert all(one.scenario.ablation_work.works for one in of_class("ablation"))
    assert all(min(edge_on_deg(one.scenario, plane) for plane in range(2)) < 7.0 for one in of_class("edge_on"))
    assert all(2.0 <= one.scenario.heart.amplitude_mm <= 5.0 for one in of_class("heart"))
    assert all(one.scenario.plane_b_offset == 0.5 for one in of_class("b_late"))
    assert all(1.0 <= one.scenario.breathing.amplitude_mm <= 3.0 for one in of_class("jet"))
    assert all(28.0 <= one.scenario.breathing.amplitude_mm <= 40.0 for one in of_class("deep"))
    assert all(0.25 <= one.scenario.imaging.lag <= 0.5 for one in of_class("ghost"))
    for name, kinds in (("cough", {"cough"}), ("shift", {"shift"}), ("slide", {"slide"}), ("plane_off", {"off"})):
        for one in of_class(name):
            assert kinds <= {incident.kind for incident in one.scenario.incidents}
    for one in of_class("sigh"):
        motion = scenario_motion(one.scenario).breathing
        depths = [
            np.linalg.norm(motion.displacement(pair / one.scenario.rate_hz)) for pair in range(one.scenario.pairs)
        ]
        assert 1e3 * max(depths) > 20.0


def test_a_class_counts_from_its_beginning() -> None:
    drawn = ClinicScenario(STILL, {"cough": 4, "star": 0, "shift": 2})
    assert drawn.classes(1) == {"star"}
    assert drawn.classes(2) == {"star", "shift"}
    assert drawn.classes(9) == {"star", "shift", "cough"}
    assert ClinicScenario(STILL, {"slide": 2}).classes(1) == {"core"}


def test_a_cough_begins_at_the_pair_that_it_is_counted_from() -> None:
    for one in of_class("cough"):
        start = next(incident.start_s for incident in one.scenario.incidents if incident.kind == "cough")
        first = one.since["cough"]
        assert (first - 1) / one.scenario.rate_hz < start <= first / one.scenario.rate_hz


def test_shutters_leave_the_rings_way_open() -> None:
    left, top, right, bottom = path_shutters(STILL)
    line = Simulator(STILL).pairs().__next__().centrelines["a"] / 128.0
    assert line[:, 0].min() > left
    assert line[:, 1].min() > top
    assert line[:, 0].max() < 1.0 - right
    assert line[:, 1].max() < 1.0 - bottom
