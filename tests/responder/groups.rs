//! A host moves motors together: the commands to the motors, and their order.

use crate::host::{Answer, N, TestHost, WITHOUT_COMMAND};
use motor_hub::extension::group::GroupCourse;
use motor_hub::extension::{FIRST_FUNCTION, MotorFunction};
use motor_hub::group::{Course, GroupCommand, Halt};
use motor_hub::hub::Command;
use motor_hub::motor::{Report, Setpoint};
use motor_hub::regulator::Reference;
use motor_hub::regulator::identify::{Identification, Refusal};
use motor_hub::units::{Acceleration, Control, CountsPerSecond};

const STATE: u16 = 0x4D07;

fn wanted<C>(course: C) -> GroupCommand<C> {
    GroupCommand {
        course,
        speed: CountsPerSecond::new(2_000),
        acceleration: Acceleration::new(5_000).expect("above 0"),
        lag: 100,
        tolerance: 5,
        halt: Halt::Coast,
    }
}

fn pair(left: i32, right: i32) -> GroupCommand<GroupCourse> {
    wanted(GroupCourse::Position([None, Some(left), None, Some(right)]))
}

fn command_group(left: i32, right: i32) -> Command {
    Command::MoveGroup(wanted(Course::positions(&[(1, left), (3, right)]).expect("motors")))
}

fn power(motor: usize, power: i16) -> Command {
    Command::Set { motor, setpoint: Setpoint::ConstantPower(Control::new(power)) }
}

fn ask(host: &mut TestHost, motor: u8, wanted: GroupCommand<GroupCourse>) -> Answer {
    host.request(MotorFunction::Move { wanted }.to(motor))
}

/// Creates a host at a hub whose motors are all enabled, at power 0.
fn enabled() -> TestHost {
    let mut host = TestHost::settled();
    for motor in 0..N as u8 {
        host.do_all(&[(15, &[motor, 0, 0]), (10, &[motor, 1])]);
    }
    host.new_commands();
    host.tick();
    host
}

#[test]
fn a_course_is_sent_in_the_counts_of_the_motors() {
    let mut host = enabled();
    host.snapshot.motors[3].position = 70;
    // Reset encoder.
    host.do_all(&[(14, &[3])]);
    host.new_commands();
    assert_eq!(ask(&mut host, 1, pair(500, -500)), Answer::Ack(0));
    assert_eq!(host.new_commands(), [command_group(500, -430)]);
    assert_eq!(host.new_commands(), []);
}

#[test]
fn enabling_a_member_again_and_a_target_of_another_mode_leave_the_group_alone() {
    let mut host = enabled();
    ask(&mut host, 1, pair(500, -500));
    host.new_commands();
    host.do_all(&WITHOUT_COMMAND);
    assert_eq!(host.new_commands(), []);
    host.do_all(&[(8, &[1, 1, 0])]);
    let setpoint = Setpoint::Velocity(CountsPerSecond::new(100));
    assert!(host.new_commands().contains(&Command::Set { motor: 1, setpoint }));
}

#[test]
fn a_course_ends_an_identification() {
    let mut host = enabled();
    let identified = |host: &mut TestHost| host.ask(FIRST_FUNCTION + 5, &[1]);
    host.ask(FIRST_FUNCTION + 4, &[1, 0xF4, 1, 0, 0]);
    host.expect_until_included(identified, Answer::Data(vec![1, 0]));
    assert_eq!(ask(&mut host, 1, pair(1, 2)), Answer::Ack(0));
    host.new_commands();
    host.snapshot.motors[1].identification = Identification::Refused(Refusal::Stopped);
    assert_eq!(identified(&mut host), Answer::Data(vec![3, 0]), "the identification does not run again");
}

#[test]
fn a_course_follows_earlier_commands_and_replaces_its_members_targets() {
    let mut host = TestHost::settled();
    for motor in 0..N as u8 {
        host.do_all(&[(15, &[motor, 0, 1]), (10, &[motor, 1])]);
    }
    ask(&mut host, 3, pair(1, 2));
    assert_eq!(host.new_commands(), [power(0, 256), power(2, 256), command_group(1, 2)]);
}

#[test]
fn a_later_command_to_a_member_alone_takes_it_out_of_the_group() {
    let coast = Command::Set { motor: 1, setpoint: Setpoint::Disabled };
    let halts_the_other = |commands: &[Command]| {
        let takes_out = commands.iter().any(|command| matches!(command, Command::Set { motor: 3, .. }));
        takes_out && commands.contains(&coast) && commands.len() == 2
    };
    for (function, payload) in [(15, &[3, 0, 1][..]), (10, &[3, 0]), (14, &[3])] {
        let mut host = enabled();
        ask(&mut host, 1, pair(1, 2));
        host.do_all(&[(function, payload)]);
        let commands = host.new_commands();
        assert!(halts_the_other(&commands), "{function}: {commands:?}");
    }
    for function in [
        MotorFunction::Identify { travel_limit: 500 },
        MotorFunction::Current { current_ma: 500, speed_limit_cps: 1_000 },
    ] {
        let mut host = enabled();
        ask(&mut host, 1, pair(1, 2));
        host.request(function.to(3));
        let commands = host.new_commands();
        assert!(halts_the_other(&commands), "{commands:?}");
    }
    // Requests that only read, and requests to other motors, do not take a member out.
    let mut host = enabled();
    ask(&mut host, 1, pair(1, 2));
    assert!(matches!(host.call(11, &[3]), Answer::Data(_)));
    host.do_all(&[(15, &[0, 0, 1])]);
    assert_eq!(host.new_commands().last(), Some(&command_group(1, 2)));
}

