"""Drives that the benches share: simulated, mapped, localized and measured by the apps, in one folder. No numpy.

Logs and maps that are in the folder already are used again: the apps give a file its name only when it is whole.
"""
import dataclasses
import itertools
import json
import pathlib
import re
import subprocess
import threading
import typing

ROOT = pathlib.Path(__file__).resolve().parents[2]
DEVICES = "lidar_front imu* vehicle* gps_*"
SOURCES = ("gps_left", "gps_right", "scan_match")
RECORDINGS = ROOT.parent / "shared/data"


class Failed(Exception):
    """A command that could not do what it was asked for, in its own words."""


class Skipped(Exception):
    """What would have to be installed, built or unpacked first."""


def with_section(text, section, values):
    """The ini with other values of keys that it has."""
    head, tail = text.split(f"[{section}]", 1)
    for key, value in values.items():
        tail, times = re.subn(rf"^{key} =.*$", f"{key} = {value}", tail, count=1, flags=re.MULTILINE)
        assert times == 1, key
    return f"{head}[{section}]{tail}"


def noise(labels, sigma_m, after_s=2):
    """Section [trial]: white noise on the positions of these sources, which go on claiming what they did."""
    return {"trial": {"noise_labels": " ".join(labels), "noise_m": sigma_m, "noise_after_s": after_s}}


def noise_rows():
    """name: (sections of live.ini, what is switched off from the first second on). All sources, then each alone."""
    table = {"clean": ({}, "")}
    for count in (1, 2, 3):
        for labels in itertools.combinations(SOURCES, count):
            for sigma_m in (5, 10):
                table[f"{sigma_m} m on {' and '.join(labels)}"] = (noise(labels, sigma_m), "")
    for label in SOURCES:
        others = " ".join(s for s in SOURCES if s != label).replace("scan_match", "lidar_*")
        table[f"{label} alone"] = ({}, others)
        for sigma_m in (5, 10):
            table[f"{sigma_m} m on {label} alone"] = (noise([label], sigma_m), others)
    return table


def write_whole(path, text):
    """A kill leaves what was there before, or all of the new."""
    part = path.with_name(path.name + ".part")
    part.write_text(text)
    part.replace(path)


class MarkdownTable:
    """Grows row by row: each is printed, and the file holds all so far."""

    def __init__(self, path, columns):
        self.path, self.lines = path, []
        self._put(f"| | {' | '.join(columns)} |")
        self._put("|" + "---|" * (len(columns) + 1))

    def add(self, name, cells):
        self._put(f"| {name} | {' | '.join(map(str, cells))} |")
        write_whole(self.path, "\n".join(self.lines) + "\n")

    def _put(self, line):
        self.lines.append(line)
        print(line, flush=True)


def stem_of(name):
    return re.sub("[^a-z0-9.]+", "_", name.lower())


