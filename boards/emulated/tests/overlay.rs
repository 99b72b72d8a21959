//! The flashed image on the emulated chip does what the same core does on the simulated board.

use emulated::emulate::{Overlay, scenario};

/// One count in a control period of 50 ms.
const ONE_COUNT_CPS: f64 = 20.0;

/// One sampling interval of the counters in a control period, of the highest speed asked for.
const SAMPLING_CPS: f64 = 2000.0 / 50.0;

/// The motor in regulated position, and the gain of its position loop, 1/s.
const ARM: usize = 2;
const POSITION_GAIN: f64 = 5.0;

#[test]
fn the_image_and_the_simulation_agree() {
    let overlay = Overlay::new(scenario().expect("a valid scenario"), &mut |_| ()).expect("both run");
    for (motor, apart) in overlay.apart().into_iter().enumerate() {
        println!("motor {motor}: {apart:?}");
        assert!(apart.worst_counts <= 40, "motor {motor}: {apart:?}");
        // In regulated position a difference in counts is one in speed.
        let position_cps = if motor == ARM { POSITION_GAIN * apart.worst_counts as f64 } else { 0.0 };
        let tolerance = ONE_COUNT_CPS + SAMPLING_CPS + position_cps;
        assert!(apart.worst_cps <= tolerance, "motor {motor}: {apart:?}");
        assert!(apart.rms_cps <= 1.5 * ONE_COUNT_CPS, "motor {motor}: {apart:?}");
    }
}
