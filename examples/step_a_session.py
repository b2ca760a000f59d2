"""Step a flight from Python: look at it, push it, change it, go back."""

import skyarm

session = skyarm.Session(skyarm.load_scenario("case3", controller="paper_ct", duration=6.0))
while session.time < 2.0:
    session.step()  # the scenario's own law
print("at 2 s:", session.state.position.z, session.measurement.joints)

before = session.snapshot()
hover = session.log.rotor_commands[-1]
for _ in range(20):  # a tenth of a second of commands from outside
    session.step(skyarm.Command(rotor_speeds=tuple(1.02 * hover), efforts=(0.0, 0.0)))
print("pushed:", session.state.position.z)

session.restore(before)
session.change({"controller.gains.position.z": 12.0})  # three times as stiff in height
log = session.run()
print(log.status, log.position[-1])
