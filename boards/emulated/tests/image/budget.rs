//! One motor's control step on the chip: its results are equal to those on this computer to the last bit, and its number of
//! instructions is within its budget.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::{board, ms, publish};
use crate::recording::{Configuration, ControlVariant, Counts, OnChip, Recording};
use addr2line::Context;
use addr2line::gimli::{self, Dwarf, EndianSlice, LittleEndian, SectionId};
use emulated::Board;
use emulated::elf::{self, Symbol};
use motor_hub::braking::DutyRule;
use motor_hub::motor::Setpoint;
use motor_hub::units::{CountsPerSecond, Period};
use object::{Object, ObjectSection};

const MODES: [&str; 2] = ["velocity", "position"];

/// Returns the set-point of a second: low and high speeds in both directions, each for a second, or positions, each for two seconds.
fn setpoint(mode: &str, second: usize) -> Setpoint {
    if mode == "velocity" {
        let speeds = [1000, 2400, 300, -700, -2600, -40, 0, 1500, 15, 2000, -2000, 5];
        return Setpoint::Velocity(CountsPerSecond::new(speeds[second % speeds.len()]));
    }
    let target = [500, 4000, -3000, -2990, 0, 12][second / 2 % 6];
    Setpoint::Position { target, tolerance: 5, speed_limit: CountsPerSecond::new(2200) }
}

fn variants() -> impl Iterator<Item = ControlVariant> {
    Configuration::ALL
        .into_iter()
        .flat_map(|configuration| DutyRule::ALL.map(|rule| ControlVariant { rule, configuration }))
}

fn record(mode: &str, variant: ControlVariant, ms: u32, ticks: usize) -> Recording {
    let period = Period::from_millis(ms).expect("a period");
    let per_second = 1000 / ms as usize;
    Recording::new(variant, period, ticks, |tick| setpoint(mode, tick / per_second))
}

#[test]
fn control_to_drive_is_the_same_to_the_last_bit_as_on_the_host() {
    for ms in [50, 1] {
        for variant in variants() {
            for mode in MODES {
                let recording = record(mode, variant, ms, if ms == 50 { 500 } else { 8000 });
                let mut chip = OnChip::new(&recording);
                let answers = chip.replay(&recording.inputs);
                let differs = answers.iter().zip(&recording.answers).position(|(chip, host)| chip != host);
                assert_eq!(differs, None, "{mode} at {ms} ms, {variant:?}: tick differs");
                assert_eq!(answers.len(), recording.answers.len());
                assert_eq!(chip.bench.gaps(), Vec::<String>::new());
            }
        }
    }
}

fn mean(counts: &[u64]) -> u64 {
    counts.iter().sum::<u64>() / counts.len().max(1) as u64
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn four_motors_steps_and_samples_stay_within_the_budget_of_the_whole_hub() {
    let mut table = String::from(
        "Instructions of one motor's control step, and of a sample of its encoder between steps.\n\n\
         | set-point, motor, duty rule | period | mean | median | worst | sample | worst |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for (ms, percent) in [(50, 2), (10, 2), (1, 10)] {
        for variant in variants() {
            for mode in MODES {
                let recording = record(mode, variant, ms, 2000 / ms as usize + 200);
                let Counts { mut steps, samples } = OnChip::new(&recording).count(&recording.inputs);
                steps.sort_unstable();
                let step = mean(&steps);
                let sample = mean(&samples);
                let (median, worst) = (steps[steps.len() / 2], steps[steps.len() - 1]);
                let configuration = variant.configuration.name();
                let rule = match variant.rule {
                    DutyRule::LinearCurrent => "linear current",
                    DutyRule::LinearDuty => "linear duty",
                };
                let worst_sample = samples.iter().max().unwrap_or(&0);
                table += &format!(
                    "| {mode}, {configuration}, {rule} | {ms} ms | {step} | {median} | {worst} | {sample} | {worst_sample} |\n"
                );
                let per_period = step + u64::from(ms - 1) * sample;
                let per_second = 4 * per_period * 1000 / u64::from(ms);
                assert!(
                    per_second <= percent * Board::NucleoF429zi.core_hz() / 100,
                    "{mode} at {ms} ms, {variant:?}: {step}, {sample}"
                );
            }
        }
    }
    publish("step", &table);
}

/// Counts `Regulator::step`: trajectory, observer and control law, without the modulator of the bridge. Other projects
/// count the same parts.
#[test]
fn the_model_regulator_by_itself_takes_at_most_750_instructions_a_step() {
    let mut table = String::from(
        "Instructions of the model regulator alone, within one motor's control step every 50 ms.\n\n\
         | set-point | mean | worst |\n|---|---|---|\n",
    );
    for mode in MODES {
        let variant =
            ControlVariant { rule: DutyRule::LinearCurrent, configuration: Configuration::Configured };
        let recording = record(mode, variant, 50, 240);
        let mut chip = OnChip::new(&recording);
        let counts = chip.count_within(&recording.inputs, "<motor_hub::regulator::Regulator>::step");
        assert_eq!(counts.len(), recording.answers.len());
        let (step, worst) = (mean(&counts), counts.iter().max().expect("steps"));
        table += &format!("| {mode} | {step} | {worst} |\n");
        assert!(step <= 750, "{mode}: {step}");
    }
    publish("regulator", &table);
}

/// Returns the image's table of source lines by address.
fn source_lines(image: &[u8]) -> Context<EndianSlice<'_, LittleEndian>> {
    let elf = object::File::parse(image).expect("an ELF file");
    let section = |id: SectionId| {
        let section = elf.section_by_name(id.name()).and_then(|section| section.data().ok());
        Ok::<_, gimli::Error>(EndianSlice::new(section.unwrap_or_default(), LittleEndian))
    };
    Dwarf::load(section).and_then(Context::from_dwarf).expect("debug information")
}

