#!/usr/bin/python3
"""Write a synthetic drive in the folder layout of KITTI's raw data, for tests and the demo.

A car drives at about 12 m/s through a bending street of flat ground, house fronts with gaps, parked cars and poles. Its
LiDAR (32 beams x 500 azimuths, 10 Hz) casts each ray from the pose that the car has at that ray's own time, so the sweeps
are distorted as real ones are; its INS writes the true pose with a little noise. Same arguments, same bytes.

Below OUT_DIR: 2020_01_01/calib_imu_to_velo.txt and 2020_01_01/2020_01_01_drive_0001_sync/{oxts,velodyne_points}.
Frames: map (x east, y north, z up), imu (x forward, y left, z up; 0.93 m above ground), velo (the LiDAR).
"""
import argparse
import pathlib

import numpy as np

ORIGIN_DEG = (49.0, 8.43)  # of the map frame, on the ground, which is 112 m above the ellipsoid
GROUND_HEIGHT_M = 112.0
IMU_HEIGHT_M = 0.93
YAW_VELO_IMU_RAD = 0.01  # p_velo = R p_imu + T, as KITTI's calibration file has it
T_VELO_IMU_M = np.array([-0.809, 0.320, -0.800])
BEAMS_RAD = np.radians(np.linspace(4.0, -24.0, 32))
AZIMUTHS_PER_SWEEP = 500
PERIOD_S = 0.1
MAX_RANGE_M = 80.0
RANGE_NOISE_M = 0.02
INS_LAG_S = 0.017  # the INS packet of a frame comes this long after the LiDAR faced forward


class Drive:
    """The true motion of the IMU: heading a sine of the way driven, speed a sine of time, no sideslip."""

    BEND_RAD, BEND_LENGTH_M, BASE_YAW_RAD = 0.25, 120.0, 0.6
    STEP_M = 0.01

    def __init__(self, length_m):
        self.way_m = np.arange(-100.0, length_m + 100.0, self.STEP_M)
        yaw = self.yaw_rad(self.way_m)
        self.x_m = np.cumsum(np.cos(yaw)) * self.STEP_M
        self.y_m = np.cumsum(np.sin(yaw)) * self.STEP_M

    def yaw_rad(self, way_m):
        return self.BASE_YAW_RAD + self.BEND_RAD * np.sin(2 * np.pi * way_m / self.BEND_LENGTH_M)

    def position_m(self, way_m):
        return np.stack([np.interp(way_m, self.way_m, self.x_m), np.interp(way_m, self.way_m, self.y_m)], axis=-1)

    @staticmethod
    def way_after_m(time_s):
        return 12.0 * time_s + 0.8 * (1 - np.cos(time_s))

    @staticmethod
    def speed_mps(time_s):
        return 12.0 + 0.8 * np.sin(time_s)

    @staticmethod
    def acceleration_mps2(time_s):
        return 0.8 * np.cos(time_s)

    def yaw_rate_rps(self, time_s):
        phase = 2 * np.pi * self.way_after_m(time_s) / self.BEND_LENGTH_M
        return self.speed_mps(time_s) * self.BEND_RAD * 2 * np.pi / self.BEND_LENGTH_M * np.cos(phase)


