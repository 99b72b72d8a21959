"""Drives the base of base.toml round a square of 0.5 m by cmd_vel, without ROS: pip install eclipse-zenoh rosbags"""

import json
import math
import os
import struct
import time

import zenoh
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
TWIST, ODOM = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry"
SPEED, TURN = 0.2, 1.0  # m/s, rad/s
gid, sequence, newest = os.urandom(16), 0, None


def key(topic: str, name: str) -> str:
    return f"0/hub0/{topic}/{name.replace('/', '::', 1).replace('/', '::dds_::')}_/{STORE.hash_rihs01(name)}"


def command(forward: float, turn: float, seconds: float) -> None:
    """Repeats a twist 50 times a second: a command is valid for 0.5 s."""
    global sequence
    vector = STORE.types["geometry_msgs/msg/Vector3"]
    twist = STORE.types[TWIST](vector(forward, 0.0, 0.0), vector(0.0, 0.0, turn))
    for _ in range(round(50 * seconds)):
        sequence += 1
        attachment = struct.pack("<qqB16s", sequence, time.time_ns(), 16, gid)
        session.put(key("cmd_vel", TWIST), bytes(STORE.serialize_cdr(twist, TWIST)), attachment=attachment)
        time.sleep(0.02)


def on_odometry(sample: zenoh.Sample) -> None:
    global newest
    newest = STORE.deserialize_cdr(bytes(sample.payload), ODOM).pose.pose


settings = {"mode": "client", "connect": {"endpoints": ["tcp/localhost:7447"]}, "scouting": {"multicast": {"enabled": False}}}
with zenoh.open(zenoh.Config.from_json5(json.dumps(settings))) as session:
    session.declare_subscriber(key("odom", ODOM), on_odometry)
    for corner in range(4):
        command(SPEED, 0.0, 0.5 / SPEED)
        command(0.0, TURN, math.pi / 2 / TURN)
        print(f"corner {corner + 1}: x {newest.position.x:.2f} m, y {newest.position.y:.2f} m")
