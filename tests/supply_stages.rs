//! What the supply allows motors to do, by the voltage of the bus.

use motor_hub::supply::{Battery, BusState, Levels, Limits, Stage, Supply};
use motor_hub::units::{Micros, Millivolts, RangeError, Share};

/// A supply that is sampled every millisecond.
struct Sampled {
    supply: Supply,
    ms: u64,
}

impl Sampled {
    fn new() -> Self {
        Self { supply: Supply::new(Limits::default()), ms: 0 }
    }

    fn see(&mut self, mv: u16) -> Battery {
        self.ms += 1;
        self.supply.step(Some(Millivolts::new(mv)), Micros::new(1000 * self.ms)).expect("plausible")
    }

    /// Until the filter has followed, and what is derated has recovered.
    fn hold(&mut self, mv: u16) -> Battery {
        (0..2_000).map(|_| self.see(mv)).last().expect("seen")
    }
}

#[test]
fn the_filter_takes_as_long_however_often_it_is_stepped() {
    for interval in [1_000, 2_000, 10_000] {
        let mut supply = Supply::new(Limits::default());
        supply.step(Some(Millivolts::new(12_000)), Micros::new(0));
        let last = (1..=60_000 / interval)
            .filter_map(|n| supply.step(Some(Millivolts::new(10_000)), Micros::new(n * interval)))
            .last()
            .expect("plausible");
        let left = f64::from(last.voltage.get() - 10_000) / 2_000.0;
        // Two time constants of 30 ms and an interval.
        assert!((0.1..0.2).contains(&left), "{interval} us: {left}");
    }
}

#[test]
fn a_silence_is_not_bridged_whoever_was_silent() {
    let mut supply = Supply::new(Limits::default());
    supply.step(Some(Millivolts::new(12_600)), Micros::new(0));
    // The task itself was held up: nobody said that there was no reading.
    let battery = supply.step(Some(Millivolts::new(9_000)), Micros::new(10_000_000)).expect("plausible");
    assert_eq!(battery.voltage, Millivolts::new(9_000));
}

#[test]
fn a_battery_near_its_end_gives_ever_less_and_then_nothing() {
    let levels = [
        (12_000, Stage::Full, 1.0),
        (7_000, Stage::Full, 1.0),
        (6_500, Stage::Derated, 0.5),
        (6_000, Stage::Cut, 0.0),
    ];
    for (mv, stage, share) in levels {
        let battery = Sampled::new().hold(mv);
        assert_eq!(battery.stage, stage, "{mv} mV");
        assert!((battery.draw.to_f32() - share).abs() < 1e-3, "{mv} mV: {:?}", battery.draw);
    }
}

#[test]
fn a_low_battery_stays_low_until_it_has_recovered() {
    use Stage::{Derated, Full};
    let mut supply = Sampled::new();
    let stages = [7_050, 6_950, 7_050, 7_450, 7_500, 7_050].map(|mv| supply.hold(mv).stage);
    assert_eq!(stages, [Full, Derated, Derated, Derated, Full, Full]);
}

#[test]
fn what_is_cut_comes_back_where_derating_began_and_slowly() {
    let mut supply = Sampled::new();
    supply.hold(5_900);
    assert_eq!(supply.hold(6_950).stage, Stage::Cut, "without load a battery recovers");
    let shares: Vec<f32> = (0..1_200).map(|_| supply.see(7_400).draw.to_f32()).collect();
    let first = shares.iter().position(|&share| share > 0.0).expect("it comes back");
    assert!((0.45..0.55).contains(&shares[first + 500]), "half of it after half a second");
    assert!(shares.windows(2).all(|pair| pair[1] >= pair[0] && pair[1] - pair[0] < 2e-3), "without a step");
}

#[test]
fn a_sagging_battery_finds_a_share_that_it_can_give_and_does_not_flicker() {
    // 8 V behind a resistance at which the motors would take 3 V.
    let (mut supply, mut share) = (Sampled::new(), 1.0);
    supply.hold(8_000);
    let mut late = Vec::new();
    for ms in 0..8_000 {
        let battery = supply.see((8_000.0 - 3_000.0 * share) as u16);
        assert_ne!(battery.stage, Stage::Cut, "at {ms} ms");
        share = f64::from(battery.draw.to_f32());
        if ms > 4_000 {
            late.push(share);
        }
    }
    let (low, high) = late.iter().fold((f64::MAX, 0.0_f64), |(low, high), &s| (s.min(low), s.max(high)));
    assert!(low > 0.4 && high - low < 0.05, "{low} to {high}");
}

#[test]
fn a_bus_that_breaks_down_below_what_is_plausible_is_given_up_at_once_and_grows_old() {
    let mut supply = Supply::new(Limits::default());
    let mut see = |ms: u64, mv| supply.step(Some(Millivolts::new(mv)), Micros::new(1000 * ms));
    let before = see(10, 7_600).expect("plausible");
    assert_eq!(see(11, 4_700), None, "one may be a bad reading");
    let down = see(12, 4_700).expect("known");
    assert_eq!(down, Battery { stage: Stage::Derated, draw: Share::NONE, ..before });
    assert!(!down.is_fresh(Micros::new(111_000)));
    // Nothing is drawn, and it is back; nothing is bridged.
    let back = see(13, 7_400).expect("plausible");
    assert_eq!((back.voltage, back.stage), (Millivolts::new(7_400), Stage::Derated));
    assert!(back.draw < Share::from_f32(0.01), "{:?}", back.draw);
    let after_silence = {
        supply.step(None, Micros::new(14_000));
        supply.step(Some(Millivolts::new(4_700)), Micros::new(15_000))
    };
    assert_eq!(after_silence, None, "of what did not answer nothing is known");
}

