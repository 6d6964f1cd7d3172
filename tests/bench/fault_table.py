#!/usr/bin/env python3
"""The table of sources that lie: python3 fault_table.py BIN TRACK.ini [--laps 2] [--seeds 11 12] [--only PATTERN]
[--jobs 1] -o FOLDER

Simulates a survey at 45 m/s and, with each seed, a race; makes the map; localizes the race with each row's fault; prints
a table in Markdown and writes it as FOLDER/table.md. Means over the seeds, worst of all. Logs and maps that are in FOLDER
already are used again. Needs numpy.
"""
import argparse
import fnmatch
import math
import pathlib
from concurrent.futures import ThreadPoolExecutor

import consistency
import drives
import numpy as np

COLUMNS = ("rmse in the plane [m]", "lateral", "along", "heading [deg]", "lateral p95", "heading p95", "worst [m]",
           "ok, degraded, dead reckoning, lost [%]", "above the protection level", "NEES")


def rows():
    """name: (sections of live.ini, fault file or None, what is switched off from the first second on)"""
    table = {name: (sections, None, disabled) for name, (sections, disabled) in drives.noise_rows().items()}
    for fault in ("gps_step_20m", "gps_ramp_0.5mps", "gps_both_receivers", "wheel_lock", "gps_outage", "lidar_off_2s",
                  "all_sources"):
        table[fault] = ({}, fault, "")
    return table


def localize(apps, chart, race, seed, name, sections, fault, disabled):
    stem = f"{drives.stem_of(name)}_{seed}"
    errors, own = apps.folder / f"{stem}_errors.csv", apps.folder / f"{stem}_own.csv"
    if not errors.exists():
        log = apps.inject(race, stem, drives.ROOT / f"ini/sim/faults/{fault}.ini") if fault else race
        sections = {"trial": {**sections.get("trial", {}), "noise_seed": seed}}
        tum = apps.localize(stem, chart, log, sections, ["--disable", disabled] if disabled else [])
        if fault:
            log.unlink()
        apps.figures(drives.truth_of(race), tum)
    return consistency.Run(errors, own)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("track", type=pathlib.Path)
    parser.add_argument("-o", dest="folder", type=pathlib.Path, required=True)
    parser.add_argument("--laps", type=float, default=2)
    parser.add_argument("--seeds", type=int, nargs="+", default=[11])
    parser.add_argument("--only", default="*")
    parser.add_argument("--jobs", type=int, default=1)
    args = parser.parse_args()
    apps = drives.Drives(args.bin, args.folder)
    survey = apps.simulate("survey", args.track, "--laps", 2.2, "--top-speed", 45, seed=5)
    chart = apps.map_of(survey)
    races = {seed: apps.simulate(f"race_{seed}", args.track, "--laps", args.laps, seed=seed) for seed in args.seeds}
    chosen = {name: row for name, row in rows().items() if fnmatch.fnmatch(name, args.only)}
    table = drives.MarkdownTable(args.folder / "table.md", COLUMNS)
    with ThreadPoolExecutor(args.jobs) as pool:
        runs = {name: [pool.submit(localize, apps, chart, race, seed, name, *row) for seed, race in races.items()]
                for name, row in chosen.items()}
        for name, futures in runs.items():
            done = [future.result() for future in futures]
            e = np.vstack([d.errors for d in done])
            rms = np.sqrt(np.mean(e**2, axis=0))
            plane = np.hypot(e[:, 0], e[:, 1])
            p95 = np.percentile(np.abs(e), 95, axis=0)
            states = sum(d.states for d in done) * 100 / sum(d.states.sum() for d in done)
            beyond = sum(np.count_nonzero(d.beyond.any(axis=1)) for d in done)
            nees = np.mean(np.concatenate([d.nees for d in done]))
            table.add(name, (f"{np.sqrt(np.mean(plane**2)):.3f}", f"{rms[1]:.3f}", f"{rms[0]:.3f}", f"{math.degrees(rms[2]):.3f}",
                             f"{p95[1]:.3f}", f"{math.degrees(p95[2]):.3f}", f"{plane.max():.3f}",
                             ", ".join(f"{s:.1f}" for s in states), f"{beyond} of {len(e)}", f"{nees:.2f}"))


if __name__ == "__main__":
    try:
        main()
    except drives.Failed as failed:
        raise SystemExit(str(failed)) from None
