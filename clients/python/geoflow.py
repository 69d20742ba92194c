"""A client of geoflowd in Python, with its standard library alone: the robot's pose, and the control socket.

    import geoflow

    for pose in geoflow.PoseClient():
        print(pose.status, pose.T_map_base.p)

    with geoflow.ControlClient() as control:
        print(control.request("status")["status"]["summary"])
        control.request("map", do="save")

Frames: T_a_b maps coordinates in b to a; its p is the position of b in a [m], its q a quaternion x, y, z, w. map -> odom -> base_link,
x forward, y left, z up. T_odom_base never jumps, T_map_odom may. Times are CLOCK_MONOTONIC in nanoseconds (time.monotonic_ns) unless they
say otherwise. The records are described in docs/protocol.md. Images: geoflow_frames.py. An object belongs to one thread at a time.
"""
import json
import socket
import struct
from dataclasses import dataclass

MAGIC = 0x574F4C46
MAJOR, MINOR = 1, 2
LARGEST_RECORD = 4096
HELLO, WELCOME, REFUSE, POSE, END, RING, FRAME = 1, 2, 3, 4, 5, 6, 7
WANT_POSE, WANT_PROPAGATED, WANT_COLOR, WANT_DEPTH, WANT_CLOUD = 1, 2, 4, 8, 16
STATUS = ("STARTING", "INITIALISING", "TRACKING", "DEGRADED", "RELOCALISING", "LOST")
SOURCE = ("none", "imu", "legs", "pnp", "gicp", "constant_velocity")
SENSORS = ("color", "depth", "imu", "legs", "body_velocity")
END_STOPPED, END_REPLAYED = 1, 2

POSE_SOCKET = "/run/geoflow/pose.sock"
CONTROL_SOCKET = "/run/geoflow/ctl.sock"

_HEADER = struct.Struct("<IBBHIIQ")
_HELLO = struct.Struct("<BBHId32s")
_WELCOME = struct.Struct("<BBHI16s16sqIIII32s")
_REFUSE = struct.Struct("<II120s")
_POSE = struct.Struct("<qqqqqqQ41dBBBBIIIIIIIq")
_END = struct.Struct("<II")


class Error(Exception):
    """What went wrong: a sentence. `code` is the control socket's, where it is from there."""

    def __init__(self, message, code="unavailable"):
        super().__init__(message)
        self.code = code


@dataclass(frozen=True)
class Header:
    """What stands before each record."""

    major: int
    minor: int
    type: int
    dropped: int
    sequence: int


@dataclass(frozen=True)
class Transform:
    """T_a_b: position [m] and unit quaternion x, y, z, w."""

    p: tuple
    q: tuple

    def rotate(self, v):
        """The vector v of frame b in frame a's axes."""
        x, y, z, w = self.q
        t = (2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0]))
        return (v[0] + w * t[0] + y * t[2] - z * t[1],
                v[1] + w * t[1] + z * t[0] - x * t[2],
                v[2] + w * t[2] + x * t[1] - y * t[0])

    def __matmul__(self, other):
        """T_a_c of T_a_b @ T_b_c."""
        ax, ay, az, aw = self.q
        bx, by, bz, bw = other.q
        turned = self.rotate(other.p)
        return Transform(tuple(a + b for a, b in zip(self.p, turned)),
                         (aw * bx + ax * bw + ay * bz - az * by,
                          aw * by - ax * bz + ay * bw + az * bx,
                          aw * bz + ax * by - ay * bx + az * bw,
                          aw * bw - ax * bx - ay * by - az * bz))


