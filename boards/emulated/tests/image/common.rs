//! Motors for the bench, and functions that drive them and check their motion.

use std::cell::Cell;
use std::ops::Range;
use std::path::Path;
use std::time::Duration;

use emulated::host_link::HostLink;
use emulated::{Bench, Board, FlashFaults, Lines, Mounting, Setup, Transition};
use motor_hub::group::{BaseSettings, DriveBase};
use motor_hub::model::catalogue::characterised;
use motor_hub::model::load::Load;
use motor_hub::model::si::{KgM2, Kilograms, Metres, Ohms, Volts};
use motor_hub::model::switching::Bridge;

thread_local! {
    static BOARD: Cell<Option<Board>> = const { Cell::new(None) };
}

/// Returns the board of a test: the board that the environment names, unless the test is run [`on`] another board.
pub(crate) fn board() -> Board {
    let named = || Board::of_environment().unwrap_or_else(|error| panic!("MOTOR_HUB_BOARD: {error}"));
    BOARD.get().unwrap_or_else(named)
}

/// Runs a test, or a part of one, on this board.
pub(crate) fn on<T>(board: Board, test: impl FnOnce() -> T) -> T {
    let before = BOARD.replace(Some(board));
    let result = test();
    BOARD.set(before);
    result
}

/// Prints a table, and leaves it as a file for the page of `docs/results` that shows it.
pub(crate) fn publish(name: &str, table: &str) {
    print!("{table}");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/results").join(board().name());
    std::fs::create_dir_all(&folder).expect("a folder for tables");
    std::fs::write(folder.join(format!("{name}.md")), table).expect("a table as a file");
}

/// Returns a setup with these motors on the [`board`] of the test.
pub(crate) fn setup(motors: Vec<Mounting>) -> Setup {
    Setup { board: board(), ..Setup::new(motors) }
}

/// TIM2's counter, which is read every millisecond (RM0090 2.3 and 18.4.10, RM0433 2.3 and 39.4.10).
pub(crate) const COUNTER: Range<u64> = 0x4000_0024..0x4000_0028;

/// The drop of a diode and the resistance of a switch in a VNH5019A-E (data sheet, typical).
const BRIDGE: Bridge = Bridge::lossy(Volts(0.6), Ohms(0.009));

/// Returns the gear motor with this load. The default settings of the firmware are for this motor.
pub(crate) fn am60_with(load: Load) -> Mounting {
    let motor = characterised("AM 60 A").expect("in the catalogue");
    Mounting { motor: motor.with_measured_rotor_inertia(), load, bridge: BRIDGE, stops: None }
}

/// Returns the gear motor of [`am60_with`] without a load.
pub(crate) fn am60() -> Mounting {
    am60_with(Load::NONE)
}

/// Returns four gear motors: without a load, with a light and a heavy flywheel, and with a robot's wheel.
pub(crate) fn four_loads() -> Vec<Mounting> {
    let wheel = |mass, radius| am60_with(Load::flywheel(Kilograms(mass), Metres(radius)));
    vec![am60(), wheel(0.5, 0.06), wheel(2.0, 0.1), am60_with(Load::inertia(KgM2(0.004)))]
}

/// Faults of the flash whose error flags appear at all points of an operation, because 7 does not divide the number of accesses of
/// an operation.
pub(crate) const ERRORS: FlashFaults = FlashFaults { errors_every: 7, late_reads: 0 };
/// A flash whose words arrive late.
pub(crate) const LATE: FlashFaults = FlashFaults { errors_every: 0, late_reads: 5 };

pub(crate) const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Returns a hub that was powered on 300 ms ago, and has had its first control ticks.
pub(crate) fn booted(motors: Vec<Mounting>) -> Bench {
    booted_as(setup(motors))
}

/// Returns a hub like [`booted`], with another setup.
pub(crate) fn booted_as(setup: Setup) -> Bench {
    let mut bench = Bench::new(setup);
    bench.run(ms(300));
    bench
}

/// Returns a hub like [`booted`], and its host.
pub(crate) fn with_host(motors: Vec<Mounting>) -> (Bench, HostLink) {
    (booted(motors), HostLink::default())
}

/// Returns a hub whose motors all turn at 1000 counts/s. The button is still pressed.
pub(crate) fn turning(motors: Vec<Mounting>) -> Bench {
    turning_as(setup(motors))
}

/// Returns a hub like [`turning`], with another setup.
pub(crate) fn turning_as(setup: Setup) -> Bench {
    let mut bench = booted_as(setup);
    bench.press(true);
    bench.run(ms(1500));
    let motors = bench.motors();
    expect_speed(&mut bench, 0..motors, 100.0);
    bench
}

