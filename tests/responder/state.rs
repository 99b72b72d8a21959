//! Motors, keep-alive timer, fail-safe, attention and LED, as a host observes them.

use crate::host::{Answer, HUB, N, TestHost, decode, frame_to, settings};
use motor_hub::extension::report::Commands;
use motor_hub::hub::{Command, Snapshot};
use motor_hub::motor::Setpoint;
use motor_hub::protocol::requests::FAIL_SAFE;
use motor_hub::protocol::{Address, BROADCAST, Colour, HOST, Packet};
use motor_hub::responder::keep_alive::TIMEOUT_MICROS;
use motor_hub::responder::{Line, Responder};
use motor_hub::supply::DrawStage;
use motor_hub::units::{Control, CountsPerSecond, Micros, Milliamperes, Millivolts};

const TIMEOUT_MS: u64 = TIMEOUT_MICROS / 1000;

fn set(motor: usize, setpoint: Setpoint) -> Command {
    Command::Set { motor, setpoint }
}

/// Creates a host at a hub whose motor 0 runs.
fn driving() -> TestHost {
    let mut host = TestHost::settled();
    host.do_all(&[(15, &[0, 0, 64]), (10, &[0, 1])]);
    assert_eq!(host.new_commands(), [set(0, Setpoint::ConstantPower(Control::new(16_384)))]);
    host
}

fn keep_alive(host: &mut TestHost) -> Answer {
    host.ask(0x7F04, &[])
}

fn no() -> Answer {
    Answer::Data(vec![0])
}

#[test]
fn a_motor_is_not_enabled_before_it_has_a_target_for_its_mode() {
    let mut host = TestHost::settled();
    let targets: [(u16, &[u8]); 3] = [(15, &[0, 1, 0]), (17, &[0, 1, 0]), (19, &[0, 1, 0, 0, 0, 0, 0])];
    for (mode, (function, payload)) in targets.into_iter().enumerate() {
        host.do_all(&[(8, &[0, mode as u8, 0])]);
        assert_eq!(host.call(10, &[0, 1]), Answer::Nack(50), "mode {mode}");
        assert_eq!(host.call(11, &[0]), no());
        host.do_all(&[(function, payload)]);
        assert!(host.new_commands().iter().all(|command| matches!(command, Command::Configure { .. })));
        host.do_all(&[(10, &[0, 1]), (10, &[0, 0])]);
        host.new_commands();
    }
}

#[test]
fn targets_may_be_set_in_any_mode_and_take_effect_in_their_own() {
    let mut host = TestHost::settled();
    host.do_all(&[(19, &[1, 100, 0, 0, 0, 7, 0]), (17, &[1, 0xD4, 0xFE]), (15, &[1, 5, 0]), (10, &[1, 1])]);
    assert_eq!(host.new_commands(), [set(1, Setpoint::ConstantPower(Control::new(5)))]);
    let velocity = Setpoint::Velocity(CountsPerSecond::new(-300));
    let position = Setpoint::Position { target: 100, tolerance: 7, speed_limit: CountsPerSecond::new(300) };
    for (mode, setpoint) in [(1, velocity), (2, position)] {
        host.do_all(&[(8, &[1, mode, 0])]);
        assert_eq!(host.new_commands().last(), Some(&set(1, setpoint)));
    }
}

#[test]
fn an_enabled_motor_in_a_mode_without_target_floats_until_it_has_one() {
    let mut host = driving();
    host.do_all(&[(8, &[0, 1, 0])]);
    assert_eq!(host.new_commands().last(), Some(&set(0, Setpoint::Disabled)));
    host.do_all(&[(17, &[0, 10, 0])]);
    assert_eq!(host.new_commands(), [set(0, Setpoint::Velocity(CountsPerSecond::new(10)))]);
}

#[test]
fn a_position_without_a_velocity_has_the_highest_speed_limit() {
    let mut host = TestHost::settled();
    host.do_all(&[(8, &[0, 2, 0]), (19, &[0, 1, 0, 0, 0, 0, 0]), (10, &[0, 1])]);
    let speed_limit = CountsPerSecond::new(32_767);
    assert_eq!(
        host.new_commands().last(),
        Some(&set(0, Setpoint::Position { target: 1, tolerance: 0, speed_limit }))
    );
    host.do_all(&[(17, &[0, 0, 0x80])]);
    let speed_limit = CountsPerSecond::new(32_768);
    assert_eq!(host.new_commands(), [set(0, Setpoint::Position { target: 1, tolerance: 0, speed_limit })]);
}

