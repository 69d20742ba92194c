"""The Python client on the protocol's golden bytes, and with scripted daemons."""
import json
import math
import socket
import threading
import unittest

import geoflow
import scripted_daemon
from scripted_daemon import golden

class Records(unittest.TestCase):
    def test_the_pose_is_read_in_every_version(self):
        for version, t_frame_ns in (("1.0", 0), ("1.1", 0x0102030405060708), ("1.2", 0x0102030405060708)):
            header, payload = geoflow.split(golden(version)["pose"])
            self.assertEqual((header.type, header.dropped, header.sequence), (geoflow.POSE, 9, 10))
            pose = geoflow.parse_pose(payload, header.dropped)
            self.assertEqual((pose.t_capture_ns, pose.sync_error_bound_ns, pose.frame), (1, 6, 7))
            self.assertEqual(pose.T_odom_base, geoflow.Transform((8, 9, 10), (11, 12, 13, 14)))
            self.assertEqual(pose.T_map_odom, geoflow.Transform((15, 16, 17), (18, 19, 20, 21)))
            self.assertEqual((pose.v_base, pose.w_base), ((22, 23, 24), (25, 26, 27)))
            self.assertEqual(pose.covariance, tuple(range(28, 49)))
            self.assertEqual((pose.status, pose.source, pose.quality), ("TRACKING", "pnp", 99))
            self.assertEqual((pose.replay, pose.unpaced, pose.reset_counter, pose.map_id), (True, False, 101, 102))
            self.assertEqual((pose.sensors, pose.frames_dropped), (("color", "depth"), 106))
            self.assertEqual((pose.t_frame_ns, pose.dropped), (t_frame_ns, 9))

    def test_the_hello_is_the_golden_one(self):
        self.assertEqual(geoflow.make_hello("abc", geoflow.WANT_POSE, 2.0), golden("1.2")["hello"])

    def test_what_is_no_record_is_refused(self):
        record = golden("1.1")["pose"]
        for wrong in (record[:23], record[:-1], b"\0" + record[1:]):
            with self.assertRaises(geoflow.Error):
                geoflow.split(wrong)

    def test_the_base_in_the_map_is_both_transforms(self):
        half = math.sqrt(0.5)
        quarter = geoflow.Transform((10, 0, 0), (0, 0, half, half))
        both = quarter @ geoflow.Transform((1, 0, 0), (0, 0, half, half))
        for got, expected in zip(both.p + both.q, (10, 1, 0, 0, 0, 1, 0)):
            self.assertAlmostEqual(got, expected)


class ScriptedDaemon(scripted_daemon.Case):
    """Clients of poses and requests."""

    def test_poses_come_until_the_end(self):
        records = golden("1.1")
        unknown = records["end"][:6] + b"\x63\0" + records["end"][8:]

        def script(connection):
            connection.recv(4096)
            for record in (records["welcome"], records["pose"], unknown, records["pose"], records["end"]):
                connection.send(record)

        with geoflow.PoseClient(self.serve(socket.SOCK_SEQPACKET, script)) as client:
            self.assertEqual((client.version, client.client_id), ("0.1.0", 11))
            self.assertEqual([pose.frame for pose in client], [7, 7])
            self.assertEqual(client.end_reason, geoflow.END_REPLAYED)

    def test_a_refusal_is_told(self):
        def script(connection):
            connection.recv(4096)
            connection.send(golden("1.1")["refuse"])

        with self.assertRaisesRegex(geoflow.Error, "too many clients"):
            geoflow.PoseClient(self.serve(socket.SOCK_SEQPACKET, script))

    def test_nothing_comes_in_time(self):
        done = threading.Event()

        def script(connection):
            connection.recv(4096)
            connection.send(golden("1.1")["welcome"])
            done.wait(10)

        with geoflow.PoseClient(self.serve(socket.SOCK_SEQPACKET, script)) as client:
            self.assertIsNone(client.next(timeout=0.01))
            self.assertIsNone(client.end_reason)
            done.set()

    def test_requests_are_answered_refused_and_kept_apart_from_streams(self):
        def script(connection):
            lines = connection.makefile("rw")

            def say(line):
                lines.write(json.dumps(line) + "\n")
                lines.flush()

            say({"hello": "geoflowd"})
            lines.readline()
            say({"stream": "pose", "pose": {"frame": 1}})
            say({"ok": True, "reply": "status"})
            lines.readline()
            say({"ok": False, "error": {"code": "permission_denied", "message": "not for you"}})
            lines.close()

        with geoflow.ControlClient(self.serve(socket.SOCK_STREAM, script)) as control:
            self.assertEqual(control.greeting["hello"], "geoflowd")
            self.assertEqual(control.request("status")["reply"], "status")
            self.assertEqual(control.next()["pose"]["frame"], 1)
            with self.assertRaisesRegex(geoflow.Error, "not for you") as caught:
                control.request("map", do="save")
            self.assertEqual(caught.exception.code, "permission_denied")

    def test_no_daemon_is_an_error(self):
        with self.assertRaisesRegex(geoflow.Error, "/nonexistent/pose.sock: No such file"):
            geoflow.PoseClient("/nonexistent/pose.sock")


if __name__ == "__main__":
    unittest.main()
