"""Images of geoflowd in Python, from memory that is shared with it.

    from geoflow_frames import FrameClient

    with FrameClient() as client:
        for frame in client:
            print(frame.stream, frame.width, frame.height, frame.pixels[:8])

`pixels` are bytes: numpy.frombuffer(frame.pixels, frame.dtype).reshape(frame.height, frame.width) where there is numpy. Of a cloud of the map's
surfaces they are `width` points of seven floats: place in the map [m], unit normal, standard deviation along it [m]. An object belongs to one
thread at a time.
"""
import fcntl
import mmap
import os
import struct
from dataclasses import dataclass

import geoflow

STREAM = {1: "color", 2: "depth", 3: "cloud"}
DTYPE = {1: "u1", 2: "<u2", 3: "<f4"}  # by format: gray; counts of depth, 0: not measured; points
DISTORTION = ("none", "radtan", "equidistant")

_RING = struct.Struct("<QQQIIII4d5dd")
_FRAME = struct.Struct("<qqQQQQIIIIII")
_GENERATION = struct.Struct("<Q")
_SLOT_BYTES = 64  # before a frame's pixels
_F_GET_SEALS, _F_SEAL_SHRINK = 1034, 2  # linux/fcntl.h


@dataclass(frozen=True)
class Ring:
    """The RING record of docs/protocol.md under its names."""

    ring: int
    bytes: int
    slot_bytes: int
    stream: int
    slots: int
    distortion_model: str  # one of DISTORTION
    intrinsics: tuple  # fx fy cx cy [px]
    distortion: tuple
    unit_m: float  # of depth: metres per count; else 0


@dataclass(frozen=True)
class Frame:
    """One image: the FRAME record under its names, with its pixels."""

    t_capture_ns: int
    t_recording_ns: int
    frame: int  # as in the Pose that was made from it
    stream: str  # color, depth or cloud
    dtype: str  # of a pixel, as numpy says it
    width: int  # of a cloud: points
    height: int
    pixels: bytes  # row by row
    camera: Ring  # of which camera it is
    dropped: int  # frames of this stream missed since the last one, for being slow


def parse_ring(payload):
    """The Ring of a RING record's payload, of any minor version."""
    ring, size, slot_bytes, stream, slots, model, _, *numbers = geoflow.unpack(_RING, payload)
    name = DISTORTION[model] if model < len(DISTORTION) else str(model)
    return Ring(ring, size, slot_bytes, stream, slots, name, tuple(numbers[:4]), tuple(numbers[4:9]), numbers[9])


class FrameClient(geoflow.RecordClient):
    """Images as they come: colour (in gray, as the estimator sees it), depth, and clouds of the map's surfaces. Iterating ends when the daemon says that no more will
    follow. `lost`: images that were overwritten before they could be taken, for being slow.

    `max_rate_hz`: images a second of each kind at most; 0: every one. Error where no daemon answers, or it refuses.
    """

    def __init__(self, path=geoflow.POSE_SOCKET, name="python", color=True, depth=True, cloud=False, max_rate_hz=0.0):
        self._rings = {}  # stream: Ring and its memory
        self.lost = 0
        want = (geoflow.WANT_COLOR if color else 0) | (geoflow.WANT_DEPTH if depth else 0) | (geoflow.WANT_CLOUD if cloud else 0)
        super().__init__(path, geoflow.make_hello(name, want, max_rate_hz))

    def close(self):
        for _, memory in self._rings.values():
            memory.close()
        self._rings = {}
        super().close()

    def next(self, timeout=None):
        """The next Frame; None after `timeout` seconds (None: no limit), and where no more will follow (`end_reason` is set)."""
        while (received := self.receive(timeout)) is not None:
            header, payload, descriptors = received
            if header.type == geoflow.RING:
                self._map(parse_ring(payload), descriptors)
            elif header.type == geoflow.FRAME:
                frame = self._take(payload, header.dropped)
                if frame is not None:
                    return frame
        return None

    def __iter__(self):
        while (frame := self.next()) is not None:
            yield frame

    def _map(self, ring, descriptors):
        if len(descriptors) != 1:
            raise geoflow.Error("the daemon's memory for frames did not come", "invalid_data")
        descriptor = descriptors[0]
        try:
            # What could shrink would end its reader.
            sealed = fcntl.fcntl(descriptor, _F_GET_SEALS) & _F_SEAL_SHRINK
            if not sealed or os.fstat(descriptor).st_size < ring.bytes or ring.slots * ring.slot_bytes > ring.bytes:
                raise geoflow.Error("the daemon's memory for frames is not as it says", "invalid_data")
            memory = mmap.mmap(descriptor, ring.bytes, mmap.MAP_SHARED, mmap.PROT_READ)
        except OSError as error:
            raise geoflow.Error(f"the daemon's memory for frames cannot be mapped: {error}") from error
        finally:
            os.close(descriptor)
        former = self._rings.pop(ring.stream, None)
        if former is not None:
            former[1].close()
        self._rings[ring.stream] = ring, memory

    def _take(self, payload, dropped):
        """None where the frame is of a later version's kind, or is no longer there."""
        (t_capture_ns, t_recording_ns, number, ring_number, generation, size, stream, slot, pixel_format, width, height,
         _) = geoflow.unpack(_FRAME, payload)
        ring, memory = self._rings.get(stream, (None, None))
        if ring is None or ring.ring != ring_number or slot >= ring.slots or pixel_format not in DTYPE or stream not in STREAM:
            return None
        begin = slot * ring.slot_bytes
        pixels = memory[begin + _SLOT_BYTES:begin + _SLOT_BYTES + size]
        if _GENERATION.unpack_from(memory, begin)[0] != generation:
            self.lost += 1
            return None
        return Frame(t_capture_ns, t_recording_ns, number, STREAM[stream], DTYPE[pixel_format], width, height, pixels, ring, dropped)
