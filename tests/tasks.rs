//! The real tasks under virtual time.

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, Instant, MockDriver, Timer};
use motor_hub::board::{Bridges, Encoders, SupplyAdc};
use motor_hub::braking::Winding;
use motor_hub::bridge::{BridgeFeedback, Drive, Mode};
use motor_hub::hub::{Command, Hub, Snapshot};
use motor_hub::motor::{Setpoint, Settings};
use motor_hub::supply::{Limits, Supply};
use motor_hub::tasks::{self, Health, Task, Wires};
use motor_hub::units::{Control, CountsPerSecond, Micros, Milliamperes, Millivolts, Period};
use std::cell::{Cell, RefCell};
use std::future::Future;
use std::ops::RangeInclusive;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Wake, Waker};

const N: usize = 4;
const GOOD: Millivolts = Millivolts::new(12_000);

/// All tests of the process share the clock of the mock driver, so they run one after another.
static CLOCK: Mutex<()> = Mutex::new(());

#[derive(Default)]
struct World {
    counts: [Cell<u16>; N],
    /// Encoder counters that do not answer.
    dead: [Cell<bool>; N],
    sample: Cell<Option<Millivolts>>,
    /// Time of a conversion, in ms.
    conversion_ms: Cell<u64>,
    applied: RefCell<Vec<(u64, [Drive; N])>>,
    fed: RefCell<Vec<u64>>,
}

fn now_ms() -> u64 {
    Instant::now().as_millis()
}

impl Encoders<N> for &World {
    fn counts(&mut self) -> [Option<u16>; N] {
        std::array::from_fn(|motor| (!self.dead[motor].get()).then(|| self.counts[motor].get()))
    }
}

impl SupplyAdc for &World {
    async fn sample(&mut self) -> Option<Millivolts> {
        Timer::after(Duration::from_millis(self.conversion_ms.get())).await;
        self.sample.get()
    }

    async fn wait_until_outside(&mut self, quiet: RangeInclusive<Millivolts>) {
        while self.sample.get().is_none_or(|voltage| quiet.contains(&voltage)) {
            Timer::after(Duration::from_millis(1)).await;
        }
    }
}

impl Bridges<N> for &World {
    fn apply(&mut self, drives: &[Drive; N]) {
        self.applied.borrow_mut().push((now_ms(), *drives));
    }
}

impl World {
    fn last_drives(&self) -> [Drive; N] {
        self.applied.borrow().last().expect("at least the first coast").1
    }
}

#[derive(Default)]
struct Woken(AtomicBool);

impl Wake for Woken {
    fn wake(self: Arc<Self>) {
        self.0.store(true, Ordering::Relaxed);
    }
}

type TaskFuture<'a> = Pin<Box<dyn Future<Output = ()> + 'a>>;

/// The tasks of a board. Each can be stopped.
struct Board<'a> {
    tasks: Vec<(Task, TaskFuture<'a>)>,
    health: TaskFuture<'a>,
    woken: Arc<Woken>,
}

fn never<'a>(future: impl Future<Output = impl Sized> + 'a) -> TaskFuture<'a> {
    Box::pin(async move {
        future.await;
    })
}

struct Parts {
    world: World,
    wires: Wires<NoopRawMutex, N>,
    health: Health,
    period: Period,
    _clock: MutexGuard<'static, ()>,
}

impl Parts {
    fn new(period_ms: u32) -> Self {
        let clock = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
        MockDriver::get().reset();
        let world = World::default();
        world.sample.set(Some(GOOD));
        let period = Period::from_millis(period_ms).expect("period");
        Self { world, wires: Wires::new(), health: Health::new(), period, _clock: clock }
    }

    fn board(&self) -> Board<'_> {
        let Self { world, wires, health, period, .. } = self;
        let supply = Supply::new(Limits::default());
        let settings = Settings::new(Winding::NEVEREST_60);
        let mut hub = Hub::new([settings; N], *period);
        let tasks = vec![
            (Task::Capture, never(tasks::capture::run(world, wires, health))),
            (Task::Supply, never(tasks::supply::run(world, supply, wires, health))),
            (Task::Control, never(async move { tasks::control::run(&mut hub, wires, health).await })),
            (Task::Output, never(tasks::output::run(world, *period, wires, health))),
        ];
        Board {
            tasks,
            health: never(tasks::health::run(|| world.fed.borrow_mut().push(now_ms()), health)),
            woken: Arc::default(),
        }
    }

    fn send(&self, motor: usize, setpoint: Setpoint) {
        self.wires.try_send(Command::Set { motor, setpoint }).expect("room");
    }

    fn snapshot(&self) -> Snapshot<N> {
        self.wires.snapshot.try_get().expect("a tick has been")
    }
}

