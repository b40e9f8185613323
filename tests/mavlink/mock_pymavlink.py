"""What pymavlink sees of `tomoswarm mock-autopilot`."""

import random
import socket
import time

from mock import (
    COPTER, ROVER, arm, command, connect, distance_m, download, heartbeat, item, mavlink, mock, mavutil,
    place_at, run, stream, upload, wait_for,
)

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


def heartbeat_at_once_and_armable_soon():
    with mock("--vehicle", "copter", speedup=1) as [address]:
        began = time.monotonic()
        link = connect(address)
        assert time.monotonic() - began < 0.5
        assert link.recv_match(blocking=True, timeout=1.5, type=["HEARTBEAT", "ATTITUDE"]).get_type() == "HEARTBEAT"
        arm(link, COPTER["guided"])
        assert time.monotonic() - began < 3.0
        beat = wait_for(link, "HEARTBEAT", lambda beat: beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        assert (beat.type, beat.autopilot) == (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
        assert beat.custom_mode == COPTER["guided"]


def version_and_unknown_things():
    with mock() as [address]:
        link = connect(address)
        assert command(link, mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == ACCEPTED
        link.mav.command_long_send(1, 1, mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 0, 1, 0, 0, 0, 0, 0, 0)
        version = wait_for(link, "AUTOPILOT_VERSION", lambda _: True)
        assert version.flight_sw_version >> 8 == 0x040504
        assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        # As ArduPilot answers them.
        assert command(link, 31_999) == mavlink.MAV_RESULT_UNSUPPORTED
        assert command(link, mavlink.MAV_CMD_DO_PARACHUTE) == mavlink.MAV_RESULT_UNSUPPORTED
        assert command(link, mavlink.MAV_CMD_DO_SET_MODE, 1, 77) == mavlink.MAV_RESULT_FAILED
        assert command(link, mavlink.MAV_CMD_REQUEST_MESSAGE, 9_999) == mavlink.MAV_RESULT_FAILED
        assert command(link, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 9_999, 1e5) == mavlink.MAV_RESULT_DENIED
        assert command(link, mavlink.MAV_CMD_GET_HOME_POSITION, target=9, wait=0.5) is None
        assert command(link, mavlink.MAV_CMD_REQUEST_MESSAGE, 30, target=0) == ACCEPTED


def streams_at_asked_rates():
    with mock(speedup=1) as [address]:
        link = connect(address)
        rates = {"ATTITUDE": (30, 50), "GLOBAL_POSITION_INT": (33, 10), "SYS_STATUS": (1, 2)}
        for number, rate_hz in rates.values():
            stream(link, number, rate_hz)
        counts = dict.fromkeys(rates, 0)
        until = time.monotonic() + 3
        while time.monotonic() < until:
            said = link.recv_match(blocking=True, timeout=0.1)
            if said is not None and said.get_type() in counts:
                counts[said.get_type()] += 1
        for kind, (_, rate_hz) in rates.items():
            assert abs(counts[kind] - 3 * rate_hz) <= max(2, 0.1 * 3 * rate_hz), (kind, counts)
        link.mav.command_long_send(1, 1, mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, 0, 30, 0, 0, 0, 0, 0, 0)
        assert wait_for(link, "MESSAGE_INTERVAL", lambda _: True).interval_us == 20_000
        for number, _ in rates.values():
            assert command(link, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, -1) == ACCEPTED
        link.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_ALL, 20, 1)
        wait_for(link, "VFR_HUD", lambda _: True)


def parameters_are_listed_read_and_set():
    with mock() as [address]:
        link = connect(address)
        link.mav.param_request_list_send(1, 1)
        values = {}
        until = time.monotonic() + 5
        count = None
        while time.monotonic() < until and (count is None or len(values) < count):
            value = link.recv_match(type="PARAM_VALUE", blocking=True, timeout=1)
            if value is not None:
                count, values[value.param_id] = value.param_count, value.param_value
        assert count == len(values) > 15, (count, len(values))
        assert values["FS_ACTION"] == 2 and values["SYSID_THISMAV"] == 1
        link.mav.param_set_send(1, 1, b"FS_GCS_TIMEOUT", 7.5, mavlink.MAV_PARAM_TYPE_REAL32)
        assert wait_for(link, "PARAM_VALUE", lambda value: value.param_id == "FS_GCS_TIMEOUT").param_value == 7.5
        link.mav.param_set_send(1, 1, b"FS_GCS_TIMEOUT", float("nan"), mavlink.MAV_PARAM_TYPE_REAL32)
        link.mav.param_request_read_send(1, 1, b"FS_GCS_TIMEOUT", -1)
        assert wait_for(link, "PARAM_VALUE", lambda value: value.param_id == "FS_GCS_TIMEOUT").param_value == 7.5


def a_mission_of_200_items_comes_back():
    with mock() as [address]:
        link = connect(address)
        middle = place_at(link, 0, 0)
        items = [item(link, 0, mavlink.MAV_CMD_NAV_WAYPOINT, middle)]
        for seq in range(1, 200):
            items.append(item(link, seq, mavlink.MAV_CMD_NAV_WAYPOINT, place_at(link, seq, -seq, middle), seq, (1, 0, 0, 0)))
        assert upload(link, items) == mavlink.MAV_MISSION_ACCEPTED
        for sent, read in zip(items, download(link), strict=True):
            fields = ("seq", "command", "frame", "x", "y", "z", "param1", "autocontinue")
            assert [getattr(sent, field) for field in fields] == [getattr(read, field) for field in fields]
        # What is refused leaves the stored one.
        bad = [items[0], item(link, 1, mavlink.MAV_CMD_NAV_FOLLOW, middle)]
        assert upload(link, bad) == mavlink.MAV_MISSION_UNSUPPORTED
        far = [items[0], item(link, 1, mavlink.MAV_CMD_NAV_WAYPOINT, (950_000_000, 0))]
        assert upload(link, far) == mavlink.MAV_MISSION_INVALID_PARAM5_X
        link.mav.mission_count_send(1, 1, 900, 0)
        assert wait_for(link, "MISSION_ACK", lambda _: True).type == mavlink.MAV_MISSION_NO_SPACE
        assert len(download(link)) == 200
        link.mav.mission_clear_all_send(1, 1, 0)
        wait_for(link, "MISSION_ACK", lambda _: True)
        assert download(link) == []


def a_copter_takes_off_goes_and_lands():
    with mock("--vehicle", "copter") as [address]:
        link = connect(address)
        arm(link, COPTER["guided"])
        assert command(link, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 6) == ACCEPTED
        goal = place_at(link, 30, -20)
        wait_for(link, "GLOBAL_POSITION_INT", lambda at: at.relative_alt > 5_900)
        only_place = 0b110111111000
        link.mav.set_position_target_global_int_send(
            0, 1, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, only_place, *goal, 8, 0, 0, 0, 0, 0, 0, 0, 0)
        near = lambda at: distance_m((at.lat, at.lon), goal) < 0.5 and abs(at.relative_alt - 8_000) < 300
        wait_for(link, "GLOBAL_POSITION_INT", near)
        nan = float("nan")
        link.mav.set_position_target_global_int_send(
            0, 1, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, only_place, *goal, nan, nan, 0, 0, 0, 0, 0, 0, 0)
        assert command(link, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) != ACCEPTED, "it is in the air"
        assert command(link, mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        wait_for(link, "HEARTBEAT", lambda beat: not beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)


def a_rover_goes_to_places_in_every_frame():
    with mock("--datum", "52,4,3,40") as [address]:
        link = connect(address)
        arm(link, ROVER["guided"])
        stream(link, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 20)
        here = wait_for(link, "LOCAL_POSITION_NED", lambda _: True)
        only_place = 0b110111111000
        for frame, step, expected in [
            (mavlink.MAV_FRAME_LOCAL_NED, (6, -4), lambda _: (6, -4)),
            (mavlink.MAV_FRAME_LOCAL_OFFSET_NED, (3, 3), lambda at: (at.x + 3, at.y + 3)),
        ]:
            north, east = expected(here)
            link.mav.set_position_target_local_ned_send(0, 1, 1, frame, only_place, *step, 0, 0, 0, 0, 0, 0, 0, 0, 0)
            near = lambda at, north=north, east=east: abs(at.x - north) < 0.3 and abs(at.y - east) < 0.3
            here = wait_for(link, "LOCAL_POSITION_NED", lambda at: near(at) and abs(at.vx) + abs(at.vy) < 0.01)
        only_velocity = 0b110111000111
        link.mav.set_position_target_local_ned_send(
            0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, only_velocity, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0)
        wait_for(link, "LOCAL_POSITION_NED", lambda at: at.vx > 0.5 and abs(at.vy) < 0.1)
        # Not said again it ends after 3 s.
        wait_for(link, "LOCAL_POSITION_NED", lambda at: abs(at.vx) + abs(at.vy) < 0.01)


def a_mission_is_flown_and_it_returns():
    with mock() as [address]:
        link = connect(address)
        home = place_at(link, 0, 0)
        arm(link, ROVER["guided"])
        waypoint, servo = mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_DO_SET_SERVO
        items = [
            item(link, 0, waypoint, home),
            item(link, 1, waypoint, place_at(link, 10, 0, home)),
            item(link, 2, servo, parameters=(9, 1700, 0, 0)),
            item(link, 3, waypoint, place_at(link, 10, 10, home), parameters=(2, 0, 0, 0)),
            item(link, 4, mavlink.MAV_CMD_DO_JUMP, parameters=(1, 1, 0, 0)),
            item(link, 5, waypoint, place_at(link, 0, 10, home)),
        ]
        assert upload(link, items) == mavlink.MAV_MISSION_ACCEPTED
        stream(link, mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 10)
        assert command(link, mavlink.MAV_CMD_DO_SET_MODE, 1, ROVER["auto"]) == ACCEPTED
        reached = []
        while not reached or reached[-1] != 5:
            reached.append(wait_for(link, "MISSION_ITEM_REACHED", lambda _: True).seq)
        places = [seq for seq in reached if seq in (1, 3, 5)]
        assert places == [1, 3, 1, 3, 5], reached
        assert wait_for(link, "SERVO_OUTPUT_RAW", lambda _: True).servo9_raw == 1700
        assert command(link, mavlink.MAV_CMD_DO_SET_MODE, 1, ROVER["return"]) == ACCEPTED
        wait_for(link, "GLOBAL_POSITION_INT", lambda at: distance_m((at.lat, at.lon), home) < 0.5)


def a_silent_ground_station_is_missed():
    with mock() as [address]:
        link = connect(address)
        for name, value in [(b"FS_GCS_ENABLE", 1), (b"FS_GCS_TIMEOUT", 5)]:
            link.mav.param_set_send(1, 1, name, value, mavlink.MAV_PARAM_TYPE_REAL32)
        arm(link, ROVER["guided"])
        heartbeat(link)
        wait_for(link, "STATUSTEXT", lambda said: "GCS Failsafe" in said.text)
        wait_for(link, "HEARTBEAT", lambda beat: beat.custom_mode == ROVER["hold"])


def it_says_why_it_does_not_arm():
    with mock("--vehicle", "copter") as [address]:
        link = connect(address)
        while command(link, mavlink.MAV_CMD_DO_SET_MODE, 1, COPTER["return"]) != ACCEPTED:
            time.sleep(0.02)
        link.mav.command_long_send(1, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0)
        said = wait_for(link, "STATUSTEXT", lambda said: said.text.startswith("PreArm: "))
        assert "return" in said.text, said.text


def garbage_floods_and_clients_that_vanish():
    with mock() as [address]:
        host, port = address.split(":")
        chance = random.Random(7)
        whole = mavutil.mavlink.MAVLink(None, srcSystem=255).heartbeat_encode(6, 8, 0, 0, 0)
        for _ in range(20):
            with socket.create_connection((host, int(port))) as vandal:
                frame = bytearray(whole.pack(mavutil.mavlink.MAVLink(None, srcSystem=255)))
                frame[chance.randrange(len(frame))] ^= 0xFF
                vandal.sendall(bytes(chance.randbytes(chance.randrange(20_000))) + frame[: chance.randrange(len(frame))])
        deaf = socket.create_connection((host, int(port)))
        deaf.sendall(b"".join(
            mavutil.mavlink.MAVLink(None, srcSystem=254).command_long_encode(
                1, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, number, 2_000, 0, 0, 0, 0, 0,
            ).pack(mavutil.mavlink.MAVLink(None, srcSystem=254)) for number in (30, 33, 32, 74)))
        one, two = connect(address), connect(address, system=254)
        stream(one, 30, 50)
        arm(two, ROVER["guided"])
        wait_for(one, "ATTITUDE", lambda _: True)
        one.close()
        wait_for(two, "HEARTBEAT", lambda _: True)
        back = connect(address)
        assert command(back, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED
        deaf.close()


def many_vehicles_on_one_link_and_by_udp():
    with mock("--count", "5", "--one-link", sockets="--udp") as [address]:
        link = connect(address, "udpout")
        systems = set()
        until = time.monotonic() + 5
        while time.monotonic() < until and len(systems) < 5:
            heartbeat(link)
            beat = link.recv_match(type="HEARTBEAT", blocking=True, timeout=1)
            systems.add(beat.get_srcSystem())
        assert systems == {1, 2, 3, 4, 5}, systems
        link.mav.command_long_send(3, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, ROVER["guided"], 0, 0, 0, 0, 0)
        ack = wait_for(link, "COMMAND_ACK", lambda _: True)
        assert ack.get_srcSystem() == 3
    with mock("--count", "3") as addresses:
        assert [connect(address).target_system for address in addresses] == [1, 2, 3]


if __name__ == "__main__":
    run([
        heartbeat_at_once_and_armable_soon, version_and_unknown_things, streams_at_asked_rates,
        parameters_are_listed_read_and_set, a_mission_of_200_items_comes_back, a_copter_takes_off_goes_and_lands,
        a_rover_goes_to_places_in_every_frame, a_mission_is_flown_and_it_returns, a_silent_ground_station_is_missed,
        it_says_why_it_does_not_arm, garbage_floods_and_clients_that_vanish, many_vehicles_on_one_link_and_by_udp,
    ])