/// Returns the module of `motor_hub` that a function belongs to, or a name for all functions of other crates.
fn module_of(function: &str) -> String {
    let ours = function.split("motor_hub::").nth(1).and_then(|path| path.split("::").next());
    ours.map_or_else(|| "other crates".to_owned(), str::to_owned)
}

/// `cargo test --test image report_of_the_hub -- --ignored --nocapture`: prints which functions and lines execute the
/// instructions of the whole hub, per motor and millisecond. Each motor has a control step every millisecond.
#[test]
#[ignore = "a report, not a test"]
fn report_of_the_hub() {
    const MILLISECONDS: u64 = 100;
    for configuration in Configuration::ALL {
        let image = elf::build(board().name(), elf::Variant::Period(1));
        let mut bench = crate::boot::at_speed(&image, configuration);
        let counts = bench.profile(ms(MILLISECONDS));
        println!("\n{configuration:?}, 1 ms: instructions per motor and ms");
        report(&image, bench.symbols(), &counts, 4.0 * MILLISECONDS as f64);
    }
}

/// Prints how often instructions ran, by several views, in multiples of `unit`.
fn report(image: &Path, symbols: &[Symbol], counts: &BTreeMap<u64, u64>, unit: f64) {
    let image = std::fs::read(image).expect("the image");
    let lines = source_lines(&image);
    let (mut by_module, mut by_symbol, mut by_function, mut by_line) =
        (BTreeMap::new(), BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    for (&address, &count) in counts {
        let place = symbols.partition_point(|s| s.address <= address).saturating_sub(1);
        *by_symbol.entry(symbols[place].name.clone()).or_insert(0) += count;
        let mut frames = lines.find_frames(address).skip_all_loads().expect("debug information");
        let mut named = None;
        while let Ok(Some(frame)) = frames.next() {
            let function = frame.function.as_ref().and_then(|f| f.raw_name().ok());
            let function = function.map(|name| format!("{:#}", rustc_demangle::demangle(&name)));
            let location = frame
                .location
                .map(|l| format!("{}:{}", l.file.unwrap_or("?"), l.line.unwrap_or(0)))
                .unwrap_or_default();
            let function = function.unwrap_or_default();
            // Of nested inlined functions, the innermost one of this project counts.
            let ours = !location.contains("/library/") && !location.contains("/registry/");
            if named.is_none() || ours {
                named = Some((function, location));
            }
            if ours {
                break;
            }
        }
        let (function, location) = named.unwrap_or_default();
        *by_module.entry(module_of(&function)).or_insert(0) += count;
        *by_function.entry(function).or_insert(0) += count;
        *by_line.entry(location).or_insert(0) += count;
    }
    for (title, table, at_least) in [
        ("by module", by_module, 1.0),
        ("by symbol", by_symbol, 1.0),
        ("by function", by_function, 4.0),
        ("by line", by_line, 6.0),
    ] {
        println!("  {title}");
        let mut rows: Vec<_> = table.into_iter().map(|(name, count)| (count as f64 / unit, name)).collect();
        rows.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (count, name) in rows.iter().filter(|row| row.0 >= at_least) {
            println!("    {count:7.1}  {name}");
        }
    }
}