impl Board<'_> {
    /// Lets everything happen that is due now.
    fn poll(&mut self) {
        let waker = Waker::from(Arc::clone(&self.woken));
        let mut context = Context::from_waker(&waker);
        loop {
            self.woken.0.store(false, Ordering::Relaxed);
            for task in self.tasks.iter_mut().map(|(_, task)| task).chain([&mut self.health]) {
                assert!(task.as_mut().poll(&mut context).is_pending(), "tasks run for ever");
            }
            if !self.woken.0.load(Ordering::Relaxed) {
                return;
            }
        }
    }

    fn stop(&mut self, stopped: Task) {
        self.tasks.retain(|(task, _)| *task != stopped);
    }

    fn run_ms(&mut self, ms: u64) {
        self.poll();
        for _ in 0..ms {
            MockDriver::get().advance(Duration::from_millis(1));
            self.poll();
        }
    }
}

const HALF: Setpoint = Setpoint::ConstantPower(Control::new(16_384));

#[test]
fn ticks_come_exactly_one_period_apart() {
    for period_ms in [1, 7, 50, 100] {
        let parts = Parts::new(period_ms);
        let mut board = parts.board();
        board.poll();
        for tick in 1..=40u64 {
            board.run_ms(u64::from(period_ms));
            let snapshot = parts.snapshot();
            assert_eq!(u64::from(snapshot.tick), tick);
            assert_eq!(snapshot.at, Micros::new(tick * u64::from(period_ms) * 1000));
            assert_eq!(snapshot.missed_ticks, 0);
        }
    }
}

#[test]
fn a_tick_that_came_too_late_is_left_out_and_counted_not_caught_up() {
    let parts = Parts::new(50);
    let mut board = parts.board();
    board.run_ms(100);
    // Nothing runs for 270 ms: the ticks at 150, 200, 250, 300 and 350 ms are due.
    MockDriver::get().advance(Duration::from_millis(270));
    board.poll();
    let late = parts.snapshot();
    assert_eq!((late.tick, late.at), (3, Micros::new(370_000)));
    board.run_ms(30);
    let next = parts.snapshot();
    assert_eq!((next.tick, next.at, next.missed_ticks), (4, Micros::new(400_000), 4), "back on the grid");
}

#[test]
fn constant_power_and_coasting_wait_for_no_tick_and_regulation_does() {
    let parts = Parts::new(50);
    let mut board = parts.board();
    board.run_ms(210);
    let modes = || parts.world.last_drives().map(|drive| (drive != Drive::COAST).then_some(drive.mode));
    for motor in [0, 1] {
        parts.send(motor, HALF);
    }
    parts.send(2, Setpoint::Velocity(CountsPerSecond::new(1_000)));
    board.run_ms(1);
    // Commands before a direct command are applied with it. Regulated motors wait for a tick.
    assert_eq!(modes(), [Some(Mode::Cw98), Some(Mode::Cw98), None, None]);
    board.run_ms(38);
    assert_eq!(modes(), [Some(Mode::Cw98), Some(Mode::Cw98), None, None]);
    board.run_ms(1);
    assert_eq!(modes(), [Some(Mode::Cw98), Some(Mode::Cw98), Some(Mode::Cw98), None]);
    board.run_ms(10);
    parts.send(0, Setpoint::Disabled);
    parts.send(1, Setpoint::ConstantPower(Control::ZERO));
    parts.send(2, Setpoint::FailSafe);
    board.run_ms(1);
    assert_eq!(modes(), [None, Some(Mode::Brake50), None, None]);
    // No further command is applied.
    let applied = parts.world.applied.borrow().len();
    board.run_ms(200);
    let last = parts.world.last_drives();
    assert!(parts.world.applied.borrow()[applied..].iter().all(|(_, drives)| *drives == last));
}