def build_street(drive, random):
    """Upright walls (start, end, top, reflectivity) and poles (centre, radius, top, reflectivity), as columns."""
    walls, poles = [], []

    def add_box(way_m, left_m, length_m, depth_m, top_m):
        yaw = drive.yaw_rad(way_m)
        forward, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        centre = drive.position_m(way_m) + left_m * left
        corners = [centre + sx * length_m / 2 * forward + sy * depth_m / 2 * left
                   for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        reflectivity = random.uniform(0.1, 0.9)
        for start, end in zip(corners, corners[1:] + corners[:1]):
            walls.append([*start, *end, top_m, reflectivity])

    for side in (-1, 1):
        way_m = drive.way_m[0]
        while way_m < drive.way_m[-1]:
            length_m, depth_m = random.uniform(6, 18), 5.0
            add_box(way_m + length_m / 2, side * (random.uniform(6, 10) + depth_m / 2), length_m, depth_m,
                    random.uniform(3, 9))
            if random.uniform() < 0.5:
                add_box(way_m + random.uniform(0, length_m), side * 4.3, 4.2, 1.8, 1.5)
            pole_way_m = way_m + random.uniform(0, length_m)
            yaw = drive.yaw_rad(pole_way_m)
            centre = drive.position_m(pole_way_m) + side * 5.6 * np.array([-np.sin(yaw), np.cos(yaw)])
            poles.append([*centre, 0.15, 6.0, random.uniform(0.1, 0.9)])
            way_m += length_m + random.uniform(1.5, 7)
    return np.array(walls), np.array(poles)


def flat_distances(origin_m, direction, walls, poles):
    """Horizontal distance [m] from each ray's origin to each wall and pole, infinity where it misses them."""
    def cross(a, b):
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

    ray, edge = direction[:, None, :], (walls[:, 2:4] - walls[:, 0:2])[None]
    to_start = walls[None, :, 0:2] - origin_m[:, None, :]
    across = cross(ray, edge)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance, along = cross(to_start, edge) / across, cross(to_start, ray) / across
        to_walls = np.where((distance > 0.5) & (along >= 0) & (along <= 1), distance, np.inf)
        to_centre = poles[None, :, 0:2] - origin_m[:, None, :]
        root = poles[None, :, 2] ** 2 - cross(ray, to_centre) ** 2
        nearest = (ray * to_centre).sum(-1) - np.sqrt(np.maximum(root, 0))
        to_poles = np.where((root > 0) & (nearest > 0.5), nearest, np.inf)
    return np.concatenate([to_walls, to_poles], axis=1)


def sweep(drive, forward_s, walls, poles, random):
    """One revolution about the time when the LiDAR faces forward: points [velo frame, m] with intensity, float32."""
    turn = (np.arange(AZIMUTHS_PER_SWEEP) + 0.5) / AZIMUTHS_PER_SWEEP
    azimuth_rad = np.pi - 2 * np.pi * turn  # clockwise from straight back, as the HDL-64E turns
    way_m = drive.way_after_m(forward_s + (turn - 0.5) * PERIOD_S)
    yaw_imu = drive.yaw_rad(way_m)
    c, s = np.cos(YAW_VELO_IMU_RAD), np.sin(YAW_VELO_IMU_RAD)
    p_imu_velo = -np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ T_VELO_IMU_M
    lever = np.stack([np.cos(yaw_imu) * p_imu_velo[0] - np.sin(yaw_imu) * p_imu_velo[1],
                      np.sin(yaw_imu) * p_imu_velo[0] + np.cos(yaw_imu) * p_imu_velo[1]], axis=-1)
    origin_m = drive.position_m(way_m) + lever
    height_m = IMU_HEIGHT_M + p_imu_velo[2]
    heading = yaw_imu - YAW_VELO_IMU_RAD + azimuth_rad
    direction = np.stack([np.cos(heading), np.sin(heading)], axis=-1)

    here = origin_m[AZIMUTHS_PER_SWEEP // 2]
    walls = walls[np.hypot(*(0.5 * (walls[:, 0:2] + walls[:, 2:4]) - here).T) < MAX_RANGE_M]
    poles = poles[np.hypot(*(poles[:, 0:2] - here).T) < MAX_RANGE_M]
    distance = flat_distances(origin_m, direction, walls, poles).astype(np.float32)
    top_m = np.concatenate([walls[:, 4], poles[:, 3]])
    reflectivity = np.concatenate([walls[:, 5], poles[:, 4], [0.25]])  # the last is the ground

    which = np.argsort(distance, axis=1, kind="stable")[:, :8]  # more than a ray passes over before it leaves the street
    nearer = np.take_along_axis(distance, which, axis=1)
    points = []
    for elevation in BEAMS_RAD:  # boxes have no lids: a ray that passes over a wall goes on to the next
        hits_height = height_m + nearer * np.tan(elevation)
        hits = np.isfinite(nearer) & (hits_height >= 0) & (hits_height <= top_m[which])
        first = np.where(hits.any(axis=1), hits.argmax(axis=1), -1)
        row = np.arange(AZIMUTHS_PER_SWEEP)
        flat_m = np.where(first >= 0, nearer[row, first], np.inf)
        surface = np.where(first >= 0, which[row, first], len(top_m))
        ground_m = height_m / np.tan(-elevation) if elevation < 0 else np.inf
        surface = np.where(ground_m < flat_m, len(top_m), surface)
        range_m = np.minimum(flat_m, ground_m) / np.cos(elevation)
        range_m += random.normal(0, RANGE_NOISE_M, AZIMUTHS_PER_SWEEP)
        seen = range_m < MAX_RANGE_M
        flat_m, a = range_m[seen] * np.cos(elevation), azimuth_rad[seen]
        points.append(np.stack([flat_m * np.cos(a), flat_m * np.sin(a), range_m[seen] * np.sin(elevation),
                                reflectivity[surface[seen]]], axis=-1))
    return np.concatenate(points).astype("<f4")


def geodetic(east_m, north_m, up_m):
    """Latitude, longitude [deg], height [m] (WGS84) of a point in the map frame, through earth-centred coordinates."""
    a, e2 = 6378137.0, 6.69437999014e-3
    lat, lon = np.radians(ORIGIN_DEG)
    n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    base = np.array([(n + GROUND_HEIGHT_M) * np.cos(lat) * np.cos(lon),
                     (n + GROUND_HEIGHT_M) * np.cos(lat) * np.sin(lon),
                     (n * (1 - e2) + GROUND_HEIGHT_M) * np.sin(lat)])
    east = np.array([-np.sin(lon), np.cos(lon), 0])
    north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    x, y, z = base + east_m * east + north_m * north + up_m * up
    flat = np.hypot(x, y)
    for _ in range(6):  # converges by a factor of e2 a step
        n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
        height = flat / np.cos(lat) - n
        lat = np.arctan2(z, flat * (1 - e2 * n / (n + height)))
    return np.degrees(lat), np.degrees(np.arctan2(y, x)), height


def ins_line(drive, time_s, random):
    """The 30 values of one packet, in the order of KITTI's dataformat.txt."""
    way_m, speed = drive.way_after_m(time_s), drive.speed_mps(time_s) + random.normal(0, 0.02)
    yaw, turn = drive.yaw_rad(way_m) + random.normal(0, 5e-4), drive.yaw_rate_rps(time_s)
    east, north = drive.position_m(way_m) + random.normal(0, 0.02, 2)
    lat, lon, height = geodetic(east, north, IMU_HEIGHT_M + random.normal(0, 0.03))
    roll, pitch = random.normal(0, 3e-4, 2)
    force = np.array([drive.acceleration_mps2(time_s), speed * turn, 9.81]) + random.normal(0, 0.05, 3)
    rate = np.array([0, 0, turn]) + random.normal(0, 1e-3, 3)
    yaw = (yaw + np.pi) % (2 * np.pi) - np.pi
    values = [roll, pitch, yaw, speed * np.sin(yaw), speed * np.cos(yaw), speed, 0, 0, *force, *force, *rate, *rate, 0.05, 0.02]
    return f"{lat:.12f} {lon:.12f} {height:.8f} " + " ".join(f"{v:.12g}" for v in values) + " 4 10 4 4 0\n"


def stamp(time_s):
    """Seconds since noon, as KITTI writes local time."""
    ns = round(time_s * 1e9)
    minutes, seconds = divmod(ns // 10**9, 60)
    return f"2020-01-01 12:{minutes:02d}:{seconds:02d}.{ns % 10**9:09d}\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out_dir", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=8.0, help="length of the drive, up to 600 (default 8)")
    parser.add_argument("--seed", type=int, default=1, help="of the street and of the noise (default 1)")
    args = parser.parse_args()
    if not 0.5 <= args.seconds <= 600:
        parser.error("--seconds must be 0.5 to 600")

    random = np.random.default_rng(args.seed)
    drive = Drive(length_m=13.0 * args.seconds)
    walls, poles = build_street(drive, random)
    day = args.out_dir / "2020_01_01"
    folder = day / "2020_01_01_drive_0001_sync"
    oxts, velodyne = folder / "oxts", folder / "velodyne_points"
    for data in (oxts / "data", velodyne / "data"):
        data.mkdir(parents=True, exist_ok=True)

    c, s = np.cos(YAW_VELO_IMU_RAD), np.sin(YAW_VELO_IMU_RAD)
    (day / "calib_imu_to_velo.txt").write_text(
        "calib_time: 01-Jan-2020 12:00:00\n"
        f"R: {c:.9e} {-s:.9e} 0.0 {s:.9e} {c:.9e} 0.0 0.0 0.0 1.0\n"
        "T: " + " ".join(f"{v:.6e}" for v in T_VELO_IMU_M) + "\n")
    forward_s = PERIOD_S * (np.arange(int(args.seconds / PERIOD_S)) + 1)
    for name, shift_s in (("start", -PERIOD_S / 2), ("end", PERIOD_S / 2)):
        (velodyne / f"timestamps_{name}.txt").write_text("".join(stamp(t + shift_s) for t in forward_s))
    (velodyne / "timestamps.txt").write_text("".join(stamp(t) for t in forward_s))
    (oxts / "timestamps.txt").write_text("".join(stamp(t + INS_LAG_S) for t in forward_s))
    for i, t in enumerate(forward_s):
        (oxts / "data" / f"{i:010d}.txt").write_text(ins_line(drive, t + INS_LAG_S, random))
        (velodyne / "data" / f"{i:010d}.bin").write_bytes(sweep(drive, t, walls, poles, random).tobytes())
    print(folder)


if __name__ == "__main__":
    main()
