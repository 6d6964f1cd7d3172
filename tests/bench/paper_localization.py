"""Tables of paper.py on localization and what comes when it fails: noise, first_day, recovery, navigation."""
import csv
import math
import re
import shutil
import subprocess

import drives
from drives import Failed, Row, Skipped, Table, stem_of, truth_of

KEEPS_OUT_M = 5.0  # the paper's delta: an error of a receiver that its gate has to find

# Bounds are the figures that the project set itself for localization (lvms at 225 km/h in the mean, ims): clean 0.10 m
# in the plane; one of three sources noisy at most 1.2 times that; two of three, or both receivers off, 0.30 m.
CLEAN_M, ONE_M, TWO_M = 0.10, 0.12, 0.30


def combined(runs):
    """Of several runs of raceloc-eval: rmse over all, worst of all, shares of the states."""
    epochs = sum(run["match"]["poses"] for run in runs)
    square = sum(run["match"]["poses"] * run["errors"]["position_plane_m"]["rmse"] ** 2 for run in runs)
    states = [sum(counts) for counts in zip(*(run["integrity"]["states"] for run in runs))]
    beyond = sum(run["integrity"][way]["misleading"] + run["integrity"][way]["hazardous"] for run in runs
                 for way in ("lateral", "longitudinal", "heading"))
    return {"rmse in the plane [m]": math.sqrt(square / epochs),
            "worst [m]": max(run["errors"]["position_plane_m"]["max"] for run in runs),
            "ok, degraded, dead reckoning, lost [%]": ", ".join(f"{100 * s / sum(states):.1f}" for s in states),
            "errors above the protection level": f"{beyond} of {3 * epochs}"}


class Localized:
    """The map of a track and what is driven on it."""

    def __init__(self, apps, name, track, survey_laps, **race):
        self.apps, self.name, self.track, self.survey_laps, self.race_options = apps, name, track, survey_laps, race

    def chart(self):
        return self.apps.map_of(self.apps.simulate(f"{self.name}_survey", self.track, "--laps", self.survey_laps,
                                                   "--top-speed", 45, seed=5))

    def race(self, seed):
        options = [word for key, value in self.race_options.items() for word in (f"--{key.replace('_', '-')}", value)]
        return self.apps.simulate(f"{self.name}_race_{seed}", self.track, *options, seed=seed)

    def figures(self, stem, race, log, sections=None, options=(), eval_options=()):
        tum = self.apps.localize(stem, self.chart(), log, sections, options)
        own = tum.with_name(f"{stem}_own.csv")
        return self.apps.figures(truth_of(race), tum, "--integrity", own, "--decisions",
                                 tum.with_name(f"{stem}_decisions.csv"), *eval_options)


def noise(course, quick, seeds):
    def measure(name, sections, disabled):
        runs = []
        for seed in seeds:
            race = course.race(seed)
            trial = {"trial": {**sections.get("trial", {}), "noise_seed": seed}}
            runs.append(course.figures(f"noise_{stem_of(name)}_{seed}", race, race, trial,
                                       ["--disable", disabled] if disabled else []))
        return combined(runs)

    def bounds(name, disabled):
        noisy = len(name.split(" and ")) if " on " in name else 0
        if disabled or noisy == 3:
            return {}
        return {"rmse in the plane [m]": (0, (CLEAN_M, ONE_M, TWO_M)[noisy])}

    quick_rows = ("clean", "10 m on gps_left", "10 m on scan_match", "10 m on gps_left and gps_right",
                  "10 m on gps_right and scan_match", "10 m on gps_left alone")
    rows = [Row(name, (3 if quick else 17) * len(seeds), lambda n=name, s=sections, d=disabled: measure(n, s, d),
                "" if disabled else "accuracy stays" if name != "clean" and name.count("and") < 2 else "",
                bounds(name, disabled))
            for name, (sections, disabled) in drives.noise_rows().items() if not quick or name in quick_rows]
    return Table("noise", "5 and 10 m of noise, all sources against each alone",
                 "LVMS at 225 km/h in the mean, 244 at most; noise of 5 and 10 m on two GPS and one LiDAR; a picture without "
                 "figures: with one or two of three bad the accuracy stays, a single one does not.",
                 f"simulated {course.track} at up to 249 km/h on the map of a survey at 45 m/s, indy car with one LiDAR, seeds "
                 f"{', '.join(map(str, seeds))}; noise from the third second on, the claim stays at centimetres; `alone`: "
                 "the other sources are off after the first second.",
                 ["rmse in the plane [m]", "worst [m]", "ok, degraded, dead reckoning, lost [%]",
                  "errors above the protection level"], rows)