#[test]
fn where_motors_are_and_how_fast_is_as_new_as_the_last_sample() {
    let parts = Parts::new(50);
    let mut board = parts.board();
    // Returns position and velocity as a host reads them.
    let look = || {
        let snapshot = parts.wires.snapshot.try_get()?;
        let report = snapshot.motors[0];
        let newer = parts.wires.newest.lock(|newest| newest.borrow().newer_than(0, snapshot.at));
        let (position, velocity) = newer.unwrap_or((report.position, None));
        Some((position, velocity.unwrap_or(report.velocity)))
    };
    let (mut counts, mut turned) = (0, 0);
    for ms in 0..800 {
        // 2000 counts/s from the start, which the observer follows with a delay, and 1000 counts/s from the middle on.
        turned += if ms < 400 { 2 } else { 1 };
        counts += 1;
        parts.world.counts[0].set(1_000_u16.wrapping_add(turned));
        board.run_ms(1);
        let Some((position, velocity)) = look() else { continue };
        let behind = i32::from(turned) - position;
        // The first sample is position 0.
        assert!(counts < 3 || (0..=4).contains(&(behind - 2)), "{ms} ms: {position}, {behind}");
        let cps = velocity.round();
        match ms {
            300..400 => assert!((1_960..=2_040).contains(&cps), "{ms} ms: {cps} counts/s"),
            700.. => assert!((980..=1_020).contains(&cps), "{ms} ms: {cps} counts/s"),
            _ => (),
        }
    }
    // The snapshot of the last tick has an older position.
    assert!(parts.snapshot().motors[0].position <= look().expect("sampled").0);
}

#[test]
fn commands_queue_in_order_and_a_command_without_room_is_refused() {
    let parts = Parts::new(50);
    let mut board = parts.board();
    board.run_ms(200);
    // A command for no motor disturbs nothing.
    parts.send(N, HALF);
    for n in 1..tasks::COMMANDS {
        parts.send(n % N, Setpoint::ConstantPower(Control::new(n as i16)));
    }
    let extra = Command::Set { motor: 0, setpoint: HALF };
    assert!(parts.wires.try_send(extra).is_err());
    board.run_ms(50);
    let powers = parts.snapshot().motors.map(|m| m.requested.expect("constant power").get());
    assert_eq!(powers, [12, 13, 14, 15], "the last of each, none lost");
    let number = parts.wires.try_send(extra).expect("room");
    assert_eq!(number as usize, tasks::COMMANDS + 1, "a refused command has no number");
    assert!(!parts.snapshot().includes(number));
    board.run_ms(50);
    assert!(parts.snapshot().includes(number));
}

#[test]
fn when_control_stops_the_bridges_coast_after_three_periods() {
    for period_ms in [1, 50] {
        let parts = Parts::new(period_ms);
        let mut board = parts.board();
        parts.send(0, HALF);
        board.run_ms(200);
        assert_ne!(parts.world.last_drives(), [Drive::COAST; N]);
        board.stop(Task::Control);
        board.run_ms(u64::from(period_ms) * 3 - 1);
        assert_ne!(parts.world.last_drives(), [Drive::COAST; N], "the output task waits three periods");
        board.run_ms(1);
        assert_eq!(parts.world.last_drives(), [Drive::COAST; N]);
    }
}

#[test]
fn the_watchdog_starves_when_any_task_stops() {
    for task in [Task::Capture, Task::Supply, Task::Control, Task::Output] {
        let parts = Parts::new(50);
        let mut board = parts.board();
        board.run_ms(1000);
        assert!(parts.world.fed.borrow().len() >= 19, "fed once a tick while all are well");
        board.stop(task);
        board.run_ms(100);
        parts.world.fed.borrow_mut().clear();
        board.run_ms(2000);
        assert_eq!(parts.world.fed.borrow().len(), 0, "{task:?}");
    }
}

#[test]
fn the_watchdog_is_fed_at_the_longest_period_too() {
    let parts = Parts::new(100);
    let mut board = parts.board();
    board.run_ms(2000);
    let fed = parts.world.fed.borrow();
    assert!(fed.windows(2).all(|pair| pair[1] - pair[0] <= 120), "{fed:?}");
}