#[test]
fn a_release_is_sent_first_even_if_the_motor_is_enabled_again_immediately() {
    let mut host = driving();
    host.do_all(&[(15, &[1, 1, 0]), (10, &[1, 1]), (10, &[0, 0]), (10, &[0, 1])]);
    let half = Setpoint::ConstantPower(Control::new(16_384));
    let one = Setpoint::ConstantPower(Control::new(1));
    assert_eq!(host.new_commands(), [set(0, Setpoint::Disabled), set(0, half), set(1, one)]);
}

#[test]
fn a_reset_encoder_reads_0_and_targets_are_in_its_counts() {
    let mut host = TestHost::settled();
    host.snapshot.motors[0].position = i32::MAX;
    host.do_all(&[(8, &[0, 2, 0]), (19, &[0, 10, 0, 0, 0, 3, 0]), (10, &[0, 1]), (14, &[0])]);
    assert_eq!(host.call(22, &[0]), Answer::Data(vec![0; 4]));
    let commands = host.new_commands();
    let Some(&Command::Set { setpoint: Setpoint::Position { target, .. }, .. }) = commands.last() else {
        panic!("{commands:?}")
    };
    assert_eq!(target, i32::MAX.wrapping_add(10));
    for (moved, within) in [(6, 0), (7, 1), (13, 1), (14, 0)] {
        host.snapshot.motors[0].position = i32::MAX.wrapping_add(moved);
        assert_eq!(host.call(21, &[0]), Answer::Data(vec![within]));
        let bulk = host.call(0, &[]).data();
        assert_eq!((bulk[1..5].to_vec(), bulk[17]), (moved.to_le_bytes().to_vec(), within << 4));
    }
}

#[test]
fn a_far_target_is_in_the_direction_of_the_hosts_counts() {
    const QUARTER: i64 = 1 << 30;
    let places = [i32::MIN, i32::MIN + 50, -QUARTER as i32, -3_179, -1, 0, 1, 5_000, i32::MAX - 50, i32::MAX];
    for offset in [0, 5_000, i32::MAX, i32::MIN] {
        for (from, to) in places.iter().flat_map(|&from| places.map(|to| (from, to))) {
            let mut host = TestHost::settled();
            host.snapshot.motors[0].position = offset;
            host.do_all(&[(14, &[0]), (8, &[0, 2, 0])]);
            host.snapshot.motors[0].position = offset.wrapping_add(from);
            let [a, b, c, d] = to.to_le_bytes();
            host.do_all(&[(19, &[0, a, b, c, d, 0, 0]), (10, &[0, 1])]);
            assert_eq!(host.call(20, &[0]), Answer::Data(vec![a, b, c, d, 0, 0]));
            let commands = host.new_commands();
            let Some(&Command::Set { setpoint: Setpoint::Position { target, .. }, .. }) = commands.last()
            else {
                panic!("{commands:?}")
            };
            let ahead = i64::from(to) - i64::from(from);
            // Positions wrap: the largest and the smallest number are neighbours.
            let round = ahead - ahead.signum() * 4 * QUARTER;
            let meant = if round.abs() < QUARTER { round } else { ahead };
            for pushed in [0, -1_000_000, 1_000_000] {
                let here = offset.wrapping_add(from).wrapping_add(pushed);
                let way = i64::from(target.wrapping_sub(here));
                let case = format!("from {from} to {to}, reset at {offset}, pushed by {pushed}");
                if meant.abs() > 1_000_000 {
                    assert_eq!(way.signum(), meant.signum(), "{case}");
                }
                if meant.abs() <= QUARTER {
                    assert_eq!(way, meant - i64::from(pushed), "{case}");
                }
            }
        }
    }
}

#[test]
fn a_motor_in_full_flight_is_within_tolerance_when_it_passes_its_target_but_not_settled() {
    let mut host = TestHost::settled();
    host.do_all(&[(8, &[0, 2, 0]), (19, &[0, 0, 0, 0, 0, 5, 0]), (10, &[0, 1])]);
    host.new_commands();
    host.snapshot.motors[0].velocity = CountsPerSecond::new(2_000);
    assert_eq!(host.call(21, &[0]), Answer::Data(vec![1]));
    assert!(!host.reported(0).settled);
}