#[test]
fn a_bus_need_not_be_looked_at_while_nothing_changes_for_the_motors() {
    let quiet = |mv: &[u16]| {
        let mut supply = Sampled::new();
        for mv in mv {
            supply.hold(*mv);
        }
        supply.supply.quiet().is_some()
    };
    for (mv, expected) in [
        (&[12_000][..], true),
        (&[7_100], true),
        (&[13_900], true),
        (&[14_100], false),
        (&[14_100, 13_900], true),
        (&[6_900], false),
        (&[6_900, 7_100], false),
        (&[6_900, 7_600], true),
    ] {
        assert_eq!(quiet(mv), expected, "{mv:?}");
    }
    assert_eq!(Supply::new(Limits::default()).quiet(), None);
}

#[test]
fn a_bus_that_was_too_high_is_burnt_for_a_while_however_low_it_is_and_is_quiet_then() {
    for mv in [13_900, 12_000] {
        let mut supply = Sampled::new();
        supply.see(14_100);
        for ms in 1..=60 {
            let burn = supply.see(mv).burn;
            assert_eq!(burn > Share::NONE, ms < 50, "{mv} mV, {ms} ms later");
            assert_eq!(supply.supply.quiet().is_some(), burn == Share::NONE, "{mv} mV, {ms} ms later");
        }
    }
}

#[test]
fn a_bus_that_leaves_the_quiet_voltages_has_only_just_done_so() {
    let mut supply = Supply::new(Limits::default());
    supply.step(Some(Millivolts::new(7_600)), Micros::new(0));
    let battery = supply.step(Some(Millivolts::new(5_000)), Micros::new(9_000)).expect("plausible");
    assert!(battery.voltage > Millivolts::new(7_500), "a millisecond of 30: {:?}", battery.voltage);
}

#[test]
fn a_rising_bus_is_burnt_from_the_lower_limit_on_and_fully_before_the_upper_one() {
    for (mv, some, all) in
        [(12_600, false, false), (14_000, false, false), (14_100, true, false), (15_000, true, true)]
    {
        let burn = Sampled::new().hold(mv).burn;
        assert_eq!((burn > Share::NONE, burn == Share::ALL), (some, all), "{mv} mV");
    }
    // 200 mV a millisecond: where it will be counts.
    let mut supply = Sampled::new();
    supply.see(13_700);
    assert!(supply.see(13_900).burn > Share::NONE);
}

#[test]
fn above_what_is_plausible_nothing_is_drawn_and_all_is_burnt() {
    for mv in [24_001, u16::MAX] {
        let Battery { voltage, stage, draw, burn, .. } = Sampled::new().hold(mv);
        assert_eq!((stage, draw, burn), (Stage::Cut, Share::NONE, Share::ALL), "{mv} mV");
        assert_eq!(voltage, Millivolts::new(24_000));
    }
}

#[test]
fn levels_that_do_not_ascend_are_refused() {
    let good = Limits::default().levels();
    assert!(Limits::new(good).is_ok());
    let v = Millivolts::new;
    let wrong = [
        Levels { min: v(6_001), ..good },
        Levels { cut: v(7_000), ..good },
        Levels { derate: v(7_501), ..good },
        Levels { recover: v(14_000), ..good },
        Levels { burn: v(15_500), ..good },
        Levels { burn_all: v(24_001), ..good },
        Levels { max: v(15_499), ..good },
    ];
    for levels in wrong {
        assert_eq!(Limits::new(levels), Err(RangeError::SupplyLevels), "{levels:?}");
    }
    assert!(RangeError::SupplyLevels.to_string().contains("min <= cut < derate"));
}

#[test]
fn the_bus_is_seen_in_one_of_its_ranges_whether_or_not_motors_may_run_on_it() {
    for (mv, state) in [
        (4_500, BusState::TooLow),
        (5_900, BusState::Cut),
        (6_500, BusState::Derated),
        (12_000, BusState::Quiet),
        (14_600, BusState::Burning),
        (15_600, BusState::TooHigh),
        (30_000, BusState::TooHigh),
    ] {
        let mut supply = Supply::new(Limits::default());
        for ms in 0..100 {
            supply.step(Some(Millivolts::new(mv)), Micros::new(1_000 * ms));
        }
        let seen = supply.seen();
        assert_eq!((seen.state, seen.measured), (state, Some(Millivolts::new(mv))), "{mv} mV");
        assert_eq!(seen.by(Micros::new(199_001)).state, BusState::Silent, "{mv} mV, long ago");
        supply.step(None, Micros::new(100_000));
        assert_eq!((supply.seen().state, supply.seen().measured), (BusState::Silent, None));
    }
}
