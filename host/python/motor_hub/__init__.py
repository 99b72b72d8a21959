"""Drives the DC motors of a motor hub from Python's asyncio.

>>> import asyncio, motor_hub
>>> async def main():
...     hub = motor_hub.connect()
...     with hub.enabled(0):
...         await hub[0].velocity(800)
...         await asyncio.sleep(2)
...         print(await hub[0].read())
>>> asyncio.run(main())  # doctest: +SKIP

What stops motors
-----------------
Motors turn only inside of a ``with hub.enabled(...)`` block. They are disabled however the block ends: at its end, by an
exception, by Ctrl-C, by cancellation of the task. While the block runs, the event loop sends the hub's keep-alive. If the
process is killed, or the event loop is blocked for longer than 2.5 s (by ``time.sleep``, for example), the hub disables all
motors by itself. The next command and the block's end then raise ``HubError``. ``Hub.close``, or a ``with`` block of the
hub, disables the motors and closes the line.

Units are encoder counts, counts/s, amperes, volts and seconds. Positive values turn a motor clockwise (CW).
Counts and counts/s are rounded to whole numbers.
"""

from __future__ import annotations

import asyncio
import dataclasses
import os
import operator
import tempfile
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from .native import CHANNELS, HubError, Link, Refused, Unreachable, usb_ports

__all__ = [
    "CHANNELS",
    "Base",
    "Hub",
    "HubError",
    "Identified",
    "Motor",
    "Odometry",
    "Reading",
    "Recording",
    "Refused",
    "Unreachable",
    "connect",
]

_T = TypeVar("_T")

# The hub disables all motors 2.5 s after the last packet.
_KEEP_ALIVE_S = 0.5
_POLL_S = 0.05
# Time for which a velocity must be kept to count as settled.
_KEPT_S = 0.2
# Longest time in seconds for a braked motor to stand before an identification.
_REST_S = 5.0
# Longest time-out, and longest interval of a recording, in seconds: some 11 days.
_LONGEST_S = 1_000_000
# Longest time in seconds to the first reading of a gyro: a BNO055 answers 0.65 s after its supply is on.
_GYRO_S = 3.0


@dataclass(frozen=True)
class Reading:
    """State of one motor at a control tick.

    A hub of another maker reports motor, position and velocity only; the other fields are then ``None``.
    """

    motor: int
    """Number of the motor, 0 to 3."""
    position: int
    """Position in counts."""
    velocity: int
    """Velocity in counts/s."""
    time_s: float | None = None
    """Time of the control tick since the hub's start, in s."""
    setpoint: str | None = None
    """Kind of the set-point: off, fail-safe, power, velocity, position, together, current or identify."""
    setpoint_value: float | None = None
    """Value of the set-point: share of full power, counts/s, counts or A; ``None`` for off and fail-safe."""
    enabled: bool | None = None
    """True if the motor is enabled."""
    settled: bool | None = None
    """True if the motor has settled at its target position, or its group at its end; always false at a velocity."""
    stalled: bool | None = None
    """True if the motor is driven and does not turn."""
    fault: bool | None = None
    """True if a fault keeps the motor from running."""
    why_still: str | None = None
    """Why the motor does not turn; ``None`` if it turns, or if no reason is known."""
    regime: str | None = None
    """Regime of the bridge: forward, braking or reverse; ``None`` while the bridge is open."""
    mode: str | None = None
    """Switching mode of the bridge: 9/8, 6/2 or 5/0; ``None`` while the bridge is open."""
    duty: float | None = None
    """Duty of the bridge, 0 to 1."""
    control: float | None = None
    """Control value as a share of its range, -1 to 1."""
    current_a: float | None = None
    """Mean current in A: measured where the hub measures it, else modelled."""
    load_a: float | None = None
    """Current in A that balances load, friction and drag; ``None`` for a motor whose dynamics are not configured."""
    heat: float | None = None
    """Heat of the winding as a share of its limit; 0 without a limit."""
    battery_v: float | None = None
    """Battery voltage in V; ``None`` if the hub does not know it."""