#[test]
fn a_disabled_motor_that_stands_on_its_target_is_neither_within_tolerance_nor_settled() {
    let mut host = TestHost::settled();
    host.do_all(&[(8, &[0, 2, 0]), (19, &[0, 0, 0, 0, 0, 5, 0])]);
    for calls in [&[][..], &[(10, &[0, 1][..]), (10, &[0, 0])]] {
        host.do_all(calls);
        host.new_commands();
        assert_eq!(host.call(21, &[0]), no());
        assert_eq!(host.call(0, &[]).data()[17], 0);
        assert!(!host.reported(0).settled);
    }
}

#[test]
fn a_motor_is_neither_within_tolerance_of_an_older_target_nor_settled_before_a_snapshot_includes_the_newest()
{
    let mut host = TestHost::settled();
    host.do_all(&[(8, &[0, 2, 0]), (19, &[0, 0, 0, 0, 0, 5, 0]), (10, &[0, 1])]);
    host.new_commands();
    host.tick();
    host.snapshot.motors[0].settled = true;
    let settled_and_within = |host: &mut TestHost| (host.reported(0).settled, host.call(21, &[0]));
    assert_eq!(settled_and_within(&mut host), (true, Answer::Data(vec![1])));
    host.do_all(&[(19, &[0, 0, 1, 0, 0, 5, 0])]);
    host.expect_until_included(settled_and_within, (false, no()));
    assert!(host.reported(0).settled);
}

#[test]
fn a_report_says_whether_it_includes_all_commands_also_where_the_numbers_wrap() {
    for start in [0, u32::MAX - 1, u32::MAX, 1 << 31] {
        let mut host = TestHost::settled();
        host.commands = start;
        host.tick();
        assert!(host.report().is_up_to_date(), "{start}");
        host.do_all(&[(15, &[0, 0, 64]), (10, &[0, 1]), (15, &[2, 0, 64]), (10, &[2, 1])]);
        assert!(!host.report().is_up_to_date(), "not sent yet, {start}");
        assert_eq!(host.new_commands().len(), 2);
        assert!(!host.report().is_up_to_date(), "in no snapshot yet, {start}");
        host.snapshot.newest_command = start.wrapping_add(1);
        assert!(!host.report().is_up_to_date(), "one of two, {start}");
        host.tick();
        let commands = Commands { included: start.wrapping_add(2), newest: start.wrapping_add(2) };
        assert_eq!(host.report().commands, Some(commands));
        // Commands of others do not concern this host.
        host.snapshot.newest_command = start.wrapping_add(1_000);
        assert!(host.report().is_up_to_date(), "{start}");
    }
}

#[test]
fn bulk_velocities_saturate() {
    let mut host = TestHost::settled();
    for (motor, cps) in [40_000, -40_000, 32_767, -5].into_iter().enumerate() {
        host.snapshot.motors[motor].velocity = CountsPerSecond::new(cps);
    }
    let expected = [32_767i16, -32_768, 32_767, -5].map(i16::to_le_bytes).concat();
    assert_eq!(host.call(0, &[]).data()[18..26], expected);
}

#[test]
fn a_motor_is_not_enabled_on_a_low_or_unknown_battery() {
    for (battery, stage, said) in [
        (Some(7_000), DrawStage::Full, Answer::Ack(0)),
        (Some(7_200), DrawStage::Derated, Answer::Nack(52)),
        (Some(5_900), DrawStage::Cutoff, Answer::Nack(52)),
        (Some(24_000), DrawStage::Overvoltage, Answer::Nack(52)),
        (None, DrawStage::Cutoff, Answer::Nack(52)),
    ] {
        let mut host = TestHost::settled();
        host.do_all(&[(15, &[0, 1, 0])]);
        host.set_battery(battery, stage);
        assert_eq!(host.call(10, &[0, 1]), said, "{battery:?}");
        assert_eq!(host.responder.enabled()[0], said == Answer::Ack(0));
    }
}

#[test]
fn the_battery_reads_0_when_unknown_and_saturates() {
    let mut host = TestHost::settled();
    for (battery, mv) in [(None, 0i16), (Some(32_768), 32_767)] {
        host.snapshot.battery = battery.map(Millivolts::new);
        assert_eq!(host.call(7, &[13, 0]), Answer::Data(mv.to_le_bytes().to_vec()));
    }
}

