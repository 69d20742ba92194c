"""What tests in the guest share: checks, and the kernel's interfaces to cameras and IMUs. Runs in the guest only."""
import ctypes
import fcntl
import json
import os
import re
import select
import signal
import socket
import struct
import subprocess
import time
import zlib
from pathlib import Path

_failed = []


def check(holds, what, *found):
    """One thing that must hold, printed; `found` is shown where it does not."""
    print(f"{'ok' if holds else 'FAILED'}: {what}", *(found if not holds else ()), flush=True)
    if not holds:
        _failed.append(what)


def summary():
    print(f"{len(_failed)} checks failed", flush=True)
    return 1 if _failed else 0


def load(*modules):
    subprocess.run(["modprobe", "-a", *modules], check=True)


def load_camera_drivers():
    load("vhci-hcd", "usbhid", "uvcvideo", "hid-sensor-hub", "hid-sensor-accel-3d", "hid-sensor-gyro-3d")
    # Kernels before 6.3 know the metadata's layout of other cameras of the family only.
    Path("/sys/bus/usb/drivers/uvcvideo/new_id").write_text("8086 0b3a 0e 8086 0b03", encoding="ascii")


def raise_can_bus(name):
    load("can-raw", "vcan")
    subprocess.run(["ip", "link", "add", name, "type", "vcan"], check=True)
    subprocess.run(["ip", "link", "set", name, "up"], check=True)


class Process:
    """A program of the build that runs until stop(), and the JSON lines that it says."""

    def __init__(self, name, *command):
        self.output = Path(f"/tmp/{name}.ndjson")
        with self.output.open("wb") as output:
            self.process = subprocess.Popen([str(part) for part in command], stdout=output)

    def said(self, key):
        """Newest value of a key that a line had; none: no line had it."""
        lines = json_lines(self.output, lambda line: key in line)
        return lines[-1][key] if lines else None

    def wait_until_said(self, key, seconds):
        end = time.monotonic() + seconds
        while (value := self.said(key)) is None and time.monotonic() < end and self.process.poll() is None:
            time.sleep(0.05)
        return value

    def stop(self):
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(timeout=60)


class Emulator(Process):
    """A running `geoflow emulate d435i`."""

    def __init__(self, build, recording, *options):
        super().__init__("emulator", build / "bin/geoflow", "emulate", "d435i", "--recording", recording, "--attach", "--json",
                         *options)

    @staticmethod
    def plugged_in():
        return wait_for("/dev/video5", 120) and wait_for("/sys/bus/iio/devices/iio:device1", 30)


class Daemon(Process):
    """A running geoflowd, its sockets in /tmp."""

    POSES, CONTROL = "/tmp/pose.sock", "/tmp/ctl.sock"

    def __init__(self, build, **keys):
        settings = [word for key, value in keys.items() for word in ("--set", f"{key.replace('__', '.')}={value}")]
        super().__init__("geoflowd", build / "bin/geoflowd", "--pose-socket", self.POSES, "--control-socket", self.CONTROL,
                         *settings)

    def status(self):
        """What it says on its control socket, {} while it does not answer."""
        with socket.socket(socket.AF_UNIX) as connection:
            try:
                connection.connect(self.CONTROL)
                connection.sendall(b'{"cmd":"status"}\n')
                with connection.makefile(encoding="utf-8") as lines:
                    for line in lines:
                        if (reply := json.loads(line)).get("reply") == "status":
                            return reply["status"]
            except OSError:
                pass
        return {}


def wait_for(path, seconds, there=True):
    """Whether a path is there, or gone, within a time."""
    end = time.monotonic() + seconds
    while os.path.exists(path) != there and time.monotonic() < end:
        time.sleep(0.1)
    return os.path.exists(path) == there


def json_lines(path, wanted):
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    parsed = [json.loads(line) for line in lines if line.endswith("\n")]
    return [line for line in parsed if wanted(line)]


def in_order(received, sent):
    """Whether all that was received was sent, in the same order; some of what was sent may be missing."""
    rest = iter(sent)
    return bool(received) and all(any(item == other for other in rest) for item in received)


