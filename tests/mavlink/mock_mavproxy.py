"""What MAVProxy sees of `tomoswarm mock-autopilot`: its commands are typed in, and what it prints is read."""

import os
import re
import subprocess
import sys
import tempfile
import threading
import time

from mock import mock, run

MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t51.9989\t4.3733\t0\t1
1\t0\t3\t16\t0\t0\t0\t0\t51.99895\t4.3733\t0\t1
2\t0\t3\t183\t9\t1700\t0\t0\t0\t0\t0\t1
3\t0\t3\t16\t0\t0\t0\t0\t51.9990\t4.3733\t0\t1
"""


class MavProxy:
    """A MAVProxy that is connected, with its folder."""

    def __init__(self, address, folder):
        program = os.path.join(os.path.dirname(sys.executable), "mavproxy.py")
        self.process = subprocess.Popen(
            [sys.executable, program, "--master", f"tcp:{address}", "--default-modules", "mode,arm,wp,param,cmdlong,misc",
             "--state-basedir", folder, "--aircraft", "mock"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1, cwd=folder)
        self.said = ""
        self.seen = 0
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        while piece := self.process.stdout.read(1):
            self.said += piece

    def until(self, pattern, wait=20):
        """Waits until it prints something that was not seen yet."""
        deadline = time.monotonic() + wait
        while True:
            found = re.search(pattern, self.said[self.seen:])
            if found:
                self.seen += found.end()
                return found
            assert time.monotonic() < deadline, f"not printed: {pattern}; but {self.said[-2000:]}"
            time.sleep(0.05)

    def type(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def end(self):
        self.process.kill()
        self.process.wait()


def a_rover_is_driven_by_typed_commands():
    with tempfile.TemporaryDirectory() as folder, mock(speedup=10) as [address]:
        with open(os.path.join(folder, "mission.txt"), "w", encoding="ascii") as file:
            file.write(MISSION)
        proxy = MavProxy(address, folder)
        try:
            proxy.until(r"Received \d+ parameters")
            proxy.type("param show FS_ACTION")
            proxy.until(r"FS_ACTION\s+2")
            proxy.type("param set FS_GCS_TIMEOUT 9")
            time.sleep(1)
            proxy.type("param show FS_GCS_TIMEOUT")
            proxy.until(r"FS_GCS_TIMEOUT\s+9")
            proxy.type("wp load mission.txt")
            proxy.until(r"Sent all 4 waypoints|Flight plan received|Loaded 4 waypoints")
            time.sleep(1)
            proxy.type("wp save back.txt")
            proxy.until(r"Saved 4 waypoints|Saved waypoints to")
            proxy.type("mode GUIDED")
            proxy.until(r"Mode GUIDED|GUIDED> ")
            proxy.type("arm throttle")
            proxy.until(r"ARMED|Arming motors")
            proxy.type("mode AUTO")
            proxy.until(r"Mission Complete", 40)
            proxy.until(r"Mode HOLD|HOLD> ")
            with open(os.path.join(folder, "back.txt"), encoding="ascii") as file:
                assert [line.split("\t")[3] for line in file.read().splitlines()[1:]] == ["16", "16", "183", "16"]
        finally:
            proxy.end()


if __name__ == "__main__":
    run([a_rover_is_driven_by_typed_commands])
