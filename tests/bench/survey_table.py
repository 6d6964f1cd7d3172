#!/usr/bin/env python3
"""The table of surveys: python3 survey_table.py BIN [--tracks lvms ims ...] [--only PATTERN] -o FOLDER

Simulates surveys of two laps and a bit at 45 m/s (seed 5), clean and with receivers that lie; on monza_like also one whose
GPS ends half-way round the first lap, and five laps with all LiDARs. Maps each, holds the key poses against the truth, and
prints a table in Markdown, which it writes as FOLDER/surveys.md. One after the other: what a map takes is measured. Logs that
are in FOLDER already are used again, maps are made anew.
"""
import argparse
import fnmatch
import json
import pathlib

import drives

SPANS = """[fault_01]
kind = gps_step
labels = gps_left
from_s = 20
to_s = 28
east_m = 5
north_m = 3
[fault_02]
kind = gps_noise
labels = gps_*
from_s = 45
to_s = 49
sigma_m = 10
[fault_03]
kind = gps_noise
labels = gps_right
from_s = 70
to_s = 78
sigma_m = 10
[fault_04]
kind = gps_step
labels = gps_*
from_s = 90
to_s = 93
east_m = -2
north_m = 2
up_m = 1
"""
INJECTED = {("gps_left", 20, 28), ("gps_left", 45, 49), ("gps_right", 45, 49), ("gps_right", 70, 78), ("gps_left", 90, 93),
            ("gps_right", 90, 93)}
WITHIN_S = 0.15  # an epoch and a half, at 10 Hz
BEGIN_S = 1.7e9  # kStartStamp_s of libs/sim
# From where on monza_like's receivers are silent: half-way round the first lap.
SILENT = """[fault_01]
kind = gps_outage
labels = gps_*
from_s = 65
"""
COLUMNS = ("key poses", "lateral [m]", "along [m]", "height [m]", "spans named", "other spans", "loops (refused)",
           "loops off, median [m]", "aligned [m]", "refined [m]", "walls [m]", "mapped in [s]", "of [s]", "peak [MiB]", "verdict")


def rows(tracks):
    """name: (track, what raceloc-sim is told, devices, faults or None)"""
    laps = ("--laps", 2.2, "--top-speed", 45)
    table = {}
    for track in tracks:
        table[track] = (track, laps, drives.DEVICES, None)
        table[f"{track}, receivers lie"] = (track, laps, drives.DEVICES, SPANS)
    if "monza_like" in tracks:
        table["monza_like, GPS ends after 65 s"] = ("monza_like", ("--laps", 2, "--top-speed", 45), drives.DEVICES, SILENT)
        table["monza_like, five laps, all LiDARs"] = ("monza_like", ("--laps", 5, "--top-speed", 45), "*", None)
    return table


def refused_spans(page):
    """(receiver, from, to), seconds of the log."""
    return {(span["receiver"], span["begin_s"] - BEGIN_S, span["end_s"] - BEGIN_S)
            for span in page["gps_spans"] if span["refused"]}


def is_injected(span):
    return any(span[0] == label and abs(span[1] - begin) <= WITHIN_S and abs(span[2] - end) <= WITHIN_S
               for label, begin, end in INJECTED)


def measured(apps, name, track, options, devices, faults):
    stem = drives.stem_of(name)
    log = truth_log = apps.simulate(drives.stem_of(" ".join(map(str, (track, *options, devices)))).strip("_"), track,
                                    *options, devices=devices, seed=5)
    if faults:
        ini = apps.folder / f"{stem}_faults.ini"
        ini.write_text(faults)
        log = apps.inject(log, stem, ini)
    chart, keys, cpu = (apps.folder / f"{stem}{end}" for end in (".rlmap", "_keys.tum", "_cpu.json"))
    apps.run(apps.bin / "raceloc-eval", "cpu", "--json", cpu, "--", apps.bin / "raceloc-map", "-c",
             drives.ROOT / "ini/map.ini", "--replace", "-o", chart, "--trajectory", keys, log)
    errors = apps.figures(drives.truth_of(truth_log), keys)["errors"]
    page, usage = (json.loads(path.read_text()) for path in (chart.with_suffix(".json"), cpu))
    refused = refused_spans(page)
    named = sum(map(is_injected, refused))
    rmse = [errors[f"{way}_m"]["rmse"] for way in ("lateral", "longitudinal", "height")]
    return (page["graph"]["key_poses"], *rmse, f"{named} of {len(INJECTED) if faults == SPANS else 0}",
            len(refused) - named, f"{len(page['loops'])} ({len(page['refused_loops'])})",
            page["loop_residual_m"], page["graph"]["aligned_rmse_m"], page["graph"]["refined_rmse_m"],
            page["map"]["wall_thickness_median_m"], round(usage["wall_s"], 1),
            round(sum(s["recorded_s"] for s in page["sessions"]), 1), round(usage["peak_rss_MiB"]),
            page["verdict"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("-o", dest="folder", type=pathlib.Path, required=True)
    parser.add_argument("--tracks", nargs="+", default=["lvms", "ims", "monza_like", "everland_like"])
    parser.add_argument("--only", default="*")
    args = parser.parse_args()
    apps = drives.Drives(args.bin, args.folder)
    table = drives.MarkdownTable(apps.folder / "surveys.md", COLUMNS)
    for name, row in rows(args.tracks).items():
        if not fnmatch.fnmatch(name, args.only):
            continue
        figures = measured(apps, name, *row)
        table.add(name, (f"{f:.3f}" if isinstance(f, float) and f < 10 else f for f in figures))


if __name__ == "__main__":
    try:
        main()
    except drives.Failed as failed:
        raise SystemExit(str(failed)) from None