#[test]
fn a_battery_that_becomes_low_sets_attention_once_and_stays_in_the_status() {
    let mut host = driving();
    host.set_battery(Some(6_900), DrawStage::Derated);
    assert_eq!(keep_alive(&mut host), Answer::Ack(1));
    assert_eq!(host.ask(0x7F03, &[1]), Answer::Data(vec![1 << 4, 0]));
    assert_eq!(keep_alive(&mut host), Answer::Ack(0));
    assert_eq!(host.ask(0x7F03, &[1]), Answer::Data(vec![1 << 4, 0]));
    host.set_battery(Some(7_500), DrawStage::Full);
    assert_eq!(host.ask(0x7F03, &[1]), Answer::Data(vec![0, 0]));
    assert!(host.responder.enabled()[0], "a running motor goes on");
}

#[test]
fn attention_is_set_until_the_status_is_read_and_cleared() {
    let mut host = TestHost::new();
    assert_eq!(keep_alive(&mut host), Answer::Ack(1), "after a reset");
    assert_eq!(host.ask(0x7F03, &[0]), Answer::Data(vec![2, 0]));
    assert_eq!(keep_alive(&mut host), Answer::Ack(1));
    assert_eq!(host.call(0, &[]).data()[34], 1);
    assert_eq!(host.ask(0x7F03, &[1]), Answer::Data(vec![2, 0]), "cleared after the answer");
    assert_eq!(keep_alive(&mut host), Answer::Ack(0));
    assert_eq!(host.ask(0x7F05, &[]), Answer::Ack(1));
    assert_eq!(host.ask(0x7F03, &[1]), Answer::Data(vec![4, 0]));
}

#[test]
fn a_silence_of_2500_ms_disables_all_motors_once() {
    let mut host = driving();
    host.wait_ms(TIMEOUT_MS);
    host.now = Micros::new(host.now.get() - 1);
    host.responder.tick(host.now, &host.snapshot);
    assert!(host.responder.enabled()[0] && host.new_commands().is_empty());
    host.now = Micros::new(host.now.get() + 1);
    host.responder.tick(host.now, &host.snapshot);
    assert_eq!(host.new_commands(), [0, 1, 2, 3].map(|motor| set(motor, Setpoint::Disabled)));
    host.wait_ms(10 * TIMEOUT_MS);
    host.responder.tick(host.now, &host.snapshot);
    assert!(host.new_commands().is_empty());
    assert_eq!(host.responder.enabled(), [false; N]);
    assert_eq!(keep_alive(&mut host), Answer::Ack(1));
    assert_eq!(host.ask(0x7F03, &[1]), Answer::Data(vec![1, 0]));
    assert!(host.new_commands().is_empty(), "packets alone enable nothing");
    host.do_all(&[(15, &[0, 0, 64])]);
    assert!(host.new_commands().is_empty(), "nor do targets");
    host.do_all(&[(10, &[0, 1])]);
    assert_eq!(host.new_commands(), [set(0, Setpoint::ConstantPower(Control::new(16_384)))]);
}

#[test]
fn a_late_packet_does_not_hide_the_time_out() {
    let mut host = driving();
    host.wait_ms(TIMEOUT_MS);
    assert_eq!(keep_alive(&mut host), Answer::Ack(1));
    assert!(!host.responder.enabled()[0]);
}

#[test]
fn only_packets_to_the_hub_keep_motors_running() {
    let mut damaged = frame_to(HUB, 1, 0x7F04, &[]);
    damaged[6] ^= 1;
    let feeding =
        [frame_to(HUB, 1, 0x7F03, &[0]), frame_to(HUB, 1, 0x1016, &[9]), frame_to(HUB, 1, 0x6666, &[])];
    let others = [frame_to(HUB + 1, 1, 0x7F04, &[]), frame_to(255, 1, 0x7F04, &[]), damaged, vec![0x44; 300]];
    let cases = feeding.iter().map(|f| (f, true)).chain(others.iter().map(|f| (f, false)));
    for (frame, runs) in cases {
        let mut host = driving();
        for _ in 0..4 {
            host.wait_ms(2100);
            host.send(frame);
            host.responder.tick(host.now, &host.snapshot);
        }
        assert_eq!(host.responder.enabled()[0], runs, "{frame:x?}");
    }
}

