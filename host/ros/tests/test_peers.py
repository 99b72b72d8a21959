"""motor-hub-ros against code of others: eclipse-zenoh and zenoh-ros2-sdk as peers, rosbags as judge. No ROS is needed.

The environment names the programs: MOTOR_HUB (motor-hub) and MOTOR_HUB_ROS (motor-hub-ros). If there is a zenohd on the
PATH, it is the router instead of eclipse-zenoh.
"""

import json
import math
import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import unittest.mock
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy
import xxhash
import zenoh
from rosbags.rosbag2 import Reader, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from zenoh import ext

STORE = get_typestore(Stores.ROS2_JAZZY)
STORE.register(get_types_from_msg("bool success\nstring message", "std_srvs/msg/Answer"))
TRIGGER = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
SET_BOOL = "RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"
TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
STATE, ODOM = "sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry"
BATTERY, DIAGNOSTICS, TF = "sensor_msgs/msg/BatteryState", "diagnostic_msgs/msg/DiagnosticArray", "tf2_msgs/msg/TFMessage"
IMU = "sensor_msgs/msg/Imu"

HEAD = """
router = "tcp/127.0.0.1:{port}"
domain = 7
distribution = "{distribution}"
"""
# The base loses 5 % of each turn, which its gyro sees.
SCENARIO = """
name = "robot"
duration_s = 10
battery = { emf_v = 12.6, resistance_ohm = 0.05 }
floor = { slip_in_turns = 0.05 }
motors = [
    { label = "left", motor = "NeveRest 60", load = { inertia_kg_m2 = 0.006, drag_nms_per_rad = 0.1 } },
    { label = "right", motor = "NeveRest 60", load = { inertia_kg_m2 = 0.006, drag_nms_per_rad = 0.1 } },
    { label = "arm", motor = "NeveRest 60", load = { inertia_kg_m2 = 0.006, drag_nms_per_rad = 0.1 } },
]
"""
HUB = """
[[hub]]
place = "{place}"
namespace = "{namespace}"
robot_description = "{urdf}"
joint = [
    {{ name = "left", motor = 0, counts_per_turn = 1680, torque_per_ampere = 0.6, speed = 6 }},
    {{ name = "right", motor = 1, counts_per_turn = 1680, torque_per_ampere = 0.6, speed = 6 }},
    {{ name = "arm", motor = 2, counts_per_turn = 1680, speed = 6 }},
]
base = {{ left = "left", right = "right", wheel_diameter_m = 0.09, track_m = 0.3 }}
"""


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def open_session(mode: str, port: int, address: str = "127.0.0.1") -> zenoh.Session:
    here = f"tcp/{address}:{port}"
    settings = {
        "mode": mode,
        "scouting": {"multicast": {"enabled": False}},
        "timestamping": {"enabled": True},
        "listen": {"endpoints": [here] if mode == "router" else []},
        "connect": {"endpoints": [] if mode == "router" else [here], "timeout_ms": 10_000},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))


def router_command(port: int, address: str = "127.0.0.1") -> list[str]:
    if program := shutil.which("zenohd"):
        return [program, "--no-multicast-scouting", "--listen", f"tcp/{address}:{port}"]
    return [sys.executable, __file__, "router", str(port), address]


def dds(name: str) -> str:
    return name.replace("/", "::", 1).replace("/", "::dds_::") + "_"


def key(topic: str, name: str) -> str:
    return f"7{topic}/{dds(name)}/{STORE.hash_rihs01(name)}"


class Commander:
    """A publisher of commands. A named one is visible as a ROS node is, on its topic of this type."""

    def __init__(
        self, session: zenoh.Session, node: str = "", number: int = 1, topic: str = "cmd_vel", of: str = TWIST, hub: str = "/hub0"
    ) -> None:
        self.session, self.hub, self.sequence, self.gid = session, hub, 0, os.urandom(16)
        if node:
            head = f"@ros2_lv/7/{session.zid()}/0/{number}/MP/%/%/{node}/{hub.replace('/', '%')}%{topic}"
            token = f"{head}/{dds(of)}/{STORE.hash_rihs01(of)}/::,10:,:,:,,"
            self.gid = xxhash.xxh3_128(token.encode()).intdigest().to_bytes(16, "little")
            self.token = session.liveliness().declare_token(token)

    def attachment(self) -> bytes:
        self.sequence += 1
        return struct.pack("<qqB16s", self.sequence, time.time_ns(), 16, self.gid)

    def put(self, topic: str, message, name: str) -> None:
        data = bytes(STORE.serialize_cdr(message, name))
        self.session.put(key(topic, name), data, attachment=self.attachment())

    def twist(self, forward: float, turn: float = 0.0) -> None:
        self.put(f"{self.hub}/cmd_vel", twist(forward, turn), TWIST)

    def drive(self, seconds: float, forward: float, turn: float = 0.0) -> None:
        for _ in range(round(seconds * 50)):
            self.twist(forward, turn)
            time.sleep(0.02)

    def call(self, service: str, on: bool | None = None) -> tuple[bool, str]:
        name, code, request = ("Trigger", TRIGGER, b"\0") if on is None else ("SetBool", SET_BOOL, bytes([on]))
        attachment = self.attachment()
        replies = list(
            self.session.get(
                f"7{self.hub}/{service}/{dds('std_srvs/srv/' + name)}/{code}",
                payload=b"\0\1\0\0" + request,
                attachment=attachment,
                timeout=30.0,
                target=zenoh.QueryTarget.ALL_COMPLETE,
                consolidation=zenoh.ConsolidationMode.NONE,
            )
        )
        assert len(replies) == 1, f"{len(replies)} replies to {service}"
        reply = replies[0].ok
        returned = bytes(reply.attachment)
        assert len(returned) == 33 and returned[:8] == attachment[:8] and returned[16:] == attachment[16:]
        answer = STORE.deserialize_cdr(bytes(reply.payload), "std_srvs/msg/Answer")
        return answer.success, answer.message