class Drives:
    """Runs the apps of `bin_dir`, which write into `folder`; no command for longer than `timeout_s`.

    `commands` are those that the calling thread has asked for since it last cleared them, also where the file was
    there already; for people: below ROOT, with the folder as `build/paper`."""

    def __init__(self, bin_dir, folder, timeout_s=1800):
        self.bin, self.folder, self.timeout_s = bin_dir.resolve(), folder.resolve(), timeout_s
        self.folder.mkdir(parents=True, exist_ok=True)
        self._locks, self._guard, self._thread = {}, threading.Lock(), threading.local()

    @property
    def commands(self):
        if not hasattr(self._thread, "commands"):
            self._thread.commands = []
        return self._thread.commands

    def shown(self, word):
        word = str(word)
        for path, short in ((self.folder, "build/paper/"), (self.bin, ""), (ROOT, ""), (RECORDINGS, "../shared/data/")):
            word = re.sub(rf"{re.escape(str(path))}(/|$)", short, word)
        word = "python3" if re.search(r"/python[0-9.]*$", word) else word
        return f"'{word}'" if re.search(r"[ *?]", word) else word

    def run(self, *command, makes=None):
        """Standard output of a command; empty where `makes`, a file, is there already."""
        command = self._asked(command)
        if makes is None:
            return self._run(command)
        with self._lock_of(makes):
            return "" if makes.exists() else self._run(command)

    def said(self, path, *command):
        """Standard output of a command, kept in a file that is used again."""
        command = self._asked(command)
        with self._lock_of(path):
            if not path.exists():
                write_whole(path, self._run(command))
        return path.read_text()

    def _asked(self, command):
        self.commands.append(" ".join(map(self.shown, command)))
        return [str(word) for word in command]

    def _lock_of(self, path):
        with self._guard:
            return self._locks.setdefault(path, threading.Lock())

    def _run(self, command):
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=self.timeout_s)
        except subprocess.TimeoutExpired:
            raise Failed(f"{command[0]}: not done after {self.timeout_s:.0f} s") from None
        if done.returncode != 0:
            raise Failed(f"{' '.join(command)}: {done.stderr.strip() or done.returncode}")
        return done.stdout

    def app(self, name, *arguments, makes=None):
        return self.run(self.bin / f"raceloc-{name}", *arguments, makes=makes)

    def simulate(self, name, track, *options, car="indy", devices=DEVICES, seed=1):
        """NAME.rawlog and NAME_truth.tum: stems the other methods take. `track` is a path or the name of a shipped one."""
        track = pathlib.Path(track)
        if not track.suffix:
            track = ROOT / f"share/tracks/{track}.ini"
        log = self.folder / f"{name}.rawlog"
        self.app("sim", "--track", track, "--car", ROOT / f"ini/sim/{car}.ini", "--devices", devices, *options, "--seed",
                 seed, "-o", log, makes=self.folder / f"{name}_truth.tum")
        return log

    def inject(self, log, name, faults):
        """NAME.rawlog: the log with the faults of an ini."""
        faulty = self.folder / f"{name}.rawlog"
        self.app("sim", "inject", "--faults", faults, "-i", log, "-o", faulty, makes=faulty)
        return faulty

    def map_of(self, log):
        chart = log.with_suffix(".rlmap")
        self.app("map", "-c", ROOT / "ini/map.ini", "-o", chart, log, makes=chart)
        return chart

    def ini(self, app, name, sections):
        """ini/APP.ini; with `sections` ({section: {key: value}}) a copy with other values."""
        shipped = ROOT / f"ini/{app}.ini"
        if not sections:
            return shipped
        text = shipped.read_text()
        for section, values in sections.items():
            text = with_section(text, section, values)
        ini = self.folder / f"{name}_{app}.ini"
        ini.write_text(text)
        return ini

    def localize(self, name, chart, log, sections=None, options=()):
        """NAME.tum, NAME_own.csv (integrity) and NAME_decisions.csv of raceloc-live. Returns the path of the first."""
        tum = self.folder / f"{name}.tum"
        self.app("live", "-c", self.ini("live", name, sections), "-m", chart, "-i", log, "--trajectory", tum, "--integrity",
                 self.folder / f"{name}_own.csv", "--decisions", self.folder / f"{name}_decisions.csv", *options)
        return tum

    def odometry(self, name, log, sections=None, options=()):
        tum = self.folder / f"{name}.tum"
        self.measured(name, self.bin / "raceloc-live", "-c", self.ini("live", name, sections), "--odometry-only", "-i", log,
                      "--trajectory", tum, *options)
        return tum

    def measured(self, name, *command):
        """Runs it under `raceloc-eval cpu`, which writes NAME_cpu.json."""
        self.app("eval", "cpu", "--json", self.folder / f"{name}_cpu.json", "--", *command)

    def figures(self, truth, tum, *options):
        """What raceloc-eval says, as its JSON; NAME_errors.csv too, and what `options` ask for."""
        figures = tum.with_suffix(".json")
        self.app("eval", "--truth", truth, "--estimate", tum, *options, "--json", figures, "--csv",
                 tum.with_name(tum.stem + "_errors.csv"))
        return json.loads(figures.read_text())


def truth_of(log):
    return log.with_name(log.stem + "_truth.tum")


@dataclasses.dataclass
class Row:
    """A row of a table: `measure` gives {column: figure}, about `about_s` of work. `bounds`: {column: (low, high)} of
    figures, beyond which something is wrong."""

    name: str
    about_s: float
    measure: typing.Callable
    paper: str = ""
    bounds: dict = dataclasses.field(default_factory=dict)


@dataclasses.dataclass
class Table:
    """One of the paper's results. `pictures` gives (title, path below the folder) of those that were made."""

    name: str
    title: str
    paper: str
    data: str
    columns: list
    rows: list
    pictures: typing.Callable = list