#[test]
fn on_the_chain_line_only_the_hosts_packets_are_answered_and_keep_motors_running() {
    for (source, runs) in [(HOST, true), (HUB + 1, false)] {
        let mut host = driving();
        let packet = Packet { destination: HUB, source, number: 1, id: 0x7F04, ..Packet::default() };
        for _ in 0..4 {
            host.wait_ms(2100);
            let reply = host.responder.receive_with(&packet, Line::Chain, host.now, &host.snapshot, None);
            assert_eq!(reply.is_some(), runs, "{source}");
        }
        assert_eq!(host.responder.enabled()[0], runs, "{source}");
    }
}

#[test]
fn a_stop_to_all_on_the_chain_line_withdraws_the_buttons_permission() {
    let mut responder = Responder::new(Address::DEFAULT, [settings(); N]);
    assert!(responder.permits_button());
    let stop = Packet { destination: BROADCAST, id: FAIL_SAFE, ..Packet::default() };
    let now = Micros::new(1);
    assert_eq!(responder.receive_with(&stop, Line::Chain, now, &Snapshot::INITIAL, None), None);
    assert!(!responder.permits_button());
    assert_eq!(responder.deadline(), None, "the timer does not run");
}

#[test]
fn the_timer_starts_with_the_first_packet() {
    let mut responder = Responder::new(Address::DEFAULT, [settings(); N]);
    assert_eq!(responder.deadline(), None);
    responder.tick(Micros::new(1 << 40), &Snapshot::INITIAL);
    assert_eq!(responder.pending(), None);
}

#[test]
fn fail_safe_keeps_modes_targets_and_coefficients() {
    let mut host = driving();
    host.do_all(&[(8, &[0, 1, 1]), (17, &[0, 9, 0]), (19, &[0, 1, 2, 3, 4, 5, 6])]);
    let keep = |host: &mut TestHost| [9, 16, 18, 20].map(|function| host.call(function, &[0]));
    let before = keep(&mut host);
    assert_eq!(host.ask(0x7F05, &[]), Answer::Ack(1));
    assert_eq!(keep(&mut host), before);
    assert_eq!(host.responder.enabled(), [false; N]);
}

#[test]
fn the_led_shows_the_states_of_host_and_battery() {
    let mut host = TestHost::new();
    assert_eq!(host.responder.led(host.now), Colour::BLUE, "waiting");
    keep_alive(&mut host);
    assert_eq!(host.responder.led(host.now), Colour::GREEN, "talking");
    host.wait_ms(TIMEOUT_MS);
    host.responder.tick(host.now, &host.snapshot);
    let three_seconds = |host: &mut TestHost| {
        [0; 6].map(|_| {
            let colour = host.responder.led(host.now);
            host.wait_ms(500);
            colour
        })
    };
    assert_eq!(three_seconds(&mut host), [Colour::BLUE, Colour::OFF].repeat(3)[..], "lost");
    host.set_battery(Some(6_500), DrawStage::Derated);
    keep_alive(&mut host);
    let mut seen = three_seconds(&mut host);
    seen.sort_by_key(|colour| colour.red);
    assert_eq!(seen[2..4], [Colour::OFF, Colour::ORANGE], "low");
}

#[test]
fn a_connected_host_sets_colour_and_pattern() {
    let mut host = TestHost::settled();
    host.ask(0x7F0A, &[1, 2, 3]);
    let colour = Colour { red: 1, green: 2, blue: 3 };
    assert_eq!(host.responder.led(host.now), colour);
    // 0.2 s of one, 0.1 s of another, then the end.
    host.ask(0x7F0C, &[2, 30, 20, 10, 1, 33, 22, 11, 0, 9, 9, 9, 5, 5, 5, 5]);
    let (one, other) = (Colour { red: 10, green: 20, blue: 30 }, Colour { red: 11, green: 22, blue: 33 });
    for expected in [one, one, other, one, one, other, one] {
        assert_eq!(host.responder.led(host.now), expected);
        host.wait_ms(100);
    }
    let mut pattern = vec![2, 30, 20, 10, 1, 33, 22, 11];
    pattern.resize(64, 0);
    assert_eq!(host.ask(0x7F0D, &[]), Answer::Data(pattern));
    assert_eq!(host.ask(0x7F0B, &[]), Answer::Data(vec![1, 2, 3]));
    host.wait_ms(TIMEOUT_MS);
    host.responder.tick(host.now, &host.snapshot);
    assert_eq!(host.responder.led(host.now), Colour::BLUE, "the colour of a lost host is not shown");
    host.ask(0x7F0C, &[0]);
    assert_eq!(host.responder.led(host.now), Colour::GREEN, "an empty pattern gives the LED back");
}