def twist(forward: float, turn: float):
    types = STORE.types
    vector = types["geometry_msgs/msg/Vector3"]
    return types[TWIST](vector(forward, 0.0, 0.0), vector(0.0, 0.0, turn))


def header():
    types = STORE.types
    return types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](*divmod(time.time_ns(), 10**9)), "")


class Relay:
    """A line to a hub that stays open while the hub behind it is reset."""

    def __init__(self) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.host = self.hub = None
        threading.Thread(target=self.run, daemon=True).start()

    def run(self) -> None:
        self.host, _ = self.listener.accept()
        self.host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while data := self.host.recv(4096):
            self.request(data)

    def close(self) -> None:
        for each in (self.listener, self.host, self.hub):
            if each:
                each.close()

    def request(self, data: bytes) -> None:
        try:
            self.hub.sendall(data)
        except OSError:
            pass  # A hub that is being reset receives nothing.

    def answer(self, data: bytes) -> None:
        if self.host:
            self.host.sendall(data)

    def connect(self, port: int) -> None:
        """Passes bytes on to this hub from now on."""
        if self.hub:
            self.hub.close()
        self.hub = hub = socket.create_connection(("127.0.0.1", port))
        hub.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        def answers() -> None:
            try:
                while data := hub.recv(4096):
                    self.answer(data)
            except OSError:
                pass

        threading.Thread(target=answers, daemon=True).start()


class CutLine(Relay):
    """A line that is cut when the host asks the hub to reset an encoder."""

    def request(self, data: bytes) -> None:
        if data[8:10] == b"\x0e\x10":
            self.host.shutdown(socket.SHUT_RDWR)
        else:
            super().request(data)


class WithRobot(unittest.TestCase):
    distribution, has_hub, namespaces = "jazzy", True, ["/hub0"]

    def setUp(self) -> None:
        self.port = free_port()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.start_router()
        self.ports = [free_port() for _ in self.namespaces]
        self.hub_port = self.ports[0]
        if self.has_hub:
            self.hub = self.start_hub(self.hub_port)
        (self.folder / "robot.urdf").write_text("<robot name='test'/>")
        self.start_node()
        self.session = open_session("peer", self.port)
        self.addCleanup(self.session.close)
        self.commander = Commander(self.session)
        self.newest: dict[str, object] = {}
        self.counts: dict[str, int] = {}
        self.raw: list[tuple[str, str, int, bytes]] = []
        self.subscriber = self.session.declare_subscriber("7/**", self.take)
        self.wait_for(lambda: (ODOM if self.has_hub else DIAGNOSTICS) in self.newest, "messages of the hub")

    def start_node(self, places: list[str] | None = None) -> None:
        places = places or [f"127.0.0.1:{port}" for port in self.ports]
        text = HEAD.format(port=self.port, distribution=self.distribution)
        for place, namespace in zip(places, self.namespaces):
            text += HUB.format(place=place, namespace=namespace, urdf=self.folder / "robot.urdf")
        config = self.folder / "config.toml"
        config.write_text(text)
        self.node = self.start([os.environ["MOTOR_HUB_ROS"], str(config)])

    def process(self) -> zenoh.Session:
        """The session of another process."""
        session = open_session("peer", self.port)
        self.addCleanup(session.close)
        return session

    def start(self, command: list[str]) -> subprocess.Popen:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def start_hub(self, port: int) -> subprocess.Popen:
        scenario = self.folder / "scenario.toml"
        scenario.write_text(SCENARIO)
        options = ["--store", str(self.folder / f"store{port}"), "--scenario", str(scenario)]
        return self.start([os.environ["MOTOR_HUB"], "serve", "--tcp", f"127.0.0.1:{port}", *options])

    def start_router(self) -> None:
        self.router = self.start(router_command(self.port))
        self.wait_for_port(self.port)

    def wait_for_port(self, port: int) -> None:
        for _ in range(200):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    return
            time.sleep(0.05)
        self.fail(f"no program listens at port {port}")

    def take(self, sample: zenoh.Sample) -> None:
        where, spelt, _ = re.fullmatch(r"7(/.*)/(.*)/(.*)", str(sample.key_expr)).groups()
        name = spelt.replace("::dds_::", "/").replace("::", "/").removesuffix("_")
        data = bytes(sample.payload)
        if not where.endswith(("cmd_vel", "joint_commands")) and len(bytes(sample.attachment)) == 33:
            message = STORE.deserialize_cdr(data, name)
            # Strict: what is read must be written as the same bytes.
            if bytes(STORE.serialize_cdr(message, name)) == data:
                robot = where if where.startswith("/hub") else f"/{message.status[0].name}" if name == DIAGNOSTICS else ""
                self.newest[f"/hub1 {name}" if robot.startswith("/hub1") else name] = message
                self.counts[name] = self.counts.get(name, 0) + 1
                self.raw.append((where, name, time.time_ns(), data))

    def wait_for(self, condition, what: str, seconds: float = 15.0) -> None:
        end = time.time() + seconds
        while not condition():
            self.assertLess(time.time(), end, f"no {what} within {seconds} s")
            time.sleep(0.02)

    def speed(self, hub: str = "") -> float:
        return self.newest[hub + ODOM].twist.twist.linear.x

    def joint(self, name: str):
        state = self.newest[STATE]
        index = state.name.index(name)
        return state.position[index], state.velocity[index]

    def hub_status(self):
        self.wait_for(lambda: DIAGNOSTICS in self.newest, "diagnostics", 3)
        return self.newest[DIAGNOSTICS].status[0]


