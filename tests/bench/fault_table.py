#!/usr/bin/env python3
"""The table of sources that lie: python3 fault_table.py BIN TRACK.ini [--laps 2] [--seeds 11 12] [--only PATTERN]
[--jobs 1] -o FOLDER

Simulates a survey at 45 m/s and, with each seed, a race; makes the map; localizes the race with each row's fault; prints
a table in Markdown and writes it as FOLDER/table.md. Means over the seeds, worst of all. Logs and maps that are in FOLDER
already are used again. Needs numpy.
"""
import argparse
import fnmatch
import itertools
import math
import pathlib
import re
import subprocess
from concurrent.futures import ThreadPoolExecutor

import consistency
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
DEVICES = "lidar_front imu* vehicle* gps_*"
SOURCES = ("gps_left", "gps_right", "scan_match")


def noise(labels, sigma_m, after_s=2):
    return {"noise_labels": " ".join(labels), "noise_m": sigma_m, "noise_after_s": after_s}


def rows():
    """name: (options of [trial], fault file or None, what is switched off from the first second on)"""
    table = {"clean": ({}, None, "")}
    for count in (1, 2, 3):
        for labels in itertools.combinations(SOURCES, count):
            for sigma_m in (5, 10):
                table[f"{sigma_m} m on {' and '.join(labels)}"] = (noise(labels, sigma_m), None, "")
    for label in SOURCES:
        others = " ".join(s for s in SOURCES if s != label).replace("scan_match", "lidar_*")
        table[f"{label} alone"] = ({}, None, others)
        for sigma_m in (5, 10):
            table[f"{sigma_m} m on {label} alone"] = (noise([label], sigma_m), None, others)
    for fault in ("gps_step_20m", "gps_ramp_0.5mps", "gps_both_receivers", "wheel_lock", "gps_outage", "lidar_off_2s",
                  "all_sources"):
        table[fault] = ({}, fault, "")
    return table


def run(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: {done.stderr.strip()}")
    return done.stdout


def with_section(text, section, values):
    """The ini with other values of keys that it has."""
    head, tail = text.split(f"[{section}]", 1)
    for key, value in values.items():
        tail, times = re.subn(rf"^{key} =.*$", f"{key} = {value}", tail, count=1, flags=re.MULTILINE)
        assert times == 1, key
    return f"{head}[{section}]{tail}"


def localize(bin_dir, folder, seed, name, trial, fault, disabled):
    stem = folder / f"{re.sub('[^a-z0-9.]+', '_', name)}_{seed}"
    ini, tum, own, errors = (stem.with_name(stem.name + end) for end in (".ini", ".tum", "_own.csv", "_errors.csv"))
    if not errors.exists():
        text = (ROOT / "ini/live.ini").read_text()
        ini.write_text(with_section(text, "trial", {**trial, "noise_seed": seed}))
        log = folder / f"race_{seed}.rawlog"
        if fault:
            log = stem.with_name(stem.name + ".rawlog")
            run(bin_dir / "raceloc-sim", "inject", "--faults", ROOT / f"ini/sim/faults/{fault}.ini", "-i",
                folder / f"race_{seed}.rawlog", "-o", log)
        run(bin_dir / "raceloc-live", "-c", ini, "-m", folder / "map.rlmap", "-i", log, "--trajectory", tum,
            "--integrity", own, *(["--disable", disabled] if disabled else []))
        if fault:
            log.unlink()
        run(bin_dir / "raceloc-eval", "--truth", folder / f"race_{seed}_truth.tum", "--estimate", tum, "--csv", errors)
    return consistency.Run(errors, own)


def prepare(args):
    args.folder.mkdir(parents=True, exist_ok=True)
    simulated = [args.bin / "raceloc-sim", "--track", args.track, "--car", ROOT / "ini/sim/indy.ini", "--devices",
                 DEVICES]
    chart = args.folder / "map.rlmap"
    if not chart.exists():
        survey = args.folder / "survey.rawlog"
        run(*simulated, "--laps", 2.2, "--top-speed", 45, "--seed", 5, "-o", survey)
        run(args.bin / "raceloc-map", "-c", ROOT / "ini/map.ini", "-o", chart, survey)
        survey.unlink()
    for seed in args.seeds:
        if not (args.folder / f"race_{seed}_truth.tum").exists():
            run(*simulated, "--laps", args.laps, "--seed", seed, "-o", args.folder / f"race_{seed}.rawlog")


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
    prepare(args)
    chosen = {name: row for name, row in rows().items() if fnmatch.fnmatch(name, args.only)}
    lines = ["| | rmse in the plane [m] | lateral | along | heading [deg] | lateral p95 | heading p95 | worst [m] | ok, "
             "degraded, dead reckoning, lost [%] | above the protection level | NEES |", "|" + "---|" * 11]
    print("\n".join(lines), flush=True)
    with ThreadPoolExecutor(args.jobs) as pool:
        runs = {name: [pool.submit(localize, args.bin, args.folder, seed, name, *row) for seed in args.seeds]
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
            lines.append(f"| {name} | {np.sqrt(np.mean(plane**2)):.3f} | {rms[1]:.3f} | {rms[0]:.3f} | "
                         f"{math.degrees(rms[2]):.3f} | {p95[1]:.3f} | {math.degrees(p95[2]):.3f} | {plane.max():.3f} | "
                         f"{', '.join(f'{s:.1f}' for s in states)} | {beyond} of {len(e)} | {nees:.2f} |")
            print(lines[-1], flush=True)
    (args.folder / "table.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
