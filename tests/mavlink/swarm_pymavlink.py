"""What pymavlink sees of a swarm that `tomoswarm ground --mavlink` shows: three simulated rovers as processes of their own, on
free ports of this machine; the program is named by TOMOSWARM."""

import contextlib
import os
import signal
import socket
import subprocess
import tempfile
import time

from mock import ROVER, command, distance_m, heartbeat, mavlink, mavutil, run, wait_for

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
IN_PROGRESS, UNSUPPORTED = mavlink.MAV_RESULT_IN_PROGRESS, mavlink.MAV_RESULT_UNSUPPORTED
VEHICLES = (1, 2, 3)
BODY = "max_speed_mps = 1.5\nacceleration_mps2 = 3\nbraking_mps2 = 3\nturn_rate_deg_per_s = 360\n"
VENUE = """kind = "venue"
name = "courtyard"
area_m = [0, 0, 6, 6]
fence_m = [[-4, -4], [10, -4], [10, 10], [-4, 10]]
homes_m = [[-1.5, -1.5], [7.5, -1.5], [7.5, 7.5]]
datum = {latitude_deg = 52.0, longitude_deg = 4.0}
"""
SCENE = 'kind = "scene"\nname = "small"\n[[person]]\nname = "ada"\nat_m = [3, 3.5]\n'


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Swarm:
    """The files and processes of a swarm."""

    def __init__(self, folder, mavlink_table):
        self.folder = folder
        self.processes = {}
        world, ground = free_port(), free_port()
        bus = f'[bus]\nlisten = ["tcp/127.0.0.1:0"]\nconnect = ["tcp/127.0.0.1:{ground}"]\n'
        self.write("venue.toml", VENUE)
        self.write("scene.toml", SCENE)
        self.write("sim.toml", f'kind = "sim"\nvenue = "venue.toml"\nscene = "scene.toml"\n[vehicles]\ncount = 3\n{BODY}')
        sweep = f"[sweep]\npositions = 16\nlaps = 3\n[bus]\nlisten = [\"tcp/127.0.0.1:{ground}\"]\n"
        self.write("ground.toml", f'kind = "ground"\nvenue = "venue.toml"\nvehicles = [1, 2, 3]\nstate_dir = "state-g"\n{sweep}')
        self.write("operator.toml", f'kind = "operator"\nvenue = "venue.toml"\n{bus}[mavlink]\n{mavlink_table}')
        drivers = "".join(f'[{part}]\ndriver = "sim"\n' for part in ("autopilot", "range", "servo", "radio"))
        place = f'[world]\nconnect = "127.0.0.1:{world}"\ntoken = "secret-token"\n'
        self.start("world", "sim.toml", "--listen", f"127.0.0.1:{world}", "--token", "secret-token", name="world")
        self.start("ground", "ground.toml", "--mavlink", "operator.toml", name="ground")
        for number in VEHICLES:
            head = f'kind = "vehicle"\nvenue = "venue.toml"\nid = {number}\nstate_dir = "state-{number}"\n[vehicle]\n{BODY}'
            self.write(f"vehicle-{number}.toml", head + drivers + place + bus)
            self.start("vehicle", f"vehicle-{number}.toml", name=f"vehicle-{number}")

    def write(self, name, text):
        with open(os.path.join(self.folder, name), "w", encoding="utf-8") as file:
            file.write(text)

    def start(self, *words, name):
        with open(os.path.join(self.folder, f"{name}.log"), "a", encoding="utf-8") as log:
            self.processes[name] = subprocess.Popen(
                [os.environ["TOMOSWARM"], *words], cwd=self.folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def end(self, name):
        process = self.processes.pop(name)
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(timeout=15)
        except subprocess.TimeoutExpired:
            process.kill()

    def logs(self):
        with open(os.path.join(self.folder, "ground.log"), encoding="utf-8") as log:
            return log.read()[-3000:]


@contextlib.contextmanager
def swarm(commands):
    """A swarm, and a link at which it is shown."""
    port = free_port(socket.SOCK_DGRAM)
    link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=255)
    with tempfile.TemporaryDirectory() as folder:
        one = Swarm(folder, f'address = "127.0.0.1:{port}"\ncommands = {commands}\n')
        try:
            all_are_shown(link)
            yield one, link
            assert one.processes["ground"].poll() is None, one.logs()
        except AssertionError:
            print(one.logs())
            raise
        finally:
            for name in sorted(one.processes, reverse=True):
                one.end(name)
            link.close()


