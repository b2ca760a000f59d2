"""One example for each public name, as doctest: shown on its page of the API, and run
by a test where it is cheap.
"""

from __future__ import annotations

import re

PREPARED = """
>>> import dataclasses
>>> import numpy as np
>>> import skyarm
>>> vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
>>> scenario = skyarm.load_scenario("case3", controller="paper_ct", duration=0.1)
>>> pose = [0, 0, 1], [1, 0, 0, 0], [0.3, 0.0]  # position, quaternion wxyz, joints
>>> rates = [0, 0, 0, 0, 0, 0, 0.1, 0.0]  # velocity (world), body rate, joint rates
"""
"""Names that the examples use."""

TEXT = """
## Air
>>> class Breeze(skyarm.Air):
...     def velocity(self, memory, t, position_W):
...         return skyarm.Vec3(2.0, 0.0, 0.0)  # m/s, world axes

## Batch
>>> batch = skyarm.Batch(  # doctest: +SKIP
...     scenario, ["plant.payload.mass"], metrics=["ee_error_mean"]
... )
>>> outcome = batch.fly(  # doctest: +SKIP
...     {"plant.payload.mass": np.linspace(0.0, 0.1, 64)}
... )

## Body
>>> skyarm.Body(mass=0.7, inertia=[0.007, 0.007, 0.012]).mass
0.7

## Change
>>> change = skyarm.Change(at=0.05, path="environment.wind.force.x", value=2.0)
>>> windy = skyarm.load_scenario("case3_wind")
>>> dataclasses.replace(windy, changes=(change,)).changes[0].at
0.05

## Command
>>> # rad/s; N m or N
>>> skyarm.Command(rotor_speeds=(480.0,) * 4, efforts=(0.0, 0.0)).efforts
(0.0, 0.0)

## Constant
>>> skyarm.Constant(value=0.3).derivatives(2.0)[0]
0.3

## Contact
>>> world = skyarm.Contact(surfaces=(skyarm.Surface(name="ground"),), points=())
>>> world.surfaces[0].shape
'plane'

## ContactPoint
>>> skyarm.ContactPoint(name="front", body="base", position=[0.15, 0, -0.12]).radius
0

## Controller
>>> scenario.controller.name
'hybrid_computed_torque'

## Delays
>>> # s
>>> dataclasses.replace(scenario, delays=skyarm.Delays(command=0.003)).delays.command
0.003

## Drive
>>> class Spring(skyarm.Drive):
...     def effort(self, memory, setpoint, position, rate):
...         return 8.0 * (setpoint - position) - 0.1 * rate  # N m

## Ending
>>> class TooHigh(skyarm.Ending):
...     status = "too_high"
...     def fine(self, scenario, state, goal, slack):
...         return state.position.z <= 3.0 - slack

## Estimator
>>> class Raw(skyarm.Estimator):
...     def start(self, vehicle):
...         return ()
...     def step(self, memory, readings, command, dt):
...         return memory, readings["state"]

## Fault
>>> fault = skyarm.Fault(rotor="front", effectiveness=0.9, start=5.0)
>>> fault.effectiveness
0.9

## Force
>>> class Pull(skyarm.Force):
...     def wrenches(self, memory, t, motion, rotor_speeds):
...         tip, link = motion.frame()
...         down = skyarm.Vec3(0.0, 0.0, -1.0)
...         return (skyarm.Wrench(force_W=down, point=tip, body=link),)

## ForceWind
>>> windy = dataclasses.replace(
...     scenario, wind=skyarm.ForceWind(force_W=[2.0, 0.0, 0.0])
... )  # N, world axes

## Frame
>>> skyarm.Frame(name="tip", link=0, position=[0, 0, -0.2]).name
'tip'

## Gust
>>> gust = skyarm.Gust(
...     peak=[2.0, 0.0, 0.0], start=3.0, duration=2.0, shape="one_minus_cosine"
... )
>>> float(gust.at(4.0).x)
2.0

## HangingPayload
>>> skyarm.HangingPayload(mass=0.2, pick=1.0, drop=3.0, cord=0.5).cord  # m
0.5

## Joint
>>> skyarm.Joint(
...     name="shoulder", axis=[0, 1, 0], position=[0, 0, -0.02], effort_limit=0.5
... ).kind
'revolute'

## JointDrive
>>> skyarm.JointDrive(joint="joint2", drive=skyarm.Drive()).joint
'joint2'

## Link
>>> joint = skyarm.Joint(name="shoulder", axis=[0, 1, 0], position=[0, 0, 0])
>>> # -1: the base
>>> skyarm.Link(name="arm", parent=-1, joint=joint, body=skyarm.Body(mass=0.05)).parent
-1

## Log
>>> log = skyarm.run(scenario)
>>> log.position.shape, log.units["position"].unit  # a row a control period
((20, 3), 'm')

## LogFormat
>>> def write(log, path):
...     np.savetxt(path, log.position)
...     return path
>>> text = skyarm.LogFormat(write)

## Mat3
>>> np.array(skyarm.Quaternion(1.0, 0.0, 0.0, 0.0).rotation()).shape
(3, 3)

## Material
>>> skyarm.Material(stiffness=5000.0, friction=0.6).friction
0.6

## Measurement
>>> session = skyarm.Session(scenario)
>>> len(session.measurement.joints)
2

## Metric
>>> class Highest(skyarm.Metric):
...     def start(self):
...         return (0.0,)
...     def count(self, memory, now):
...         return (skyarm.algebra.scalars.maximum(memory[0], now.state.position.z),)
...     def result(self, memory, instants, period):
...         return memory[0]

## Mixer
>>> len(skyarm.make_mixer(vehicle).inverse)  # a row for each rotor
4

## Model
>>> skyarm.Model(vehicle=vehicle, gravity=9.81).gravity  # m/s^2
9.81

## MovingAir
>>> breeze = dataclasses.replace(
...     scenario, wind=skyarm.MovingAir(velocity_W=[3.0, 0.0, 0.0])
... )  # m/s, world axes

## NamedSensor
>>> class Clock(skyarm.Sensor):
...     pass
>>> skyarm.NamedSensor(name="clock", sensor=Clock()).name
'clock'

## Payload
>>> # kg at the tip
>>> loaded = dataclasses.replace(scenario.plant, vehicle=vehicle.with_payload(0.05))
>>> round(float(loaded.vehicle.mass - vehicle.mass), 3)
0.05

## Plan
>>> found = skyarm.plan(skyarm.load_task("eagle_catch_free"))  # doctest: +SKIP
>>> found.t.shape, found.x.shape, found.u.shape  # doctest: +SKIP
((81,), (81, 28), (80, 9))

## Quaternion
>>> q = skyarm.Quaternion(1.0, 0.0, 0.0, 0.0)  # wxyz, body to world
>>> np.array(q).tolist()
[1.0, 0.0, 0.0, 0.0]

## Ramp
>>> skyarm.Ramp(start=1.0, duration=2.0, height=0.5).derivatives(9.0)[0]
0.5

## Rates
>>> skyarm.Rates(physics=1000, control=200, reference=50).control  # Hz
200

## Reach
>>> bool(
...     skyarm.Reach(within=0.05, of=[0.0, 0.0, 0.5]).holds(skyarm.Vec3(0.0, 0.02, 0.5))
... )
True

## Reference
>>> np.array(scenario.reference.at(0.0).position).shape  # m, world axes
(3,)

## Rotor
>>> skyarm.Rotor(
...     name="front",
...     position=[0.17, 0, 0],
...     direction=-1,
...     thrust_coefficient=8.5e-6,
...     moment_coefficient=0.016,
... ).direction  # -1: clockwise seen against the axis
-1

## Scenario
>>> dataclasses.replace(scenario, seed=7, duration=1.0).seed
7

## ScenarioError
>>> skyarm.load_scenario("case9")
Traceback (most recent call last):
skyarm.scenario.scenario_record.ScenarioError: ...

## Sensor
>>> class Height(skyarm.Sensor):
...     frequency = 20.0  # Hz
...     def measure(self, memory, t, state, specific_force, draws, dt):
...         return memory, state.position.z

## SensorNoise
>>> # m, standard deviation
>>> noisy = dataclasses.replace(scenario, noise=skyarm.SensorNoise(position=0.002))

## Session
>>> session = skyarm.Session(scenario)
>>> while session.step():
...     pass
>>> session.run().status
'completed'

## Sine
>>> skyarm.Sine(amplitude=0.4, frequency_hz=0.5).derivatives(0.5)[0]
0.4

## State
>>> np.array(skyarm.Session(scenario).state.position).shape  # m, world axes
(3,)

## StudyError
>>> skyarm.load_study("nothing")
Traceback (most recent call last):
skyarm.studies.sweep.study.StudyError: ...

## Surface
>>> skyarm.Surface(
...     name="wall", shape="box", size=[0.1, 2.0, 0.9], position=[0.3, 0.0, 0.45]
... ).shape
'box'

## Task
>>> task = skyarm.load_task("eagle_catch")
>>> slower = dataclasses.replace(
...     task, limits=dataclasses.replace(task.limits, joint_rate=2.0)
... )
>>> slower.limits.joint_rate  # rad/s
2.0

## Team
>>> skyarm.Team(object="bar", mass=1.6).columns[0][:3]
('team_position_error', 'bar', 'm')

## TimedPayload
>>> load = skyarm.TimedPayload(name="parcel", mass=0.3, pick=8.0, drop=14.0)  # kg, s
>>> dataclasses.replace(scenario, payloads=(load,)).payloads[0].mass
0.3

## Trajectory
>>> skyarm.hover([0, 0, 1], joints=[0.3, 0.0]).at(1.0).joints
(0.3, 0.0)

## Truth
>>> skyarm.Truth(vehicle=vehicle, gravity=9.8).gravity  # the simulated plant
9.8

## Vec3
>>> v = skyarm.Vec3(1.0, 2.0, 2.0)
>>> float(v.norm())
3.0

## Vehicle
>>> vehicle.n, len(vehicle.rotors), round(float(vehicle.mass), 5)
(2, 4, 0.82103)

## VehicleError
>>> skyarm.load_vehicle("nothing")
Traceback (most recent call last):
skyarm.vehicle.check.VehicleError: ...

## Windows
>>> skyarm.Windows(last=5.0).last  # s
5.0

## Wrench
>>> skyarm.Wrench(force_W=skyarm.Vec3(0.0, 0.0, -1.0)).body  # -1: the base
-1

## center_of_mass
>>> skyarm.center_of_mass(vehicle, *pose).shape  # m, world axes
(3,)

## check
>>> skyarm.check("case3").flies  # or a record, a vehicle, a path  # doctest: +SKIP

## check_law
>>> model = skyarm.Model(vehicle=vehicle)
>>> skyarm.check_law(  # doctest: +SKIP
...     lambda model: skyarm.make_controller("decoupled_pd", model)
... )

## circle
>>> path = skyarm.circle(radius=0.3, frequency_hz=0.08, center=[0, 0, 1])
>>> np.array(path.at(0.0).position).round(3).tolist()
[0.3, 0.0, 1.0]

## compare
>>> results = skyarm.compare(  # doctest: +SKIP
...     "case3", ["paper_pd", "centroidal_tip"], "out/case3"
... )
>>> print(results.report.markdown())  # doctest: +SKIP

## energy
>>> bool(skyarm.energy(vehicle, *pose, rates) > 0.0)  # J
True

## film
>>> skyarm.film(skyarm.run(scenario), "flight.viser")  # doctest: +SKIP

## fly_sweep
>>> rows = skyarm.fly_sweep("robustness", "out/robustness")  # doctest: +SKIP

## forward_dynamics
>>> tau = skyarm.inverse_dynamics(vehicle, *pose, rates, [0] * 8)
>>> bool(
...     np.allclose(skyarm.forward_dynamics(vehicle, *pose, rates, tau), 0.0, atol=1e-9)
... )
True

## frame_jacobian
>>> skyarm.frame_jacobian(vehicle, *pose).shape[-1]  # of [v_W, w_B, joint rates]
8

## frame_pose_world
>>> tip, R = skyarm.frame_pose_world(vehicle, *pose)
>>> np.round(tip, 3).tolist()  # m, world axes
[-0.089, 0.0, 0.713]

## govern
>>> calmer = skyarm.govern(scenario, tilt=0.3)  # doctest: +SKIP

## hover
>>> skyarm.hover([0, 0, 1], joints=[0.0, 0.0]).at(0.0).joints
(0.0, 0.0)

## hover_delay
>>> skyarm.hover_delay(scenario).enough  # doctest: +SKIP
True

## identify_flights
>>> found = skyarm.identify_flights(  # doctest: +SKIP
...     [skyarm.load_flight("flight.ulg")], vehicle
... )
>>> found["rotors.time_constant_up"].is_known  # doctest: +SKIP
True

## inverse_dynamics
>>> # N, N m; dual of [v_W, w_B, joint rates]
>>> skyarm.inverse_dynamics(vehicle, *pose, rates, [0] * 8).shape
(8,)

## list_scenarios
>>> "case3" in skyarm.list_scenarios()
True

## list_studies
>>> "robustness" in skyarm.list_studies()
True

## list_vehicles
>>> "hexarotor_arm6" in skyarm.list_vehicles()
True

## load_controller
>>> skyarm.load_controller(  # doctest: +SKIP
...     "tuned.toml", skyarm.Model(vehicle=vehicle)
... )

## load_flight
>>> flight = skyarm.load_flight("flight.ulg")  # doctest: +SKIP
>>> flight["gyro"].rate, list(flight)  # doctest: +SKIP

## load_log
>>> log = skyarm.load_log("out/run/case3.npz")  # doctest: +SKIP

## load_plugin
>>> module = skyarm.load_plugin("examples/own_wind.py")  # doctest: +SKIP

## load_scenario
>>> skyarm.load_scenario("case3", plant="mujoco", duration=2.0).kind
'mujoco'

## load_study
>>> skyarm.load_study("robustness").episodes
4000

## load_task
>>> [phase.name for phase in skyarm.load_task("eagle_catch").phases]
['approach', 'grasp', 'away']

## load_vehicle
>>> skyarm.load_vehicle("hexarotor_arm6").n  # joints
6

## make_controller
>>> skyarm.make_controller(
...     "indi", skyarm.Model(vehicle=vehicle), cutoff=20.0
... ).par.cutoff  # Hz
20.0

## make_mixer
>>> skyarm.make_mixer(vehicle, policy="priority").policy
'priority'

## margins
>>> hover = skyarm.margins(scenario, instants=1).instants[0]  # doctest: +SKIP
>>> hover.delay  # doctest: +SKIP

## mass_matrix
>>> # of [v_W, w_B, joint rates]; kg, kg m, kg m^2
>>> skyarm.mass_matrix(vehicle, *pose).shape
(8, 8)

## mix
>>> speeds, squares = skyarm.mix(
...     skyarm.make_mixer(vehicle), skyarm.Vec3(0.0, 0.0, 0.0), 8.0
... )  # N m, N
>>> [round(speed) for speed in speeds]  # rad/s
[484, 484, 484, 484]

## momentum
>>> # N s; N m s about the centre of mass, world axes
>>> skyarm.momentum(vehicle, *pose, rates).shape
(6,)

## normals
>>> len(skyarm.normals([0.2, 0.7, 0.4, 0.9]))  # as many as uniform numbers
4

## paper
>>> paper_vehicle = skyarm.load_vehicle("hummingbird_arm2")
>>> q = [0, 0, 1, 0.1, -0.2, 0.3, 0.5, -0.4]
>>> skyarm.paper.mass_matrix(paper_vehicle, q)[6:, 6:].round(6).tolist()
[[0.003193, 0.001147], [0.001147, 0.000525]]
>>> q_dot = [0, 0, 0, 0, 0, 0, 1.0, -0.5]
>>> matrix = skyarm.paper.coriolis_matrix(paper_vehicle, q, q_dot)
>>> matrix[6:, 6:].round(6).tolist()
[[-0.000131, 0.000131], [-0.000263, 0.0]]
>>> skyarm.paper.gravity_vector(paper_vehicle, q)[2:].round(3).tolist()  # N, N m
[7.907, 0.013, 0.026, 0.0, 0.026, -0.004]
>>> list(skyarm.paper.forward_kinematics(paper_vehicle, q))
['base', 'link1', 'link2', 'tip']

## plan
>>> skyarm.plan(skyarm.load_task("eagle_catch")).t[-1]  # s  # doctest: +SKIP
3.2

## plot
>>> figure = skyarm.plot(  # doctest: +SKIP
...     skyarm.run(scenario), "flight.png", kind="tip"
... )

## plot_sweep
>>> figure = skyarm.plot_sweep(  # doctest: +SKIP
...     "out/robustness", "ee_error_mean", "plant.vehicle.base.mass"
... )

## preset
>>> skyarm.preset("paper_pd", skyarm.Model(vehicle=vehicle)).name
'decoupled_pd'

## register
>>> @skyarm.register.air("calm_breeze")  # doctest: +SKIP
... class Calm(skyarm.Air):
...     pass

## replay
>>> log = skyarm.run(scenario)
>>> bool((skyarm.replay(log).position == log.position).all())
True

## reproduce
>>> skyarm.reproduce("out/paper")  # doctest: +SKIP

## run
>>> skyarm.run(scenario).status
'completed'

## save_log
>>> skyarm.save_log(skyarm.run(scenario), "flight.csv")  # doctest: +SKIP

## save_scenario
>>> lighter = skyarm.with_numbers(skyarm.load_scenario("case3"), {"plant.gravity": 9.7})
>>> skyarm.save_scenario("lighter.toml", lighter, "case3")  # doctest: +SKIP

## scenario_from
>>> skyarm.scenario_from(
...     {
...         "name": "x",
...         "duration": 1.0,
...         "plant": {"vehicle": "hummingbird"},
...         "controller": {"law": "rotors_sim_position"},
...     }
... ).duration
1.0

## score
>>> sorted(skyarm.score(skyarm.run(scenario), ["rotor_jitter"]))
['rotor_jitter']

## tune
>>> tuned = skyarm.tune("case3", "centroidal_tip")  # doctest: +SKIP
>>> skyarm.run(  # doctest: +SKIP
...     skyarm.load_scenario("case3").under(tuned.controller)
... ).status

## vehicle_drawing
>>> figure = skyarm.vehicle_drawing(vehicle, (0.3, -0.6))  # doctest: +SKIP

## with_numbers
>>> heavier = skyarm.with_numbers(scenario, {"plant.payload.mass": 0.05})
"""

EXAMPLES: dict[str, str] = dict(
    re.findall(r"^## (\w+)\n(.*?)\n(?=\n## |\Z)", TEXT, re.M | re.S)
)
"""Public name -> its example."""


def shown_example(name: str) -> str:
    """Markdown of the example of a public name; empty without one."""
    text = re.sub(r" *# doctest: \+SKIP", "", EXAMPLES.get(name, ""))
    return f"**Example**\n\n```python\n{text}\n```" if text else ""
