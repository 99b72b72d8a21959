//! The flashed image on the emulated chip does what the same core does on the simulated board.

use emulated::emulate::{Overlay, on_a_line};
use simulated::scenario::Scenario;

/// One count in a control period of 50 ms.
const ONE_COUNT_CPS: f64 = 20.0;

#[test]
fn the_image_and_the_simulation_agree() {
    let overlay = Overlay::new(on_a_line(Scenario::default_one().expect("it is valid")), &mut |_| ())
        .expect("both run");
    for (motor, apart) in overlay.apart().into_iter().enumerate() {
        println!("motor {motor}: {apart:?}");
        assert!(apart.worst_cps <= ONE_COUNT_CPS, "motor {motor}: {apart:?}");
        assert!(apart.rms_cps <= 0.5 * ONE_COUNT_CPS, "motor {motor}: {apart:?}");
        assert!(apart.worst_counts <= 10, "motor {motor}: {apart:?}");
    }
}
