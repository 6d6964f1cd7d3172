#!/usr/bin/python3
"""Run clang-tidy over the sources of a build's compile_commands.json, on all cores.

A file that was found clean is not looked at again until its preprocessed text (comments and macros included), the checks or
clang-tidy itself change: the answers are kept in ${XDG_CACHE_HOME:-~/.cache}/raceloc/tidy, by hash.
"""
import argparse
import concurrent.futures
import hashlib
import json
import os
import pathlib
import shlex
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "raceloc" / "tidy"


def sources(build_dir, folders):
    """The entries of the compile database whose C++ file lies below one of the folders."""
    for entry in json.loads((build_dir / "compile_commands.json").read_text()):
        file = pathlib.Path(entry["directory"], entry["file"]).resolve()
        if file.suffix == ".cpp" and any(file.is_relative_to(ROOT / folder) for folder in folders):
            yield file, entry


def preprocessed(entry):
    words = shlex.split(entry["command"])
    if pathlib.Path(words[0]).name == "ccache":
        words = words[1:]
    for flag in ("-o", "-c"):  # -o takes its file with it; -c the source, which is named again below
        at = words.index(flag)
        del words[at:at + 2]
    # -P drops the line markers, which hold the paths of this checkout
    done = subprocess.run([*words, "-E", "-C", "-P", "-dD", entry["file"]], cwd=entry["directory"], capture_output=True)
    return done.stdout if done.returncode == 0 else None


def check(file, entry, build_dir, salt):
    """Clang-tidy's complaints about one file, empty when it is clean; and whether the cache knew."""
    text = preprocessed(entry)
    mark = CACHE / hashlib.sha256(salt + text).hexdigest() if text is not None else None
    if mark and mark.exists():
        return "", True
    done = subprocess.run(["clang-tidy", "-p", str(build_dir), "--quiet", str(file)], capture_output=True, text=True)
    if done.returncode != 0:
        return done.stdout + done.stderr, False
    if mark:
        mark.touch()
    return "", False


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build_dir", type=pathlib.Path)
    parser.add_argument("folders", nargs="+", help="below the project's root")
    args = parser.parse_args()
    CACHE.mkdir(parents=True, exist_ok=True)
    version = subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout
    salt = version + (ROOT / ".clang-tidy").read_bytes()

    files = dict(sources(args.build_dir, args.folders))
    if not files:
        sys.exit(f"tidy: no C++ source below {', '.join(args.folders)} in {args.build_dir}/compile_commands.json")
    known, bad = 0, 0
    with concurrent.futures.ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for complaints, was_known in pool.map(lambda f: check(f, files[f], args.build_dir, salt), sorted(files)):
            known += was_known
            if complaints:
                bad += 1
                print(complaints, flush=True)
    print(f"tidy: {len(files)} files, {known} of them known to be clean, {bad} with complaints")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