def draw_over_way(picture, series):
    """A PNG of errors in the plane [m], logarithmic, over the way [km]; series: {title: ERRORS.csv of raceloc-eval}."""
    if not shutil.which("gnuplot"):
        raise Skipped("apt install gnuplot-nox")
    lines = ", ".join(f"'{path}' using (column('station_m')/1000):(column('position_plane_m')+1e-4) with lines lw 1 "
                      f"title '{title.replace('_', ' ')}'" for title, path in series.items())
    script = (f"set datafile separator ','; set terminal pngcairo size 1000,380; set output '{picture}'; set logscale y; "
              f"set yrange [0.001:100]; set autoscale xfix; set grid; set key outside top horizontal; set xlabel 'way [km]'; "
              f"set ylabel 'error in the plane [m]'; plot {lines}")
    done = subprocess.run(["gnuplot", "-e", script], capture_output=True, text=True)
    if done.returncode != 0:
        raise Failed(done.stderr.strip())


def first_day(apps, course, quick):
    shipped = drives.ROOT / "ini/sim/faults/gps_first_day.ini"
    picture = apps.folder / "first_day.png"
    columns = ["rmse in the plane [m]", "median [m]", "worst [m]", f"farther off than {KEEPS_OUT_M:g} m [% of the way]"]

    def measured(tum, figures):
        with open(tum.with_name(f"{tum.stem}_errors.csv")) as file:
            errors = [float(row["position_plane_m"]) for row in csv.DictReader(file)]
        plane = figures["errors"]["position_plane_m"]
        off = 100 * sum(e > KEEPS_OUT_M for e in errors) / len(errors)
        return dict(zip(columns, (plane["rmse"], plane["median"], plane["max"], off)))

    def receiver(name):
        race = course.race(13)
        folder = apps.folder / "first_day_receivers"
        tum = folder / f"{name}.tum"
        apps.run(apps.bin / "export_log", "receivers", apps.inject(race, "first_day", shipped), folder,
                 makes=folder / "gps_right.tum")  # the last that it writes
        return measured(tum, apps.figures(truth_of(race), tum))

    def estimate(stem, fault):
        race = course.race(13)
        figures = course.figures(f"{stem}_estimate", race, apps.inject(race, stem, fault))
        return measured(apps.folder / f"{stem}_estimate.tum", figures)

    def drawn():
        figures = estimate("first_day", shipped)
        for name in ("gps_left", "gps_right"):
            receiver(name)
        draw_over_way(picture, {"gps_left": apps.folder / "first_day_receivers/gps_left_errors.csv",
                                "gps_right": apps.folder / "first_day_receivers/gps_right_errors.csv",
                                "estimate": apps.folder / "first_day_estimate_errors.csv"})
        return figures

    def both_mounts():
        fault = apps.folder / "first_day_both.ini"
        fault.write_text(f"{shipped.read_text()}\n[fault_11]\nkind = gps_vibration\nlabels = gps_right\nfrom_s = 0\nto_s = 0\n"
                         "gain_m_per_mps2 = 0.12\ntime_constant_s = 0.5\n")
        return estimate("first_day_both", fault)

    about = 6 if quick else 100
    rows = [Row("gps_left", about, lambda: receiver("gps_left")), Row("gps_right", about, lambda: receiver("gps_right")),
            Row("estimate", about, drawn, "stays on the track", {columns[0]: (0, TWO_M)})]
    if not quick:
        rows.append(Row("estimate, gps_right drifts in corners too (0.12 m for each m/s^2)", about, both_mounts))
    where = "half a lap of lvms at 41 m/s" if quick else "five laps of ims at up to 41 m/s, 20 km"
    return Table("first_day", "degraded GNSS as on the first day at Indianapolis",
                 "IMS, 20 km: errors of both receivers over the way as a picture; often metres in the beginning, drifts in "
                 "corners; the estimate resilient throughout.",
                 f"simulated {where}, ini/sim/faults/gps_first_day.ini, seed 13.", columns, rows,
                 lambda: [("Errors of both receivers and of the estimate", picture.name)] if picture.exists() else [])


