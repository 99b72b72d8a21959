//! Explains each fault number to users. The sections of `docs/reference/fault-numbers.md` have these texts.

use motor_hub::record::Fault;

/// Explanation of a fault. Names of commands, files and functions stand between backticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Explanation {
    /// Cause of the fault.
    pub means: &'static str,
    /// What the hub does, after the words "The hub".
    pub hub: &'static str,
    /// What the user should check, after the words "Look at".
    pub look_at: &'static str,
}

impl Explanation {
    /// Returns cause, reaction and check as three paragraphs without backticks.
    #[must_use]
    pub fn sentences(self) -> [String; 3] {
        let Self { means, hub, look_at } = self;
        [format!("Means. {means}"), format!("The hub {hub}"), format!("Look at {look_at}")]
            .map(|text| text.replace('`', ""))
    }
}

/// Returns the explanation of a fault or of a reset.
#[must_use]
pub const fn explanation(fault: Fault) -> Explanation {
    match fault {
        Fault::EncoderStale => Explanation {
            means: "A motor's counter could not be read for 20 ms while the motor had a set-point. On STM32 boards the \
                      counters are in the chip and always answer. There a task that samples too late looks like this \
                      fault.",
            hub: "opens the motor's bridge, or brakes the motor if it is set to brake. Constant power goes on. The \
                      motor obeys again once readings return.",
            look_at: "the `Encoders` implementation, if the board is your own. Check whether a task keeps the executor \
                      busy.",
        },
        Fault::EncoderStuck => Explanation {
            means: "A regulated motor was driven, released and driven the other way. No counts came though they were \
                      due.",
            hub: "opens that motor's bridge, or brakes the motor if it is set to brake, until it is disabled. Constant \
                      power goes on.",
            look_at: "the shaft first: something may hold it. Then turn the shaft by hand, with the motor disabled: \
                      `client watch` shows the position. If the position stays, check the encoder's plug, its supply, \
                      and A and B at the board's pins. If the position follows the hand, the shaft was held, or the \
                      motor had no power: check its leads and the bridge's fuse. In the recorded ticks the position \
                      stops while the voltage goes on.",
        },
        Fault::EncoderReversed => Explanation {
            means: "The counts went against the direction in which the motor was driven.",
            hub: "opens that motor's bridge, or brakes the motor if it is set to brake, until it is disabled. Constant \
                      power goes on.",
            look_at: "the load first: a load beyond the motor's stall torque turns the motor backwards. Then check the \
                      wiring without a load: at positive power the position must rise. If the position falls, either A \
                      and B or the motor's two leads are swapped: exchange one of the pairs.",
        },
        Fault::Overheated => Explanation {
            means: "By its current and its configured limit the winding got too hot, though the current was limited.",
            hub: "opens that motor's bridge, or brakes the motor if it is set to brake, until it has cooled down and \
                      is disabled.",
            look_at: "what blocks the motor. Check that the limit and the motor's constants belong to this motor (`client \
                      setup`). In the recorded ticks the speed is small and the duty large.",
        },
        Fault::BridgeOff => Explanation {
            means: "The bridge pulled its DIAG line low: too hot, too much current, or a short circuit.",
            hub: "opens that motor's bridge until the motor is disabled.",
            look_at: "the motor's leads for a short circuit, at the bridge's heat sink, and at the load.",
        },
        Fault::BatteryUnknown => Explanation {
            means: "There was no plausible voltage for 100 ms. Either the converter does not answer, or the battery is \
                      below the bridges' working range. All motors share one battery, so this is one entry for all. It \
                      names the first motor.",
            hub: "lets all motors coast until the battery voltage is known again.",
            look_at: "the battery, its switch, its fuse, and the divider to the converter's pin. A large duty in the ticks \
                      just before points to a battery that broke down under its load.",
        },
        Fault::Watchdog => Explanation {
            means: "For half a second not every task had checked in, and no fault handler had run. Either a task hung, \
                      or the core was locked up. A stack that jumps over its guard locks up the core.",
            hub: "was reset, which opens all bridges.",
            look_at: "the log up to the reset (`cargo xtask flash` shows it). In code of your own, look for loops without \
                      `await`.",
        },
        Fault::HardFault => Explanation {
            means: "The bus refused an access, or the core met an invalid instruction, or similar. The details give the \
                      address of the instruction, and the address from which the function was called.",
            hub: "opened all bridges immediately. The watchdog then restarted it.",
            look_at: "the line of the source: `llvm-addr2line -e target/thumbv7em-none-eabihf/firmware/nucleo-f429zi \
                      0x08001234`.",
        },
        Fault::StackOverflow => Explanation {
            means: "The stack grew into its guard. The detail gives the lowest address that it reached.",
            hub: "opened all bridges immediately. The watchdog then restarted it.",
            look_at: "large variables in functions of your own, at recursion, and at the length of `STACK` in the board's \
                      `build.rs`.",
        },
        Fault::Panic => Explanation {
            means: "The code stopped at a condition that must not occur. The details are line and column. The log has \
                      the file and the message.",
            hub: "opened all bridges immediately. The watchdog then restarted it.",
            look_at: "that line. The library has nothing that panics. A board's `main` and drivers may panic.",
        },
        Fault::SupplyFell => Explanation {
            means: "The 3.3 V supply fell below what the chip needs to compute correctly, and came back.",
            hub: "opened all bridges immediately. The watchdog then restarted it.",
            look_at: "the 5 V converter and its wires. Check that it bridges the dips of the battery when motors start.",
        },
        Fault::UnhandledInterrupt => Explanation {
            means: "An interrupt had no handler. The detail is its number, of 16 bits. Negative numbers are exceptions \
                      of the core.",
            hub: "opened all bridges immediately. The watchdog then restarted it.",
            look_at: "`bind_interrupts!` in the board's `main`.",
        },
        Fault::PowerOn => Explanation {
            means: "The supply was gone for such a short time that the memory kept its content. After a longer time \
                      without supply there is no record. On the NUCLEO-G474RE this is a brown-out too: its chip has one \
                      flag for both.",
            hub: "started again. Its motors coasted from the moment the supply went.",
            look_at: "plugs and switches that bounce.",
        },
        Fault::ResetPin => Explanation {
            means: "The reset button, a debugger or a probe reset the chip.",
            hub: "started again. Its motors coasted.",
            look_at: "nothing, if it was you. Long wires on the reset line pick up what the bridges switch.",
        },
        Fault::SoftwareReset => Explanation {
            means: "The core requested the reset. A debugger does this when it flashes, and an update does it to start \
                      new firmware.",
            hub: "started again. Its motors coasted.",
            look_at: "which debugger or host was connected.",
        },
        Fault::BrownOut => Explanation {
            means: "The supply fell below the level of the chip's brown-out reset.",
            hub: "started again. Its motors coasted.",
            look_at: "the parts named under 20.",
        },
        Fault::OtherReset => Explanation {
            means: "Another reset of the chip: the window watchdog, low power, or a reset without a flag.",
            hub: "started again. Its motors coasted.",
            look_at: "the reset causes in the chip's reference manual.",
        },
    }
}