@dataclass(frozen=True)
class Identified:
    """Constants of a motor with its load, as the hub has found them. Errors are standard errors."""

    acceleration_per_volt: float
    """Acceleration per volt, in counts/s² per V."""
    decay_per_s: float
    """Rate at which the motor approaches its steady speed, per s."""
    friction_v: float
    """Voltage that balances the friction, in V."""
    acceleration_error: float
    """Error of the acceleration per volt, as a share of it."""
    decay_error: float
    """Error of the decay, as a share of it."""
    residual: float
    """Changes of speed that the constants do not explain, as a share of all changes (root mean square)."""


@dataclass(frozen=True)
class Odometry:
    """Where a drive base is, by the hub's own count, since the base was configured."""

    x_mm: float
    """Distance forward from the start, in mm."""
    y_mm: float
    """Distance to the left of the start, in mm."""
    heading_degrees: float
    """Angle by which the base has turned left, in degrees, with whole turns."""
    gyro: str
    """State of the gyro: unused, waiting, good, lost or implausible. The heading is by the encoders unless it is good."""
    gyro_losses: int
    """Number of times that the gyro was lost."""


def connect(place: str | None = None) -> Hub:
    """Opens a hub at a serial port, or at ``HOST:PORT``; without a place, the only hub that is found.

    Hubs are looked for on all USB serial ports, which each get a discovery of 11 bytes, and among the simulated hubs that this
    user serves by ``motor-hub serve``. Motors that a former host has left running are disabled; ``Hub.left_running`` names them.

    Raises ``Unreachable`` if the port cannot be opened, if no hub answers, or if several hubs are found.
    """
    if place is not None:
        return Hub(Link(place))
    links, failures = {}, []
    for candidate in [*usb_ports(), *_served()]:
        try:
            links[candidate] = Link(candidate)
        except Unreachable as failure:
            failures.append(str(failure))
    if len(links) > 1:
        raise Unreachable(f"{len(links)} hubs are found, at {', '.join(links)}; give connect one of these places")
    if not links:
        why = "; ".join(failures) or "there is no USB serial port, and this user serves no hub; give connect a place"
        raise Unreachable(f"no hub is found: {why}")
    return Hub(links.popitem()[1])