@dataclass(frozen=True)
class Pose:
    """One estimate: the POSE record of docs/protocol.md under its names."""

    t_capture_ns: int
    t_arrival_ns: int
    t_publish_ns: int
    t_recording_ns: int
    realtime_minus_mono_ns: int
    sync_error_bound_ns: int
    frame: int
    T_odom_base: Transform
    T_map_odom: Transform
    v_base: tuple  # velocity of base_link in base_link [m/s]
    w_base: tuple  # angular velocity of base_link in base_link [rad/s]
    covariance: tuple  # of T_odom_base: upper triangle by rows, order x y z rx ry rz, as nav_msgs/Odometry
    status: str  # one of STATUS; a number as text where it is none that this version knows
    source: str
    quality: int  # 0 to 100
    replay: bool
    unpaced: bool
    reset_counter: int
    map_id: int
    visual_inliers: int
    depth_inliers: int
    sensors: tuple
    frames_dropped: int
    t_frame_ns: int  # 0: a daemon of protocol 1.0
    dropped: int = 0  # poses missed since the last one, for being slow

    @property
    def T_map_base(self):
        """Where the robot is in the map."""
        return self.T_map_odom @ self.T_odom_base


def split(record):
    """Header and payload of one datagram. Error where it is no record."""
    if len(record) < _HEADER.size:
        raise Error(f"a record of {len(record)} bytes is shorter than its header", "invalid_data")
    magic, major, minor, kind, size, dropped, sequence = _HEADER.unpack_from(record)
    if magic != MAGIC or size != len(record) - _HEADER.size:
        raise Error("these bytes are no record", "invalid_data")
    return Header(major, minor, kind, dropped, sequence), record[_HEADER.size:]


def unpack(layout, payload):
    """The fields of a payload: what the sender did not have yet is zero, what it has besides is left out."""
    return layout.unpack(payload[:layout.size].ljust(layout.size, b"\0"))


def _text(field):
    return field.split(b"\0", 1)[0].decode("utf-8", "replace")


def _name(names, number):
    return names[number] if number < len(names) else str(number)


def parse_pose(payload, dropped=0):
    """The Pose of a POSE record's payload, of any minor version."""
    f = unpack(_POSE, payload)
    doubles = f[7:48]
    status, source, quality, _, flags, resets, map_id, visual, depth, sensors, lost, t_frame = f[48:]
    return Pose(*f[:7], Transform(doubles[0:3], doubles[3:7]), Transform(doubles[7:10], doubles[10:14]), doubles[14:17], doubles[17:20],
                doubles[20:41], _name(STATUS, status), _name(SOURCE, source), quality, bool(flags & 1), bool(flags & 2), resets, map_id,
                visual, depth, tuple(name for bit, name in enumerate(SENSORS) if sensors >> bit & 1), lost, t_frame, dropped)


def make_hello(name="", want=WANT_POSE, max_rate_hz=0.0):
    """The HELLO record."""
    payload = _HELLO.pack(MAJOR, MINOR, 0, want, max_rate_hz, name.encode()[:31])
    return _HEADER.pack(MAGIC, MAJOR, MINOR, HELLO, len(payload), 0, 0) + payload


