#!/usr/bin/env python3
"""Prints the poses that raceloc-live sends: pose_client.py udp://HOST:PORT | tcp://HOST:PORT [--count N]

With udp it listens on that address (port 0: a free one, named on stderr), with tcp it connects to it. Ends after N lines,
or when raceloc-live has ended the connection."""
import argparse
import json
import socket
import sys
from urllib.parse import urlparse


def lines(url):
    """The lines of a stream, one by one."""
    kind = socket.SOCK_DGRAM if url.scheme == "udp" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, kind) as connection:
        if url.scheme == "udp":
            connection.bind((url.hostname, url.port))
            print("listening on udp://%s:%d" % connection.getsockname(), file=sys.stderr, flush=True)
            while True:
                yield connection.recv(65536)
        connection.connect((url.hostname, url.port))
        with connection.makefile("rb") as stream:
            yield from stream


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("url", type=urlparse)
    parser.add_argument("--count", type=int, default=0, help="of lines, then it ends; 0: never")
    arguments = parser.parse_args()
    if arguments.url.scheme not in ("udp", "tcp") or arguments.url.port is None:
        parser.error("the url must be udp://HOST:PORT or tcp://HOST:PORT")
    for number, line in enumerate(lines(arguments.url), start=1):
        output = json.loads(line)
        pose = output["pose"]
        age = "-" if output["age_s"] is None else "%.3f" % output["age_s"]
        print("%.3f age %s x %.3f y %.3f yaw %.4f %s %s" % (output["stamp_s"], age, pose["x_m"], pose["y_m"],
                                                            pose["yaw_rad"], output["state"], output["cause"]), flush=True)
        if number == arguments.count:
            break


if __name__ == "__main__":
    main()
