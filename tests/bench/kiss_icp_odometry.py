#!/usr/bin/env python3
"""KISS-ICP (PyPI kiss-icp, its defaults) on a folder of KITTI scans, for a comparison with ours.

    kiss_icp_odometry.py VELODYNE_FOLDER STAMPS.tum OUT.tum [--calibration calib_imu_to_velo.txt] [--deskew]

STAMPS.tum is ours, a pose for each scan: its stamps are taken. OUT.tum holds the pose of the body in that of the first scan,
the LiDAR mounted where raceloc-import puts it: turned as the calibration says (a raw drive), else not at all (the odometry
benchmark). With --deskew KISS-ICP moves the points by constant velocity, with times by azimuth, clockwise from behind."""
import argparse
import pathlib

import numpy as np
from kiss_icp.config import load_config
from kiss_icp.kiss_icp import KissICP
from scipy.spatial.transform import Rotation

P_BODY_LIDAR_M = (0.86, 0.0, 1.43)


def body_from_lidar(calibration):
    """T_body_lidar, 4x4."""
    T = np.eye(4)
    T[:3, 3] = P_BODY_LIDAR_M
    if calibration:
        rows = dict(line.split(":", 1) for line in calibration.read_text().splitlines() if ":" in line)
        R_velo_imu = np.array(rows["R"].split(), float).reshape(3, 3)
        T[:3, :3] = R_velo_imu.T
    return T


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", type=pathlib.Path)
    parser.add_argument("stamps", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--calibration", type=pathlib.Path)
    parser.add_argument("--deskew", action="store_true")
    args = parser.parse_args()

    config = load_config(None)
    config.data.deskew = args.deskew
    if config.mapping.voxel_size is None:
        config.mapping.voxel_size = config.data.max_range / 100.0
    odometry = KissICP(config)
    files = sorted(args.scans.glob("*.bin"))
    stamps = [line.split()[0] for line in args.stamps.read_text().splitlines() if line[:1] != "#"]
    if len(files) != len(stamps):
        raise SystemExit(f"{args.stamps}: {len(stamps)} poses, but {args.scans} holds {len(files)} scans")

    T_body_lidar = body_from_lidar(args.calibration)
    lines = []
    for file, stamp in zip(files, stamps):
        points = np.fromfile(file, np.float32).reshape(-1, 4)[:, :3].astype(np.float64)
        azimuth = np.arctan2(points[:, 1], points[:, 0])
        times = ((np.pi - azimuth) % (2 * np.pi)) / (2 * np.pi) if args.deskew else np.zeros(0)
        odometry.register_frame(points, times)
        T = T_body_lidar @ odometry.last_pose @ np.linalg.inv(T_body_lidar)
        numbers = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()]
        lines.append(" ".join([stamp, *(f"{x:.9f}" for x in numbers)]))
    args.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
