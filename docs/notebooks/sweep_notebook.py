# %% [markdown]
# # A sweep and its picture
#
# How much load at the tip, of which the law does not know, does each law bear? 96 flights, one call.

# %%
import skyarm

study = {
    "schema": 1,
    "name": "load",
    "scenario": "case3",
    "controllers": ["paper_ct", "centroidal_joint"],
    "duration": 15.0,
    "episodes": 48,
    "design": "grid",
    "vary": {"plant.payload.mass": {"grid": [0.0, 0.1, 48]}},
    "windows": {"steady": [8.0, 15.0], "last": 4.0},
}
rows = skyarm.fly_sweep(study, "out/load", workers=1)
print(rows.count, "flights,", "complete" if rows.complete else "not complete")

# %% [markdown]
# A row is a flight; a column is a varied number or a metric.

# %%
from matplotlib.figure import Figure

figure = Figure(figsize=(6.4, 3.4), layout="constrained")
axes = figure.add_subplot()
for law in rows.controllers:
    axes.plot(1000 * rows.of(law, "plant.payload.mass"), 1000 * rows.of(law, "position_error_mean"), label=law)
axes.set_xlabel("load at the tip, g")
axes.set_ylabel("mean position error, mm")
axes.legend()
figure

# %% [markdown]
# The paper's law sinks by weight over stiffness; the centroidal law finds the load.

# %%
for law in rows.controllers:
    error = 1000 * rows.of(law, "position_error_mean")
    print(f"{law}: {error.min():.1f} to {error.max():.1f} mm")
