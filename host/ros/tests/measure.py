"""Measures what a fleet costs: messages, delay from cmd_vel to the bridge, and processor time, for 1, 5 and 20 hubs.

Run by `cargo xtask ros measure`. Each hub is a simulated one with a control period of 10 ms, in a process of its own, and all
are nodes of one motor-hub-ros with 100 reports a second. Every hub gets 20 commands a second.

The delay is that of the first hub. A relay on its line reads the hub's reports: the first one whose set-point is the new one
gives the control tick that commanded the bridge. The reports come once a tick, so a delay may be one tick too long, not too
short. `measure.py square PICTURE.svg` drives a square instead, and draws `odom` against the wheels' path.
"""

import atexit
import bisect
import math
import os
import random
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import test_peers as peers
from test_peers import Commander, Relay, free_port, open_session

SECONDS, INTERVAL = 25.0, 0.05
SCENARIO = """
name = "fleet"
duration_s = 10
control_period_ms = 10
battery = { emf_v = 12.6, resistance_ohm = 0.05 }
""" + "".join(f"""
[[motors]]
label = "{label}"
motor = "AM 60 A"
scheme = "A"
load = {{ inertia_kg_m2 = 0.002 }}
""" for label in ("left", "right", "arm", "none"))


class Tap(Relay):
    """Records each report: its arrival, the hub's time in ms, and set-point, position and velocity of each motor."""

    def __init__(self) -> None:
        self.reports: list[tuple[float, int, list[tuple[int, int, int]]]] = []
        self.rest = b""
        super().__init__()

    def answer(self, data: bytes) -> None:
        now = time.monotonic()
        super().answer(data)
        self.rest += data
        while (start := self.rest.find(b"DK")) >= 0 and len(self.rest) >= start + 4:
            (length,) = struct.unpack_from("<H", self.rest, start + 2)
            if len(self.rest) < start + length:
                break
            payload, self.rest = self.rest[start + 10 : start + length - 1], self.rest[start + length :]
            if payload[:3] == bytes([2, 4, 36]):
                (ms,) = struct.unpack_from("<I", payload, 3)
                motors = [struct.unpack_from("<xiih", payload, 12 + 36 * motor) for motor in range(4)]
                self.reports.append((now, ms, motors))


class Bench:
    """A router, simulated hubs, and motor-hub-ros; the first hub's line has a tap."""

    def __init__(self, hubs: int) -> None:
        self.folder, self.processes, self.hubs = tempfile.TemporaryDirectory(), [], hubs
        scenario = Path(self.folder.name) / "scenario.toml"
        scenario.write_text(SCENARIO)
        self.port, places = free_port(), []
        self.router = self.start(peers.router_command(self.port))
        for _ in range(hubs):
            place = f"127.0.0.1:{free_port()}"
            self.start([os.environ["MOTOR_HUB"], "serve", "--tcp", place, "--scenario", str(scenario)])
            places.append(place)
        time.sleep(1.5)
        self.tap = Tap()
        self.tap.connect(int(places[0].split(":")[1]))
        places[0] = f"127.0.0.1:{self.tap.port}"
        text = "rate_hz = 100\n" + peers.HEAD.format(port=self.port, distribution="jazzy")
        for number, place in enumerate(places):
            text += peers.HUB.format(place=place, namespace=f"/hub{number}", urdf="/dev/null")
        config = Path(self.folder.name) / "config.toml"
        config.write_text(text)
        self.node = self.start([os.environ["MOTOR_HUB_ROS"], str(config)])
        self.session = open_session("client", self.port)

    def start(self, command: list[str]) -> subprocess.Popen:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        atexit.register(process.kill)
        self.processes.append(process)
        return process

    def close(self) -> None:
        self.session.close()
        for process in self.processes:
            process.kill()
            process.wait()
        self.tap.close()


