"""Images in Python: golden bytes, and memory that a scripted daemon shares."""
import fcntl
import os
import socket
import struct
import unittest

import geoflow
import geoflow_frames
import scripted_daemon
from scripted_daemon import golden

SLOT_BYTES = 4096
F_ADD_SEALS, SEALS = 1033, 0x2 | 0x4 | 0x10 | 0x1  # shrink, grow, future write, seal


def record(kind, payload, dropped=0):
    return struct.pack("<IBBHIIQ", geoflow.MAGIC, 1, 2, kind, len(payload), dropped, 0) + payload


def ring_record(number, slots):
    return record(geoflow.RING, struct.pack("<QQQIIII4d5dd", number, slots * SLOT_BYTES, SLOT_BYTES, 2, slots, 1, 0, 1, 2, 3, 4, *[0] * 5, 0.001))


def frame_record(generation, slot=0, dropped=0):
    return record(geoflow.FRAME, struct.pack("<qqQQQQIIIIII", 1, 2, 3, 1, generation, 4, 2, slot, 2, 2, 1, 4), dropped)


class Frames(scripted_daemon.Case):
    def memory(self, slots=2, seals=SEALS):
        descriptor = os.memfd_create("test", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        self.addCleanup(os.close, descriptor)
        os.ftruncate(descriptor, slots * SLOT_BYTES)
        os.pwrite(descriptor, struct.pack("<Q", 8) + bytes(56) + b"\1\2\3\4", 0)
        if seals:
            fcntl.fcntl(descriptor, F_ADD_SEALS, seals)
        return descriptor

    def client(self, *records, memory=None):
        """A client of a daemon that welcomes it and says these records, the first with the memory's descriptor."""

        def script(connection):
            connection.recv(4096)
            connection.send(golden("1.2")["welcome"])
            socket.send_fds(connection, [records[0]], [memory] if memory is not None else [])
            for further in records[1:] + (golden("1.2")["end"],):
                connection.send(further)

        return geoflow_frames.FrameClient(self.serve(socket.SOCK_SEQPACKET, script))

    def test_the_ring_is_read(self):
        header, payload = geoflow.split(golden("1.2")["ring"])
        ring = geoflow_frames.parse_ring(payload)
        self.assertEqual((header.type, ring.ring, ring.slots, ring.intrinsics, ring.unit_m), (geoflow.RING, 1, 5, (8, 9, 10, 11), 17))

    def test_images_come_with_their_camera(self):
        with self.client(ring_record(1, 2), frame_record(8, dropped=5), memory=self.memory()) as client:
            frames = list(client)
        self.assertEqual([(f.stream, f.frame, f.width, f.height, f.dropped, f.pixels) for f in frames], [("depth", 3, 2, 1, 5, b"\1\2\3\4")])
        self.assertEqual((frames[0].dtype, frames[0].camera.unit_m, frames[0].camera.distortion_model), ("<u2", 0.001, "radtan"))
        self.assertEqual(client.end_reason, geoflow.END_REPLAYED)

    def test_what_was_overwritten_is_counted_and_left_out(self):
        with self.client(ring_record(1, 2), frame_record(6), frame_record(8), frame_record(8, slot=7), memory=self.memory()) as client:
            self.assertEqual(len(list(client)), 1)
            self.assertEqual(client.lost, 1)

    def test_memory_that_is_not_as_it_says_is_refused(self):
        for ring, memory in ((ring_record(1, 2), self.memory(seals=0)), (ring_record(1, 3), self.memory()), (ring_record(1, 2), None)):
            with self.client(ring, memory=memory) as client, self.assertRaisesRegex(geoflow.Error, "memory for frames"):
                client.next()


if __name__ == "__main__":
    unittest.main()