class _Connection:
    """A Unix socket that is closed at the end of `with`."""

    def __init__(self, path, kind):
        self._socket = socket.socket(socket.AF_UNIX, kind)
        try:
            self._socket.settimeout(5.0)
            self._socket.connect(str(path))
        except OSError as error:
            self.close()
            raise Error(f"{path}: {error.strerror or error}") from error

    def close(self):
        """Idempotent."""
        self._socket.close()

    def fileno(self):
        """For select and selectors."""
        return self._socket.fileno()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class RecordClient(_Connection):
    """Records as they come, after the handshake. `end_reason`: None while more may follow, then END_STOPPED, END_REPLAYED or 0 (the daemon
    has gone without a word). Error where no daemon answers, or it refuses.
    """

    def __init__(self, path, hello):
        super().__init__(path, socket.SOCK_SEQPACKET)
        self.end_reason = None
        try:
            self._greet(hello)
        except (OSError, Error) as error:
            self.close()
            raise error if isinstance(error, Error) else Error(f"{path}: {error}") from error

    def _greet(self, hello):
        try:
            self._socket.send(hello)
        except BrokenPipeError:
            pass  # a daemon that refuses may have shut its end already; its reason can still be read
        record = self._socket.recv(LARGEST_RECORD)
        if not record:
            raise Error("the daemon does not answer")
        header, payload = split(record)
        if header.type == REFUSE:
            raise Error("the daemon refused: " + _text(unpack(_REFUSE, payload)[2]))
        if header.type != WELCOME:
            raise Error("what answers is no geoflowd", "invalid_data")
        fields = unpack(_WELCOME, payload)
        self.client_id, self.instance, self.boot_id = fields[3:6]
        self.version = _text(fields[11])

    def receive(self, timeout):
        """Header, payload and descriptors of the next record, END apart; None after `timeout` seconds (None: no limit), and where no more
        will follow."""
        if self.end_reason is not None:
            return None
        self._socket.settimeout(timeout)
        try:
            record, descriptors, _, _ = socket.recv_fds(self._socket, LARGEST_RECORD, 1)
        except (TimeoutError, BlockingIOError):
            return None
        except ConnectionResetError:
            record, descriptors = b"", []
        if not record:
            self.end_reason = 0
            return None
        header, payload = split(record)
        if header.type == END:
            self.end_reason = unpack(_END, payload)[0]
            return None
        return header, payload, descriptors


class PoseClient(RecordClient):
    """Poses as they come. Iterating ends when the daemon says that no more will follow.

    `propagated`: poses at each IMU sample instead of each frame. `max_rate_hz`: poses a second at most; 0: every one. Error where no daemon
    answers, or it refuses.
    """

    def __init__(self, path=POSE_SOCKET, name="python", propagated=False, max_rate_hz=0.0):
        super().__init__(path, make_hello(name, WANT_PROPAGATED if propagated else WANT_POSE, max_rate_hz))

    def next(self, timeout=None):
        """The next Pose; None after `timeout` seconds (None: no limit), and where no more will follow (`end_reason` is set)."""
        while (received := self.receive(timeout)) is not None:
            header, payload, _ = received
            if header.type == POSE:
                return parse_pose(payload, header.dropped)
        return None

    def __iter__(self):
        while (pose := self.next()) is not None:
            yield pose


class ControlClient(_Connection):
    """Requests on the control socket, one JSON object a line. `greeting` is what the daemon said first."""

    def __init__(self, path=CONTROL_SOCKET):
        super().__init__(path, socket.SOCK_STREAM)
        self._lines = self._socket.makefile("r", encoding="utf-8", newline="\n")
        self._stream = []
        try:
            self.greeting = self._checked(self._line())
        except Error:
            self.close()
            raise

    def close(self):
        if hasattr(self, "_lines"):
            self._lines.close()
        super().close()

    def _line(self):
        try:
            line = self._lines.readline()
        except OSError as error:
            raise Error(f"the daemon does not answer: {error}") from error
        if not line.endswith("\n"):
            raise Error("the daemon has gone")
        return json.loads(line)

    @staticmethod
    def _checked(line):
        if line.get("ok") is False:
            raise Error(line["error"]["message"], line["error"]["code"])
        return line

    def request(self, cmd, timeout=60.0, **arguments):
        """The reply to {"cmd": cmd, …arguments}. Error, with its code, where the daemon says that it cannot be, or does not answer."""
        self._socket.settimeout(timeout)
        try:
            self._socket.sendall((json.dumps({"cmd": cmd, **arguments}) + "\n").encode())
        except OSError as error:
            raise Error(f"the daemon has gone: {error}") from error
        while True:
            line = self._line()
            if "ok" in line:
                return self._checked(line)
            self._stream.append(line)

    def next(self, timeout=60.0):
        """The next line of the stream that is watched (request("watch"))."""
        if self._stream:
            return self._stream.pop(0)
        self._socket.settimeout(timeout)
        return self._checked(self._line())
