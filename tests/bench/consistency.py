"""Whether the localizer's errors are what it says: python3 consistency.py ERRORS.csv INTEGRITY.csv

ERRORS.csv of `raceloc-eval --csv`, INTEGRITY.csv of `raceloc-live --integrity`. Prints the share of epochs in each
state, the epochs whose error is above the protection level, and the normalised estimation error squared of along,
across and heading (3 in the mean if the covariance is right), thinned to one epoch a second.
"""
import csv
import math
import sys

import numpy as np

errors = {round(float(r["stamp_s"]), 3): r for r in csv.DictReader(open(sys.argv[1]))}
states = {"0": "ok", "1": "degraded", "2": "dead reckoning", "3": "lost"}
counts, beyond, nees = {}, {"lateral": 0, "longitudinal": 0, "heading": 0}, []
matched, last_s = 0, -math.inf
for row in csv.DictReader(open(sys.argv[2])):
    stamp_s = float(row["stamp_s"])
    counts[states[row["state"]]] = counts.get(states[row["state"]], 0) + 1
    error = errors.get(round(stamp_s, 3))
    if error is None:
        continue
    matched += 1
    e = np.array([float(error["longitudinal_m"]), float(error["lateral_m"]), math.radians(float(error["heading_deg"]))])
    beyond["longitudinal"] += abs(e[0]) > float(row["protection_longitudinal_m"])
    beyond["lateral"] += abs(e[1]) > float(row["protection_lateral_m"])
    beyond["heading"] += abs(e[2]) > float(row["protection_heading_rad"])
    if stamp_s - last_s < 1:
        continue
    last_s = stamp_s
    xx, xy, xh, yy, yh, hh = (float(row[k]) for k in ("var_along_m2", "cov_along_across_m2", "cov_along_heading",
                                                      "var_across_m2", "cov_across_heading", "var_heading_rad2"))
    P = np.array([[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]])
    nees.append(e @ np.linalg.solve(P, e))
print(f"{matched} epochs matched;", ", ".join(f"{k} {v}" for k, v in sorted(counts.items())))
print("above the protection level:", ", ".join(f"{k} {v}" for k, v in beyond.items()))
print(f"NEES (3 in the mean): mean {np.mean(nees):.2f}, median {np.median(nees):.2f}, {len(nees)} epochs a second apart")