#[test]
fn a_pattern_of_16_steps_is_kept_whole() {
    let mut host = TestHost::settled();
    let pattern: Vec<u8> = (1..=64).collect();
    assert_eq!(host.ask(0x7F0C, &pattern), Answer::Ack(0));
    assert_eq!(host.ask(0x7F0D, &[]), Answer::Data(pattern));
}

#[test]
fn replies_are_numbered_from_1_to_255() {
    let mut host = TestHost::new();
    let numbers: Vec<u8> = (0..=255).map(|_| host.send(&frame_to(HUB, 0, 0x7F04, &[]))[0][6]).collect();
    assert_eq!(numbers, (1..=255).chain([1]).collect::<Vec<u8>>());
}

#[test]
fn a_hub_with_fewer_motors_refuses_the_other_channels() {
    let mut responder = Responder::new(Address::DEFAULT, [settings(); 2]);
    let mut ask = |id, payload: &[u8]| {
        let packet = decode(&frame_to(2, 1, id, payload));
        responder.receive(&packet, Micros::new(0), &Snapshot::INITIAL).expect("an answer")
    };
    let ids = [0, 1, 2, 3].map(|motor| ask(0x1009, &[motor]).id);
    assert_eq!(ids, [0x9009, 0x9009, 0x7F02, 0x7F02]);
    assert_eq!(ask(0x1000, &[]).payload.len(), 35);
}

#[test]
fn a_motor_set_to_brake_at_faults_brakes_when_its_host_is_silent() {
    let mut host = driving();
    host.new_commands();
    let setup = motor_hub::extension::FIRST_FUNCTION;
    for motor in [0, 1] {
        assert_eq!(host.ask(setup + 8, &[motor, 1, 0, 0, 0, 0, 0, 0]), Answer::Ack(0));
    }
    // Motor 1 is disabled, so of both motors only motor 0 runs.
    host.do_all(&[(10, &[1, 0])]);
    host.new_commands();
    let silence = |host: &mut TestHost| {
        host.wait_ms(2_500);
        host.responder.tick(host.now, &host.snapshot);
        host.new_commands()
    };
    let commands = silence(&mut host);
    assert_eq!(commands.first(), Some(&set(0, Setpoint::FailSafe)));
    assert!(!commands.contains(&set(1, Setpoint::FailSafe)), "{commands:?}");
    assert!(commands.contains(&set(2, Setpoint::Disabled)), "{commands:?}");
    assert_eq!(host.responder.enabled(), [false; N]);
    // The motor brakes until a host disables it.
    let is_for_motor_0 = |command: &Command| {
        matches!(command, Command::Set { motor: 0, .. } | Command::Configure { motor: 0, .. })
    };
    assert!(!silence(&mut host).iter().any(is_for_motor_0));
    host.do_all(&[(10, &[0, 0])]);
    assert_eq!(host.new_commands(), [set(0, Setpoint::Disabled)]);
}

#[test]
fn a_current_above_its_alert_is_reported_measured_or_modelled() {
    let mut host = TestHost::settled();
    let over = |host: &mut TestHost| host.call(0, &[]).data()[17] & 0x0F;
    // Alert of motor 1 above 2 A.
    host.do_all(&[(12, &[1, 0xD0, 7])]);
    for (ma, alerts) in [(2_000, 0), (2_001, 2)] {
        host.snapshot.motors[1].measured = Some(Milliamperes::new(ma));
        host.snapshot.motors[2].measured = Some(Milliamperes::new(ma));
        assert_eq!(over(&mut host), alerts, "{ma} mA");
    }
    host.snapshot.motors[1].measured = None;
    for (ma, alerts) in [(-2_000, 0), (-2_001, 2)] {
        host.snapshot.motors[1].current = Milliamperes::new(ma);
        assert_eq!(over(&mut host), alerts, "{ma} mA, by the model");
    }
}

#[test]
fn a_silent_encoder_and_a_bridge_that_has_switched_itself_off_are_motor_alerts() {
    let mut host = TestHost::settled();
    host.snapshot.motors[2].faults.encoder_stale = true;
    host.snapshot.motors[3].faults.bridge = true;
    assert_eq!(host.ask(0x7F03, &[0]), Answer::Data(vec![0, 1 << 2 | 1 << 7]));
}
