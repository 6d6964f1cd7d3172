#!/usr/bin/env python3
"""LiDAR odometry of a peer from PyPI on sweeps that export_log wrote: `pip install kiss-icp small_gicp numpy`.

    peer_odometry.py kiss_icp|small_gicp SWEEPS_FOLDER OUT.tum [--leaf M] [--paced]

kiss_icp: its pipeline with its defaults; --leaf is its voxel_size. small_gicp: scan to model as in its own example (VGICP,
constant velocity, a voxel map that forgets after 100 scans); --leaf is that of the scan, and the map's voxel and the
largest distance of a match where they are larger than the example's 1 m. One thread. Sweeps whose points have times are
de-skewed by constant velocity, to their end: by KISS-ICP itself, and for small_gicp, which does not, here. OUT.tum holds
the pose of the body at each sweep's end in that at the first. With --paced a sweep is taken when it would have come, as
raceloc-live --speed 1 does."""
import argparse
import pathlib
import time

import numpy as np


class Kiss:
    def __init__(self, leaf_m):
        from kiss_icp.config import load_config
        from kiss_icp.kiss_icp import KissICP

        config = load_config(None)
        config.registration.max_num_threads = 1
        if leaf_m:
            config.mapping.voxel_size = leaf_m
        if config.mapping.voxel_size is None:
            config.mapping.voxel_size = config.data.max_range / 100.0
        self.odometry = KissICP(config)

    def add(self, points, times_s):
        shares = times_s / times_s.max() if times_s.any() else np.zeros(0)
        self.odometry.register_frame(points, shares)
        return self.odometry.last_pose


class SmallGicp:
    def __init__(self, leaf_m):
        import small_gicp

        self.peer = small_gicp
        self.leaf_m = leaf_m or 0.25
        self.voxel_m = max(1.0, self.leaf_m)
        self.map = small_gicp.GaussianVoxelMap(self.voxel_m)
        self.map.set_lru(horizon=100, clear_cycle=10)
        self.pose, self.motion = np.eye(4), np.eye(4)

    def add(self, points, times_s):
        if times_s.any():
            points = deskewed(points, 1 - times_s / times_s.max(), self.motion)
        scan, _ = self.peer.preprocess_points(points, self.leaf_m, num_threads=1)
        if self.map.size() > 0:
            match = self.peer.align(self.map, scan, self.pose @ self.motion, num_threads=1,
                                    max_correspondence_distance=self.voxel_m)
            self.motion = np.linalg.inv(self.pose) @ match.T_target_source
            self.pose = match.T_target_source
        self.map.insert(scan, self.pose)
        return self.pose


def deskewed(points, ages, motion):
    """Points that were seen this share (0..1) of a sweep before its end, in the frame at its end. The motion of a sweep turns
    by little: the share of its rotation vector and of its way."""
    turn = np.array([motion[2, 1] - motion[1, 2], motion[0, 2] - motion[2, 0], motion[1, 0] - motion[0, 1]]) / 2
    return points - ages[:, None] * (np.cross(turn, points) + motion[:3, 3])


def quaternion(R):
    """x, y, z, w of a rotation: the eigenvector of Bar-Itzhack's symmetric matrix."""
    K = np.array([[R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
                  [R[1, 0] + R[0, 1], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
                  [R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[2, 2] - R[0, 0] - R[1, 1], 0],
                  [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)]]) / 3
    return np.linalg.eigh(K)[1][:, 3]


def rotation(q):
    """Of x, y, z, w."""
    v, w = np.array(q[:3]), q[3]
    V = np.cross(np.eye(3), v)
    return np.eye(3) + 2 * w * V + 2 * V @ V


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("peer", choices=("kiss_icp", "small_gicp"))
    parser.add_argument("sweeps", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--leaf", type=float)
    parser.add_argument("--paced", action="store_true")
    args = parser.parse_args()
    peer = {"kiss_icp": Kiss, "small_gicp": SmallGicp}[args.peer](args.leaf)
    lines, begun_s, first_s = [], time.monotonic(), None
    for line in (args.sweeps / "sweeps.tum").read_text().splitlines():
        if line[0] == "#":
            continue
        stamp_s, *mounted = map(float, line.split())
        sweep = np.fromfile(args.sweeps / f"{len(lines):06d}.bin", np.float32).reshape(-1, 4).astype(np.float64)
        end_s = stamp_s + sweep[:, 3].max()
        first_s = end_s if first_s is None else first_s
        if args.paced:
            time.sleep(max(0, end_s - first_s - (time.monotonic() - begun_s)))
        T_body_lidar = np.eye(4)
        T_body_lidar[:3, :3], T_body_lidar[:3, 3] = rotation(mounted[3:]), mounted[:3]
        T = T_body_lidar @ peer.add(sweep[:, :3], sweep[:, 3]) @ np.linalg.inv(T_body_lidar)
        lines.append(" ".join([f"{end_s:.6f}", *(f"{x:.9f}" for x in (*T[:3, 3], *quaternion(T[:3, :3])))]))
    args.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