class Program(unittest.TestCase):
    """The program before it has a router."""

    def run_with(self, *arguments: str) -> subprocess.CompletedProcess:
        return subprocess.run([os.environ["MOTOR_HUB_ROS"], *arguments], capture_output=True, text=True, timeout=10)

    def test_version_and_help_are_printed(self) -> None:
        for option in ("--version", "-V"):
            version = self.run_with(option)
            self.assertEqual(version.returncode, 0, version.stderr)
            self.assertRegex(version.stdout, r"^motor-hub-ros \d+\.\d+\.\d+\n$")
        usage = self.run_with("--help")
        self.assertEqual((usage.returncode, usage.stdout.splitlines()[0]), (0, "Usage: motor-hub-ros CONFIG.toml"))

    def test_a_path_may_be_no_unicode(self) -> None:
        ended = subprocess.run([os.environ["MOTOR_HUB_ROS"], b"\xff.toml"], capture_output=True, timeout=10)
        self.assertEqual(ended.returncode, 1)
        self.assertIn(b"No such file", ended.stderr)

    def test_a_missing_description_of_the_robot_is_named_before_a_router_is_there(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            config = Path(folder, "config.toml")
            text = HEAD.format(port=free_port(), distribution="jazzy")
            config.write_text(text + HUB.format(place="127.0.0.1:1", namespace="/hub0", urdf=f"{folder}/none.urdf"))
            ended = self.run_with(str(config))
        self.assertEqual((ended.returncode, ended.stdout), (1, ""))
        self.assertIn("none.urdf: No such file", ended.stderr)

    def test_the_program_outlives_the_readers_of_its_messages(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            config = Path(folder) / "config.toml"
            config.write_text('[[hub]]\nplace = "127.0.0.1:1"\n')
            read, write = os.pipe()
            os.close(read)
            node = subprocess.Popen([os.environ["MOTOR_HUB_ROS"], str(config)], stdout=write, stderr=write)
            os.close(write)
            self.addCleanup(node.wait)
            self.addCleanup(node.kill)
            with self.assertRaises(subprocess.TimeoutExpired):
                node.wait(timeout=2)

    def test_one_signal_ends_the_program_that_waits_for_a_router(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            config = Path(folder, "config.toml")
            config.write_text(HEAD.format(port=free_port(), distribution="jazzy") + '[[hub]]\nplace = "127.0.0.1:1"\n')
            node = subprocess.Popen([os.environ["MOTOR_HUB_ROS"], str(config)], stdout=subprocess.PIPE, text=True)
            self.addCleanup(node.communicate)
            self.addCleanup(node.kill)
            self.assertIn("waits for the router", node.stdout.readline())
            node.terminate()
            self.assertNotEqual(node.wait(5), 0)


class Graph(WithRobot):
    def test_every_topic_and_service_has_a_token_and_a_gid_of_it(self) -> None:
        time.sleep(1)
        tokens = [str(reply.ok.key_expr) for reply in self.session.liveliness().get("@ros2_lv/7/**")]
        parts = [token.split("/") for token in tokens]
        self.assertEqual([part[8] for part in parts if part[5] == "NN"], ["motor_hub"])
        found = {(part[5], part[9].replace("%", "/"), part[10]) for part in parts if part[5] != "NN"}
        expected = {("MP", "/hub0/joint_states", STATE), ("MP", "/hub0/odom", ODOM), ("MP", "/tf", TF)}
        expected |= {("MP", "/hub0/imu", IMU), ("MP", "/hub0/battery_state", BATTERY), ("MP", "/diagnostics", DIAGNOSTICS)}
        expected |= {("MP", "/hub0/robot_description", "std_msgs/msg/String")}
        expected |= {("MS", "/hub0/cmd_vel", TWIST), ("MS", "/hub0/cmd_vel", STAMPED), ("MS", "/hub0/joint_commands", STATE)}
        services = {"stop": "Trigger", "enable": "SetBool", "reset_encoders": "Trigger", "identify": "Trigger"}
        services["save_settings"] = "Trigger"
        expected |= {("SS", f"/hub0/{name}", f"std_srvs/srv/{of}") for name, of in services.items()}
        self.assertEqual(found, {(kind, name, dds(of)) for kind, name, of in expected})
        numbers = [part[4] for part in parts]
        self.assertEqual(len(numbers), len(set(numbers)))
        for part in parts:
            name = part[10].replace("::dds_::", "/").replace("::", "/").removesuffix("_") if len(part) > 10 else ""
            if "/msg/" in name:
                self.assertEqual(part[11], STORE.hash_rihs01(name))
        gids = {xxhash.xxh3_128(token.encode()).intdigest().to_bytes(16, "little") for token in tokens}
        attachments = []
        with self.session.declare_subscriber("7/hub0/odom/**", lambda sample: attachments.append(bytes(sample.attachment))):
            time.sleep(0.5)
        numbers = [struct.unpack("<qqB16s", each)[0] for each in attachments]
        self.assertEqual(numbers, list(range(numbers[0], numbers[0] + len(numbers))))
        self.assertTrue(all(each[17:] in gids and each[16] == 16 for each in attachments))

    def test_the_description_reaches_a_late_subscriber(self) -> None:
        texts = []
        subscriber = ext.declare_advanced_subscriber(
            self.session,
            key("/hub0/robot_description", "std_msgs/msg/String"),
            lambda sample: texts.append(STORE.deserialize_cdr(bytes(sample.payload), "std_msgs/msg/String").data),
            history=ext.HistoryConfig(detect_late_publishers=True),
        )
        self.wait_for(lambda: texts, "description")
        self.assertEqual(texts, ["<robot name='test'/>"])
        subscriber.undeclare()

    def test_states_come_fifty_times_a_second_and_are_read_back_from_a_bag(self) -> None:
        time.sleep(0.5)
        before, start = self.counts[STATE], time.time()
        time.sleep(4)
        rate = (self.counts[STATE] - before) / (time.time() - start)
        self.assertAlmostEqual(rate, 50, delta=10)
        self.assertTrue(10 < self.newest[BATTERY].voltage < 14)
        self.assertTrue(math.isnan(self.newest[BATTERY].percentage))
        with Writer(self.folder / "bag", version=9) as bag:
            connections, raw = {}, list(self.raw)
            for where, name, at, data in raw:
                if where not in connections:
                    connections[where] = bag.add_connection(where, name, typestore=STORE)
                bag.write(connections[where], at, data)
        with Reader(self.folder / "bag") as bag:
            read = [STORE.deserialize_cdr(data, of.msgtype) for of, _, data in bag.messages()]
        self.assertEqual(len(read), len(raw))
        self.assertTrue({"left", "right", "arm"} <= set(next(m.name for m in read if hasattr(m, "effort"))))


class Commands(WithRobot):
    def test_a_twist_drives_and_ends_half_a_second_after_the_last_one(self) -> None:
        self.commander.drive(1.5, 0.2)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)
        time.sleep(0.35)
        self.assertGreater(self.speed(), 0.15)
        time.sleep(1)
        self.assertAlmostEqual(self.speed(), 0.0, delta=0.01)
        pose = self.newest[ODOM].pose.pose
        self.assertGreater(pose.position.x, 0.25)
        self.assertAlmostEqual(pose.position.y, 0.0, delta=0.02)
        transform = self.newest[TF].transforms[0]
        self.assertEqual((transform.header.frame_id, transform.child_frame_id), ("odom", "base_link"))
        self.assertAlmostEqual(transform.transform.translation.x, pose.position.x, delta=0.01)

    def test_a_stamped_twist_turns_on_the_spot(self) -> None:
        for _ in range(50):
            self.commander.put("/hub0/cmd_vel", STORE.types[STAMPED](header(), twist(0.0, 1.0)), STAMPED)
            time.sleep(0.02)
        moving = self.newest[ODOM].twist.twist
        self.assertAlmostEqual(moving.angular.z, 1.0, delta=0.1)
        self.assertAlmostEqual(moving.linear.x, 0.0, delta=0.02)

    def test_the_heading_is_by_the_gyro_although_the_wheels_slip(self) -> None:
        self.wait_for(lambda: ("heading", "by the gyro") in [(one.key, one.value) for one in self.hub_status().values], "a gyro")
        self.commander.drive(1.5, 0.0, 1.0)
        time.sleep(1.0)
        wheels = (self.joint("right")[0] - self.joint("left")[0]) * 0.045 / 0.3
        turned = self.newest[ODOM].pose.pose.orientation
        heading = 2 * math.atan2(turned.z, turned.w)
        self.assertGreater(wheels, 1.2)
        self.assertAlmostEqual(heading, 0.95 * wheels, delta=0.02)
        imu = self.newest[IMU]
        self.assertAlmostEqual(2 * math.atan2(imu.orientation.z, imu.orientation.w), heading, delta=0.02)
        self.assertEqual((imu.header.frame_id, imu.angular_velocity_covariance[0]), ("base_link", -1.0))

    def test_joints_are_driven_by_name(self) -> None:
        none = numpy.array([])
        for _ in range(150):
            state = STORE.types[STATE](header(), ["arm"], numpy.array([2.0]), none, none)
            self.commander.put("/hub0/joint_commands", state, STATE)
            time.sleep(0.02)
        self.assertAlmostEqual(self.joint("arm")[0], 2.0, delta=0.05)
        for _ in range(50):
            state = STORE.types[STATE](header(), ["left", "arm"], none, numpy.array([3.0, -1.0]), none)
            self.commander.put("/hub0/joint_commands", state, STATE)
            time.sleep(0.02)
        self.assertAlmostEqual(self.joint("left")[1], 3.0, delta=0.3)
        self.assertAlmostEqual(self.joint("arm")[1], -1.0, delta=0.2)

    def test_changing_efforts_turn_a_joint_as_a_constant_effort_does(self) -> None:
        none = numpy.array([])

        def speed(*efforts: float) -> float:
            for each in range(100):
                effort = numpy.array([efforts[each % len(efforts)]])
                state = STORE.types[STATE](header(), ["left"], none, none, effort)
                self.commander.put("/hub0/joint_commands", state, STATE)
                time.sleep(0.02)
            return self.joint("left")[1]

        constant = speed(0.3)
        self.assertGreater(constant, 1.0)
        self.assertAlmostEqual(speed(0.300, 0.301), constant, delta=0.1 * constant)

    def test_malformed_messages_are_dropped_and_counted(self) -> None:
        good = bytes(STORE.serialize_cdr(twist(0.3, 0.0), TWIST))
        attachment = self.commander.attachment()
        bad = [(good, attachment[:end]) for end in range(33)] + [(good, attachment + b"\0"), (good, None)]
        bad += [(good[:end], attachment) for end in range(len(good))] + [(b"\0\0\0\0" + good[4:], attachment)]
        for data, attached in bad:
            self.session.put(key("/hub0/cmd_vel", TWIST), data, attachment=attached)
        self.wait_for(lambda: int(self.hub_status().values[0].value) == len(bad), "count of malformed messages")
        self.assertAlmostEqual(self.speed(), 0.0, delta=0.01)
        self.commander.drive(1, 0.2)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)


class Services(WithRobot):
    def test_stop_lasts_until_enable(self) -> None:
        self.commander.drive(0.5, 0.2)
        self.assertTrue(self.commander.call("stop")[0])
        # The motors coast to a standstill.
        self.commander.drive(2.5, 0.2)
        self.assertAlmostEqual(self.speed(), 0.0, delta=0.01)
        self.assertTrue(self.commander.call("enable", True)[0])
        self.commander.drive(1.0, 0.2)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)

    def test_encoders_are_reset_and_the_base_stays_where_it_is(self) -> None:
        self.commander.drive(1.0, 0.2)
        time.sleep(1.5)
        there = self.newest[ODOM].pose.pose.position.x
        self.assertEqual(self.commander.call("reset_encoders"), (True, "all encoders are at 0"))
        time.sleep(0.5)
        self.assertAlmostEqual(self.joint("left")[0], 0.0, delta=0.01)
        self.assertAlmostEqual(self.newest[ODOM].pose.pose.position.x, there, delta=0.005)

    def test_a_joint_that_holds_a_position_stays_where_it_is_when_encoders_are_reset(self) -> None:
        none = numpy.array([])
        for _ in range(120):
            state = STORE.types[STATE](header(), ["arm"], numpy.array([4.0]), none, none)
            self.commander.put("/hub0/joint_commands", state, STATE)
            time.sleep(0.02)
        self.assertAlmostEqual(self.joint("arm")[0], 4.0, delta=0.05)
        # The first reset is within the validity of the commands, the second after their end.
        for _ in range(2):
            self.assertTrue(self.commander.call("reset_encoders")[0])
            fastest, end = 0.0, time.time() + 1.0
            while time.time() < end:
                fastest = max(fastest, abs(self.joint("arm")[1]))
                time.sleep(0.01)
            self.assertLess(fastest, 0.2)
            self.assertAlmostEqual(self.joint("arm")[0], 0.0, delta=0.02)

    def test_identify_finds_all_joints_and_stop_ends_it(self) -> None:
        success, message = self.commander.call("identify")
        self.assertTrue(success, message)
        self.commander.drive(1.0, 0.2)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)

    def test_settings_are_saved(self) -> None:
        self.assertEqual(self.commander.call("save_settings"), (True, "settings are stored"))