/// Makes the host command 1000 counts/s to all four motors.
pub(crate) fn set_speeds(bench: &mut Bench, host: &mut HostLink) {
    (0..4).for_each(|motor| host.velocity(bench, motor, 1000));
}

/// Lets time pass. Returns the counts by which each motor has turned in this time.
pub(crate) fn counts_in(bench: &mut Bench, time: Duration) -> [i64; 4] {
    let counts = |bench: &mut Bench| std::array::from_fn(|motor| bench.look(motor).counts);
    let before: [i64; 4] = counts(bench);
    bench.run(time);
    let after: [i64; 4] = counts(bench);
    std::array::from_fn(|motor| after[motor] - before[motor])
}

/// Expects motors to turn at 1000 counts/s, within a tolerance in counts/s.
#[track_caller]
pub(crate) fn expect_speed(bench: &mut Bench, motors: impl IntoIterator<Item = usize>, tolerance: f64) {
    for motor in motors {
        expect_motor(bench, motor, 1000.0, tolerance);
    }
}

/// Watches the task that samples the encoders every millisecond.
pub(crate) fn watch_samples(bench: &mut Bench) {
    bench.watch(vec![bench.address("TaskStorage..capture_task..::poll")]);
    bench.take_hits();
}

/// Returns the longest time between two samples since the last call of this function or of [`watch_samples`].
pub(crate) fn worst_sample(bench: &mut Bench) -> Duration {
    let samples = bench.take_hits();
    samples
        .windows(2)
        .map(|pair| pair[1].at.0 - pair[0].at.0)
        .max()
        .map(Duration::from_nanos)
        .expect("samples")
}

/// Returns the value for the board of the test.
pub(crate) fn by_board<T>(f429zi: T, h743zi2: T) -> T {
    match board() {
        Board::NucleoF429zi => f429zi,
        Board::NucleoH743zi2 => h743zi2,
    }
}

pub(crate) fn other_board() -> Board {
    by_board(Board::NucleoH743zi2, Board::NucleoF429zi)
}

/// Returns the bits `high..=low` of a word.
pub(crate) fn bits(word: u32, high: u32, low: u32) -> u32 {
    word >> low & ((1 << (high - low + 1)) - 1)
}

/// Returns the time from `from` until the lines of a bridge fulfilled the condition `such` without interruption. `None` if the lines
/// do not fulfil the condition now.
pub(crate) fn time_to(
    transitions: &[Transition],
    motor: usize,
    from: Duration,
    such: impl Fn(Lines) -> bool,
) -> Option<Duration> {
    let since = such(Lines::FLOATING).then_some(Duration::ZERO);
    let of_motor = transitions.iter().filter(|t| t.motor == motor);
    let since = of_motor.fold(since, |since, t| such(t.lines).then(|| since.unwrap_or(t.at)));
    since.map(|at| at.saturating_sub(from))
}

/// Expects that the bridge of each motor opened at most this time after `from`, and stayed open.
#[track_caller]
pub(crate) fn expect_open_within(bench: &mut Bench, from: Duration, limit: Duration) {
    for motor in 0..bench.motors() {
        let time = time_to(&bench.transitions(), motor, from, Lines::open);
        assert!(time.is_some_and(|time| time <= limit), "bridge {motor} is open {time:?} after {from:?}");
    }
}

/// Expects a motor to turn at this speed, within a tolerance, in counts/s.
#[track_caller]
pub(crate) fn expect_motor(bench: &mut Bench, motor: usize, speed: f64, tolerance: f64) {
    let found = bench.look(motor).counts_per_second;
    assert!((found - speed).abs() < tolerance, "motor {motor} turns at {found} instead of {speed} counts/s");
}

pub(crate) fn log(bench: &mut Bench) -> String {
    bench.log().iter().map(|line| format!("{} {line}\n", line.boot)).collect()
}

/// Returns a supply voltage in mV at which the voltage detector must report a falling supply. Both chips still run at
/// this voltage: the F429 needs 2.7 V at 168 MHz with 5 wait states, and the H743 runs down to 1.62 V.
pub(crate) fn too_low() -> u32 {
    by_board(2_800, 2_740)
}

/// Returns a base on the motors 0 and 1, with a gyro.
pub(crate) fn base() -> BaseSettings {
    let geometry = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0; 2] };
    BaseSettings::new([0, 1], &geometry, true).expect("in range")
}
