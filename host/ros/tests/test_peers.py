"""motor-hub-ros against code of others: eclipse-zenoh as peer, rosbags as judge of messages. No ROS is needed.

The environment names the programs: MOTOR_HUB (motor-hub) and MOTOR_HUB_ROS (motor-hub-ros).
"""

import json
import math
import os
import re
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest
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

CONFIG = """
router = "tcp/127.0.0.1:{port}"
domain = 7

[[hub]]
place = "{place}"
namespace = "/hub0"
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


def open_session(mode: str, port: int) -> zenoh.Session:
    here = f"tcp/127.0.0.1:{port}"
    settings = {
        "mode": mode,
        "scouting": {"multicast": {"enabled": False}},
        "timestamping": {"enabled": True},
        "listen": {"endpoints": [here] if mode == "router" else []},
        "connect": {"endpoints": [] if mode == "router" else [here], "timeout_ms": 10_000},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))


def dds(name: str) -> str:
    return name.replace("/", "::", 1).replace("/", "::dds_::") + "_"


def key(topic: str, name: str) -> str:
    return f"7{topic}/{dds(name)}/{STORE.hash_rihs01(name)}"


class Commander:
    """A publisher of commands, as a ROS process is one."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session, self.sequence, self.gid = session, 0, os.urandom(16)

    def attachment(self) -> bytes:
        self.sequence += 1
        return struct.pack("<qqB16s", self.sequence, time.time_ns(), 16, self.gid)

    def put(self, topic: str, message, name: str) -> None:
        data = bytes(STORE.serialize_cdr(message, name))
        self.session.put(key(topic, name), data, attachment=self.attachment())

    def twist(self, forward: float, turn: float = 0.0) -> None:
        self.put("/hub0/cmd_vel", twist(forward, turn), TWIST)

    def drive(self, seconds: float, forward: float, turn: float = 0.0) -> None:
        for _ in range(round(seconds * 50)):
            self.twist(forward, turn)
            time.sleep(0.02)

    def call(self, service: str, on: bool | None = None) -> tuple[bool, str]:
        name, code, request = ("Trigger", TRIGGER, b"\0") if on is None else ("SetBool", SET_BOOL, bytes([on]))
        attachment = self.attachment()
        replies = list(
            self.session.get(
                f"7/hub0/{service}/{dds('std_srvs/srv/' + name)}/{code}",
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


class WithRobot(unittest.TestCase):
    def setUp(self) -> None:
        self.port = free_port()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.start_router()
        self.hub_port = free_port()
        self.start_hub()
        (self.folder / "robot.urdf").write_text("<robot name='test'/>")
        config = self.folder / "config.toml"
        config.write_text(
            CONFIG.format(port=self.port, place=f"127.0.0.1:{self.hub_port}", urdf=self.folder / "robot.urdf")
        )
        self.node = self.start([os.environ["MOTOR_HUB_ROS"], str(config)])
        self.session = open_session("peer", self.port)
        self.addCleanup(self.session.close)
        self.commander = Commander(self.session)
        self.newest: dict[str, object] = {}
        self.counts: dict[str, int] = {}
        self.raw: list[tuple[str, str, int, bytes]] = []
        self.subscriber = self.session.declare_subscriber("7/**", self.take)
        self.wait_for(lambda: ODOM in self.newest, "odometry")

    def start(self, command: list[str]) -> subprocess.Popen:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def start_hub(self) -> None:
        store = ["--store", str(self.folder / "store")]
        self.hub = self.start([os.environ["MOTOR_HUB"], "serve", "--tcp", f"127.0.0.1:{self.hub_port}", *store])

    def start_router(self) -> None:
        self.router = self.start([sys.executable, __file__, "router", str(self.port)])
        for _ in range(100):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.1)
        self.fail("the router does not start")

    def take(self, sample: zenoh.Sample) -> None:
        where, spelt, _ = re.fullmatch(r"7(/.*)/(.*)/(.*)", str(sample.key_expr)).groups()
        name = spelt.replace("::dds_::", "/").replace("::", "/").removesuffix("_")
        data = bytes(sample.payload)
        if not where.endswith(("cmd_vel", "joint_commands")) and len(bytes(sample.attachment)) == 33:
            message = STORE.deserialize_cdr(data, name)
            # Strict: what is read must be written as the same bytes.
            if bytes(STORE.serialize_cdr(message, name)) == data:
                self.newest[name] = message
                self.counts[name] = self.counts.get(name, 0) + 1
                self.raw.append((where, name, time.time_ns(), data))

    def wait_for(self, condition, what: str, seconds: float = 15.0) -> None:
        end = time.time() + seconds
        while not condition():
            self.assertLess(time.time(), end, f"no {what} within {seconds} s")
            time.sleep(0.02)

    def speed(self) -> float:
        return self.newest[ODOM].twist.twist.linear.x

    def joint(self, name: str):
        state = self.newest[STATE]
        index = state.name.index(name)
        return state.position[index], state.velocity[index]

    def hub_status(self):
        return self.newest[DIAGNOSTICS].status[0]


class Graph(WithRobot):
    def test_every_topic_and_service_has_a_token_and_a_gid_of_it(self) -> None:
        time.sleep(1)
        tokens = [str(reply.ok.key_expr) for reply in self.session.liveliness().get("@ros2_lv/7/**")]
        parts = [token.split("/") for token in tokens]
        self.assertEqual([part[8] for part in parts if part[5] == "NN"], ["motor_hub"])
        found = {(part[5], part[9].replace("%", "/"), part[10]) for part in parts if part[5] != "NN"}
        expected = {("MP", "/hub0/joint_states", STATE), ("MP", "/hub0/odom", ODOM), ("MP", "/tf", TF)}
        expected |= {("MP", "/hub0/battery_state", BATTERY), ("MP", "/diagnostics", DIAGNOSTICS)}
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

    def test_identify_finds_all_joints_and_stop_ends_it(self) -> None:
        success, message = self.commander.call("identify")
        self.assertTrue(success, message)
        self.commander.drive(1.0, 0.2)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)

    def test_settings_are_saved(self) -> None:
        self.assertEqual(self.commander.call("save_settings"), (True, "settings are stored"))


class Losses(WithRobot):
    def test_two_commanders_are_told_and_the_newest_drives(self) -> None:
        older, newer = Commander(self.session), Commander(self.session)
        older.twist(0.1)
        for _ in range(75):
            newer.twist(0.2)
            older.twist(-0.1)
            time.sleep(0.02)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)
        self.wait_for(lambda: "two commanders" in self.hub_status().message, "warning", 3)

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
        self.assertEqual(self.commander.call("stop"), (False, "the hub cannot be reached"))
        self.start_hub()
        self.wait_for(lambda: self.counts[STATE] > before + 20, "states of the hub that is back")
        self.commander.drive(1.0, 0.2)
        self.assertAlmostEqual(self.speed(), 0.0, delta=0.01)
        self.assertTrue(self.commander.call("enable", True)[0])
        self.commander.drive(1.5, 0.2)
        self.assertAlmostEqual(self.speed(), 0.2, delta=0.02)

    def test_the_program_disables_motors_when_it_ends(self) -> None:
        self.commander.drive(0.5, 0.2)
        self.node.terminate()
        self.assertEqual(self.node.wait(10), 0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["router"]:
        with open_session("router", int(sys.argv[2])):
            time.sleep(3600)
    else:
        unittest.main()
