# The public names and where each is defined: read by type checkers, and by
# __init__.py at the first use of a name.

from skyarm import paper as paper
from skyarm.algebra import Mat3 as Mat3
from skyarm.algebra import Quaternion as Quaternion
from skyarm.algebra import Vec3 as Vec3
from skyarm.algebra.scalars.philox import normals as normals
from skyarm.control.catalogue import Controller as Controller
from skyarm.control.catalogue import make_controller as make_controller
from skyarm.control.catalogue import preset as preset
from skyarm.control.model import Model as Model
from skyarm.dynamics import State as State
from skyarm.dynamics.actuators import Command as Command
from skyarm.dynamics.actuators import Mixer as Mixer
from skyarm.dynamics.actuators import make_mixer as make_mixer
from skyarm.dynamics.actuators import mix as mix
from skyarm.dynamics.actuators.drive import Drive as Drive
from skyarm.dynamics.array_front import (
    center_of_mass as center_of_mass,
)
from skyarm.dynamics.array_front import (
    energy as energy,
)
from skyarm.dynamics.array_front import (
    forward_dynamics as forward_dynamics,
)
from skyarm.dynamics.array_front import (
    frame_jacobian as frame_jacobian,
)
from skyarm.dynamics.array_front import (
    frame_pose_world as frame_pose_world,
)
from skyarm.dynamics.array_front import (
    inverse_dynamics as inverse_dynamics,
)
from skyarm.dynamics.array_front import (
    mass_matrix as mass_matrix,
)
from skyarm.dynamics.array_front import (
    momentum as momentum,
)
from skyarm.flight_data.flight_data import load_flight as load_flight
from skyarm.identify.identify_flights import identify_flights as identify_flights
from skyarm.log.flight_log import Log as Log
from skyarm.log.formats import LogFormat as LogFormat
from skyarm.log.formats import load_log as load_log
from skyarm.log.formats import save_log as save_log
from skyarm.log.metrics.metric import Metric as Metric
from skyarm.log.metrics.score import score as score
from skyarm.log.metrics.windows import Windows as Windows
from skyarm.paper.reproduce import reproduce as reproduce
from skyarm.planning.planner import Plan as Plan
from skyarm.planning.planner import plan as plan
from skyarm.planning.task import Task as Task
from skyarm.planning.task import load_task as load_task
from skyarm.plant.interface import Truth as Truth
from skyarm.records.registry import load_plugin as load_plugin
from skyarm.records.registry import register as register
from skyarm.reference import (
    Constant as Constant,
)
from skyarm.reference import (
    Ramp as Ramp,
)
from skyarm.reference import (
    Reference as Reference,
)
from skyarm.reference import (
    Sine as Sine,
)
from skyarm.reference import (
    Trajectory as Trajectory,
)
from skyarm.reference import (
    circle as circle,
)
from skyarm.reference import (
    hover as hover,
)
from skyarm.scenario.controller_table import load_controller as load_controller
from skyarm.scenario.endings import Ending as Ending
from skyarm.scenario.numbers import with_numbers as with_numbers
from skyarm.scenario.path_governor import govern as govern
from skyarm.scenario.save import save_scenario as save_scenario
from skyarm.scenario.scenario_file import (
    list_scenarios as list_scenarios,
)
from skyarm.scenario.scenario_file import (
    load_scenario as load_scenario,
)
from skyarm.scenario.scenario_file import (
    scenario_from as scenario_from,
)
from skyarm.scenario.scenario_record import (
    Change as Change,
)
from skyarm.scenario.scenario_record import (
    Delays as Delays,
)
from skyarm.scenario.scenario_record import (
    JointDrive as JointDrive,
)
from skyarm.scenario.scenario_record import (
    NamedSensor as NamedSensor,
)
from skyarm.scenario.scenario_record import (
    Rates as Rates,
)
from skyarm.scenario.scenario_record import (
    Scenario as Scenario,
)
from skyarm.scenario.scenario_record import (
    ScenarioError as ScenarioError,
)
from skyarm.sensing.estimate.estimator import Estimator as Estimator
from skyarm.sensing.measurement import Measurement as Measurement
from skyarm.sensing.measurement import SensorNoise as SensorNoise
from skyarm.sensing.sensor import Sensor as Sensor
from skyarm.simulate.batch import Batch as Batch
from skyarm.simulate.examine import check_law as check_law
from skyarm.simulate.loop import replay as replay
from skyarm.simulate.loop import run as run
from skyarm.simulate.session import Session as Session
from skyarm.studies.assess.assessment import check as check
from skyarm.studies.compare.compare_laws import compare as compare
from skyarm.studies.stability.flight_margins import margins as margins
from skyarm.studies.stability.hover_delay import hover_delay as hover_delay
from skyarm.studies.sweep.runner import fly_sweep as fly_sweep
from skyarm.studies.sweep.study import StudyError as StudyError
from skyarm.studies.sweep.study_file import list_studies as list_studies
from skyarm.studies.sweep.study_file import load_study as load_study
from skyarm.studies.sweep.sweep_figures import plot_sweep as plot_sweep
from skyarm.studies.tune.tuning import tune as tune
from skyarm.vehicle import (
    Body as Body,
)
from skyarm.vehicle import (
    Frame as Frame,
)
from skyarm.vehicle import (
    Joint as Joint,
)
from skyarm.vehicle import (
    Link as Link,
)
from skyarm.vehicle import (
    Rotor as Rotor,
)
from skyarm.vehicle import (
    Vehicle as Vehicle,
)
from skyarm.vehicle import (
    VehicleError as VehicleError,
)
from skyarm.vehicle.vehicle_files import list_vehicles as list_vehicles
from skyarm.vehicle.vehicle_files import load_vehicle as load_vehicle
from skyarm.view.figures.flight_plot import plot as plot
from skyarm.view.figures.vehicle_drawing import vehicle_drawing as vehicle_drawing
from skyarm.view.film.film_flights import film as film
from skyarm.world import (
    Air as Air,
)
from skyarm.world import (
    Fault as Fault,
)
from skyarm.world import (
    Force as Force,
)
from skyarm.world import (
    ForceWind as ForceWind,
)
from skyarm.world import (
    Gust as Gust,
)
from skyarm.world import (
    HangingPayload as HangingPayload,
)
from skyarm.world import (
    MovingAir as MovingAir,
)
from skyarm.world import (
    Payload as Payload,
)
from skyarm.world import (
    Reach as Reach,
)
from skyarm.world import (
    TimedPayload as TimedPayload,
)
from skyarm.world import (
    Wrench as Wrench,
)
from skyarm.world.contact import (
    Contact as Contact,
)
from skyarm.world.contact import (
    ContactPoint as ContactPoint,
)
from skyarm.world.contact import (
    Material as Material,
)
from skyarm.world.contact import (
    Surface as Surface,
)
from skyarm.world.team import (
    Team as Team,
)

__version__: str
