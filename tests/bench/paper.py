#!/usr/bin/env python3
"""The paper's tables and figures, measured again: python3 paper.py BIN_FOLDER -o FOLDER [--quick] [--only PATTERN] [--jobs N]
[--peers PYTHON]

Simulates each table's drives (fixed seeds), runs the apps on them, and writes FOLDER/results.md (each table with what the
paper has, what we have, on which data and by which commands), FOLDER/results.json and pictures. A row that fails or is out
of its bounds says so, the others go on, and the exit status is 1 in the end; what would have to be installed first is
`skipped`. Logs and maps that are in FOLDER already are used again (10 GB in full).

--quick: short laps, one seed, no peers: what a CI can do in two minutes.
--only:  tables or `table: row`s by a shell pattern, e.g. 'noise*'.
--peers: an interpreter that has them: python3 -m venv V && V/bin/pip install kiss-icp small_gicp numpy
"""
import argparse
import fnmatch
import json
import pathlib
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed

import drives
import paper_localization
import paper_odometry


class Campaign:
    """Runs the rows of tables and tells how far it is. `done`: {table: {row: what came of it}}."""

    def __init__(self, tables, only):
        self.tables = [(table, rows) for table in tables
                       if (rows := [r for r in table.rows if any(fnmatch.fnmatch(name, only) for name in
                                                                 (table.name, f"{table.name}: {r.name}"))])]
        self.done = {table.name: {} for table, _ in self.tables}
        self.about_s = sum(row.about_s for _, rows in self.tables for row in rows)
        self.gone_s, self.count = 0, 0

    def run(self, jobs, apps):
        begun_s = time.monotonic()
        total = sum(len(rows) for _, rows in self.tables)
        with ThreadPoolExecutor(jobs) as pool:
            futures = {pool.submit(measured, row, apps): (table, row) for table, rows in self.tables for row in rows}
            for future in as_completed(futures):
                table, row = futures[future]
                result = self.done[table.name][row.name] = future.result()
                self.count += 1
                self.gone_s += row.about_s
                left_s = (time.monotonic() - begun_s) * (self.about_s / self.gone_s - 1)
                print(f"[{self.count}/{total}] {table.name}: {row.name}: {result['status']} ({result['seconds']:.0f} s; "
                      f"about {left_s / 60:.0f} min left)", flush=True)
        return time.monotonic() - begun_s


def measured(row, apps):
    """Figures of a row, and whether they are within its bounds; nothing that it does ends the campaign."""
    begun_s = time.monotonic()
    apps.commands.clear()
    figures, status = {}, "done"
    try:
        figures = row.measure()
        wrong = [f"{key} is {figures[key]:.3g}, not {low:g} .. {high:g}" for key, (low, high) in row.bounds.items()
                 if not low <= figures[key] <= high]
        if wrong:
            status = "FAILED: " + "; ".join(wrong)
    except drives.Skipped as why:
        status = f"skipped ({why})"
    except (drives.Failed, OSError, KeyError, TypeError, ValueError, IndexError) as why:
        status = f"FAILED: {type(why).__name__}: {why}"
    return {"figures": figures, "status": status, "seconds": round(time.monotonic() - begun_s, 1),
            "commands": list(dict.fromkeys(apps.commands))}


def text_of(value):
    if isinstance(value, float):
        return f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"
    return str(value)


def markdown(table, rows, done):
    out = [f"## {table.name}: {table.title}", "", f"Paper: {table.paper}", "", f"Data: {table.data}", ""]
    out += ["| | " + " | ".join(table.columns) + " | the paper |", "|" + "---|" * (len(table.columns) + 2)]
    for row in rows:
        result = done[row.name]
        cells = [text_of(result["figures"].get(column, "")) for column in table.columns]
        if result["status"] != "done":
            cells[0] = result["status"].replace("|", "/").replace("\n", " ")
        out.append(f"| {row.name} | " + " | ".join(cells) + f" | {row.paper} |")
    out += [""] + [f"![{title}]({path})" for title, path in table.pictures()] + [""]
    shared = set.intersection(*(set(done[row.name]["commands"]) for row in rows))
    first = done[rows[0].name]["commands"]
    out += ["<details><summary>commands</summary>", "", "```"] + [c for c in first if c in shared and len(rows) > 1]
    for row in rows:
        own = [c for c in done[row.name]["commands"] if c not in shared or len(rows) == 1]
        out += [f"# {row.name}", *own] if own else []
    return "\n".join(out + ["```", "</details>", ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("-o", dest="folder", type=pathlib.Path, required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", default="*")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--peers", default=sys.executable)
    args = parser.parse_args()
    apps = drives.Drives(args.bin, args.folder, timeout_s=300 if args.quick else 1800)
    campaign = Campaign(paper_localization.tables(apps, args.quick) + paper_odometry.tables(apps, args.quick, args.peers),
                        args.only)
    if not campaign.tables:
        raise SystemExit(f"no table or row is called {args.only}")
    took_s = campaign.run(args.jobs, apps)
    words = ["# The paper's results, measured again", "",
             f"{'Quick form: short laps, one seed. ' if args.quick else ''}{took_s / 60:.1f} min with {args.jobs} "
             "rows at a time. Simulated or other data, other computer: figures of the paper are for orientation.", ""]
    words += [markdown(table, rows, campaign.done[table.name]) for table, rows in campaign.tables]
    (apps.folder / "results.md").write_text("\n".join(words))
    (apps.folder / "results.json").write_text(json.dumps({"quick": args.quick, "minutes": took_s / 60,
                                                          "tables": campaign.done}, indent=1) + "\n")
    failed = [f"{table}: {row}: {result['status']}" for table, rows in campaign.done.items()
              for row, result in rows.items() if result["status"].startswith("FAILED")]
    print(f"written          {apps.folder}/results.md, results.json: {campaign.count - len(failed)} of {campaign.count} rows "
          f"in {took_s / 60:.1f} min")
    if failed:
        raise SystemExit("\n".join(failed))


if __name__ == "__main__":
    main()