class LowBattery(WithRobot):
    def start_hub(self, port: int) -> subprocess.Popen:
        with unittest.mock.patch.object(sys.modules[__name__], "SCENARIO", SCENARIO.replace("emf_v = 12.6", "emf_v = 5.0")):
            return super().start_hub(port)

    def test_identify_is_answered_although_no_motor_can_be_enabled(self) -> None:
        success, message = self.commander.call("identify")
        self.assertFalse(success)
        self.assertRegex(message, "left: the hub refuses: battery unknown, below 7 V")


class Losses(WithRobot):
    def test_of_two_processes_the_newest_drives_and_both_are_told(self) -> None:
        older, newer = Commander(self.process(), "planner"), Commander(self.process(), "teleop")
        older.drive(0.5, 0.1)
        for _ in range(75):
            newer.twist(0.2)
            older.twist(-0.1)
            time.sleep(0.02)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)
        told = r"two commanders: /teleop \(session \w{8}\) drives, /planner \(session \w{8}\) is ignored"
        self.wait_for(lambda: re.fullmatch(told, self.hub_status().message), "warning", 3)

    def test_two_topics_of_one_process_are_one_commander(self) -> None:
        process, none = self.process(), numpy.array([])
        base, arm = Commander(process, "teleop", 1), Commander(process, "teleop", 2, "joint_commands", STATE)
        for _ in range(75):
            base.twist(0.2)
            arm.put("/hub0/joint_commands", STORE.types[STATE](header(), ["arm"], none, numpy.array([1.0]), none), STATE)
            time.sleep(0.02)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)
        self.assertAlmostEqual(self.joint("arm")[1], 1.0, delta=0.2)
        time.sleep(1.1)
        self.assertEqual(self.hub_status().message, "ready")

    def test_motors_stop_when_the_router_is_gone_and_run_when_it_is_back(self) -> None:
        self.commander.drive(0.5, 0.2)
        self.router.kill()
        self.router.wait()
        time.sleep(1.5)
        self.start_router()
        before = self.counts[STATE]
        self.wait_for(lambda: self.counts[STATE] > before + 20, "states after the router's restart")
        self.assertAlmostEqual(self.speed(), 0.0, delta=0.01)
        self.wait_for(lambda: self.session.liveliness().get("@ros2_lv/7/*/*/*/SS/**"), "tokens")
        self.commander.drive(1.5, 0.2)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)

    def test_a_hub_that_was_lost_is_stale_and_stays_off_until_enable(self) -> None:
        self.commander.drive(0.5, 0.2)
        self.hub.kill()
        self.hub.wait()
        self.wait_for(lambda: self.hub_status().level == 3, "stale status")
        before = self.counts[STATE]
        time.sleep(0.5)
        self.assertLessEqual(self.counts[STATE], before + 1)
        self.assertEqual(self.commander.call("reset_encoders"), (False, "the hub cannot be reached"))
        self.start_hub(self.hub_port)
        self.wait_for(lambda: self.counts[STATE] > before + 20, "states of the hub that is back")
        self.commander.drive(1.0, 0.2)
        self.assertAlmostEqual(self.speed(), 0.0, delta=0.01)
        self.assertTrue(self.commander.call("enable", True)[0])
        self.commander.drive(1.5, 0.2)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)

    def test_a_hub_that_is_reset_on_an_open_line_moves_no_base_and_stays_off_until_enable(self) -> None:
        self.node.kill()
        self.node.wait()
        relay = Relay()
        self.addCleanup(relay.close)
        relay.connect(self.hub_port)
        before = self.counts[ODOM]
        self.start_node([f"127.0.0.1:{relay.port}"])
        self.wait_for(lambda: self.counts[ODOM] > before + 20, "odometry through the relay")
        self.commander.drive(1.5, 0.2)
        self.hub.kill()
        self.hub.wait()
        there, before = self.newest[ODOM].pose.pose.position.x, self.counts[ODOM]
        self.assertGreater(there, 0.2)
        port = free_port()
        self.start_hub(port)
        self.wait_for_port(port)
        relay.connect(port)
        self.commander.drive(1.5, 0.2)
        self.assertGreater(self.counts[ODOM], before + 20)
        self.assertAlmostEqual(self.newest[ODOM].pose.pose.position.x, there, delta=0.02)
        self.wait_for(lambda: self.hub_status().message == "the hub was reset; call enable", "warning", 3)
        self.assertTrue(self.commander.call("enable", True)[0])
        self.commander.drive(1.0, 0.2)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)

    def test_a_call_is_answered_although_the_line_is_lost_during_it(self) -> None:
        self.node.kill()
        self.node.wait()
        line = CutLine()
        self.addCleanup(line.close)
        line.connect(self.hub_port)
        before = self.counts[ODOM]
        self.start_node([f"127.0.0.1:{line.port}"])
        self.wait_for(lambda: self.counts[ODOM] > before + 20, "odometry through the line")
        self.assertEqual(self.commander.call("reset_encoders"), (False, "the hub was lost"))

    def left_running(self) -> bool:
        """Asks the hub by another program, which disables what runs."""
        status = [os.environ["MOTOR_HUB"], "client", "status", "--tcp", f"127.0.0.1:{self.hub_port}"]
        return "left running" in subprocess.run(status, capture_output=True, text=True, check=True, timeout=20).stderr

    def test_the_program_disables_motors_when_it_ends(self) -> None:
        self.commander.drive(0.5, 0.2)
        self.node.terminate()
        self.assertEqual(self.node.wait(10), 0)
        self.assertFalse(self.left_running())

    def test_after_a_kill_the_hub_disables_motors_by_itself(self) -> None:
        self.commander.drive(0.5, 0.2)
        self.node.kill()
        self.assertEqual(self.node.wait(10), -9)
        self.assertTrue(self.left_running())
        self.start_node()
        self.wait_for(lambda: self.hub_status().message == "ready", "the node again")
        self.commander.drive(1.0, 0.2)
        self.node.kill()
        self.node.wait()
        time.sleep(2.8)
        self.assertFalse(self.left_running())


