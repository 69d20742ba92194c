#!/usr/bin/env python3
"""In the guest: the emulated D435i before Debian's own drivers.  d435i_guest.py BUILD DATA

What uvcvideo, hid-sensor-hub, lsusb and v4l2-ctl make of it must be what they make of a real camera, and each image, metadata header
and IMU sample that comes out of the kernel must be one that the emulator wrote down as sent, in the same order.
"""
import subprocess
import sys
from pathlib import Path

import guest

SERIAL = "843123050435"
FROM_90 = [90, 60, 30, 15, 6]
FROM_60 = [60, 30, 15, 6]
# As `v4l2-ctl --list-formats-ext` lists them of a real D435i. Formats that the kernel does not know have no name, and are left out.
STEREO = {(256, 144): [300, 90], (424, 240): FROM_90, (480, 270): FROM_90, (640, 360): FROM_90, (640, 480): FROM_90,
          (848, 100): [300, 100], (848, 480): FROM_90, (1280, 720): [30, 15, 6]}
FORMATS = {
    "/dev/video0": {"Z16 ": STEREO},
    "/dev/video2": {"GREY": STEREO, "UYVY": STEREO, "Y8I ": {**STEREO, (1280, 800): [30, 15]},
                    "Y12I": {(640, 400): [25, 15], (1280, 800): [25, 15]}},
    "/dev/video4": {"YUYV": {(320, 180): [60, 30, 6], (320, 240): [60, 30, 6], (424, 240): FROM_60, (640, 360): FROM_60,
                             (640, 480): FROM_60, (848, 480): FROM_60, (960, 540): FROM_60, (1280, 720): [30, 15, 6],
                             (1920, 1080): [30, 15, 6]}},
}
# Lines of `lsusb -v` of a real camera, without their column widths.
LSUSB = ["bcdUSB 3.20", "bMaxPacketSize0 9", "bcdDevice 50.c7", "wTotalLength 0x0c7f", "bNumInterfaces 6", "MaxPower 440mA",
         "dwClockFrequency 48.000000MHz", "guidExtensionCode {c9606ccb-594c-4d25-af47-ccc496435995}",
         "guidExtensionCode {b8ec416e-a3ac-4580-8d5c-0bee1597e43d}", "wDescriptorLength 1000",
         "guidFormat {2036315a-0000-0010-8000-00aa00389b71}", "bMaxBurst 15"]
FRAMES = 15


def camera(build, recording, *options):
    return guest.Emulator(build, recording, "--loop", "--asic-serial", SERIAL, "--sent-log", "/tmp/sent.ndjson", *options)


def sent(endpoint):
    """What the emulator wrote down as sent on an endpoint."""
    return guest.json_lines(Path("/tmp/sent.ndjson"), lambda line: line["endpoint"] == endpoint)


def check_identity():
    shown = " ".join(subprocess.run(["lsusb", "-v", "-d", "8086:0b3a"], check=False, capture_output=True,
                                    text=True).stdout.split())
    for line in LSUSB:
        guest.check(line.lower() in shown.lower(), f"lsusb -v says {line}")
    guest.check(f"iSerial 3 {SERIAL}" in shown, f"lsusb -v says {SERIAL}")
    for node, expected in FORMATS.items():
        found = guest.video_formats(node)
        found = {name: sizes for name, sizes in found.items() if name.strip("\0 ")}
        guest.check(found == expected, f"{node} offers what a D435i does", found)


def check_monitor():
    identity = guest.hardware_monitor("/dev/video0", 0x10)
    guest.check(identity[12:16] == bytes([100, 7, 12, 5]), "the hardware monitor tells the firmware", identity[:16].hex())
    guest.check(identity[64:70].hex() == SERIAL, "and the serial number of the chip")
    guest.check(len(guest.hardware_monitor("/dev/video0", 0x15, 25)) == 512, "and the depth table")
    guest.check(len(guest.hardware_monitor("/dev/video0", 0x15, 32)) == 256, "and the colour table")


def check_images():
    for node, fourcc, pixel_bytes, endpoint in (("/dev/video0", "Z16 ", 2, 0x82), ("/dev/video4", "YUYV", 2, 0x84),
                                                ("/dev/video2", "GREY", 1, 0x83)):
        received = guest.capture(node, fourcc, (640, 480), pixel_bytes, FRAMES)
        crcs = [line["crc32"] for line in sent(endpoint)]
        guest.check(len(received) == FRAMES, f"{node} gave {FRAMES} frames of {fourcc}", len(received))
        guest.check(guest.in_order(received, crcs), f"each of them is one of the {len(crcs)} sent, in their order")


def check_metadata():
    headers = guest.metadata_while_streaming("/dev/video1", "/dev/video0", FRAMES)
    those_sent = [bytes.fromhex(line["header"]) for line in sent(0x82)]
    found = sum(header in headers for header in those_sent)
    guest.check(found >= FRAMES // 2 and len(those_sent[0]) == 232, "the metadata node gives the headers that were sent, whole", found)


def check_imu():
    for name, report, scale in (("accel_3d", 1, 0.009806650), ("gyro_3d", 2, 0.001745329)):
        samples, shown_scale = guest.imu_samples(name, 100)
        reports = [guest.decode_report(bytes.fromhex(line["report"])) for line in sent(0x86)]
        felt = [tuple(sample) for number, *sample in reports if number == report]
        guest.check(abs(shown_scale - scale) < 1e-8, f"{name} has the scale of a real camera", shown_scale)
        guest.check(len(samples) == 100, f"{name} gave 100 samples", len(samples))
        guest.check(guest.in_order(samples, felt), f"each of them is one of the {len(felt)} sent, in their order",
                    samples[:2], felt[:2])


def check_unplugging(build, recording):
    emulator = camera(build, recording, "--fault", "unplug@1+2")
    guest.check(guest.wait_for("/dev/video5", 60), "plugged in again, the nodes are back")
    subprocess.run(["timeout", "20", "v4l2-ctl", "-d", "/dev/video0", "--stream-mmap", "--stream-count=300"], check=False,
                   capture_output=True)
    guest.check(guest.wait_for("/dev/video5", 10, there=False), "unplugged while it streams, the nodes are gone")
    guest.check(guest.wait_for("/dev/video5", 60), "and back when the camera is")
    emulator.stop()


def main():
    build, data = Path(sys.argv[1]), Path(sys.argv[2])
    recording = data / "office"
    guest.load_camera_drivers()
    emulator = camera(build, recording)
    guest.check(emulator.plugged_in(), "uvcvideo makes six video nodes, and hid-sensor-hub two IMU devices")
    check_identity()
    check_monitor()
    check_images()
    check_metadata()
    check_imu()
    emulator.stop()
    guest.check(guest.wait_for("/dev/video0", 10, there=False), "without the emulator the nodes are gone")
    check_unplugging(build, recording)
    return guest.summary()


if __name__ == "__main__":
    sys.exit(main())
