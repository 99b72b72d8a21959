"""Turns motor 0 of a hub for two seconds, with no library but pyserial: python3 drive.py /dev/ttyACM0

Motors start when this runs: take the wheels off the ground, and keep a switch in the battery's line within reach.
"""

import argparse
import struct
import time

import serial

HUB, MOTORS = 2, 0x1000  # the hub's address, and its first motor function
NUMBER = 0


def ask(port, function, form="", *fields):
    """Sends a request and returns the fields of the answer, as bytes; a refusal is an error."""
    global NUMBER
    NUMBER = NUMBER % 255 + 1
    fields = struct.pack("<" + form, *fields)
    packet = struct.pack("<2sHBBBBH", b"DK", 11 + len(fields), HUB, 0, NUMBER, 0, function) + fields
    port.reset_input_buffer()
    port.write(packet + bytes([sum(packet) % 256]))
    head = port.read(10)
    if len(head) < 10 or head[:2] != b"DK":
        raise TimeoutError("the hub does not answer")
    (length,) = struct.unpack_from("<H", head, 2)
    rest = port.read(length - 10)
    if (sum(head) + sum(rest[:-1])) % 256 != rest[-1] or head[7] != NUMBER:
        raise ValueError("the answer is damaged, or belongs to another request")
    if head[8:10] == b"\x02\x7f":
        raise ValueError(f"the hub refuses the request: NACK {rest[0]}")
    return rest[:-1]


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], usage="drive.py PORT")
parser.add_argument("port", metavar="PORT", help="serial port of the hub, such as /dev/ttyACM0")
arguments = parser.parse_args()

with serial.Serial(arguments.port, 460800, timeout=1) as port:
    (millivolts,) = struct.unpack("<h", ask(port, MOTORS + 7, "BB", 13, 0))
    print(f"battery: {millivolts / 1000:.2f} V")
    ask(port, MOTORS + 8, "BBB", 0, 1, 0)  # motor 0: regulated velocity, brakes at zero
    ask(port, MOTORS + 17, "Bh", 0, 500)  # 500 counts/s
    try:
        ask(port, MOTORS + 10, "BB", 0, 1)  # enable
        for _ in range(20):  # the hub releases its motors after 2.5 s without a packet
            bulk = ask(port, MOTORS)
            counts, cps = struct.unpack_from("<i", bulk, 1)[0], struct.unpack_from("<h", bulk, 18)[0]
            print(f"{counts} counts, {cps} counts/s")
            time.sleep(0.1)
    finally:
        ask(port, MOTORS + 10, "BB", 0, 0)  # disable
