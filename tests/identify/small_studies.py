"""A small identification study as a file describes it."""

from __future__ import annotations

METRICS = (
    "joint_error_mean",
    "joint_error_max",
    "position_error_mean",
    "pitch_rms",
    "tau1_rms",
    "tau2_rms",
)
STUDY = """
schema = 1
name = "small"
seed = 2
rival_cells = ["joints"]
[loss]
width = 0.25
knee = 3.0
[search]
population = 16
generations = 10
[tables.short]
duration = 3.0
[tables.short.delays]
longest_command = 0.05
[tables.short.windows]
steady = [1.0, 3.0]
transient = [0.0, 3.0]
gust = [1.0, 3.0]
hover = [0.0, 1.0]
holds = [[1.0, 3.0]]
last = 1.0
[tables.late.delays]
measurement = 0.01
[[flights]]
name = "sines"
scenario = "case2"
over = ["short"]
[flights.cells]
CELLS
[groups]
joints = ["sines/joint_*", "sines/tau*"]
rest = ["*/*", "!sines/joint_*", "!sines/tau*"]
[[parameters]]
name = "friction"
words = "friction of joint 1"
unit = "N m s/rad"
low = 0.0
high = 0.1
step = 0.001
targets = [{ flights = ["*"], path = "plant.vehicle.links.0.joint.damping" }]
[[parameters]]
name = "late"
words = "rotor commands late by"
unit = "s"
low = 0.0
high = 0.03
step = 0.001
targets = [{ flights = ["*"], path = "delays.rotors" }]
[[parameters]]
name = "stiffness"
words = "stiffness of joint 1"
low = 100.0
high = 600.0
step = 10.0
targets = [{ flights = ["*"], path = "controller.joint_gains.stiffness.0" }]
[[choices]]
name = "clock"
words = "when the motion begins"
[[choices.options]]
name = "stated"
[[choices.options]]
name = "early"
words = "from 0.5 s"
sets = [
    { flights = ["sines"], path = "reference.joints.0.start", value = 0.5 },
    { flights = ["sines"], path = "reference.joints.1.start", value = 0.5 },
]
[[choices]]
name = "measured"
words = "age of the measurement"
[[choices.options]]
name = "at_once"
[[choices.options]]
name = "late"
tables = [{ flights = ["*"], table = "late" }]
[fit]
free = ["friction", "late"]
choices = { clock = "early" }
[[ladder]]
name = "motion"
adds = ["clock"]
[[ladder]]
name = "all"
adds = ["friction", "late"]
[[rivals]]
name = "stiffness"
words = "stiffness"
adds = ["stiffness"]
[[rivals]]
name = "measured"
words = "late measurements"
choices = { measured = "late" }
[[predictions]]
name = "from_joints"
free = ["friction", "late"]
choices = { clock = "early" }
seen = "joints"
unseen = ["rest"]
"""
THICK = """
[[choices]]
name = "oil"
[[choices.options]]
name = "thin"
[[choices.options]]
name = "thick"
sets = [{ flights = ["*"], path = "plant.vehicle.links.1.joint.damping", value = 0.05 }]
"""