def video_formats(node):
    """{format: {(width, height): [frames a second]}} by v4l2-ctl."""
    text = subprocess.run(["v4l2-ctl", "-d", node, "--list-formats-ext"], check=False, capture_output=True, text=True).stdout
    formats, sizes, rates = {}, {}, []
    for line in text.splitlines():
        if match := re.search(r"\]: '(.*)' \(", line):
            sizes = formats.setdefault(match[1], {})
        elif match := re.search(r"Size: Discrete (\d+)x(\d+)", line):
            rates = sizes[int(match[1]), int(match[2])] = []
        elif match := re.search(r"\(([\d.]+) fps\)", line):
            rates.append(round(float(match[1])))
    return formats


def capture(node, fourcc, size, pixel_bytes, count):
    """Checksums of frames read from a node."""
    output = Path("/tmp/frames.raw")
    subprocess.run(["timeout", "120", "v4l2-ctl", "-d", node, "--stream-mmap=8", f"--stream-count={count}",
                    f"--set-fmt-video=width={size[0]},height={size[1]},pixelformat={fourcc}", "--set-parm=30",
                    f"--stream-to={output}"], check=False, capture_output=True)
    data = output.read_bytes() if output.exists() else b""
    length = size[0] * size[1] * pixel_bytes
    output.unlink(missing_ok=True)
    return [zlib.crc32(data[i:i + length]) for i in range(0, len(data) - length + 1, length)]


def metadata_while_streaming(meta_node, node, count):
    """What a metadata node gives while its camera streams."""
    output = Path("/tmp/metadata.raw")
    subprocess.run(["v4l2-ctl", "-d", meta_node, "--set-fmt-meta=D4XX"], check=False)
    with subprocess.Popen(["timeout", "60", "v4l2-ctl", "-d", meta_node, "--stream-mmap=8", f"--stream-count={count}",
                           f"--stream-to={output}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL):
        time.sleep(1)
        capture(node, "Z16 ", (640, 480), 2, 2 * count)
    return output.read_bytes() if output.exists() else b""


class _Query(ctypes.Structure):
    """struct uvc_xu_control_query of linux/uvcvideo.h."""

    _fields_ = [("unit", ctypes.c_uint8), ("selector", ctypes.c_uint8), ("query", ctypes.c_uint8), ("size", ctypes.c_uint16),
                ("data", ctypes.c_void_p)]


def hardware_monitor(node, opcode, *parameters):
    """The data of a reply of the camera's hardware monitor, through extension unit 3."""
    control_query, set_current, get_current, size = 0xC0107521, 0x01, 0x81, 1024
    request = struct.pack("<HHI4I", 20, 0xCDAB, opcode, *(*parameters, 0, 0, 0, 0)[:4])
    buffer = ctypes.create_string_buffer(request, size)
    device = os.open(node, os.O_RDWR)
    try:
        for query in (set_current, get_current):
            fcntl.ioctl(device, control_query, _Query(3, 1, query, size, ctypes.addressof(buffer)))
    finally:
        os.close(device)
    length = struct.unpack_from("<I", buffer.raw, size - 4)[0]
    return buffer.raw[4:4 + length]


def decode_report(report):
    """(id, x, y, z, time [ns]) of an IMU report of 32 bytes."""
    number, _, time_us, x, y, z = struct.unpack_from("<BBQ3h", report)
    return number, x, y, z, time_us * 1000


def imu_samples(name, count):
    """Samples (x, y, z, time [ns]) of an IIO device at 200 Hz, and its scale."""
    folder = next(path for path in Path("/sys/bus/iio/devices").glob("iio:device*")
                  if (path / "name").read_text().strip() == name)
    channel = "in_accel" if name == "accel_3d" else "in_anglvel"

    def write(file, value):
        (folder / file).write_text(str(value), encoding="ascii")

    write(f"{channel}_sampling_frequency", 2)
    for element in (f"{channel}_x", f"{channel}_y", f"{channel}_z", "in_timestamp"):
        write(f"scan_elements/{element}_en", 1)
    write("buffer/length", 256)
    write("buffer/enable", 1)
    samples = []
    device = os.open(f"/dev/{folder.name}", os.O_RDONLY | os.O_NONBLOCK)
    end = time.monotonic() + 60
    while len(samples) < count and time.monotonic() < end:
        if select.select([device], [], [], 1)[0]:
            data = os.read(device, 24 * (count - len(samples)))
            samples += [struct.unpack_from("<hxxhxxhxx4xq", data, i) for i in range(0, len(data) - 23, 24)]
    os.close(device)
    write("buffer/enable", 0)
    return samples, float((folder / f"{channel}_scale").read_text())
