#!/usr/bin/env python3
"""Absolute and relative errors of raceloc-eval against evo's (PyPI) on the same two files, to 1e-9 m and 1e-9 deg.

usage: evo_parity.py PATH_OF_RACELOC_EVAL
Exit status: 0 the figures agree, 1 they do not, 77 evo is not installed (skipped).
With evo in a virtual environment: cmake -DPython3_EXECUTABLE=VENV/bin/python ...
evo pairs equal stamps and does not interpolate, so the two files share theirs.
"""
import json
import math
import random
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    from evo.core import metrics
    from evo.tools import file_interface
except ImportError as missing:
    print(f"skipped: {missing}; `pip install evo` to run it")
    sys.exit(77)

TOLERANCE = 1e-9  # [m], [deg]
STEPS = (("1s", 10, metrics.Unit.frames), ("0.5s", 5, metrics.Unit.frames), ("10m", 10.0, metrics.Unit.meters),
         ("33.3m", 33.3, metrics.Unit.meters))  # 10 poses a second


def pose_line(stamp_s, xyz, yaw_rad):
    return f"{stamp_s:.6f} {xyz[0]:.4f} {xyz[1]:.4f} {xyz[2]:.4f} 0 0 {math.sin(yaw_rad / 2):.9f} {math.cos(yaw_rad / 2):.9f}\n"


def write_drive(truth, estimate):
    """400 m with bends and hills; the estimate is turned by 0.5 rad, moved by 50 m, and noisy."""
    rnd = random.Random(7)
    x, y, yaw = 0.0, 0.0, 0.3
    with open(truth, "w") as t, open(estimate, "w") as e:
        for i in range(400):
            stamp_s = 1317042651 + 0.1 * i
            z = 5 * math.sin(i / 40)
            t.write(pose_line(stamp_s, (x, y, z), yaw))
            c, s = math.cos(0.5), math.sin(0.5)
            noisy = (c * x - s * y + 50 + rnd.gauss(0, 0.2), s * x + c * y - 20 + rnd.gauss(0, 0.2), z + rnd.gauss(0, 0.1))
            e.write(pose_line(stamp_s, noisy, yaw + 0.5 + rnd.gauss(0, 0.01)))
            x, y, yaw = x + math.cos(yaw), y + math.sin(yaw), yaw + 0.03 * math.sin(i / 30)


def trajectories(truth, estimate, align):
    reference = file_interface.read_tum_trajectory_file(str(truth))
    estimated = file_interface.read_tum_trajectory_file(str(estimate))
    if align:
        estimated.align(reference, correct_scale=False)
    return reference, estimated


def evo_figures(pair):
    """Figures by what they are of: {("ATE", "m"): {"rmse": ...}, ("1s", "m"): ..., ("1s", "deg"): ...}"""
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data(pair)
    figures = {("ATE", "m"): ape.get_all_statistics()}
    for name, delta, unit in STEPS:
        for relation, symbol in ((metrics.PoseRelation.translation_part, "m"), (metrics.PoseRelation.rotation_angle_deg, "deg")):
            rpe = metrics.RPE(relation, delta, unit, pairs_from_reference=True)
            rpe.process_data(pair)
            figures[name, symbol] = rpe.get_all_statistics()
    return figures


def our_figures(program, truth, estimate, align, folder):
    out = folder / "figures.json"
    command = [program, "--truth", truth, "--estimate", estimate, "--json", out, "--align", "se3" if align else "none",
               "--rpe", ",".join(name for name, _, _ in STEPS)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    json_figures = json.loads(out.read_text())
    figures = {("ATE", "m"): json_figures["errors"]["position_3d_m"]}
    for (name, _, _), rpe in zip(STEPS, json_figures["rpe"], strict=True):
        figures[name, "m"], figures[name, "deg"] = rpe["translation_m"], rpe["rotation_deg"]
    return figures


def main():
    program = sys.argv[1]
    largest = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        truth, estimate = folder / "truth.tum", folder / "estimate.tum"
        write_drive(truth, estimate)
        for align in (False, True):
            evo = evo_figures(trajectories(truth, estimate, align))
            ours = our_figures(program, truth, estimate, align, folder)
            for of, symbol in evo:
                for key in ("rmse", "mean", "median", "std", "max"):
                    difference = abs(ours[of, symbol][key] - evo[of, symbol][key])
                    largest = max(largest, difference)
                    print(f"{'aligned' if align else 'as it is':9} {of:6} {key:6} ours {ours[of, symbol][key]:.12f}"
                          f" evo {evo[of, symbol][key]:.12f} difference {difference:.1e} {symbol}")
    print(f"largest difference {largest:.1e}")
    return 0 if largest <= TOLERANCE else 1


if __name__ == "__main__":
    sys.exit(main())