class NoHubYet(WithRobot):
    distribution, has_hub = "humble", False

    def test_stop_before_the_first_connection_lasts_until_enable_and_humble_has_no_hashes(self) -> None:
        tokens = [str(reply.ok.key_expr) for reply in self.session.liveliness().get("@ros2_lv/7/**")]
        self.assertEqual({token.split("/")[11] for token in tokens if "/NN/" not in token}, {"TypeHashNotSupported"})
        with unittest.mock.patch.multiple(__name__, TRIGGER="TypeHashNotSupported", SET_BOOL="TypeHashNotSupported"), \
                unittest.mock.patch.object(STORE, "hash_rihs01", lambda _: "TypeHashNotSupported"):
            success, message = self.commander.call("stop")
            self.assertFalse(success)
            self.assertIn("its motors are off until enable is called", message)
            self.hub = self.start_hub(self.hub_port)
            self.wait_for(lambda: ODOM in self.newest, "odometry")
            self.commander.drive(1.0, 0.2)
            self.assertAlmostEqual(self.speed(), 0.0, delta=0.01)
            self.assertTrue(self.commander.call("enable", True)[0])
            self.commander.drive(1.0, 0.2)
            self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)


class Fleet(WithRobot):
    namespaces = ["/hub0", "/hub1"]

    def start_node(self, places: list[str] | None = None) -> None:
        # The second hub is on a serial port.
        self.port1 = self.folder / "port1"
        self.start_second()
        super().start_node([f"127.0.0.1:{self.hub_port}", str(self.port1)])

    def start_second(self) -> None:
        self.second = self.start([os.environ["MOTOR_HUB"], "serve", "--pty", "--link", str(self.port1)])
        self.wait_for(self.port1.exists, "port of the second hub")

    def test_each_hub_has_its_own_commands_stop_and_loss(self) -> None:
        self.wait_for(lambda: f"/hub1 {ODOM}" in self.newest, "odometry of the second hub")
        first, second = self.commander, Commander(self.session, hub="/hub1")

        def both(seconds: float) -> None:
            for _ in range(round(50 * seconds)):
                first.twist(0.2)
                second.twist(-0.1)
                time.sleep(0.02)

        first.drive(1.0, 0.2)
        self.assertAlmostEqual(self.speed("/hub1 "), 0.0, delta=0.01)
        both(1.0)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)
        self.assertAlmostEqual(self.speed("/hub1 "), -0.1, delta=0.02)
        self.assertTrue(first.call("stop")[0])
        both(1.5)
        self.assertAlmostEqual(self.speed(), 0.0, delta=0.01)
        self.assertAlmostEqual(self.speed("/hub1 "), -0.1, delta=0.02)
        self.assertTrue(first.call("enable", True)[0])
        # The second hub is unplugged and comes back.
        self.second.kill()
        self.second.wait()
        self.port1.unlink()
        both(1.5)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)
        self.assertEqual(self.newest[f"/hub1 {DIAGNOSTICS}"].status[0].level, 3)
        self.assertEqual(self.hub_status().message, "ready")
        del self.newest[f"/hub1 {ODOM}"]
        self.start_second()
        self.wait_for(lambda: f"/hub1 {ODOM}" in self.newest, "odometry of the hub that is back")
        both(0.5)
        self.assertAlmostEqual(self.speed("/hub1 "), 0.0, delta=0.01)
        self.assertTrue(second.call("enable", True)[0])
        both(1.0)
        self.assertAlmostEqual(self.speed("/hub1 "), -0.1, delta=0.02)


