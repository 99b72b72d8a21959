//! `motor-hub emulate`: runs a scenario on an emulated chip and on the simulated board.

use crate::output::Failure;
use std::path::PathBuf;

/// Run a scenario on an emulated chip and on the simulated board, and compare the two
///
/// The emulated chip (nucleo-f429zi: STM32F427, nucleo-h743zi2: STM32H743) runs the board's unmodified image; its
/// pins drive the motors. The simulated board runs the same library. In the sources of this program the image is
/// built first if it is out of date; elsewhere give --image. Set-points take effect half a control period late,
/// because the line needs time.
#[derive(clap::Args)]
#[cfg_attr(not(feature = "emulated"), expect(dead_code, reason = "read only where there is an emulator"))]
pub(crate) struct Options {
    /// Scenario file (TOML) instead of the default scenario
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Board of the image: nucleo-f429zi or nucleo-h743zi2
    #[arg(long, value_name = "BOARD", default_value = "nucleo-f429zi")]
    board: String,
    /// ELF file of the image, instead of building one
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// Folder for the chart
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/emulate")]
    out: PathBuf,
}

impl Options {
    #[cfg(not(feature = "emulated"))]
    pub(crate) fn execute(self) -> Result<(), Failure> {
        Err(no_emulator("emulate"))
    }

    #[cfg(feature = "emulated")]
    pub(crate) fn execute(self) -> Result<(), Failure> {
        use crate::output::{Folder, drawn, print, print_paths, progress};
        use emulated::{Board, elf, replay};
        use simulated::scenario::Scenario;
        use simulated::sim;
        use studies::overlay::Overlay;

        let board: Board = self.board.parse().map_err(Failure::input)?;
        elf::choose(self.image.as_deref()).map_err(Failure::input)?;
        let scenario = match &self.scenario {
            Some(file) => Scenario::load(file),
            None => Scenario::default_one(),
        };
        let scenario = replay::on_a_line(scenario.map_err(Failure::input)?);
        let folder = Folder::new(&self.out)?;
        let bar = progress(Some((2000.0 * scenario.duration_s) as u64), "virtual ms");
        let at = |s: f64| bar.set_position((1000.0 * s) as u64);
        let emulated = replay::run(&scenario, board, &mut |s| at(s)).map_err(Failure::work)?;
        let simulated = sim::run(&scenario, &mut |s| at(scenario.duration_s + s)).map_err(Failure::work)?;
        bar.finish_and_clear();
        let overlay = Overlay::new(scenario, board.chip(), emulated, simulated);
        print(&overlay.tables())?;
        print_paths(&folder.write_all(drawn(&[("overlay".to_owned(), overlay.figure())]))?)
    }
}

/// Returns a failure that says how to build this program with the emulated chips.
#[cfg(not(feature = "emulated"))]
pub(crate) fn no_emulator(command: &str) -> Failure {
    Failure::Input(format!(
        "this program was built without the emulated chips, which take minutes to build; start it as\n    \
         cargo run --release --features emulated -- {command}"
    ))
}
