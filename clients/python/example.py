#!/usr/bin/env python3
"""Prints the robot's place in the map, as it comes: status, frame, x, y, z [m], and its age [ms].

Usage: example.py [SOCKET [COUNT]]      COUNT: end after so many poses. Exit code 4 where no daemon answers.
"""
import sys
import time

import geoflow


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else geoflow.POSE_SOCKET
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    try:
        client = geoflow.PoseClient(path, name="example.py")
    except geoflow.Error as error:
        print(f"example: {error}", file=sys.stderr)
        return 4
    with client:
        for shown, pose in enumerate(client, 1):
            x, y, z = pose.T_map_base.p
            age_ms = (time.monotonic_ns() - pose.t_capture_ns) * 1e-6
            print(f"{pose.status} {pose.frame} {x:.4f} {y:.4f} {z:.4f} {age_ms:.1f}", flush=True)
            if shown == count:
                break
    return 0


if __name__ == "__main__":
    sys.exit(main())