#[test]
fn members_of_a_deleted_course_halt_as_if_the_course_had_been_sent() {
    let set = |setpoint| Command::Set { motor: 1, setpoint };
    let [coast, stop] = [Setpoint::Disabled, Setpoint::Velocity(CountsPerSecond::ZERO)].map(set);
    let stopping = GroupCommand { halt: Halt::Stop, ..pair(1, 2) };
    for (course, halted) in [(pair(1, 2), coast), (stopping, stop)] {
        // The queue of commands is full, so nothing is sent yet. Motor 3 leaves the group.
        let mut host = enabled();
        host.do_all(&[(15, &[1, 0, 1])]);
        ask(&mut host, 1, course);
        host.do_all(&[(15, &[3, 0, 2])]);
        assert_eq!(host.new_commands(), [halted, power(3, 512)]);
        // A target of its own moves the member again.
        host.do_all(&[(15, &[1, 0, 1])]);
        assert_eq!(host.new_commands(), [power(1, 256)]);
        // Another course replaces the pending one.
        ask(&mut host, 1, course);
        ask(&mut host, 0, wanted(GroupCourse::Position([Some(5), None, None, Some(6)])));
        let replacing = wanted(Course::positions(&[(0, 5), (3, 6)]).expect("motors"));
        assert_eq!(host.new_commands(), [halted, Command::MoveGroup(replacing)]);
    }
    // A member that is disabled disables the others.
    let mut host = enabled();
    ask(&mut host, 1, stopping);
    host.do_all(&[(10, &[3, 0])]);
    assert_eq!(host.new_commands(), [Command::Set { motor: 3, setpoint: Setpoint::Disabled }, coast]);
}

#[test]
fn a_question_to_a_member_keeps_the_course_that_waits_behind_a_release() {
    let mut host = enabled();
    // Disable and enable motor 3. The queue of commands is full, so neither command is sent yet.
    host.do_all(&[(10, &[3, 0]), (10, &[3, 1])]);
    assert!(matches!(ask(&mut host, 1, pair(1, 2)), Answer::Ack(_)));
    // Get enable of motor 3.
    assert!(matches!(host.call(11, &[3]), Answer::Data(_)));
    let release = Command::Set { motor: 3, setpoint: Setpoint::Disabled };
    assert_eq!(host.new_commands(), [release, command_group(1, 2)]);
}

#[test]
fn a_later_course_replaces_a_pending_one() {
    let mut host = enabled();
    ask(&mut host, 1, pair(1, 2));
    ask(&mut host, 3, pair(3, 4));
    assert_eq!(host.new_commands(), [command_group(3, 4)]);
}

#[test]
fn a_group_with_a_disabled_member_is_refused() {
    let mut host = enabled();
    host.do_all(&[(10, &[3, 0])]);
    host.new_commands();
    assert_eq!(ask(&mut host, 1, pair(1, 2)), Answer::Nack(51));
    assert_eq!(host.new_commands(), []);
    // Fail-safe disables all.
    let mut host = enabled();
    ask(&mut host, 1, pair(1, 2));
    host.ask(0x7F05, &[]);
    let disables = |command: &Command| matches!(command, Command::Set { setpoint: Setpoint::Disabled, .. });
    assert!(host.new_commands().iter().all(disables));
}

#[test]
fn a_request_to_a_motor_outside_the_group_is_refused() {
    let mut host = enabled();
    assert_eq!(ask(&mut host, 0, pair(1, 2)), Answer::Nack(2));
    assert_eq!(ask(&mut host, 0, wanted(GroupCourse::Velocity([None; 4]))), Answer::Nack(2));
    assert_eq!(ask(&mut host, 7, pair(1, 2)), Answer::Nack(0));
    assert_eq!(host.new_commands(), []);
}

#[test]
fn the_state_of_a_group_is_reported_once_the_report_is_new_enough() {
    let mut host = enabled();
    let state = |host: &mut TestHost| (host.ask(STATE, &[1]).data()[0], host.reported(1).settled);
    assert_eq!(state(&mut host), (0, false));

    // A report that is older than the course does not say that it is at its end.
    let settled =
        Report { setpoint: Setpoint::Follow(Reference::default()), settled: true, ..Report::INITIAL };
    host.snapshot.motors[1] = settled;
    ask(&mut host, 1, pair(1, 2));
    host.expect_until_included(state, (1, false));
    assert_eq!(state(&mut host), (2, true));
    host.snapshot.motors[1].settled = false;
    assert_eq!(state(&mut host), (1, false));
    // A member that gets a target of its own is alone, also before a snapshot says so.
    host.do_all(&[(15, &[1, 0, 1])]);
    host.expect_until_included(state, (0, false));
}

#[test]
fn a_member_of_a_group_is_not_within_tolerance_of_the_target_that_the_course_replaced() {
    let mut host = enabled();
    host.do_all(&[(8, &[1, 2, 0]), (19, &[1, 0, 0, 0, 0, 5, 0])]);
    assert_eq!(host.call(21, &[1]), Answer::Data(vec![1]));
    ask(&mut host, 1, pair(1, 2));
    assert_eq!(host.call(21, &[1]), Answer::Data(vec![0]));
    host.do_all(&[(19, &[1, 0, 0, 0, 0, 5, 0])]);
    assert_eq!(host.call(21, &[1]), Answer::Data(vec![1]));
}
