"""What the maker's library (digi-xbee) sees of the simulated modules of `tomoswarm world`; the program is named by TOMOSWARM.

It knows nothing of this project: it opens two modules in both API modes, reads and sets registers, sends and hears.
"""

import contextlib
import os
import subprocess
import sys
import tempfile
import time
import traceback

import serial
from digi.xbee.devices import Raw802Device
from digi.xbee.exception import ATCommandException

BAUD = 115_200
# All four bytes that API mode 2 escapes.
PAYLOAD = bytes([0x74, 0x53, 1, 0x0A, 0x7E, 0x7D, 0x11, 0x13])


@contextlib.contextmanager
def world():
    """A world with two vehicles; gives the folder of their ports."""
    with tempfile.TemporaryDirectory() as folder:
        command = [os.environ["TOMOSWARM"], "world", "configs/small.sim.toml", "--tied", "--xbee-pty", folder]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            assert process.stdout.readline(), process.stderr.read()
            # A module that was switched on hears nothing for 0.1 s.
            time.sleep(0.5)
            yield folder
            assert process.poll() is None, f"it has ended by itself with {process.returncode}"
        finally:
            process.stdin.close()
            process.wait(timeout=10)


@contextlib.contextmanager
def modules(folder):
    """Both modules, opened by the library."""
    opened = []
    try:
        for vehicle in (1, 2):
            device = Raw802Device(f"{folder}/vehicle-{vehicle}", BAUD)
            opened.append(device)
            device.open()
        yield opened
    finally:
        for device in opened:
            if device.is_open():
                device.close()


def set_mode_1(folder):
    """Puts both modules from API mode 2 into 1; none of these bytes is escaped."""
    for vehicle in (1, 2):
        with serial.Serial(f"{folder}/vehicle-{vehicle}", BAUD, timeout=1) as port:
            frame = b"\x08\x01AP\x01"
            port.write(b"\x7e\x00\x05" + frame + bytes([0xFF - sum(frame) % 256]))
            assert port.read(9)[3:8] == b"\x88\x01AP\x00"


def they_are_what_the_library_expects(folder, mode):
    with modules(folder) as (one, two):
        assert one.operating_mode.code == mode
        for vehicle, device in enumerate((one, two), start=1):
            assert int(device.get_16bit_addr().address.hex(), 16) == vehicle
            assert device.get_64bit_addr().address.hex().startswith("0013a200")
        one.send_data_broadcast(PAYLOAD)
        heard = two.read_data(2)
        assert (bytes(heard.data), heard.is_broadcast) == (PAYLOAD, True)
        assert heard.remote_device.get_16bit_addr() == one.get_16bit_addr()
        # To a sender that it has not heard before the library speaks by itself, and does not answer meanwhile.
        time.sleep(1.0)
        assert 20 < two.get_parameter("DB")[0] < 110
        one.set_node_id("tomoswarm-1")
        assert one.get_node_id() == "tomoswarm-1"
        try:
            one.set_parameter("CH", b"\x63")
            raise AssertionError("channel 99 was taken")
        except ATCommandException:
            pass


def mode_2():
    with world() as folder:
        they_are_what_the_library_expects(folder, 2)


def mode_1():
    with world() as folder:
        set_mode_1(folder)
        they_are_what_the_library_expects(folder, 1)


if __name__ == "__main__":
    failed = False
    for test in (mode_2, mode_1):
        try:
            test()
            print(f"ok {test.__name__}", flush=True)
        except Exception:
            traceback.print_exc(file=sys.stdout)
            failed = True
    # The library leaves threads behind.
    sys.stdout.flush()
    os._exit(failed)
