#!/usr/bin/python3
"""Run clang-tidy over the sources of a build's compile_commands.json, on all cores.

A file that was found clean is not looked at again until its preprocessed text (comments and macros included), the checks or
clang-tidy itself change: the answers are kept in ${XDG_CACHE_HOME:-~/.cache}/raceloc/tidy, by hash. The others of one library
are looked at together, a few at a time, as one source: what costs is the headers that they share.
"""
import argparse
import collections
import concurrent.futures
import hashlib
import json
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOGETHER = 8  # more of them save little, and leave a core idle at the end
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "raceloc" / "tidy"


def sources(build_dir, folders):
    """The entries of the compile database whose C++ file lies below one of the folders."""
    for entry in json.loads((build_dir / "compile_commands.json").read_text()):
        file = pathlib.Path(entry["directory"], entry["file"]).resolve()
        if file.suffix == ".cpp" and any(file.is_relative_to(ROOT / folder) for folder in folders):
            yield file, entry


def compiler_words(entry):
    """The compiler and its options, without the source and the object."""
    words = shlex.split(entry["command"])
    if pathlib.Path(words[0]).name == "ccache":
        words = words[1:]
    for flag in ("-o", "-c"):  # each takes its file with it
        at = words.index(flag)
        del words[at:at + 2]
    return words


def mark_of(entry, salt):
    """The file whose being there says that the source is clean; None for a source that has no preprocessed text."""
    # -P drops the line markers, which hold the paths of this checkout
    done = subprocess.run([*compiler_words(entry), "-E", "-C", "-P", "-dD", entry["file"]], cwd=entry["directory"],
                          capture_output=True)
    return CACHE / hashlib.sha256(salt + done.stdout).hexdigest() if done.returncode == 0 else None


def batches(files):
    """The files of one folder that are compiled in one way; each alone that has a main()."""
    groups = collections.defaultdict(list)
    for file, entry in sorted(files.items()):
        alone = file if "int main(" in file.read_text() else None
        groups[file.parent, tuple(compiler_words(entry)), alone].append(file)
    for group in groups.values():
        count = -(-len(group) // TOGETHER)
        for i in range(count):  # of one size, so that none is a straggler
            yield group[i::count]


def tidy(source, entry):
    """What clang-tidy says about a source that is compiled like this entry; empty when it is clean."""
    done = subprocess.run(["clang-tidy", "--quiet", f"--config-file={ROOT / '.clang-tidy'}", str(source), "--",
                           *compiler_words(entry)[1:]], cwd=entry["directory"], capture_output=True, text=True)
    return done.stdout + done.stderr if done.returncode != 0 else ""


def complaints_about(batch, entry):
    """{file: what clang-tidy says}, of those that are not clean. Where the files are clean one by one, what is wrong with all
    of them in one source stands under the first."""
    if len(batch) == 1:
        said = tidy(batch[0], entry)
        return {batch[0]: said} if said else {}
    with tempfile.TemporaryDirectory() as folder:
        together = pathlib.Path(folder, "together.cpp")
        together.write_text("\n".join(file.read_text() for file in batch))  # some checks see only the main file
        said = tidy(together, entry)
    if not said:
        return {}
    return {file: words for file in batch if (words := tidy(file, entry))} or {batch[0]: said}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build_dir", type=pathlib.Path)
    parser.add_argument("folders", nargs="+", help="below the project's root")
    args = parser.parse_args()
    CACHE.mkdir(parents=True, exist_ok=True)
    version = subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout
    salt = version + (ROOT / ".clang-tidy").read_bytes() + pathlib.Path(__file__).read_bytes()

    files = dict(sources(args.build_dir, args.folders))
    if not files:
        sys.exit(f"tidy: no C++ source below {', '.join(args.folders)} in {args.build_dir}/compile_commands.json")
    bad = 0
    with concurrent.futures.ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        marks = dict(zip(files, pool.map(lambda file: mark_of(files[file], salt), files)))
        unknown = {file: files[file] for file, mark in marks.items() if not (mark and mark.exists())}
        work = list(batches(unknown))
        for batch, complaints in zip(work, pool.map(lambda b: complaints_about(b, files[b[0]]), work)):
            bad += len(complaints)
            print(*complaints.values(), sep="\n", end="", flush=True)
            for mark in (marks[file] for file in batch if file not in complaints):
                if mark:
                    mark.touch()
    print(f"tidy: {len(files)} files, {len(files) - len(unknown)} of them known to be clean, {bad} with complaints")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
