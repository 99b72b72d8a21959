//! Implements the command `motor-hub motors`.

use crate::output::{Failure, print, print_json};
use crate::parse::number;
use motor_hub::model::catalogue::{CatalogueEntry, Motor, catalogue};
use motor_hub::model::si::Volts;
use serde::Serialize;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use studies::{table, with_fields};

/// List the motors of the catalogue: names, counts, speeds, currents
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Battery voltage for speeds, currents and torques, 1 to 60 V
    #[arg(long, value_name = "V", default_value = "12", value_parser = number("a voltage", 1.0..=60.0, "V"))]
    volts: f64,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// Counts, free speed, stall current and stall torque of a motor's output shaft at a battery voltage. The JSON document
/// has these fields.
#[derive(Serialize)]
struct Figures {
    counts_per_turn_of_output: f64,
    free_speed_cps: f64,
    free_speed_rpm: f64,
    free_speed_rad_per_s: f64,
    stall_current_a: f64,
    stall_torque_nm: f64,
}

impl Figures {
    fn new(motor: &Motor, volts: f64) -> Self {
        let w = motor.free_speed(Volts(volts)).0;
        let free_speed_rad_per_s = w / motor.gear_ratio;
        Self {
            counts_per_turn_of_output: motor.counts_per_rev_output(),
            free_speed_cps: w * motor.counts_per_rev_motor / TAU,
            free_speed_rpm: 60.0 * free_speed_rad_per_s / TAU,
            free_speed_rad_per_s,
            stall_current_a: volts / motor.r.0,
            stall_torque_nm: motor.stall_torque(Volts(volts)).0 * motor.gear_ratio * motor.eta,
        }
    }
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let known = catalogue().iter().filter_map(|entry| Some((entry, entry.motor?)));
        let known = known.map(|(entry, motor)| (entry, motor, Figures::new(&motor, self.volts)));
        if self.json {
            let motors: Vec<Value> =
                known.map(|(entry, motor, figures)| document(entry, &motor, &figures)).collect();
            return print_json(&json!({ "volts": self.volts, "motors": motors }));
        }
        let headings = ["motor", "also", "counts", "counts/s", "rpm", "rad/s", "stall A", "N m"];
        let mut table = table::new(&headings, 2);
        for (entry, _, of) in known {
            table.add_row([
                entry.name.to_owned(),
                entry.aliases().collect::<Vec<_>>().join(", "),
                format!("{:.0}", of.counts_per_turn_of_output),
                format!("{:.0}", of.free_speed_cps),
                format!("{:.0}", of.free_speed_rpm),
                format!("{:.1}", of.free_speed_rad_per_s),
                format!("{:.1}", of.stall_current_a),
                format!("{:.1}", of.stall_torque_nm),
            ]);
        }
        print(&format!(
            "{table}\nOutput shaft at {} V: counts in a turn, free speed, stall current, stall torque.\n\
             Every name under \"also\" is accepted; case and spaces do not matter.\n\
             For a motor that is not listed: `client setup --ke-v-s-per-rad ..`,\n\
             or `constants` in a scenario.\n",
            self.volts
        ))
    }
}

fn document(entry: &CatalogueEntry, motor: &Motor, figures: &Figures) -> Value {
    let more = json!({
        "name": entry.name,
        "aliases": entry.aliases().collect::<Vec<_>>(),
        "gear_ratio": motor.gear_ratio,
        "ke_v_s_per_rad": motor.ke.0,
        "counts_per_rev": motor.counts_per_rev_motor,
        "resistance_ohm": motor.r.0,
        "inductance_mh": 1e3 * motor.l.0,
        "caveats": entry.caveats,
    });
    with_fields(json!(figures), more)
}
