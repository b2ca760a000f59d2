# %% [markdown]
# # A law of your own
#
# An LQR for position, attitude and joints, from the examples, against the paper's law: first its gains, then its
# flight, then a wrong belief.

# %%
import dataclasses
import importlib.util
from pathlib import Path

import numpy as np

import skyarm

ROOT = next(p for p in Path(skyarm.__file__).parents if (p / "examples").is_dir())
spec = importlib.util.spec_from_file_location("own_law", ROOT / "examples" / "own_law.py")
own_law = importlib.util.module_from_spec(spec)
spec.loader.exec_module(own_law)

scenario = skyarm.load_scenario("case3", controller="paper_ct")
model = scenario.controller.par.model


def tip_error(scenario):
    log = skyarm.run(scenario)
    steady = (log.time >= 10.0) & (log.time < 20.0)
    return 1000 * np.linalg.norm(log.tip - log.tip_reference, axis=1)[steady].mean()


# %% [markdown]
# The weight on position errors is an argument of the maker. More weight, less error, until rotors saturate:

# %%
for weight in (4.0, 16.0, 64.0):
    law = own_law.make_lqr(model, weight=weight)
    error = tip_error(dataclasses.replace(scenario, controller=law))
    print(f"weight {weight:g}: gains {law.par.base[0]:.1f}, {law.par.base[1]:.1f}; tip {error:.1f} mm")

# %% [markdown]
# What a law believes is a record. Here both laws believe in an arm whose second link weighs nothing:

# %%
links = list(model.vehicle.links)
light = dataclasses.replace(links[1], body=dataclasses.replace(links[1].body, mass=0.001))
wrong = dataclasses.replace(model, vehicle=dataclasses.replace(model.vehicle, links=(links[0], light)))
for name, law in (("own", own_law.make_lqr(wrong)), ("paper's", skyarm.preset("paper_ct", wrong))):
    print(f"{name}: {tip_error(dataclasses.replace(scenario, controller=law)):.0f} mm")
