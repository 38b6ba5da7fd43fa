"""The phantom: biplane fluoroscopy of a breathing, beating thorax with catheters, by line integrals, with exact truth.

Scenario (YAML) → motion, anatomy, catheters → optical depth per ray → imaging chain → pictures. Nothing here knows a
message; `lasso-motion synth` writes what the simulator yields into a recording.
"""

from lasso_motion_ros.phantom.scenario import available_scenarios, load_scenario, scenario_directory
from lasso_motion_ros.phantom.settings import Scenario
from lasso_motion_ros.phantom.simulator import SimulatedPair, Simulator, scenario_motion

__all__ = [
    "Scenario",
    "SimulatedPair",
    "Simulator",
    "available_scenarios",
    "load_scenario",
    "scenario_directory",
    "scenario_motion",
]
