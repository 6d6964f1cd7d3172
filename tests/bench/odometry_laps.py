#!/usr/bin/env python3
"""Odometry over many laps: python3 odometry_laps.py BIN [--laps 10] [--seeds 1 2 3 4 5] [--jobs 1] -o FOLDER

Simulates lvms (up to 244 km/h) and monza_like (up to 200 km/h) with one LiDAR and no GPS, runs the odometry, and prints a table in
Markdown, which it writes as FOLDER/laps.md: how many scans were trusted, drift over 20 to 100 m after rigid alignment, peak
memory. Logs are deleted when they have been used.
"""
import argparse
import pathlib
import re
from concurrent.futures import ThreadPoolExecutor

import drives

TRACKS = {"lvms": (), "monza_like": ("--top-speed", 55.6)}
LENGTHS_M = (20, 40, 80, 100)
COLUMNS = ("km", "scans trusted", *(f"drift over {length} m [%]" for length in LENGTHS_M), "peak [MiB]")


def measured(apps, track, laps, seed):
    name = f"{track}_{laps:g}_{seed}"
    log = apps.simulate(name, track, "--laps", laps, *TRACKS[track], devices="lidar_front imu* vehicle*", seed=seed)
    tum = apps.folder / f"{name}_odometry.tum"
    said = apps.said(apps.folder / f"{name}_odometry.txt", apps.bin / "raceloc-live", "-c", drives.ROOT / "ini/live.ini",
                     "--odometry-only", "-i", log, "--trajectory", tum)
    scans, trusted = re.search(r"(\d+) scans \((\d+) trusted", said).groups()
    figures = apps.figures(drives.truth_of(log), tum, "--align", "se3", "--segments", ",".join(map(str, LENGTHS_M)))
    log.unlink()
    drift = [segment["translation_percent"] for segment in figures["drift"]]
    return (figures["path_length_m"] / 1e3, f"{trusted} of {scans}", *drift,
            int(re.search(r"peak memory (\d+) MiB", said)[1]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("-o", dest="folder", type=pathlib.Path, required=True)
    parser.add_argument("--laps", type=float, default=10)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--jobs", type=int, default=1)
    args = parser.parse_args()
    apps = drives.Drives(args.bin, args.folder)
    table = drives.MarkdownTable(apps.folder / "laps.md", COLUMNS)
    with ThreadPoolExecutor(args.jobs) as pool:
        runs = {f"{track}, seed {seed}": pool.submit(measured, apps, track, args.laps, seed)
                for track in TRACKS for seed in args.seeds}
        for name, run in runs.items():
            table.add(name, (f"{value:.3f}" if isinstance(value, float) else value for value in run.result()))


if __name__ == "__main__":
    try:
        main()
    except drives.Failed as failed:
        raise SystemExit(str(failed)) from None
