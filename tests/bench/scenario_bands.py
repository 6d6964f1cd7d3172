#!/usr/bin/env python3
"""Writes the bands of tests/golden/scenarios: python3 scenario_bands.py BIN_FOLDER -o FOLDER

Localizes the race of tests/apps/scenarios_test.cpp with other seeds under each scenario, and writes NAME.csv: of each figure
the mean over the seeds plus and minus four standard deviations, not beyond what the project set itself. The test's own
seed (7) is not among them, so nothing is copied from what is tested.
"""
import argparse
import pathlib
import statistics

import drives

SEEDS = range(21, 31)
FIX = 5  # outputs between two fixes: a state may turn one fix sooner or later on another machine
SCENARIOS = {  # name: (words, largest rmse in the plane, largest error in the plane [m])
    "clean": ("Nothing is wrong", 0.10, 0.30),
    "one_gnss_bad": ("10 m of noise on gps_left from 5 to 10 s", 0.12, 0.30),
    "two_gnss_bad": ("10 m of noise on both receivers from 5 to 10 s", 0.30, 0.90),
    "lidar_bad": ("99 of 100 points are drops of rain from 5 to 10 s", 0.12, 0.30),
    "gap": ("No fix and no scan from 5 to 7 s", 0.30, 0.60),
    "late_data": ("Fixes and scans come 0.3 s late from 5 to 10 s", 0.12, 0.30),
}
FIGURES = ("/errors/position_plane_m/rmse", "/errors/position_plane_m/max", "/errors/heading_deg/rmse",
           "/integrity/states/0", "/integrity/states/1", "/integrity/states/2", "/integrity/states/3")


def at(figures, pointer):
    for key in pointer.split("/")[1:]:
        figures = figures[int(key) if isinstance(figures, list) else key]
    return figures


def band(values, least_spread, largest):
    mean, spread = statistics.mean(values), max(4 * statistics.stdev(values), least_spread)
    return max(0.0, mean - spread), min(largest, mean + spread)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("-o", dest="folder", type=pathlib.Path, required=True)
    args = parser.parse_args()
    apps = drives.Drives(args.bin, args.folder)
    golden = drives.ROOT / "tests/golden/scenarios"
    devices = "lidar_front gps_* imu vehicle"
    chart = apps.map_of(apps.simulate("survey", "lor", "--top-speed", 30, "--laps", 2.1, devices=devices))
    for name, (words, rmse_m, max_m) in SCENARIOS.items():
        runs = []
        for seed in SEEDS:
            race = apps.simulate(f"race_{seed}", "lor", "--laps", 0.4, devices=devices, seed=seed)
            log = race if name == "clean" else apps.inject(race, f"{name}_{seed}", golden / f"{name}.ini")
            tum = apps.localize(f"{name}_{seed}_out", chart, log)
            runs.append(apps.figures(drives.truth_of(race), tum, "--integrity", tum.with_name(f"{tum.stem}_own.csv")))
        largest = {FIGURES[0]: rmse_m, FIGURES[1]: max_m}
        lines = [f"# {words}. Bands: mean of {len(SEEDS)} seeds ({SEEDS[0]} to {SEEDS[-1]}) -+ 4 standard deviations, at most the "
                 f"project's {rmse_m:.2f} m rmse,",
                 f"# {max_m:.2f} m largest. States: outputs that are ok, degraded, dead reckoning, lost, of 15 s at 100 Hz, "
                 f"-+ {FIX} at least.", "# Made by tests/bench/scenario_bands.py.", "figure,low,high"]
        for pointer in FIGURES:
            low, high = band([at(run, pointer) for run in runs], FIX if "states" in pointer else 0,
                             largest.get(pointer, float("inf")))
            lines.append(f"{pointer},{low:.4g},{high:.4g}")
        (golden / f"{name}.csv").write_text("\n".join(lines) + "\n")
        print("\n".join([name, *lines]), flush=True)


if __name__ == "__main__":
    try:
        main()
    except drives.Failed as failed:
        raise SystemExit(str(failed)) from None
