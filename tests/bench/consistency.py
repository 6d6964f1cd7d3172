"""Whether the localizer's errors are what it says: python3 consistency.py ERRORS.csv INTEGRITY.csv

ERRORS.csv of `raceloc-eval --csv`, INTEGRITY.csv of `raceloc-live --integrity`. Prints the share of epochs in each
state, the epochs whose error is above the protection level, and the normalised estimation error squared of along,
across and heading (3 in the mean if the covariance is right), thinned to one epoch a second.
"""
import csv
import math
import sys

import numpy as np

STATES = ("ok", "degraded", "dead reckoning", "lost")
LEVELS = ("longitudinal_m", "lateral_m", "heading_rad")
UPPER = ("var_along_m2", "cov_along_across_m2", "cov_along_heading_m_rad", "var_across_m2", "cov_across_heading_m_rad",
         "var_heading_rad2")


class Run:
    """errors: n x 3, along, across [m], heading [rad]; beyond: n x 3, above the protection level; nees: one a second;
    states: epochs in each of STATES."""

    def __init__(self, errors_path, integrity_path):
        with open(integrity_path) as file:
            own = {round(float(row["stamp_s"]), 3): row for row in csv.DictReader(file)}
        errors, beyond, nees, last_s = [], [], [], -math.inf
        with open(errors_path) as file:
            for row in csv.DictReader(file):
                stamp_s = float(row["stamp_s"])
                said = own.get(round(stamp_s, 3))
                if said is None:
                    continue
                e = np.array([float(row["longitudinal_m"]), float(row["lateral_m"]), math.radians(float(row["heading_deg"]))])
                errors.append(e)
                beyond.append([abs(x) > float(said["protection_" + k]) for x, k in zip(e, LEVELS)])
                if stamp_s - last_s < 1:
                    continue
                last_s = stamp_s
                P = np.zeros((3, 3))
                P[np.triu_indices(3)] = [float(said[k]) for k in UPPER]
                nees.append(e @ np.linalg.solve(P + np.triu(P, 1).T, e))
        self.errors, self.beyond, self.nees = np.array(errors), np.array(beyond), np.array(nees)
        self.states = np.bincount([int(row["state"]) for row in own.values()], minlength=len(STATES))


if __name__ == "__main__":
    run = Run(sys.argv[1], sys.argv[2])
    print(f"{len(run.errors)} epochs matched;", ", ".join(f"{k} {v}" for k, v in zip(STATES, run.states)))
    print("above the protection level:", ", ".join(f"{k} {v}" for k, v in zip(LEVELS, run.beyond.sum(axis=0))))
    print(f"NEES (3 in the mean): mean {np.mean(run.nees):.2f}, median {np.median(run.nees):.2f}, {len(run.nees)} epochs a "
          "second apart")
