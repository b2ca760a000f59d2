# %% [markdown]
# # First flight
#
# The paper's Case 3 by two laws, and what the arm costs them.

# %%
import numpy as np

import skyarm

logs = {law: skyarm.run(skyarm.load_scenario("case3", controller=law)) for law in ("paper_pd", "paper_ct")}
for law, log in logs.items():
    steady = (log.time >= 10.0) & (log.time < 20.0)
    error = np.linalg.norm(log.tip - log.tip_reference, axis=1)[steady]
    print(f"{law}: {log.status}, tip {1000 * error.mean():.1f} mm in the mean")

# %% [markdown]
# Position, joints, attitude and rotor speeds of the second, its references dotted:

# %%
skyarm.plot(logs["paper_ct"])

# %% [markdown]
# Where the errors come from is in the log, too. The baseline leans with every swing of the arm, because it does not
# know of it; the coupled law moves the rotors before the arm has pushed.

# %%
for law, log in logs.items():
    steady = (log.time >= 10.0) & (log.time < 20.0)
    print(f"{law}: pitch {1000 * log.euler[steady, 1].std():.1f} mrad RMS about its mean")
