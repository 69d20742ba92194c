#!/usr/bin/env python3
"""Prints, of each image as it comes, stream, frame, width, height, and the mean of its pixels: gray of colour images, metres of depth images.

Usage: example_frames.py [SOCKET [COUNT]]      COUNT: end after so many images. Exit code 4 where no daemon answers.
"""
import array
import sys

import geoflow
from geoflow_frames import FrameClient


def mean(frame):
    """Of the pixels that were measured, in the image's units."""
    pixels = array.array("H" if frame.dtype == "<u2" else "B", frame.pixels)
    return sum(pixels) / max(sum(1 for pixel in pixels if pixel > 0), 1) * (frame.camera.unit_m or 1)


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else geoflow.POSE_SOCKET
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    try:
        client = FrameClient(path, name="example_frames.py")
    except geoflow.Error as error:
        print(f"example: {error}", file=sys.stderr)
        return 4
    with client:
        for shown, frame in enumerate(client, 1):
            print(f"{frame.stream} {frame.frame} {frame.width} {frame.height} {mean(frame):.3f}", flush=True)
            if shown == count:
                break
    return 0


if __name__ == "__main__":
    sys.exit(main())
