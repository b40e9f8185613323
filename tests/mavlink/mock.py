"""Starts `tomoswarm mock-autopilot`, and connects pymavlink to it; the program is named by TOMOSWARM."""

import contextlib
import math
import os
import subprocess
import sys
import time
import traceback

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

mavlink = mavutil.mavlink
ROVER = {"manual": 0, "hold": 4, "loiter": 5, "auto": 10, "return": 11, "guided": 15}
COPTER = {"auto": 3, "guided": 4, "loiter": 5, "return": 6, "land": 9}


@contextlib.contextmanager
def mock(*options, sockets="--tcp", speedup=20):
    """A mock autopilot; gives the addresses of its endpoints."""
    command = [os.environ["TOMOSWARM"], "mock-autopilot", sockets, "127.0.0.1:0", "--speedup", str(speedup), "--tied", *options]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        count = int(options[options.index("--count") + 1]) if "--count" in options and "--one-link" not in options else 1
        addresses = []
        for _ in range(count):
            line = process.stdout.readline()
            assert line.startswith("autopilot "), f"no address, but {line!r}"
            addresses.append(line.split()[1])
        yield addresses
        assert process.poll() is None, f"it has ended by itself with {process.returncode}"
    finally:
        process.stdin.close()
        process.wait(timeout=10)


def connect(address, protocol="tcp", system=255):
    """A client that has heard the vehicle."""
    link = mavutil.mavlink_connection(f"{protocol}:{address}", source_system=system, autoreconnect=False)
    if protocol == "udpout":
        heartbeat(link)
    assert link.wait_heartbeat(timeout=5) is not None, "no heartbeat"
    return link


def heartbeat(link):
    link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)


def command(link, number, *parameters, wait=5, target=None):
    """Gives a command; returns the MAV_RESULT that it is answered."""
    parameters = [*parameters, *[0.0] * (7 - len(parameters))]
    target = link.target_system if target is None else target
    link.mav.command_long_send(target, link.target_component, number, 0, *parameters)
    until = time.monotonic() + wait
    while time.monotonic() < until:
        ack = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=max(0.01, until - time.monotonic()))
        if ack is not None and ack.command == number:
            return ack.result
    return None


def stream(link, message, rate_hz):
    """Asks for a message at a rate."""
    result = command(link, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, 1e6 / rate_hz)
    assert result == mavlink.MAV_RESULT_ACCEPTED, f"interval of {message}: {result}"


def arm(link, mode):
    """Arms in a mode, as soon as the vehicle knows its place."""
    deadline = time.monotonic() + 5
    while True:
        in_mode = command(link, mavlink.MAV_CMD_DO_SET_MODE, 1, mode) == mavlink.MAV_RESULT_ACCEPTED
        if in_mode and command(link, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_ACCEPTED:
            return
        assert time.monotonic() < deadline, "not armed"
        time.sleep(0.02)


def wait_for(link, kind, condition, wait=20):
    """Returns the first message of a kind for which something holds."""
    until = time.monotonic() + wait
    last = None
    while time.monotonic() < until:
        last = link.recv_match(type=kind, blocking=True, timeout=max(0.01, until - time.monotonic()))
        if last is not None and condition(last):
            return last
    raise AssertionError(f"no {kind} in time; the last one: {last}")


def distance_m(one, other):
    """Between two places in 1e-7 degrees."""
    north = (one[0] - other[0]) * 1e-7 * 111_250
    east = (one[1] - other[1]) * 1e-7 * 111_320 * math.cos(math.radians(one[0] * 1e-7))
    return math.hypot(north, east)


def place_at(link, north_m, east_m, of=None):
    """The place so far from another one, by default from where the vehicle is, 1e-7 degrees."""
    if of is None:
        stream(link, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 10)
        here = wait_for(link, "GLOBAL_POSITION_INT", lambda _: True)
        of = (here.lat, here.lon)
    latitude = of[0] + north_m / 111_250 * 1e7
    longitude = of[1] + east_m / (111_320 * math.cos(math.radians(of[0] * 1e-7))) * 1e7
    return round(latitude), round(longitude)


def item(link, seq, number, place=(0, 0), altitude_m=0.0, parameters=(0, 0, 0, 0)):
    """An item of a mission."""
    return mavlink.MAVLink_mission_item_int_message(
        link.target_system, link.target_component, seq, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        number, 0, 1, *parameters, *place, altitude_m)


def upload(link, items, wait=20):
    """Uploads a mission; returns the judgement."""
    link.mav.mission_count_send(link.target_system, link.target_component, len(items), 0)
    until = time.monotonic() + wait
    while time.monotonic() < until:
        said = link.recv_match(type=["MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"], blocking=True, timeout=1)
        if said is None:
            continue
        if said.get_type() == "MISSION_ACK":
            return said.type
        link.mav.send(items[said.seq])
    raise AssertionError("the upload does not end")


def download(link, wait=20):
    """Downloads the mission."""
    link.mav.mission_request_list_send(link.target_system, link.target_component, 0)
    count = wait_for(link, "MISSION_COUNT", lambda _: True).count
    items = []
    for seq in range(count):
        link.mav.mission_request_int_send(link.target_system, link.target_component, seq, 0)
        items.append(wait_for(link, "MISSION_ITEM_INT", lambda said: said.seq == seq, wait))
    link.mav.mission_ack_send(link.target_system, link.target_component, mavlink.MAV_MISSION_ACCEPTED, 0)
    return items


def run(tests):
    """Runs tests by name, or those that are asked for; ends the program."""
    asked = sys.argv[1:]
    failed = []
    for test in tests:
        if asked and test.__name__ not in asked:
            continue
        began = time.monotonic()
        try:
            test()
            print(f"ok {test.__name__} ({time.monotonic() - began:.1f} s)", flush=True)
        except Exception:  # whatever went wrong, the others are run
            failed.append(test.__name__)
            print(f"FAILED {test.__name__}", flush=True)
            traceback.print_exc()
    sys.exit(1 if failed else 0)