class ChainLine(Relay):
    """A line to a chain of hubs. Requests to some addresses are lost, or go to another hub."""

    def __init__(self) -> None:
        self.lost: set[int] = set()
        self.others: dict[int, Relay] = {}
        super().__init__()

    def request(self, data: bytes) -> None:
        # A request is one packet, whose fifth byte is its destination.
        if data[4] in self.others:
            self.others[data[4]].request(data)
        elif data[4] not in self.lost:
            super().request(data)

    def replace(self, address: int, port: int) -> None:
        """Puts another hub with this address in the place of one."""
        other = Relay()
        other.connect(port)
        other.host, self.others[address] = self.host, other

    def close(self) -> None:
        for other in self.others.values():
            other.host = None
            other.close()
        super().close()


class Chain(WithRobot):
    """Three hubs on one line: the base on the parent, two more joints behind it."""

    def start_hub(self, port: int) -> subprocess.Popen:
        hub = self.start([os.environ["MOTOR_HUB"], "serve", "--hubs", "3", "--tcp", f"127.0.0.1:{port}"])
        self.wait_for_port(port)
        return hub

    def start_node(self, places: list[str] | None = None) -> None:
        self.line = ChainLine()
        self.addCleanup(self.line.close)
        self.line.connect(self.hub_port)
        behind = ("lift", 3), ("grip", 4)
        joints = [f'{{{{ name = "{name}", address = {at}, motor = 0, counts_per_turn = 1680, speed = 6 }}}},' for name, at in behind]
        with unittest.mock.patch.object(sys.modules[__name__], "HUB", HUB.replace("\n]", "\n" + "\n".join(joints) + "\n]")):
            super().start_node([f"127.0.0.1:{self.line.port}"])

    def drive_all(self, seconds: float) -> None:
        none, names = numpy.array([]), ["lift", "grip"]
        for _ in range(round(50 * seconds)):
            self.commander.twist(0.2)
            state = STORE.types[STATE](header(), names, none, numpy.array([2.0, -3.0]), none)
            self.commander.put("/hub0/joint_commands", state, STATE)
            time.sleep(0.02)

    def expect(self, **speeds: float) -> None:
        self.assertEqual({"left", "right", "arm", *speeds}, set(self.newest[STATE].name))
        for name, speed in speeds.items():
            self.assertAlmostEqual(self.joint(name)[1], speed, delta=0.2, msg=name)

    def test_joints_of_all_hubs_are_driven_and_a_lost_hub_takes_its_own_alone(self) -> None:
        self.wait_for(lambda: {"lift", "grip"} <= set(self.newest[STATE].name), "joints of the children", 3)
        self.drive_all(1.5)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)
        self.expect(lift=2.0, grip=-3.0)
        # The wire behind the parent is cut: the states of the other hubs go on.
        lost = len(self.raw)
        self.line.lost = {3}
        self.drive_all(2.5)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)
        self.expect(grip=-3.0)
        times = [at for where, _, at, _ in self.raw[lost:] if where == "/hub0/joint_states"]
        self.assertLess(max(b - a for a, b in zip(times, times[1:])) / 1e9, 0.4)
        told = {status.name: (status.level, status.message) for status in self.newest[DIAGNOSTICS].status}
        self.assertEqual(told["hub0"], (0, "ready"))
        self.assertEqual(told["hub0: lift"], (3, "the hub at address 3 cannot be reached"))
        self.assertEqual({level for name, (level, _) in told.items() if name != "hub0: lift"}, {0})
        # Its own keep-alive has stopped the motor. The joint is off until enable.
        self.line.lost = set()
        self.wait_for(lambda: "lift" in self.newest[STATE].name, "the joint of the hub that is back", 3)
        self.drive_all(0.5)
        self.expect(lift=0.0, grip=-3.0)
        self.assertTrue(self.commander.call("enable", True)[0])
        self.drive_all(1.5)
        self.expect(lift=2.0, grip=-3.0)
        # One stop reaches all hubs, also beside a lost one.
        self.line.lost = {4}
        self.assertTrue(self.commander.call("stop")[0])
        self.drive_all(2.0)
        self.assertAlmostEqual(self.speed(), 0.0, delta=0.01)
        self.expect(lift=0.0)

    def test_a_child_that_is_reset_is_off_until_enable(self) -> None:
        port = free_port()
        self.start([os.environ["MOTOR_HUB"], "serve", "--address", "3", "--tcp", f"127.0.0.1:{port}"])
        self.wait_for(lambda: {"lift", "grip"} <= set(self.newest[STATE].name), "joints of the children", 3)
        self.drive_all(1.0)
        self.expect(lift=2.0, grip=-3.0)
        # A hub that was started later has the clock and the state of a hub after a reset.
        self.line.replace(3, port)
        self.drive_all(1.5)
        self.expect(lift=0.0, grip=-3.0)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)
        told = {status.name: status.message for status in self.newest[DIAGNOSTICS].status}
        self.assertEqual(told["hub0: lift"], "the hub at address 3 was reset; call enable")
        self.assertTrue(self.commander.call("enable", True)[0])
        self.drive_all(1.0)
        self.expect(lift=2.0, grip=-3.0)


    def test_an_identification_that_a_lost_child_ends_leaves_no_motor_turning(self) -> None:
        self.wait_for(lambda: {"lift", "grip"} <= set(self.newest[STATE].name), "joints of the children", 3)
        with ThreadPoolExecutor() as pool:
            call = pool.submit(self.commander.call, "identify")
            self.wait_for(lambda: abs(self.joint("left")[1]) > 1.0, "motion of the first joint", 5)
            self.line.lost = {3}
            self.assertEqual(call.result(), (False, "a hub of the chain was lost"))
        # The motor coasts to a standstill. An identification would turn it the other way too.
        speeds, end = [], time.time() + 4.0
        while time.time() < end:
            speeds.append(self.joint("left")[1])
            time.sleep(0.01)
        self.assertLess(min(max(speeds), -min(speeds)), 0.2)
        self.assertLess(abs(speeds[-1]), 0.2)