#[test]
fn a_dead_converter_makes_the_voltage_stale_and_all_motors_coast() {
    let parts = Parts::new(50);
    let mut board = parts.board();
    parts.send(0, HALF);
    board.run_ms(500);
    assert!(parts.snapshot().battery.is_some());
    parts.world.sample.set(None);
    board.run_ms(100);
    assert_ne!(parts.world.last_drives(), [Drive::COAST; N], "the last voltage still holds");
    board.run_ms(100);
    assert_eq!(parts.world.last_drives(), [Drive::COAST; N]);
    assert!(parts.snapshot().motors[0].faults.battery_unknown);
    parts.world.sample.set(Some(GOOD));
    board.run_ms(100);
    assert_ne!(parts.world.last_drives(), [Drive::COAST; N], "and it recovers by itself");
}

#[test]
fn the_battery_is_unknown_until_the_first_good_reading() {
    let parts = Parts::new(50);
    parts.world.sample.set(Some(Millivolts::new(0)));
    let mut board = parts.board();
    parts.send(0, HALF);
    board.run_ms(300);
    assert_eq!(parts.snapshot().battery, None);
    assert_eq!(parts.world.last_drives(), [Drive::COAST; N]);
    parts.world.sample.set(Some(GOOD));
    board.run_ms(70);
    let battery = parts.snapshot().battery.expect("measured").get();
    assert!((11_950..12_050).contains(&battery), "{battery}");
}

#[test]
fn a_slow_converter_delays_no_tick() {
    let parts = Parts::new(50);
    parts.world.conversion_ms.set(40);
    let mut board = parts.board();
    board.run_ms(1000);
    let snapshot = parts.snapshot();
    assert_eq!((snapshot.tick, snapshot.missed_ticks), (20, 0));
    assert!(snapshot.battery.is_some());
}

#[test]
fn when_capture_stops_regulated_motors_coast_and_constant_power_goes_on() {
    let parts = Parts::new(50);
    let mut board = parts.board();
    parts.send(0, HALF);
    parts.send(1, Setpoint::Velocity(CountsPerSecond::new(1000)));
    board.run_ms(200);
    assert!(parts.snapshot().motors[..2].iter().all(|m| m.regime.is_some()));
    board.stop(Task::Capture);
    board.run_ms(100);
    let motors = parts.snapshot().motors;
    assert!(motors[0].regime.is_some() && motors[0].faults.encoder_stale);
    assert_eq!(motors[1].drive, Drive::COAST);
}

#[test]
fn a_counter_that_does_not_answer_stops_its_own_motor_and_counts_meanwhile() {
    let parts = Parts::new(50);
    let mut board = parts.board();
    for motor in 0..N {
        parts.send(motor, Setpoint::Velocity(CountsPerSecond::new(1000)));
    }
    board.run_ms(110);
    let stale = || parts.snapshot().motors.map(|m| m.faults.encoder_stale);
    parts.world.dead[2].set(true);
    parts.world.counts[2].set(30);
    board.run_ms(90);
    assert_eq!(stale(), [false, false, true, false]);
    assert_eq!(parts.snapshot().motors.map(|m| m.drive == Drive::COAST), [false, false, true, false]);
    parts.world.dead[2].set(false);
    board.run_ms(50);
    assert_eq!(stale(), [false; N]);
    assert_eq!(parts.snapshot().motors.map(|m| m.position), [0, 0, 30, 0]);
}

#[test]
fn capture_counts_every_edge_of_a_fast_encoder() {
    let parts = Parts::new(50);
    let mut board = parts.board();
    board.poll();
    for _ in 0..1000 {
        // 800 000 counts/s: the 16-bit counter wraps every 82 ms.
        let count = &parts.world.counts[3];
        count.set(count.get().wrapping_add(800));
        board.run_ms(1);
    }
    let report = parts.snapshot().motors[3];
    assert_eq!(report.position, 800_000);
    assert!((report.velocity.round() - 800_000).abs() < 800, "{}", report.velocity.round());
}

