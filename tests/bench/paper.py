#!/usr/bin/env python3
"""The paper's tables and figures, measured again: python3 paper.py BIN_FOLDER -o FOLDER [--quick] [--only PATTERN] [--jobs N]
[--peers PYTHON]

Simulates each table's drives (fixed seeds), runs the apps on them, and writes FOLDER/results.md (each table with what the
paper has, what we have, on which data and by which commands), FOLDER/results.json and pictures. A row that fails or is out
of its bounds says so, the others go on, and the exit status is 1 in the end; what would have to be installed first is
`skipped`. Logs and maps that are in FOLDER already are used again (10 GB in full), and with --only the results of the
other rows are kept; results are written after each row.

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
    """Runs the rows of tables and tells how far it is. `done`: {table: {row: what came of it}}, with what an earlier run in
    the folder left."""

    def __init__(self, tables, args, apps):
        self.tables, self.args, self.apps = tables, args, apps
        self.chosen = [(table, row) for table in tables for row in table.rows
                       if any(fnmatch.fnmatch(name, args.only) for name in (table.name, f"{table.name}: {row.name}"))]
        self.done = {table.name: {} for table in tables}
        earlier = json.loads(self.results.read_text()) if self.results.exists() else {}
        if earlier.get("quick", args.quick) != args.quick:
            raise SystemExit(f"{apps.folder} holds the {'full' if args.quick else 'quick'} form's drives: take another folder")
        self.done.update(earlier.get("tables", {}))
        for table, row in self.chosen:
            self.done[table.name].pop(row.name, None)

    @property
    def results(self):
        return self.apps.folder / "results.json"

    def run(self):
        """Names of the rows that failed."""
        begun_s, gone_s, failed = time.monotonic(), 0, []
        about_s = sum(row.about_s for _, row in self.chosen)
        self.write(0)
        with ThreadPoolExecutor(self.args.jobs) as pool:
            futures = {pool.submit(measured, row, self.apps): (table, row) for table, row in self.chosen}
            for count, future in enumerate(as_completed(futures), 1):
                table, row = futures[future]
                result = self.done[table.name][row.name] = future.result()
                gone_s += row.about_s
                took_s = time.monotonic() - begun_s
                if result["status"].startswith("FAILED"):
                    failed.append(f"{table.name}: {row.name}: {result['status']}")
                self.write(took_s)
                print(f"[{count}/{len(futures)}] {table.name}: {row.name}: {result['status']} ({result['seconds']:.0f} s; "
                      f"about {took_s * (about_s / gone_s - 1) / 60:.0f} min left)", flush=True)
        print(f"written          {self.apps.folder}/results.md, results.json: {len(self.chosen) - len(failed)} of "
              f"{len(self.chosen)} rows in {took_s / 60:.1f} min", flush=True)
        return failed

    def write(self, took_s):
        quick = "Quick form: short laps, one seed. " if self.args.quick else ""
        words = ["# The paper's results, measured again", "",
                 f"{quick}Last run: {len(self.chosen)} rows, {took_s / 60:.1f} min with {self.args.jobs} at a time. Simulated or "
                 "other data, other computer: figures of the paper are for orientation.", ""]
        words += [markdown(table, self.done[table.name]) for table in self.tables if self.done[table.name]]
        drives.write_whole(self.apps.folder / "results.md", "\n".join(words))
        drives.write_whole(self.results, json.dumps({"quick": self.args.quick, "tables": self.done}, indent=1) + "\n")


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


def markdown(table, done):
    rows = [row for row in table.rows if row.name in done]
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
    tables = paper_localization.tables(apps, args.quick) + paper_odometry.tables(apps, args.quick, args.peers)
    campaign = Campaign(tables, args, apps)
    if not campaign.chosen:
        raise SystemExit(f"no table or row is called {args.only}")
    failed = campaign.run()
    if failed:
        raise SystemExit("\n".join(failed))


if __name__ == "__main__":
    main()