class TwoMachines(unittest.TestCase):
    """Robot and operator in network namespaces of their own, which one cable connects."""

    def test_a_cut_cable_stops_the_robot_and_a_whole_one_drives_it_again(self) -> None:
        names = [f"motor-hub-{os.getpid()}-{end}" for end in ("robot", "operator")]
        for name in names:
            made = subprocess.run(["ip", "netns", "add", name], capture_output=True, text=True)
            if made.returncode != 0:
                self.skipTest(f"SKIPPED: no network namespace can be made: {made.stderr.strip()}")
            self.addCleanup(subprocess.run, ["ip", "netns", "del", name])
        robot, operator = names
        ip = lambda text: subprocess.run(["ip", *text.split()], check=True)  # noqa: E731
        ip(f"-n {robot} link add cable type veth peer name cable netns {operator}")
        for name, address in ((robot, "10.9.8.1/24"), (operator, "10.9.8.2/24")):
            ip(f"-n {name} address add {address} dev cable")
            ip(f"-n {name} link set cable up")
            ip(f"-n {name} link set lo up")

        def start(machine: str, *command: str) -> subprocess.Popen:
            inside = ["ip", "netns", "exec", machine, *command]
            process = subprocess.Popen(inside, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            for end in (process.stdout.close, process.stdin.close, process.wait, process.kill):
                self.addCleanup(end)
            return process

        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        config = Path(folder.name) / "config.toml"
        head = HEAD.format(port=7447, distribution="jazzy")
        config.write_text(head + HUB.format(place="127.0.0.1:7070", namespace="/hub0", urdf="/dev/null"))
        start(robot, *router_command(7447, "0.0.0.0"))
        start(robot, os.environ["MOTOR_HUB"], "serve", "--tcp", "127.0.0.1:7070")
        start(robot, os.environ["MOTOR_HUB_ROS"], str(config))
        beside, away = (start(name, sys.executable, __file__, "agent", "10.9.8.1") for name in names)

        def tell(agent: subprocess.Popen, seconds: float) -> None:
            agent.stdin.write(f"{seconds}\n")
            agent.stdin.flush()

        def told(agent: subprocess.Popen) -> float:
            """Speed of the robot once the agent has done what it was told."""
            return float(agent.stdout.readline())

        tell(away, 2.0)
        self.assertAlmostEqual(told(away), 0.2, delta=0.02)
        tell(away, 5.0)
        time.sleep(1.0)
        ip(f"-n {robot} link set cable down")
        time.sleep(1.5)
        tell(beside, 0)
        self.assertAlmostEqual(told(beside), 0.0, delta=0.01)
        ip(f"-n {robot} link set cable up")
        # What was sent before arrives late; then the commands go on.
        self.assertAlmostEqual(told(away), 0.2, delta=0.02)
        tell(beside, 0)
        told(beside)


def agent(router: str) -> None:
    """Drives for each line's seconds, then prints the robot's newest speed."""
    session = open_session("client", 7447, router)
    commander, speeds = Commander(session, "operator"), [0.0]
    odometry = key("/hub0/odom", ODOM)
    session.declare_subscriber(odometry, lambda sample: speeds.append(STORE.deserialize_cdr(bytes(sample.payload), ODOM).twist.twist.linear.x))
    while len(speeds) < 10:
        time.sleep(0.05)
    for line in sys.stdin:
        commander.drive(float(line), 0.2)
        time.sleep(0.1)
        print(speeds[-1], flush=True)


class OthersCode(WithRobot):
    def test_zenoh_ros2_sdk_lists_topics_and_exchanges_messages(self) -> None:
        peer = [sys.executable, __file__, "sdk", str(self.port), str(self.folder)]
        seen = json.loads(subprocess.run(peer, capture_output=True, text=True, check=True, timeout=60).stdout.splitlines()[-1])
        self.assertEqual(seen["topics"]["/hub0/odom"], [ODOM])
        self.assertEqual(seen["topics"]["/hub0/cmd_vel"], [TWIST, STAMPED])
        self.assertIn("std_srvs/srv/SetBool", seen["services"]["/hub0/enable"])
        self.assertEqual(seen["enabled"], [True, "motors accept commands"])
        self.assertAlmostEqual(seen["speed"], 0.2, delta=0.02)


def sdk_peer(port: int, folder: Path) -> None:
    """Lists, calls, commands and listens by zenoh-ros2-sdk. The test gives the package the definitions of the types.

    Otherwise the package would fetch the definitions from the network.
    """
    import zenoh_ros2_sdk as sdk

    for name in STORE.types:
        package, kind, of = name.split("/")
        if kind == "msg" and package in ("std_msgs", "geometry_msgs", "nav_msgs", "builtin_interfaces"):
            path = folder / package / kind / f"{of}.msg"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(STORE.generate_msgdef(name, ros_version=2)[0].split("=" * 80)[0])
    service = folder / "std_srvs/srv/SetBool.srv"
    service.parent.mkdir(parents=True)
    service.write_text("bool data\n---\nbool success\nstring message\n")
    here = {"router_ip": "127.0.0.1", "router_port": port, "domain_id": 7}
    sdk.ZenohSession.get_instance("127.0.0.1", port)
    sdk.get_registry().messages_dir = folder
    seen = {"topics": dict(sdk.get_topic_names_and_types(**here)), "services": dict(sdk.get_service_names_and_types(**here))}
    speeds = []
    subscriber = sdk.ROS2Subscriber("/hub0/odom", ODOM, lambda message: speeds.append(message.twist.twist.linear.x), **here)
    answer = sdk.ROS2ServiceClient("/hub0/enable", "std_srvs/srv/SetBool", **here).call(data=True)
    seen["enabled"] = [answer.success, answer.message]
    publisher = sdk.ROS2Publisher("/hub0/cmd_vel", TWIST, **here)
    vector = publisher.session_mgr.store.types["geometry_msgs/msg/Vector3"]
    for _ in range(60):
        publisher.publish(linear=vector(0.2, 0.0, 0.0), angular=vector(0.0, 0.0, 0.0))
        time.sleep(0.02)
    seen["speed"] = speeds[-1]
    print(json.dumps(seen), flush=True)
    os._exit(0)  # Its session has no close of its own.


if __name__ == "__main__":
    if sys.argv[1:2] == ["router"]:
        with open_session("router", int(sys.argv[2]), sys.argv[3]):
            time.sleep(3600)
    elif sys.argv[1:2] == ["agent"]:
        agent(sys.argv[2])
    elif sys.argv[1:2] == ["sdk"]:
        sdk_peer(int(sys.argv[2]), Path(sys.argv[3]))
    elif len(sys.argv) == 1:
        # The tests wait most of the time: some classes run side by side.
        groups = [Program, Losses, Services, LowBattery, Chain, Commands, Graph, Fleet, TwoMachines, NoHubYet, OthersCode]

        def run(group: type) -> subprocess.CompletedProcess:
            return subprocess.run([sys.executable, __file__, "-v", group.__name__], stderr=subprocess.PIPE, text=True)

        with ThreadPoolExecutor(3) as pool:
            results = list(pool.map(run, groups))
        print(*(result.stderr for result in results), sep="\n")
        print("router:", shutil.which("zenohd") or "eclipse-zenoh")
        sys.exit(any(result.returncode for result in results))
    else:
        unittest.main()