#[test]
fn the_bridges_coast_before_the_first_drive() {
    let parts = Parts::new(50);
    parts.send(0, Setpoint::Velocity(CountsPerSecond::new(1_000)));
    let mut board = parts.board();
    board.run_ms(49);
    assert_eq!(*parts.world.applied.borrow(), [(0, [Drive::COAST; N])]);
}

#[test]
fn a_board_with_a_link_expects_it_to_check_in_too() {
    let fed = |expecting: bool, link: bool| {
        let mut parts = Parts::new(50);
        if expecting {
            parts.health = Health::new().expecting(Task::Responder);
        }
        let mut board = parts.board();
        for _ in 0..10 {
            if link {
                parts.health.check_in(Task::Responder);
            }
            board.run_ms(100);
        }
        drop(board);
        parts.world.fed.into_inner().len()
    };
    assert_eq!(fed(true, false), 0);
    assert!(fed(true, true) >= 9);
    assert!(fed(false, true) >= 9, "a task that is not expected need not check in");
}

/// Bridges with faults, and a current on the first bridge.
struct BridgeLines<'a>(&'a Cell<[bool; N]>);

impl motor_hub::board::BridgeSensors<N> for BridgeLines<'_> {
    async fn sample(&mut self) -> [BridgeFeedback; N] {
        let mut feedback = self.0.get().map(|fault| BridgeFeedback { current: None, fault });
        feedback[0].current = Some(Milliamperes::new(700));
        feedback
    }
}

#[test]
fn faults_and_currents_of_bridges_reach_the_motors_and_a_task_that_reads_them_must_check_in() {
    let parts = Parts { health: Health::new().expecting(Task::Bridges), ..Parts::new(50) };
    let mut board = parts.board();
    parts.world.sample.set(Some(GOOD));
    board.run_ms(100);
    assert!(parts.world.fed.borrow().is_empty());

    let faults = Cell::new([false; N]);
    let mut bridges: TaskFuture<'_> = Box::pin(async {
        tasks::bridges::run(BridgeLines(&faults), &parts.wires, &parts.health).await;
    });
    parts.send(0, HALF);
    let mut run = |board: &mut Board<'_>, ms| {
        for _ in 0..ms {
            let _ = bridges.as_mut().poll(&mut Context::from_waker(Waker::noop()));
            board.run_ms(1);
        }
        parts.wires.snapshot.try_get().expect("ticks").motors
    };
    let motors = run(&mut board, 250);
    assert!(!parts.world.fed.borrow().is_empty());
    assert_eq!(motors.map(|motor| motor.measured), [Some(Milliamperes::new(700)), None, None, None]);
    assert!(motors.iter().all(|motor| !motor.faults.bridge));
    faults.set([false, false, true, false]);
    let motors = run(&mut board, 100);
    assert_eq!(motors.map(|motor| motor.faults.bridge), [false, false, true, false]);
}

#[test]
fn a_bus_that_rises_between_two_ticks_reaches_the_bridges_at_once() {
    let parts = Parts::new(50);
    let mut board = parts.board();
    let turn = |board: &mut Board<'_>, ms| {
        for _ in 0..ms {
            let count = &parts.world.counts[0];
            count.set(count.get().wrapping_add(2));
            board.run_ms(1);
        }
    };
    board.poll();
    // The motor turns at 2000 counts/s independent of its command, so it is braked.
    turn(&mut board, 500);
    parts.send(0, Setpoint::Velocity(CountsPerSecond::new(1_950)));
    turn(&mut board, 110);
    let braking = parts.world.last_drives();
    assert_eq!(braking[0].mode, Mode::Brake50);
    assert!(braking[0] != Drive::COAST && braking[0] != Drive::BRAKE, "{braking:?}");
    parts.world.sample.set(Some(Millivolts::new(15_500)));
    turn(&mut board, 2);
    assert_eq!(parts.world.last_drives(), [Drive::BRAKE, Drive::COAST, Drive::COAST, Drive::COAST]);
    // The bridges return energy again after the bus has been low for the time of dissipation.
    parts.world.sample.set(Some(GOOD));
    turn(&mut board, 110);
    let drives = parts.world.last_drives();
    assert_eq!(drives[0].mode, Mode::Brake50);
    assert!(drives[0] != Drive::COAST && drives[0] != Drive::BRAKE, "{drives:?}");
}