def processor_s(process: subprocess.Popen) -> float:
    """Processor time of a process so far, in s."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")")[-1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def load(port: int, hubs: int) -> None:
    """Another process: counts all messages, and commands all hubs but the first. Prints the count at each line it reads."""
    session, count = open_session("client", port), 0

    def take(_) -> None:
        nonlocal count
        count += 1

    session.declare_subscriber("7/**", take)
    commanders = [Commander(session, f"load{hub}", 1, hub=f"/hub{hub}") for hub in range(1, hubs)]

    def drive() -> None:
        while True:
            for commander in commanders:
                commander.twist(random.uniform(0.1, 0.2))
                time.sleep(INTERVAL / hubs)
            time.sleep(INTERVAL / hubs)

    threading.Thread(target=drive, daemon=True).start()
    for _ in sys.stdin:
        print(count, flush=True)


def measure(hubs: int) -> None:
    bench = Bench(hubs)
    command = [sys.executable, __file__, "load", str(bench.port), str(hubs)]
    others = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    bench.processes.append(others)
    commander = Commander(bench.session, "operator")

    def messages() -> int:
        others.stdin.write("\n")
        others.stdin.flush()
        return int(others.stdout.readline())

    while len(bench.tap.reports) < 100:
        time.sleep(0.1)
    commander.drive(2.0, 0.1)
    random.seed(1)
    sent: list[tuple[float, int]] = []
    watched = {"node": bench.node, "router": bench.router}
    before, start = {name: processor_s(process) for name, process in watched.items()}, time.monotonic()
    counted, speed = messages(), 0.1
    while time.monotonic() < start + SECONDS:
        # Each command differs from the one before it by 4 counts/s at least.
        speed += random.choice([-1, 1]) * random.uniform(0.002, 0.004) if 0.06 < speed < 0.24 else 0.15 - speed
        sent.append((time.monotonic(), round(speed / (math.pi * 0.09) * 1680)))
        commander.twist(speed)
        time.sleep(random.uniform(0.8, 1.2) * INTERVAL)
    seconds = time.monotonic() - start
    counted = messages() - counted
    cpu = {name: (processor_s(process) - before[name]) / seconds for name, process in watched.items()}
    reports = list(bench.tap.reports)
    bench.close()
    # Time of this machine minus time of the hub. The smallest difference of the last 200 reports has the shortest delay
    # of the line. The delay of a command that no report shows is infinite.
    offsets = [arrived - ms / 1e3 for arrived, ms, _ in reports]

    def delay_ms(when: float, wanted: int) -> float:
        for at in range(bisect.bisect(reports, when, key=lambda report: report[0]), len(reports)):
            arrived, ms, motors = reports[at]
            if abs(motors[0][0] - wanted) <= 1:
                return 1e3 * (ms / 1e3 + min(offsets[max(0, at - 200) : at + 1]) - when)
            if arrived > when + 1:
                break
        return math.inf

    delays = [delay_ms(when, wanted) for when, wanted in sent]
    delays.sort()
    p50, p99 = delays[len(delays) // 2], delays[len(delays) * 99 // 100]
    print(
        f"| {hubs} | {counted / seconds:.0f} | {p50:.1f} ms | {p99:.1f} ms | {100 * cpu['node'] / hubs:.1f} % "
        f"| {100 * cpu['node']:.0f} % | {100 * cpu['router']:.0f} % |",
        flush=True,
    )


def square(picture: Path) -> None:
    """Drives a square, and draws odometry over the path that the wheels have rolled, which is integrated from the line."""
    bench = Bench(1)
    poses = []

    def take(sample) -> None:
        pose = peers.STORE.deserialize_cdr(bytes(sample.payload), peers.ODOM).pose.pose
        poses.append((pose.position.x, pose.position.y))

    bench.session.declare_subscriber(peers.key("/hub0/odom", peers.ODOM), take)
    commander = Commander(bench.session, "operator")
    while len(poses) < 20:
        time.sleep(0.1)
    for _ in range(4):
        commander.drive(2.5, 0.2)
        commander.drive(math.pi / 2, 0.0, 1.0)
    time.sleep(1.5)
    rolled, (x, y, heading) = [(0.0, 0.0)], (0.0, 0.0, 0.0)
    positions = [[motor[1] for motor in motors[:2]] for _, _, motors in bench.tap.reports]
    for then, now in zip(positions, positions[1:]):
        left, right = ((b - a) / 1680 * math.pi * 0.09 for a, b in zip(then, now))
        turned, forward = (right - left) / 0.3, (left + right) / 2
        if abs(turned) < 1e-9:
            x, y = x + forward * math.cos(heading), y + forward * math.sin(heading)
        else:  # an arc
            radius = forward / turned
            x += radius * (math.sin(heading + turned) - math.sin(heading))
            y -= radius * (math.cos(heading + turned) - math.cos(heading))
        heading += turned
        rolled.append((x, y))
    bench.close()
    apart = math.hypot(poses[-1][0] - x, poses[-1][1] - y)
    print(f"odom ends {1e3 * apart:.2f} mm from the wheels' path, {1e3 * math.hypot(x, y):.0f} mm from the start")
    ideal = [(0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5), (0, 0)]

    def line(points, style: str) -> str:
        text = " ".join(f"{60 + 600 * x:.1f},{370 - 600 * y:.1f}" for x, y in points)
        return f'<polyline points="{text}" fill="none" {style}/>'

    thin = [pose for index, pose in enumerate(poses) if index % 20 == 0 or pose == poses[-1]]
    dots = "".join(f'<circle cx="{60 + 600 * x:.1f}" cy="{370 - 600 * y:.1f}" r="4" fill="#c4440c"/>' for x, y in thin)
    words = [("#767676", "commanded square of 0.5 m (dashed)"), ("#1c6ba0", "path of the wheels"), ("#c4440c", "odom, five times a second")]
    legend = "".join(
        f'<text x="385" y="{30 + 22 * row}" fill="{colour}">{word}</text>' for row, (colour, word) in enumerate(words)
    )
    picture.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 620 420" font-family="sans-serif" font-size="15">'
        '<rect width="620" height="420" fill="#fff"/>'
        + line(ideal, 'stroke="#767676" stroke-dasharray="6 4"')
        + line(rolled[::5], 'stroke="#1c6ba0" stroke-width="2"')
        + dots
        + legend
        + "</svg>\n"
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["load"]:
        load(int(sys.argv[2]), int(sys.argv[3]))
    elif sys.argv[1:2] == ["square"]:
        square(Path(sys.argv[2]))
    else:
        print("| hubs | messages/s | cmd_vel to bridge, p50 | p99 | processor a hub | motor-hub-ros | router |")
        print("|---|---|---|---|---|---|---|")
        for hubs in (1, 5, 20):
            measure(hubs)
