"""Record three periods of a flight as C arrays, which check an exported law."""

import dataclasses

import skyarm


def braces(record):
    """A record as C: {.time = 0.0, .position = {0.0, 0.0, 1.0}, ...}."""
    members = []
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if not hasattr(value, "__iter__"):
            members.append(f".{field.name} = {float(value)!r}")
        elif numbers := [repr(float(each)) for each in value]:
            members.append(f".{field.name} = {{{', '.join(numbers)}}}")
    return "{" + ", ".join(members) + "}"


scenario = skyarm.load_scenario("case3", duration=1.0)
controller, session = scenario.controller, skyarm.Session(scenario)
memory, period = controller.memory, 1.0 / scenario.rates.control
measured, desired = [], []
for _ in range(3):
    given = session.measurement, session.reference
    memory, command = controller.law(memory, *given, period, par=controller.par)
    print(f"{command.rotor_speeds[0]:.9f}")
    measured.append(braces(given[0]))
    desired.append(braces(given[1]))
    session.step()
with open("flown.h", "w") as file:
    arrays = {"measurement measured": measured, "reference desired": desired}
    for name, rows in arrays.items():
        print(f"static const struct case3_{name}[] = {{{', '.join(rows)}}};", file=file)
