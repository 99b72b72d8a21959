//! Implements the command `motor-hub client faults`.

use super::hub::HubOptions;
use crate::output::{Failure, print, print_json};
use crate::parse::whole;
use motor_hub::bridge::Drive;
use motor_hub::record::{Fault, Head, Tick};
use serde_json::{Value, json};
use studies::table;

/// Lists the last faults and resets, newest first, on hubs of this project
///
/// docs/reference/fault-numbers.md explains each fault number: meaning, reaction of the hub, and what to check. With
/// the number of an entry the command shows the 64 control ticks before the fault. They are those of the motor at
/// fault or, for a fault of the hub itself, of the motor with the largest duty.
///
/// The record survives a reset, but not a loss of power.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Shows the control ticks of this entry, by its number in the first column
    #[arg(value_parser = whole("an entry", 0..=u16::MAX, ""))]
    entry: Option<u16>,
    /// JSON instead of tables, with the ticks of all entries
    #[arg(long, conflicts_with = "entry")]
    json: bool,
    /// Clears the hub's record afterwards
    #[arg(long)]
    clear: bool,
}

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let session = &mut hub.open(None)?;
        let Some((run, heads)) = session.recorded()? else {
            return Err(Failure::Work("this hub keeps no record of faults".to_owned()));
        };
        match self.entry {
            Some(number) => {
                let head = heads.iter().find(|head| head.number == number);
                let head = head.filter(|head| head.ticks > 0).ok_or_else(|| no_ticks(number, &heads))?;
                print(&ticks(head, &session.recorded_ticks(number)?))?;
            }
            None if self.json => {
                let mut entries = Vec::new();
                for head in &heads {
                    let ticks =
                        if head.ticks > 0 { session.recorded_ticks(head.number)? } else { Vec::new() };
                    entries.push(entry_json(head, &ticks));
                }
                print_json(&json!({ "run": run, "entries": entries }))?;
            }
            None => print(&list(run, &heads))?,
        }
        if self.clear {
            session.forget_record()?;
        }
        Ok(())
    }
}

fn no_ticks(number: u16, heads: &[Head]) -> Failure {
    let with: Vec<String> =
        heads.iter().filter(|head| head.ticks > 0).map(|head| head.number.to_string()).collect();
    let with = if with.is_empty() {
        "no entry has ticks".to_owned()
    } else {
        format!("entries with ticks: {}", with.join(", "))
    };
    Failure::Work(format!("the hub has no ticks of entry {number}; {with}"))
}

fn list(run: u32, heads: &[Head]) -> String {
    if heads.is_empty() {
        return format!("No faults or resets recorded. This is run {run} since the record began.\n");
    }
    let mut table =
        table::new(&["entry", "fault", "run", "after", "times", "motor", "drive", "battery", "ticks"], 2);
    for head in heads {
        let detail = detail(head).map_or_else(String::new, |detail| format!("\n{detail}"));
        table.add_row([
            head.number.to_string(),
            format!("{} {}{detail}", head.fault.number(), head.fault.name()),
            head.run.to_string(),
            format!("{:.3} s", f64::from(head.uptime_ms) / 1e3),
            head.times.to_string(),
            head.motor.map_or_else(|| "-".to_owned(), |motor| motor.to_string()),
            drive(head.drive),
            head.battery
                .map_or_else(|| "unknown".to_owned(), |mv| format!("{:.2} V", f64::from(mv.get()) / 1e3)),
            head.ticks.to_string(),
        ]);
    }
    format!(
        "{table}\nThis is run {run} since the record began. Faults are explained in docs/reference/fault-numbers.md\n"
    )
}

fn ticks(head: &Head, ticks: &[Tick]) -> String {
    let mut table = table::new(&["tick", "position", "velocity", "volts", "drive"], 1);
    for (tick, before) in ticks.iter().zip((0..ticks.len()).rev()) {
        table.add_row([
            if before == 0 { "last".to_owned() } else { format!("-{before}") },
            tick.position.to_string(),
            tick.velocity.to_string(),
            format!("{:.2}", f64::from(tick.millivolts) / 1e3),
            drive(tick.drive),
        ]);
    }
    let motor = head.motor.map_or_else(String::new, |motor| format!(", motor {motor}"));
    format!(
        "{} {}{motor}\nPosition in counts (lower 16 bits), velocity in counts/s, volts across the motor\n{table}\n",
        head.fault.number(),
        head.fault.name()
    )
}

fn entry_json(head: &Head, ticks: &[Tick]) -> Value {
    let ticks: Vec<Value> = ticks
        .iter()
        .map(|tick| {
            json!({
                "position": tick.position,
                "velocity": tick.velocity,
                "voltage_v": f64::from(tick.millivolts) / 1e3,
                "mode": tick.drive.mode.name(),
                "duty_percent": 100.0 * tick.drive.duty.to_f64(),
            })
        })
        .collect();
    json!({
        "entry": head.number,
        "fault": head.fault.number(),
        "name": head.fault.name(),
        "detail": detail(head),
        "run": head.run,
        "times": head.times,
        "uptime_s": f64::from(head.uptime_ms) / 1e3,
        "motor": head.motor,
        "mode": head.drive.mode.name(),
        "duty_percent": 100.0 * head.drive.duty.to_f64(),
        "battery_v": head.battery.map(|mv| f64::from(mv.get()) / 1e3),
        "ticks": ticks,
    })
}

fn detail(head: &Head) -> Option<String> {
    let [first, second] = head.detail;
    match head.fault {
        Fault::HardFault => Some(format!("at {first:#010x} from {second:#010x}")),
        Fault::StackOverflow => Some(format!("down to {first:#010x}")),
        Fault::Panic => Some(format!("line {first}, column {second}")),
        Fault::UnhandledInterrupt => Some(format!("number {}", first as u16 as i16)),
        _ => None,
    }
}

fn drive(drive: Drive) -> String {
    if drive == Drive::COAST {
        return "open".to_owned();
    }
    format!("{} {:.1} %", drive.mode.name(), 100.0 * drive.duty.to_f64())
}
