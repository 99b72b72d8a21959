"""The package against a served hub: `motor-hub serve`, whose path is in the environment variable MOTOR_HUB."""

import ast
import asyncio
import fcntl
import gc
import json
import os
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
import unittest
import unittest.mock
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import motor_hub
from motor_hub import HubError, Refused, Unreachable, connect

PROGRAM = os.environ["MOTOR_HUB"]


class Served:
    """A simulated hub in a process of its own."""

    def __init__(self) -> None:
        self.process = subprocess.Popen([PROGRAM, "serve", "--tcp", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.place = self.process.stdout.readline().strip()

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


def make_own_notes(test: unittest.TestCase) -> None:
    """Gives a test a folder of its own for notes of served hubs."""
    folder = tempfile.TemporaryDirectory()
    test.addCleanup(folder.cleanup)
    user = unittest.mock.patch.dict(os.environ, XDG_RUNTIME_DIR=folder.name)
    user.start()
    test.addCleanup(user.stop)


class WithHub(unittest.IsolatedAsyncioTestCase):
    def setUp(self) -> None:
        self.served = Served()
        self.addCleanup(self.served.close)
        self.hub = connect(self.served.place)

    async def still(self, motor: int = 0) -> None:
        """Asserts that a motor is disabled."""
        self.assertFalse((await self.hub[motor].read()).enabled)


class Commands(WithHub):
    async def test_a_velocity_is_reached_and_the_motor_is_disabled_after_the_block(self) -> None:
        with self.hub.enabled(0):
            await self.hub[0].velocity(800)
            await self.hub[0].settled(5)
            reading = await self.hub[0].read()
            self.assertAlmostEqual(reading.velocity, 800, delta=16)
            self.assertEqual((reading.setpoint, reading.setpoint_value), ("velocity", 800))
            self.assertEqual((reading.regime, reading.mode), ("forward", "9/8"))
            self.assertTrue(11 < reading.battery_v < 14)
        await self.still()

    async def test_a_position_follows_a_velocity_and_settles_at_its_target(self) -> None:
        with self.hub.enabled(1):
            await self.hub[1].velocity(-500)
            await asyncio.sleep(0.3)
            await self.hub[1].position(1000, speed=900)
            await self.hub[1].settled(10)
            self.assertAlmostEqual((await self.hub[1].read()).position, 1000, delta=10)

    async def test_a_power_turns_at_once_and_a_current_keeps_its_speed_limit(self) -> None:
        with self.hub.enabled(2):
            await self.hub[2].power(0.5)
            await asyncio.sleep(0.5)
            self.assertGreater((await self.hub[2].read()).velocity, 500)
            await self.hub[2].current(1.0, speed=300)
            await asyncio.sleep(1.0)
            self.assertAlmostEqual((await self.hub[2].read()).velocity, 300, delta=30)

    async def test_a_velocity_does_not_come_back_after_a_current(self) -> None:
        with self.hub.enabled(2):
            await self.hub[2].velocity(800)
            await self.hub[2].current(0.5, speed=300)
        # The task that sent the hub's keep-alive ends. Then nothing refers to the hub, and its connection is closed.
        await asyncio.sleep(0.1)
        del self.hub
        gc.collect()
        status = [PROGRAM, "client", "status", "--json", "--tcp", self.served.place]
        motor = json.loads(subprocess.run(status, stdout=subprocess.PIPE, check=True).stdout)["motors"][2]
        # A motor follows the target of its mode when its constant current ends.
        self.assertEqual((motor["mode"], motor["power"]), ("power", 0))

    async def test_an_encoder_is_reset_to_zero_unless_its_motor_has_a_target_position(self) -> None:
        with self.hub.enabled(0):
            for motion in [self.hub[0].position(600), self.hub.together({0: 300})]:
                await motion
                with self.assertRaisesRegex(HubError, "motor 0 has a target position"):
                    await self.hub[0].reset_encoder()
            await self.hub[0].power(0)
            await asyncio.sleep(0.5)
            self.assertGreater((await self.hub[0].read()).position, 100)
            await self.hub[0].reset_encoder()
            await asyncio.sleep(0.5)
            self.assertAlmostEqual((await self.hub[0].read()).position, 0, delta=5)

    async def test_a_group_moves_in_step_and_settles(self) -> None:
        with self.hub.enabled(0, 1):
            await self.hub.together({0: 600, 1: -300}, timeout=10)
            readings = await self.hub.read()
            self.assertAlmostEqual(readings[0].position, 600, delta=24)
            self.assertAlmostEqual(readings[1].position, -300, delta=24)
            await self.hub.together_at({0: 400, 1: 400})
            await asyncio.sleep(1)
            self.assertAlmostEqual((await self.hub[1].read()).velocity, 400, delta=40)

    async def test_a_motor_of_a_group_at_speeds_settles_at_its_own_speed(self) -> None:
        with self.hub.enabled(0, 1):
            await self.hub.together_at({0: 400, 1: -200.4})
            for motor, speed in [(0, 400), (1, -200)]:
                await self.hub[motor].settled(5)
                self.assertAlmostEqual((await self.hub[motor].read()).velocity, speed, delta=12)
            await self.hub.together_at({0: 0, 1: 0})
            await self.hub[1].settled(5)
            self.assertAlmostEqual((await self.hub[1].read()).velocity, 0, delta=5)

    async def test_a_drive_base_drives_by_its_gyro_and_reports_where_it_is(self) -> None:
        with self.assertRaisesRegex(HubError, "no drive base; configure one by hub.set_base"):
            await self.hub.base()
        dimensions = {"wheel_diameter_mm": 90, "track_mm": 300, "counts_per_turn": (560, 1680)}
        for wheels, changed, message in [
            ((0, 4), {}, "motor is 4; allowed are 0 to 3"),
            ((1, 1), {}, "two different motors"),
            ((0, 1), {"track_mm": 20_000}, "a track of 1 mm to 10 m"),
        ]:
            with self.assertRaisesRegex(ValueError, message):
                await self.hub.set_base(*wheels, **{**dimensions, **changed})
        base = await self.hub.set_base(0, 1, **dimensions, use_gyro=True)
        with self.assertRaisesRegex(HubError, "motor 0 is not enabled"):
            await base.turn(5)
        with self.hub.enabled(*base.wheels):
            with self.assertRaisesRegex(ValueError, "speed is 0; allowed are 0.001 to 1000000 mm/s"):
                await base.drive(100, speed=0)
            await base.turn(45, timeout=10)
            await base.drive(100, timeout=10)
        at = await (await self.hub.base()).odometry()
        self.assertEqual((at.gyro, at.gyro_losses), ("good", 0))
        self.assertAlmostEqual(at.heading_degrees, 45, delta=0.5)
        self.assertAlmostEqual(at.x_mm, 70.7, delta=2)
        self.assertAlmostEqual(at.y_mm, 70.7, delta=2)

    async def test_an_identification_finds_the_motor_and_applies_the_result(self) -> None:
        with self.hub.enabled(0):
            found = await self.hub[0].identify(apply=True)
        self.assertLess(found.acceleration_error, 0.1)
        self.assertGreater(found.acceleration_per_volt, 0)

    async def test_an_identification_that_the_hub_stops_is_refused_with_its_reason(self) -> None:
        with self.hub.enabled(0):
            with self.assertRaisesRegex(Refused, "travel limit"):
                await self.hub[0].identify(travel=1)

    async def test_a_reset_during_an_identification_ends_it_with_an_error(self) -> None:
        # After a reset the hub reports that it has identified no motor.
        link = unittest.mock.Mock(wraps=self.hub._link)
        link.identification.side_effect = [5, None]
        with unittest.mock.patch.object(self.hub, "_link", link), self.hub.enabled(0):
            with self.assertRaisesRegex(HubError, "motor 0 was not identified: the hub was reset"):
                await asyncio.wait_for(self.hub[0].identify(), 20)
        await self.still()

    async def test_a_cancelled_identification_stops_its_motor(self) -> None:
        with self.hub.enabled(0):
            identifying = asyncio.create_task(self.hub[0].identify())
            while (await self.hub[0].read()).setpoint != "identify":
                await asyncio.sleep(0.05)
            identifying.cancel()
            with self.assertRaises(asyncio.CancelledError):
                await identifying
            reading = await self.hub[0].read()
            self.assertEqual((reading.enabled, reading.setpoint), (True, "power"))

    async def test_stop_disables_every_motor_and_settled_names_the_reason(self) -> None:
        with self.hub.enabled(0, 3):
            await self.hub[3].velocity(500)
            await self.hub.stop()
            await self.still(3)
            with self.assertRaisesRegex(HubError, "motor 3 does not run"):
                await self.hub[3].settled(1)
            for command in [
                self.hub[3].power(0.1),
                self.hub[3].velocity(500),
                self.hub[3].position(500),
                self.hub[3].current(0.5, speed=100),
                self.hub[3].identify(),
                self.hub.together({3: 500}),
                self.hub.together_at({3: 500}),
            ]:
                with self.assertRaisesRegex(HubError, "motor 3 is off: stop was called"):
                    await command
        with self.hub.enabled(3):
            await self.hub[3].velocity(500)
            await self.hub[3].settled(5)

    async def test_two_hubs_are_driven_side_by_side(self) -> None:
        other = Served()
        self.addCleanup(other.close)
        second = connect(other.place)
        with self.hub.enabled(0), second.enabled(0):
            await asyncio.gather(self.hub[0].velocity(600), second[0].velocity(-600))
            await asyncio.gather(self.hub[0].settled(5), second[0].settled(5))
            self.assertAlmostEqual((await self.hub[0].read()).velocity, 600, delta=12)
            self.assertAlmostEqual((await second[0].read()).velocity, -600, delta=12)


class MotionsInStep(WithHub):
    """How motions of several motors end before all of them have settled."""

    async def base(self) -> motor_hub.Base:
        dimensions = {"wheel_diameter_mm": 90, "track_mm": 300, "counts_per_turn": (1680, 1680)}
        return await self.hub.set_base(0, 1, **dimensions)

    async def test_a_motion_whose_member_gets_another_command_is_an_error(self) -> None:
        base = await self.base()
        with self.hub.enabled(0, 1, 2):
            for motion in (base.drive(1000), base.turn(180), self.hub.together({0: 9000, 1: 9000})):
                waiting = asyncio.create_task(motion)
                await asyncio.sleep(0.3)
                await self.hub[2].velocity(100)
                self.assertFalse(waiting.done())
                await self.hub[1].power(0)
                with self.assertRaisesRegex(HubError, "motors 0, 1 was ended by another command to motor 1"):
                    await asyncio.wait_for(waiting, 3)

    async def test_a_motion_that_has_lost_any_of_its_members_is_an_error(self) -> None:
        for lost in (0, 1):
            with self.hub.enabled(0, 1):
                waiting = asyncio.create_task(self.hub.together({0: 9000, 1: 9000}))
                await asyncio.sleep(0.3)
                # The member leaves as by a fault that is over: the package knows of no other command.
                await asyncio.to_thread(self.hub._link.power, lost, 0.1)
                with self.assertRaisesRegex(HubError, f"motors 0, 1 has ended: motor {lost} has left the group"):
                    await asyncio.wait_for(waiting, 3)

    async def test_a_motion_that_has_lost_all_of_its_members_is_an_error(self) -> None:
        for members in ((0,), (0, 1)):
            with self.hub.enabled(*members):
                waiting = asyncio.create_task(self.hub.together(dict.fromkeys(members, 9000)))
                await asyncio.sleep(0.3)
                # No state of the group is read between two of these commands, as with a fault that all members have.
                lose = [self.hub._thread.submit(self.hub._link.power, member, 0.1) for member in members]
                with self.assertRaisesRegex(HubError, "^the motion of motors? 0(, 1)? has ended: .* left the group by a fault"):
                    await asyncio.wait_for(waiting, 3)
                self.assertEqual([each.result() for each in lose], [None] * len(members))

    async def test_a_motion_that_is_replaced_is_an_error_and_the_newer_one_succeeds(self) -> None:
        base = await self.base()
        with self.hub.enabled(0, 1):
            first = asyncio.create_task(base.drive(1000))
            await asyncio.sleep(0.3)
            await base.turn(5, timeout=10)
            with self.assertRaisesRegex(HubError, "motors 0, 1 was ended by another command to motors 0, 1"):
                await asyncio.wait_for(first, 3)
            first = asyncio.create_task(self.hub.together({0: 9000, 1: 9000}))
            await asyncio.sleep(0.3)
            with self.assertRaisesRegex(ValueError, "speed is 0"):
                await self.hub.together({0: 0}, speed=0)
            await asyncio.sleep(0.3)
            self.assertFalse(first.done(), "a command that is refused replaces nothing")
            await self.hub.together_at({0: 100})
            with self.assertRaisesRegex(HubError, "ended by another command to motor 0"):
                await asyncio.wait_for(first, 3)

    async def test_a_motion_that_nobody_awaits_any_more_stops(self) -> None:
        base = await self.base()

        async def times_out(move) -> None:
            with self.assertRaises(TimeoutError):
                await move(timeout=0.5)

        async def is_cancelled(move) -> None:
            with self.assertRaises(asyncio.TimeoutError):
                await asyncio.wait_for(move(), 0.5)

        with self.hub.enabled(0, 1):
            for end in (times_out, is_cancelled):
                for move in (
                    lambda **options: base.drive(2000, **options),
                    lambda **options: self.hub.together({0: 20_000, 1: 20_000}, **options),
                ):
                    await end(move)
                    await asyncio.sleep(1.2)
                    readings = await self.hub.read()
                    self.assertTrue(readings[0].enabled)
                    self.assertEqual([readings[0].velocity, readings[1].velocity], [0, 0])
            # A motion that was replaced before its time-out leaves the newer command in force.
            waiting = asyncio.create_task(base.drive(2000))
            await asyncio.sleep(0.3)
            await self.hub.together_at({0: 400, 1: 400})
            waiting.cancel()
            await asyncio.sleep(1)
            self.assertAlmostEqual((await self.hub[0].read()).velocity, 400, delta=40)


class ClosedHubs(WithHub):
    async def test_a_closed_hub_is_free_and_its_calls_are_errors(self) -> None:
        base = await self.hub.set_base(0, 1, wheel_diameter_mm=90, track_mm=300, counts_per_turn=(1680, 1680))
        self.hub.close()
        self.hub.close()
        closed = "the hub is closed; open it again by motor_hub.connect"
        for call in (
            self.hub.read(), self.hub.version(), self.hub.battery(), self.hub.stop(), self.hub.save(), self.hub.base(),
            self.hub[0].read(), self.hub[0].power(0), self.hub[0].settled(), self.hub[0].identify(),
            self.hub[0].reset_encoder(), self.hub.together({0: 1}), self.hub.together_at({0: 1}), base.drive(1),
            base.odometry(),
        ):
            with self.assertRaisesRegex(HubError, closed):
                await call
        with self.assertRaisesRegex(HubError, closed):
            with self.hub.enabled(0):
                self.fail("the block must not run")
        self.assertEqual(repr(self.hub[0]), "<motor 0 of hub 2>")
        self.hub = connect(self.served.place)
        self.assertEqual(self.hub.left_running, ())

    async def test_a_hub_that_is_closed_in_a_block_disables_its_motors(self) -> None:
        with self.assertRaisesRegex(HubError, "the hub is closed"):
            with self.hub.enabled(0, 1):
                await self.hub[0].velocity(500)
                self.hub.close()
                with self.assertRaisesRegex(HubError, "the hub is closed"):
                    await self.hub[0].velocity(500)
        self.hub = connect(self.served.place)
        self.assertEqual(self.hub.left_running, ())

    async def test_a_with_block_closes_its_hub(self) -> None:
        self.hub.close()
        for _ in range(2):
            with connect(self.served.place) as hub:
                with hub.enabled(0):
                    await hub[0].velocity(500)

    def test_a_hub_is_closed_with_its_last_reference(self) -> None:
        self.hub.close()

        async def drive() -> None:
            hub = connect(self.served.place)
            motor = hub[0]
            with hub.enabled(0):
                await motor.velocity(500)

        gc.disable()
        self.addCleanup(gc.enable)
        asyncio.run(drive())
        asyncio.run(drive())


class Recordings(WithHub):
    async def test_a_recording_has_equal_columns_and_its_time_grows(self) -> None:
        with self.hub.enabled(0):
            async with self.hub.recording(0, every=0.05) as recording:
                await self.hub[0].velocity(800)
                await asyncio.sleep(1)
        columns = recording.columns()
        self.assertGreaterEqual(len(columns["time_s"]), 15)
        self.assertEqual({len(values) for values in columns.values()}, {len(recording.readings)})
        self.assertEqual(columns["time_s"], sorted(columns["time_s"]))
        self.assertEqual(set(columns["motor"]), {0})
        self.assertIn(800.0, columns["setpoint_value"])

    async def test_an_interval_out_of_range_is_an_error(self) -> None:
        for every in (0, float("nan"), float("inf"), 10**400):
            with self.assertRaisesRegex(ValueError, f"every is {every}; allowed is more than 0 s, up to 1000000 s"):
                async with self.hub.recording(every=every):
                    self.fail("the block must not run")


class BadInput(WithHub):
    async def test_numbers_out_of_range_are_errors_that_name_the_range(self) -> None:
        # A number may exceed 64 bits.
        big, more = "18446744073709552000", "9223372036854775807 or more"
        base = await self.hub.set_base(0, 1, wheel_diameter_mm=90, track_mm=300, counts_per_turn=(1680, 1680))
        with self.hub.enabled(0, 1):
            motor = self.hub[0]
            for command, text in [
                (motor.velocity(40_000), "velocity is 40000; allowed are -32768 to 32767 counts/s"),
                (motor.velocity(32767.5), "velocity is 32767.5; allowed are -32768 to 32767 counts/s"),
                (motor.velocity(float("nan")), "velocity is NaN; allowed are -32768 to 32767 counts/s"),
                (motor.velocity("fast"), "velocity is 'fast'; allowed are -32768 to 32767 counts/s"),
                (motor.position(float("inf")), "position is inf; allowed are -2147483648 to 2147483647 counts"),
                (motor.position(None), "position is None; allowed are -2147483648 to 2147483647 counts"),
                (motor.power("full"), "power is 'full'; allowed are -1 to 1 of full power"),
                (motor.power(1.1), "power is 1.1; allowed are -1 to 1 of full power"),
                (motor.power(float("nan")), "power is NaN; allowed are -1 to 1 of full power"),
                (motor.position(2**31), "position is 2147483648; allowed are -2147483648 to 2147483647 counts"),
                (motor.position(0, speed=0), "speed is 0; allowed are 1 to 32767 counts/s"),
                (motor.current(0.1, speed=40_000), "speed is 40000; allowed are 1 to 32767 counts/s"),
                (motor.current(2000.0, speed=100), "a current of 2000 A is out of range; allowed is -65.535 to 65.535 A"),
                (motor.identify(travel=0), "travel is 0; allowed are 1 to 4294967295 counts"),
                (motor.velocity(2**64), f"velocity is {big}; allowed are -32768 to 32767 counts/s"),
                (motor.velocity(-(10**5000)), "velocity is -inf; allowed are -32768 to 32767 counts/s"),
                (motor.position(0, tolerance=2**64), f"tolerance is {big}; allowed are 0 to 65535 counts"),
                (motor.identify(travel=2**64), f"travel is {big}; allowed are 1 to 4294967295 counts"),
                (self.hub.together({0: 2**64}), f"target is {big}; allowed are -2147483648 to 2147483647 counts"),
                (self.hub.together({0: 1}, acceleration=2**64), f"acceleration is {big}; allowed are 1 to 4294967295 counts/s²"),
                (motor.power(10**400), "power is inf; allowed are -1 to 1 of full power"),
                (motor.power(-(10**400)), "power is -inf; allowed are -1 to 1 of full power"),
                (motor.current(10**400, speed=100), "a current of inf A is out of range; allowed is -65.535 to 65.535 A"),
                (base.drive(10**400), "distance is inf; allowed are -1000000 to 1000000 mm"),
                (base.drive(1, acceleration=10**400), "acceleration is inf; allowed are 0.001 to 1000000 mm/s²"),
            ]:
                with self.assertRaises(ValueError) as caught:
                    await command
                self.assertEqual(str(caught.exception), text)
        with self.assertRaisesRegex(ValueError, f"motor is {more}; allowed are 0 to 3"):
            with self.hub.enabled(2**64):
                self.fail("the block must not run")
        with self.assertRaisesRegex(ValueError, "a track of 1 mm to 10 m"):
            await self.hub.set_base(0, 1, wheel_diameter_mm=90, track_mm=10**400, counts_per_turn=(1680, 1680))

    async def test_computed_speeds_and_positions_are_rounded_to_whole_counts(self) -> None:
        motor = self.hub[0]
        with self.hub.enabled(0):
            for command, setpoint in [
                (motor.velocity(800.0), 800),
                (motor.velocity(-799.6), -800),
                (motor.position(10.6, speed=999.5, tolerance=9.5), 11),
                (self.hub.together({0: 20.4}, speed=999.5, acceleration=2000.4, tolerance=9.5), 20),
            ]:
                await command
                await asyncio.sleep(0.1)
                self.assertEqual((await motor.read()).setpoint_value, setpoint)

    async def test_a_timeout_out_of_range_is_an_error_and_nothing_moves(self) -> None:
        base = await self.hub.set_base(0, 1, wheel_diameter_mm=90, track_mm=300, counts_per_turn=(1680, 1680))
        with self.hub.enabled(0, 1):
            await self.hub[0].velocity(0)
            for timeout in (float("nan"), float("inf"), -1, 10**400):
                for call in (
                    self.hub[0].settled(timeout),
                    self.hub.together({0: 1000}, timeout=timeout),
                    base.drive(100, timeout=timeout),
                ):
                    with self.assertRaisesRegex(ValueError, f"timeout is {timeout}; allowed are 0 to 1000000 s"):
                        await asyncio.wait_for(call, 3)
            self.assertEqual((await self.hub[0].read()).setpoint, "velocity")

    async def test_a_set_point_that_never_settles_is_an_error(self) -> None:
        with self.hub.enabled(0):
            for setpoint, command in (("power", self.hub[0].power(0.2)), ("current", self.hub[0].current(0.1, speed=100))):
                await command
                with self.assertRaisesRegex(HubError, f"motor 0 never settles at its set-point, {setpoint}; .* velocity or a position"):
                    await asyncio.wait_for(self.hub[0].settled(), 3)

    async def test_a_motor_equals_the_same_motor_of_the_same_hub(self) -> None:
        other = Served()
        self.addCleanup(other.close)
        self.assertEqual({self.hub[0]: "left"}[self.hub[0]], "left")
        for motor in (self.hub[1], connect(other.place)[0]):
            self.assertNotEqual(self.hub[0], motor)

    async def test_a_motor_that_is_not_there_is_an_error(self) -> None:
        with self.assertRaisesRegex(IndexError, "motor is 4; allowed are 0 to 3"):
            self.hub[4]
        with self.assertRaisesRegex(TypeError, "cannot be interpreted as an integer"):
            self.hub[1.5]
        with self.assertRaisesRegex(ValueError, "motor is 7; allowed are 0 to 3"):
            with self.hub.enabled(0, 7):
                self.fail("the block must not run")
        await self.still()

    async def test_a_command_to_a_motor_that_is_not_enabled_is_an_error(self) -> None:
        with self.assertRaisesRegex(HubError, r"motor 1 is not enabled; enable it by: with hub.enabled\(1\):"):
            await self.hub[1].velocity(100)

    async def test_a_motor_is_enabled_by_one_block_at_a_time(self) -> None:
        with self.hub.enabled(0):
            with self.assertRaisesRegex(ValueError, "motor 0 is already enabled by another block"):
                with self.hub.enabled(0):
                    self.fail("the block must not run")

    def test_a_hub_that_is_not_there_is_unreachable(self) -> None:
        with self.assertRaisesRegex(Unreachable, "cannot open 127.0.0.1:1: "):
            connect("127.0.0.1:1")


class WithoutAnAddress(unittest.TestCase):
    """``connect()``, for a user with a folder of their own for notes of served hubs."""

    def setUp(self) -> None:
        make_own_notes(self)
        no_ports = unittest.mock.patch.object(motor_hub, "usb_ports", lambda: [])
        no_ports.start()
        self.addCleanup(no_ports.stop)

    def serve(self) -> Served:
        served = Served()
        self.addCleanup(served.close)
        return served

    def test_the_only_hub_is_found_and_of_two_hubs_none_is_chosen(self) -> None:
        with self.assertRaisesRegex(Unreachable, "no hub is found: there is no USB serial port"):
            connect()
        first = self.serve()
        found = connect()
        self.assertEqual(found.address, 2)
        with self.assertRaisesRegex(Unreachable, f"no hub is found: .*{first.place}"):
            connect()
        del found
        gc.collect()
        second = self.serve()
        with self.assertRaisesRegex(Unreachable, "2 hubs are found, at .*; give connect one of these places"):
            connect()
        second.close()
        self.assertEqual(connect().address, 2)

    def test_a_note_that_is_being_made_is_no_hub(self) -> None:
        folder = Path(os.environ["XDG_RUNTIME_DIR"], "motor-hub")
        folder.mkdir(mode=0o700)
        with (folder / "1").open("w") as note:
            fcntl.flock(note, fcntl.LOCK_EX)
            with self.assertRaisesRegex(Unreachable, "there is no USB serial port, and this user serves no hub"):
                connect()

    def test_a_hub_on_a_usb_port_is_found_beside_a_port_without_hub(self) -> None:
        served = self.serve()
        with unittest.mock.patch.multiple(motor_hub, usb_ports=lambda: ["/dev/null", served.place], _served=lambda: []):
            self.assertEqual(connect().address, 2)


class WhatStopsMotors(WithHub):
    async def test_an_exception_disables_the_motors(self) -> None:
        with self.assertRaises(ZeroDivisionError):
            with self.hub.enabled(0):
                await self.hub[0].velocity(800)
                1 / 0
        await self.still()

    async def test_a_cancelled_task_disables_the_motors(self) -> None:
        async def work() -> None:
            with self.hub.enabled(0):
                await self.hub[0].velocity(800)
                await asyncio.sleep(60)

        task = asyncio.create_task(work())
        await asyncio.sleep(0.5)
        task.cancel()
        with self.assertRaises(asyncio.CancelledError):
            await task
        await self.still()

    async def test_the_event_loop_keeps_motors_running_and_a_blocked_one_does_not(self) -> None:
        with self.assertRaisesRegex(HubError, "motor 0 is off: the hub has disabled it"):
            with self.hub.enabled(0):
                await self.hub[0].velocity(800)
                await asyncio.sleep(3.5)
                self.assertTrue((await self.hub[0].read()).enabled)
                time.sleep(3.2)
                self.assertFalse((await self.hub[0].read()).enabled)
                with self.assertRaisesRegex(HubError, "motor 0 is off: the hub has disabled it"):
                    await self.hub[0].velocity(800)

    async def test_work_in_all_threads_of_the_event_loop_does_not_stop_motors(self) -> None:
        pool = ThreadPoolExecutor(1)
        asyncio.get_running_loop().set_default_executor(pool)
        with self.hub.enabled(0):
            await self.hub[0].velocity(800)
            await asyncio.to_thread(time.sleep, 3.5)
            self.assertAlmostEqual((await self.hub[0].read()).velocity, 800, delta=16)

    async def test_motors_run_on_after_a_hub_did_not_answer_in_time(self) -> None:
        with self.hub.enabled(0):
            await self.hub[0].velocity(800)
            # Two pauses, each longer than the time-out of a request of 1 s.
            for _ in range(2):
                self.served.process.send_signal(signal.SIGSTOP)
                await asyncio.sleep(1.6)
                self.served.process.send_signal(signal.SIGCONT)
                await asyncio.sleep(0.2)
            await asyncio.sleep(3.5)
            self.assertAlmostEqual((await self.hub[0].read()).velocity, 800, delta=16)

    async def test_a_hub_that_disappears_is_unreachable(self) -> None:
        with self.assertRaises(Unreachable):
            with self.hub.enabled(0):
                self.served.process.kill()
                await asyncio.sleep(0.2)
                await self.hub[0].velocity(800)


class Processes(unittest.TestCase):
    """What happens to motors when the program that drives them ends."""

    def run_and_signal(self, number: int) -> tuple[str, int]:
        served = Served()
        self.addCleanup(served.close)
        program = textwrap.dedent(f"""
            import asyncio, motor_hub
            async def main():
                hub = motor_hub.connect({served.place!r})
                with hub.enabled(0):
                    await hub[0].velocity(800)
                    print("turning", flush=True)
                    await asyncio.sleep(60)
            asyncio.run(main())
        """)
        def listen() -> None:
            # A shell's background job ignores Ctrl-C, and its children inherit this.
            signal.signal(signal.SIGINT, signal.SIG_DFL)

        command = [sys.executable, "-c", program]
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, preexec_fn=listen)
        self.assertEqual(child.stdout.readline(), "turning\n")
        child.send_signal(number)
        child.wait(10)
        child.stdout.close()
        return served.place, child.returncode

    def test_ctrl_c_disables_the_motors(self) -> None:
        place, code = self.run_and_signal(signal.SIGINT)
        self.assertNotEqual(code, 0)
        self.assertEqual(connect(place).left_running, ())

    def test_after_a_kill_the_hub_disables_the_motors_by_itself(self) -> None:
        place, code = self.run_and_signal(signal.SIGKILL)
        self.assertEqual(code, -signal.SIGKILL)
        time.sleep(3)
        self.assertEqual(connect(place).left_running, ())


class Documents(unittest.TestCase):
    def test_the_notebook_runs(self) -> None:
        try:
            import matplotlib
            import pandas  # noqa: F401
        except ImportError as missing:
            self.skipTest(f"SKIPPED: {missing.name} is not installed")
        matplotlib.use("Agg")
        make_own_notes(self)
        served = Served()
        self.addCleanup(served.close)
        path = Path(__file__).parent.parent / "examples" / "first-motion.ipynb"
        cells = [cell["source"] for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]
        source = "\n".join("".join(cell) + "\n" for cell in cells)
        code = compile(source, str(path), "exec", flags=ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)
        names: dict[str, object] = {}
        asyncio.run(eval(code, names))
        self.assertGreater(len(names["table"]), 20)

    def test_the_notebook_has_its_outputs(self) -> None:
        path = Path(__file__).parent.parent / "examples" / "first-motion.ipynb"
        cells = [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]
        self.assertTrue(all(cell["outputs"] for cell in cells))
        self.assertTrue(any("image/png" in output.get("data", {}) for output in cells[-1]["outputs"]))


if __name__ == "__main__":
    unittest.main()
