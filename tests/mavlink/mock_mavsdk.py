"""What MAVSDK sees of `tomoswarm mock-autopilot`: it connects, reads and sets parameters, flies a copter and a mission."""

import time

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action, ActionError
from mavsdk.plugins.mission_raw import MissionItem, MissionRaw, MissionRawError
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

from mock import mavlink, mock, run


def until(what, is_so, wait=20):
    """Waits until something is so."""
    deadline = time.monotonic() + wait
    while not is_so():
        assert time.monotonic() < deadline, f"not in time: {what}"
        time.sleep(0.02)


def eventually(act, wait=20):
    """Does something that is refused at first: the vehicle has just been switched on, or does not know its place yet."""
    deadline = time.monotonic() + wait
    while True:
        try:
            return act()
        except (ActionError, MissionRawError):
            assert time.monotonic() < deadline
            time.sleep(0.1)


def a_copter_is_flown():
    with mock("--vehicle", "copter", speedup=10) as [address]:
        with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as sdk:
            sdk.add_any_connection(f"tcpout://{address}")
            system = sdk.first_autopilot(10.0)
            assert system is not None, "not found"
            action, telemetry, param = Action(system), Telemetry(system), Param(system)
            assert param.get_param_int("FS_GCS_ENABLE") == 0
            telemetry.set_rate_position(20.0)
            param.set_param_float("WPNAV_SPEED", 800.0)
            assert param.get_param_float("WPNAV_SPEED") == 800.0
            action.set_takeoff_altitude(7.0)
            eventually(action.arm)
            until("armed", telemetry.armed)
            eventually(action.takeoff)
            until("up", lambda: telemetry.position().relative_altitude_m > 6.8)
            here = telemetry.position()
            goal = (here.latitude_deg + 2e-4, here.longitude_deg + 2e-4)
            action.goto_location(*goal, here.absolute_altitude_m, 0.0)
            near = lambda at: abs(at.latitude_deg - goal[0]) < 4e-6 and abs(at.longitude_deg - goal[1]) < 4e-6
            until("there", lambda: near(telemetry.position()), 40)
            action.land()
            until("down", lambda: not telemetry.armed(), 40)


def a_mission_is_uploaded_downloaded_and_flown():
    with mock(speedup=10) as [address]:
        with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as sdk:
            sdk.add_any_connection(f"tcpout://{address}")
            system = sdk.first_autopilot(10.0)
            action, telemetry, missions = Action(system), Telemetry(system), MissionRaw(system)
            telemetry.set_rate_position(20.0)
            until("a place", lambda: abs(telemetry.position().latitude_deg) > 1)
            here = telemetry.position()

            def item(seq, number, north=0.0, *parameters):
                parameters = [*parameters, *[0.0] * (4 - len(parameters))]
                latitude = round((here.latitude_deg + north) * 1e7) if number == mavlink.MAV_CMD_NAV_WAYPOINT else 0
                longitude = round(here.longitude_deg * 1e7) if number == mavlink.MAV_CMD_NAV_WAYPOINT else 0
                return MissionItem(seq, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, number, int(seq == 0), 1,
                                   *parameters, latitude, longitude, 0.0, 0)

            waypoint = mavlink.MAV_CMD_NAV_WAYPOINT
            items = [item(0, waypoint), item(1, waypoint, 5e-5), item(2, mavlink.MAV_CMD_DO_SET_SERVO, 0, 9, 1600),
                     item(3, waypoint, 9e-5)]
            missions.upload_mission(items)
            back = missions.download_mission()
            assert [(one.seq, one.command, one.x, one.y) for one in back] == [
                (one.seq, one.command, one.x, one.y) for one in items]
            eventually(action.arm)
            # A rover arms in MANUAL before it knows its place; AUTO needs it.
            eventually(missions.start_mission)
            until("its end", lambda: missions.mission_progress().current >= 3, 40)
            assert telemetry.position().latitude_deg > here.latitude_deg + 4e-5


if __name__ == "__main__":
    run([a_copter_is_flown, a_mission_is_uploaded_downloaded_and_flown])