def recovery(apps, course, quick):
    from_s, to_s = (4, 8) if quick else (20, 30)

    def measure(share):
        race = course.race(12)
        stem = f"recovery_{share:g}"
        fault = apps.folder / f"{stem}.ini"
        fault.write_text(f"[fault_01]\nkind = lidar_spray\nlabels = lidar_*\nfrom_s = {from_s}\nto_s = {to_s}\n"
                         f"spray_share = {share:g}\nmin_m = 1\nmax_m = 30\n")
        log = apps.inject(race, f"{stem}_race", fault)
        figures = course.figures(stem, race, log)
        start_s = figures["truth"]["start_s"]
        with open(apps.folder / f"{stem}_decisions.csv") as file:
            believed = [float(row["stamp_s"]) - start_s for row in csv.DictReader(file)
                        if row["source"] == "scan_match" and row["accepted"] == "1"]
        with open(apps.folder / f"{stem}_errors.csv") as file:
            during = [float(row["position_plane_m"]) for row in csv.DictReader(file)
                      if from_s <= float(row["stamp_s"]) - start_s < to_s]
        bad = {round(10 * s) for s in believed if from_s + 0.1 <= s < to_s}
        return {"matches believed meanwhile [%]": 100 * len(bad) / (10 * (to_s - from_s)),
                "rmse in the plane meanwhile [m]": math.sqrt(sum(e * e for e in during) / len(during)),
                "worst of the drive [m]": figures["errors"]["position_plane_m"]["max"],
                "a match believed again after [s]": min(s for s in believed if s >= to_s + 0.1) - to_s}

    # A sweep that began after the noise is there 0.1 s later; the project wants it back within a second.
    bounds = {"worst of the drive [m]": (0, 2 * TWO_M), "rmse in the plane meanwhile [m]": (0, TWO_M),
              "a match believed again after [s]": (0, 1)}
    rows = [Row(f"{100 * share:g} % of the points", 5 if quick else 25, lambda s=share: measure(s), "recovers", bounds)
            for share in ((0.99,) if quick else (0.1, 0.5, 0.99))]
    return Table("recovery", "scan matching under injected point-cloud noise, and after it",
                 "noise in the point cloud so that scan matching fails; it recovers by GPS/INS; a video without figures.",
                 f"simulated {course.track}, seed 12; from {from_s} to {to_s} s so many of the points are drops at 1 to 30 m on "
                 "their rays.",
                 ["matches believed meanwhile [%]", "rmse in the plane meanwhile [m]", "worst of the drive [m]",
                  "a match believed again after [s]"], rows)


def navigation(apps, quick):
    def measure(name, track, *options):
        stem = apps.folder / f"navigation_{stem_of(name)}"
        said = apps.app("sim", "closed-loop", "--track", drives.ROOT / f"share/tracks/{track}.ini", "--car",
                        drives.ROOT / "ini/sim/indy.ini", *options, "-o", stem)
        guarded, unguarded = said.split("\nwithout ", 1)
        if "HIT" in guarded:
            raise Failed("with the guard the car hit the wall")
        hit = re.search(r"HIT THE WALL after ([0-9.]+) s", unguarded)
        off = re.search(r"off by ([0-9.]+) m", guarded)
        return {"wheel to wall at least [m]": float(re.search(r"wheel to wall ([0-9.]+) m", guarded)[1]),
                "off the gap of 3 m at most [m]": float(off[1]) if off else "",
                "without the guard": f"hit after {hit[1]} s" if hit else "no hit"}

    rows = []
    for track, from_m in (("lvms", 450), ("ims", 250), ("lvms", 2300), ("ims", 1350)):
        for seconds in (2, 5):
            name = f"{track}, from {from_m} m, {seconds} s without GNSS"
            rows.append(Row(name, 3, lambda n=name, t=track, f=from_m, s=seconds: measure(n, t, "--from", f, "--fail-for", s),
                            "follows the wall for about 2 s" if seconds == 2 else "",
                            {"wheel to wall at least [m]": (0.5, 4), "off the gap of 3 m at most [m]": (0, 0.5)}))
    for track, from_m in (("lvms", 870), ("ims", 2490)):
        for shift_m in (2, 3):
            name = f"{track}, from {from_m} m, a line {shift_m} m into the wall"
            rows.append(Row(name, 3, lambda n=name, t=track, f=from_m, s=shift_m: measure(n, t, "--from", f, "--shift", s),
                            "stays above the threshold", {"wheel to wall at least [m]": (0.5, 4)}))
    if quick:
        rows = [row for row in rows if row.name.startswith("lvms, from 450 m, 2 s") or row.name.endswith("870 m, a line 3 m into "
                                                                                                        "the wall")]
    return Table("navigation", "resilient navigation: GNSS lost, and a wrong desired path",
                 "steering and distance to the wall as pictures: along the wall for about 2 s; the distance stays above the "
                 "emergency threshold.",
                 "simulated, closed loop at 62 m/s, seed 1; every source drifts off, or the line leads into the wall; "
                 "the emergency threshold is that of ini/live.ini.",
                 ["wheel to wall at least [m]", "off the gap of 3 m at most [m]", "without the guard"], rows,
                 lambda: [(row.name, path.name) for row in rows[::4]
                          if (path := apps.folder / f"navigation_{stem_of(row.name)}.svg").exists()])


def tables(apps, quick):
    if quick:
        lvms = Localized(apps, "lvms", "lvms", 0.5, laps=0.35)
        ims = Localized(apps, "lvms", "lvms", 0.5, laps=0.45, top_speed=41)
    else:
        lvms = Localized(apps, "lvms", "lvms", 2.2, laps=2)
        ims = Localized(apps, "ims", "ims", 2.2, laps=5, top_speed=41)
    return [noise(lvms, quick, [12] if quick else [11, 12]), first_day(apps, ims, quick), recovery(apps, lvms, quick),
            navigation(apps, quick)]