def _served() -> list[str]:
    """Returns the places of the hubs that this user serves.

    Each hub has a note: a file that the serving program keeps locked.
    """
    try:
        import fcntl
    except ImportError:
        return []  # Only Unix has notes.
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    own = os.path.isabs(runtime) and os.path.isdir(runtime)
    folder = Path(runtime, "motor-hub") if own else Path(tempfile.gettempdir(), f"motor-hub-{os.getuid()}")
    try:
        # Another user's note could lead to any address.
        state = folder.lstat()
        notes = sorted(folder.iterdir()) if state.st_uid == os.getuid() and not state.st_mode & 0o077 else []
    except FileNotFoundError:
        return []
    places = []
    for path in notes:
        with suppress(FileNotFoundError), path.open() as note:
            try:
                fcntl.flock(note, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                # A note that was just made is locked, and still empty.
                if place := note.read().partition(" ")[2].strip():
                    places.append(place)
    return places


class Hub:
    """A hub with its motors: ``hub[0]`` to ``hub[3]``. Open it by ``connect``.

    A ``with`` block of the hub closes it, as ``close`` does. A hub is also closed when Python deletes it.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        # Requests that are awaited run in this one thread, in the order of the calls. The event loop's own threads can be
        # busy with other work for so long that the hub would get no keep-alive. Enabling, disabling, stopping and closing
        # block the caller instead.
        self._thread = ThreadPoolExecutor(1)
        self._enabled: set[int] = set()
        # Motors whose blocks have not ended yet since ``stop`` was called.
        self._stopped: set[int] = set()
        # A token for each motor's newest command. It shows whether another command has replaced a motion. The token of
        # ``together_at`` has the speeds of the motors, in counts/s.
        self._motions: dict[int, object] = {}

    def __enter__(self) -> Hub:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Disables the motors whose blocks have not ended, and closes the line, so that another program can open the hub.

        Calls then raise ``HubError``, and so does the end of such a block. Closing a hub twice has no effect.
        """
        self._link.close(tuple(self._enabled))

    async def _call(self, call: Callable[..., _T], *arguments: Any) -> _T:
        """Makes a blocking call in the hub's thread."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, call, *arguments)

    def __getitem__(self, number: int) -> Motor:
        number = operator.index(number)
        if not 0 <= number < CHANNELS:
            raise IndexError(f"motor is {number}; allowed are 0 to {CHANNELS - 1}")
        return Motor(self, number)

    def __len__(self) -> int:
        return CHANNELS

    @property
    def address(self) -> int:
        """Address of the hub, 1 to 254."""
        return self._link.address

    @property
    def left_running(self) -> tuple[int, ...]:
        """Motors that a former host had left running, and that ``connect`` has disabled."""
        return tuple(self._link.left_running)

    @contextmanager
    def enabled(self, *motors: int) -> Iterator[None]:
        """Enables motors for the length of a ``with`` block, at a power of 0.

        The block must run in an event loop, which sends the hub's keep-alive. The motors are disabled however the block
        ends.

        Raises ``HubError`` at the end of the block if the hub has disabled a motor before, and ``stop`` was not called.
        """
        if not motors:
            raise ValueError("no motor is given; give each motor's number, as in hub.enabled(0, 1)")
        if twice := self._enabled.intersection(motors):
            raise ValueError(f"motor {min(twice)} is already enabled by another block")
        loop = asyncio.get_running_loop()
        self._enabled.update(motors)
        try:
            self._link.enable(motors)
            keeper = loop.create_task(self._keep_alive())
            try:
                yield
                for motor in self._link.disabled(tuple(set(motors).difference(self._stopped))):
                    raise _is_disabled(motor)
            finally:
                keeper.cancel()
                self._link.disable(motors)
        finally:
            self._enabled.difference_update(motors)
            self._stopped.difference_update(motors)

    async def _keep_alive(self) -> None:
        while True:
            # The hub can answer again before it disables the motors. Motors that it has disabled are an error of the next
            # command, and of the block's end.
            with suppress(HubError):
                await self._call(self._link.keep_alive)
            await asyncio.sleep(_KEEP_ALIVE_S)

    async def version(self) -> str:
        """Version text of the hub's hardware and firmware."""
        return await self._call(self._link.version)

    async def battery(self) -> float | None:
        """Battery voltage in V; ``None`` if the hub does not know it."""
        return await self._call(self._link.battery)

    async def read(self) -> tuple[Reading, ...]:
        """State of all motors at one control tick."""
        return tuple(Reading(**fields) for fields in await self._call(self._link.readings))

    async def stop(self) -> None:
        """Disables all motors of the hub until the end of their blocks: commands raise ``HubError``."""
        self._stopped |= self._enabled
        # Not in the hub's thread, where other requests may wait.
        self._link.fail_safe()

    async def save(self) -> None:
        """Stores the settings in force, so that they outlast a reset of the hub."""
        await self._call(self._link.save)

    async def together(
        self,
        targets: Mapping[int, float],
        *,
        speed: float = 1000,
        acceleration: float = 2000,
        tolerance: float | None = None,
        timeout: float | None = None,
    ) -> None:
        """Moves motors in step to positions in counts, and returns once all of them have settled.

        ``speed`` is that of the motor with the longest distance, in counts/s; ``acceleration`` limits each motor, in
        counts/s². ``tolerance`` is the largest distance in counts at which a motor can settle.

        The hub corrects the positions of exactly both wheels of a base with a gyro by the slip of the wheels. A position that
        ``read`` returns is then another place, so move such a base by ``Base.drive`` and ``Base.turn``.

        Raises ``HubError`` if a fault stops a motor, or if one of the motors gets another command. Raises ``TimeoutError``
        after ``timeout`` seconds; ``None`` is no limit. After a time-out, and after a cancellation, the motors stop.
        """
        arguments = (self._link.together, dict(targets), False, speed, acceleration, tolerance)
        await self._move(tuple(targets), acceleration, 1, timeout, f"motors {sorted(targets)} have not settled", *arguments)

    async def _move(
        self,
        members: tuple[int, ...],
        acceleration: float,
        counts: float,
        timeout: float | None,
        failure: str,
        call: Callable[..., _T],
        *arguments: Any,
    ) -> _T:
        """Starts a motion of a group by a call, and returns the result of the call once all members have settled.

        ``acceleration`` is that of the stop after a time-out, a cancellation or an answer that is missing. Its unit has
        ``counts`` counts/s².
        """
        _check_timeout(timeout)
        await self._check(*members)
        motion = object()

        async def settled() -> bool:
            readings = await self.read()
            # The first member is asked again, because the group may have started after the first answer.
            asked = (*members, members[0])
            states = [await self._call(self._link.group_state, motor) for motor in asked]
            if others := self._others(members, motion):
                raise HubError(f"the motion of {_named(members)} was ended by another command to {_named(others)}")
            self._raise_fault(readings, *members)
            lost = [motor for motor, before, state in zip(asked[1:], states, states[1:]) if before and not state]
            if not any(states):
                # A group starts at a control tick without a fault, such as that of the readings. So this group has ended.
                lost = sorted(members)
            if lost:
                has = "has" if len(lost) == 1 else "have"
                raise HubError(f"the motion of {_named(members)} has ended: {_named(lost)} {has} left the group by a fault")
            return states[0] == 2

        def stop() -> None:
            if not self._others(members, motion):
                self._link.together(dict.fromkeys(members, 0), True, 1, max(1, round(acceleration * counts)), None)

        try:
            result: _T = await self._call(self._start, members, motion, call, *arguments)
            await _until(settled, timeout, failure)
        except asyncio.CancelledError:
            # The thread may still be about to start the motion. The stop follows in the same thread.
            self._thread.submit(stop)
            raise
        except (TimeoutError, Unreachable):
            await self._call(stop)
            raise
        return result

    def _start(self, members: tuple[int, ...], motion: object, call: Callable[..., _T], *arguments: Any) -> _T:
        """Makes a call that starts a motion. Runs in the hub's thread."""
        try:
            result = call(*arguments)
        except Unreachable:
            # The hub may have received the command.
            self._motions.update(dict.fromkeys(members, motion))
            raise
        self._motions.update(dict.fromkeys(members, motion))
        return result

    def _others(self, members: tuple[int, ...], motion: object) -> list[int]:
        """Returns the members that have got another command since this motion."""
        return [member for member in members if self._motions.get(member) is not motion]

    async def together_at(self, speeds: Mapping[int, float], *, acceleration: float = 2000) -> None:
        """Turns motors in step at speeds in counts/s, until another command follows."""
        fastest = max((abs(speed) for speed in speeds.values()), default=0)
        arguments = (dict(speeds), True, max(1, fastest), acceleration, None)
        await self._command(tuple(speeds), dict(speeds), self._link.together, *arguments)

    async def _command(self, motors: tuple[int, ...], motion: object, call: Callable[..., Any], *arguments: Any) -> None:
        await self._check(*motors)
        await self._call(self._start, motors, motion, call, *arguments)

    async def set_base(
        self,
        left: int,
        right: int,
        *,
        wheel_diameter_mm: float,
        track_mm: float,
        counts_per_turn: tuple[float, float],
        use_gyro: bool = False,
    ) -> Base:
        """Configures the drive base with the motors of its left and right wheel. The base then starts at the origin.

        ``counts_per_turn`` is for a turn of the left and the right wheel, negative for a motor that counts down while its wheel
        drives forward. With ``use_gyro`` the base holds the heading of a BNO055 on I2C bus 0. ``Hub.save`` stores the base.

        Raises ``Refused`` while one of the motors is enabled, and ``TimeoutError`` if the gyro gives no reading within 3 s.
        """
        dimensions = (wheel_diameter_mm, track_mm, counts_per_turn, use_gyro)
        await self._call(self._link.set_base, (left, right), *dimensions)
        base = await self.base()

        async def has_heading() -> bool:
            return (await base.odometry()).gyro != "waiting"

        await _until(has_heading, _GYRO_S, "no BNO055 at address 0x28 on I2C bus 0 gives a reading")
        return base

    async def base(self) -> Base:
        """The drive base in force, which a former program may have configured or stored.

        Raises ``HubError`` if the hub has no base.
        """
        fields = await self._call(self._link.base)
        if fields is None:
            raise HubError("the hub has no drive base; configure one by hub.set_base")
        return Base(self, **fields)

    @asynccontextmanager
    async def recording(self, *motors: int, every: float = _POLL_S) -> AsyncIterator[Recording]:
        """Records motors (all, if none is given) every so many seconds, for the length of an ``async with`` block.

        An error of the recording is raised at the end of the block.
        """
        if not 0 < every <= _LONGEST_S:
            raise ValueError(f"every is {every}; allowed is more than 0 s, up to {_LONGEST_S} s")
        recording = Recording()
        chosen = {self[motor].number for motor in motors or range(CHANNELS)}

        async def record() -> None:
            loop = asyncio.get_running_loop()
            due = loop.time()
            while True:
                recording.readings.extend(each for each in await self.read() if each.motor in chosen)
                due = max(due + every, loop.time())
                await asyncio.sleep(due - loop.time())

        recorder = asyncio.ensure_future(record())
        try:
            yield recording
        finally:
            recorder.cancel()
            (outcome,) = await asyncio.gather(recorder, return_exceptions=True)
        if isinstance(outcome, Exception):
            raise outcome

    async def _check(self, *motors: int) -> None:
        """Raises an error for a motor that is not enabled: the hub would accept its command, and nothing would turn."""
        disabled = await self._call(self._link.disabled, motors)
        for motor in motors:
            if motor not in self._enabled:
                raise HubError(f"motor {motor} is not enabled; enable it by: with hub.enabled({motor}):")
            if motor in self._stopped:
                raise HubError(f"motor {motor} is off: stop was called; leave the block, and enable the motor again")
            if motor in disabled:
                raise _is_disabled(motor)

    @staticmethod
    def _raise_fault(readings: tuple[Reading, ...], *motors: int) -> None:
        for reading in readings:
            if reading.motor in motors and (reading.fault or reading.enabled is False):
                raise HubError(f"motor {reading.motor} does not run: {reading.why_still or 'disabled'}")


@dataclass(eq=False, repr=False)
class Base:
    """A drive base with two wheels, from ``Hub.set_base`` or ``Hub.base``. Its motions need ``with hub.enabled(*base.wheels)``."""

    _hub: Hub
    wheels: tuple[int, int]
    wheel_diameter_mm: float
    track_mm: float
    counts_per_turn: tuple[float, float]
    use_gyro: bool
    # Counts per mm of the wheel with more counts.
    _counts_per_mm: float
    # Counts of the wheels at the end of the last part: the next part begins there, so errors of the parts do not add up.
    _end: tuple[float, float] | None = None

    def __repr__(self) -> str:
        return f"<drive base on motors {self.wheels[0]} and {self.wheels[1]} of hub {self._hub.address}>"

    async def drive(
        self,
        distance: float,
        *,
        speed: float = 200.0,
        acceleration: float = 400.0,
        timeout: float | None = None,
    ) -> None:
        """Drives straight over a distance in mm, backward if it is negative, and returns once both wheels have settled.

        ``speed`` and ``acceleration`` are those of the wheels, in mm/s and mm/s².

        Raises ``HubError`` if a fault stops a wheel, or if a wheel gets another command. Raises ``TimeoutError`` after
        ``timeout`` seconds; ``None`` is no limit. After a time-out, and after a cancellation, the base stops with its
        acceleration.
        """
        await self._move(False, distance, speed, acceleration, timeout)

    async def turn(
        self,
        angle: float,
        *,
        speed: float = 200.0,
        acceleration: float = 400.0,
        timeout: float | None = None,
    ) -> None:
        """Turns on the spot by an angle in degrees, positive to the left. Options and errors are those of ``drive``."""
        await self._move(True, angle, speed, acceleration, timeout)

    async def odometry(self) -> Odometry:
        """Where the base is, at the last control tick."""
        return Odometry(**await self._hub._call(self._hub._link.odometry))

    async def _move(self, turns: bool, by: float, speed: float, acceleration: float, timeout: float | None) -> None:
        hub = self._hub
        what = f"the base has not {'turned by' if turns else 'driven'} {by} {'degrees' if turns else 'mm'}"
        arguments = (hub._link.drive, self._end, turns, by, speed, acceleration)
        self._end = await hub._move(self.wheels, acceleration, self._counts_per_mm, timeout, what, *arguments)


@dataclass(frozen=True, repr=False)
class Motor:
    """One motor of a hub. Commands need an enclosing ``with hub.enabled(number)`` block."""

    _hub: Hub
    number: int

    def __repr__(self) -> str:
        return f"<motor {self.number} of hub {self._hub.address}>"

    async def _command(self, call: Callable[..., Any], *arguments: Any) -> None:
        await self._hub._command((self.number,), object(), call, self.number, *arguments)

    async def power(self, share: float) -> None:
        """Applies a constant share of full power, -1 to 1."""
        await self._command(self._hub._link.power, share)

    async def velocity(self, velocity: float) -> None:
        """Regulates the velocity, in counts/s, -32768 to 32767."""
        await self._command(self._hub._link.velocity, velocity)

    async def position(self, position: float, *, speed: float = 1000, tolerance: float = 10) -> None:
        """Regulates the position, in counts, at a speed of at most ``speed`` counts/s. Returns before the motor arrives."""
        await self._command(self._hub._link.position, position, speed, tolerance)

    async def current(self, current: float, *, speed: float) -> None:
        """Holds a constant current in A, -65.535 to 65.535, while the motor is slower than ``speed`` in counts/s."""
        await self._command(self._hub._link.current, current, speed)

    async def settled(self, timeout: float | None = None) -> None:
        """Waits until the motor has settled at its position, or has kept its velocity for 0.2 s, also in ``together_at``.

        A velocity is kept while its error is at most 2 % of the set-point or 5 counts/s, whichever is more.

        Raises ``HubError`` if a fault stops the motor, and at a constant power or current, which never settles. Raises
        ``TimeoutError`` after ``timeout`` seconds; ``None`` is no limit.
        """
        _check_timeout(timeout)
        kept = 0

        async def settled() -> bool:
            nonlocal kept
            reading = await self.read()
            if reading.settled is None:
                raise HubError("the hub does not report whether motors have settled: it is another maker's, or too old")
            self._hub._raise_fault((reading,), self.number)
            if reading.setpoint in ("power", "current", "identify"):
                raise HubError(
                    f"motor {self.number} never settles at its set-point, {reading.setpoint}; give it a velocity or a position"
                )
            velocity = reading.setpoint_value if reading.setpoint == "velocity" else None
            motion = self._hub._motions.get(self.number)
            if reading.setpoint == "together" and isinstance(motion, dict):
                velocity = motion[self.number]
            if velocity is None:
                return reading.settled
            error = abs(reading.velocity - velocity)
            kept = kept + 1 if error <= max(5, 0.02 * abs(velocity)) else 0
            return kept > _KEPT_S / _POLL_S

        await _until(settled, timeout, f"motor {self.number} has not settled")

    async def read(self) -> Reading:
        """State of the motor at one control tick."""
        for reading in await self._hub.read():
            if reading.motor == self.number:
                return reading
        raise HubError(f"the hub has no motor {self.number}")

    async def reset_encoder(self) -> None:
        """Makes the present position 0 counts.

        Raises ``HubError`` while the motor holds or goes to a position, or moves in step with others: the hub keeps the number
        of its target, so the motor would run to another place.
        """
        if not await self._hub._call(self._hub._link.reset_encoder, self.number):
            raise HubError(
                f"motor {self.number} has a target position, which would move with the zero of its encoder; end the motion "
                "first, by power(0) or velocity(0), or reset the encoder after the block"
            )

    async def identify(self, travel: float = 2**32 - 1, *, apply: bool = False) -> Identified:
        """Finds the constants of the motor with its load, in some 3 s. The motor turns both ways.

        ``travel`` limits the motion in counts either way. With ``apply`` the hub regulates the motor by the result until
        its reset; ``Hub.save`` keeps the result.

        Raises ``Refused`` with the hub's reason if the constants cannot be found. After a cancellation the motor stops.
        """
        link = self._hub._link
        identification = object()
        await self._hub._command((self.number,), identification, link.power, self.number, 0)

        async def stands() -> bool:
            before = await self.read()
            await asyncio.sleep(_POLL_S)
            return (await self.read()).position == before.position

        await _until(stands, _REST_S, f"motor {self.number} does not stand: its load turns it")

        def stop() -> None:
            if not self._hub._others((self.number,), identification):
                link.power(self.number, 0)

        try:
            await self._hub._call(link.identify, self.number, travel)
            while not isinstance(found := await self._hub._call(link.identification, self.number), dict):
                if found is None:
                    raise HubError(f"motor {self.number} was not identified: the hub was reset")
                await asyncio.sleep(_POLL_S)
        except asyncio.CancelledError:
            # The thread may still be about to start the identification. The stop follows in the same thread.
            self._hub._thread.submit(stop)
            raise
        if apply:
            await self._hub._call(link.apply_identification, self.number)
        return Identified(**found)


@dataclass
class Recording:
    """Readings in the order of time. ``pandas.DataFrame(recording.columns())`` makes a table of them."""

    readings: list[Reading] = dataclasses.field(default_factory=list)
    """All readings so far."""

    def columns(self) -> dict[str, list[Any]]:
        """The readings as columns: field name to list of values."""
        names = [field.name for field in dataclasses.fields(Reading)]
        return {name: [getattr(reading, name) for reading in self.readings] for name in names}


def _is_disabled(motor: int) -> HubError:
    return HubError(
        f"motor {motor} is off: the hub has disabled it, because it got no packet for 2.5 s, was reset, or was "
        "stopped by another program; leave the block, and enable the motor again"
    )


def _named(motors: Iterable[int]) -> str:
    numbers = [str(motor) for motor in sorted(motors)]
    return f"motor{'s' * (len(numbers) > 1)} {', '.join(numbers)}"


def _check_timeout(timeout: float | None) -> None:
    if timeout is not None and not 0 <= timeout <= _LONGEST_S:
        raise ValueError(f"timeout is {timeout}; allowed are 0 to {_LONGEST_S} s, or None for no limit")


async def _until(condition: Any, timeout: float | None, failure: str) -> None:
    """Polls an asynchronous condition. Raises ``TimeoutError`` with the failure's text after ``timeout`` seconds."""
    loop = asyncio.get_running_loop()
    end = None if timeout is None else loop.time() + timeout
    while not await condition():
        if end is not None and loop.time() > end:
            raise TimeoutError(f"{failure} within {timeout} s")
        await asyncio.sleep(_POLL_S)
