"""What the Python client's tests share: golden records, and a daemon that says what a test wants."""
import socket
import tempfile
import threading
import unittest
from pathlib import Path

GOLDEN = Path(__file__).parent / "golden"


def golden(version):
    lines = (GOLDEN / f"protocol-{version}.txt").read_text().splitlines()
    return {name: bytes.fromhex(digits) for name, digits in (line.split() for line in lines if not line.startswith("#"))}


class Case(unittest.TestCase):
    """A socket whose one client gets what a test says."""

    def serve(self, kind, script):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        path = Path(folder.name) / "socket"
        listener = socket.socket(socket.AF_UNIX, kind)
        self.addCleanup(listener.close)
        listener.bind(str(path))
        listener.listen(1)

        def run():
            connection, _ = listener.accept()
            with connection:
                script(connection)

        thread = threading.Thread(target=run)
        thread.start()
        self.addCleanup(thread.join)
        return path