def all_are_shown(link, wait=30):
    seen, until = set(), time.monotonic() + wait
    while seen != set(VEHICLES):
        assert time.monotonic() < until, f"shown: {seen}"
        beat = link.recv_match(type="HEARTBEAT", blocking=True, timeout=1)
        if beat is not None:
            seen.add(beat.get_srcSystem())


def told(link, kind, system, condition=lambda _: True, wait=20):
    """The first message of a kind and a vehicle for which something holds."""
    return wait_for(link, kind, lambda said: said.get_srcSystem() == system and condition(said), wait)


def answers(link, system, number, *parameters, wait=8):
    """Gives a command; returns its answers up to the last."""
    results, until = [command(link, number, *parameters, target=system)], time.monotonic() + wait
    while results[-1] == IN_PROGRESS:
        assert time.monotonic() < until, results
        ack = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=1)
        if ack is not None and (ack.get_srcSystem(), ack.command) == (system, number):
            results.append(ack.result)
    return results


def everyone_is_shown_and_nobody_commands():
    with swarm("false") as (one, link):
        for number in VEHICLES:
            beat = told(link, "HEARTBEAT", number)
            assert (beat.type, beat.autopilot) == (mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
            home, place = told(link, "HOME_POSITION", number), told(link, "GLOBAL_POSITION_INT", number)
            away_m = distance_m((home.latitude, home.longitude), (place.lat, place.lon))
            assert away_m < 0.5, (number, away_m)
            assert told(link, "SYS_STATUS", number).battery_remaining > 50
            link.mav.param_request_list_send(number, 1)
            names = {told(link, "PARAM_VALUE", number).param_id for _ in range(4)}
            assert "SYSID_THISMAV" in names, names
            link.mav.mission_request_list_send(number, 1)
            assert told(link, "MISSION_COUNT", number).count == 0
        assert answers(link, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [DENIED]
        assert answers(link, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == [ACCEPTED]
        places = [told(link, "GLOBAL_POSITION_INT", 2) for _ in range(11)]
        span_s = (places[-1].time_boot_ms - places[0].time_boot_ms) * 1e-3
        assert 1.6 < span_s < 2.6, f"ten in {span_s} s"
        one.end("vehicle-3")
        time.sleep(3)
        while link.recv_match() is not None:
            pass
        until = time.monotonic() + 3
        while time.monotonic() < until:
            said = link.recv_match(blocking=True, timeout=1)
            assert said is None or said.get_srcSystem() != 3, said


def commands_become_orders():
    with swarm("true") as (_, link):
        heartbeat(link)
        before = {number: told(link, "GLOBAL_POSITION_INT", number) for number in VEHICLES}
        for number in VEHICLES:
            assert answers(link, number, mavlink.MAV_CMD_MISSION_START) == [IN_PROGRESS, ACCEPTED]
        for number in VEHICLES:
            told(link, "HEARTBEAT", number, lambda beat: beat.custom_mode == ROVER["auto"], 30)
            start = (before[number].lat, before[number].lon)
            told(link, "GLOBAL_POSITION_INT", number, lambda at, of=start: distance_m((at.lat, at.lon), of) > 1, 60)
        assert answers(link, 2, mavlink.MAV_CMD_DO_SET_MODE, 1, ROVER["hold"]) == [IN_PROGRESS, ACCEPTED]
        told(link, "HEARTBEAT", 2, lambda beat: beat.custom_mode == ROVER["hold"])
        told(link, "GLOBAL_POSITION_INT", 2, lambda at: at.vx == at.vy == 0)
        assert answers(link, 2, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == [IN_PROGRESS, ACCEPTED]
        told(link, "HEARTBEAT", 2, lambda beat: not beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        assert answers(link, 1, mavlink.MAV_CMD_DO_SET_MODE, 1, ROVER["return"]) == [IN_PROGRESS, ACCEPTED]
        told(link, "HEARTBEAT", 1, lambda beat: beat.custom_mode in (ROVER["return"], ROVER["hold"]))
        assert answers(link, 3, mavlink.MAV_CMD_NAV_TAKEOFF) == [UNSUPPORTED]
        assert answers(link, 0, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == [DENIED]
        assert command(link, mavlink.MAV_CMD_NAV_LAND, target=9, wait=1) is None


if __name__ == "__main__":
    run([everyone_is_shown_and_nobody_commands, commands_become_orders])
