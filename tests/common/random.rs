//! Random bytes, and settings that are read from them.

use motor_hub::braking::Winding;
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::motor::Settings;
use motor_hub::protocol::payload::Fields;
use proptest::prelude::*;

/// Bytes of fields. Codes and small numbers are frequent.
pub(crate) fn bytes(length: usize) -> impl Strategy<Value = Vec<u8>> {
    let byte = |random: u32| {
        let [kind, byte, ..] = random.to_le_bytes();
        match kind % 9 {
            0..2 => byte % 2,
            2..4 => byte % 4,
            4 => byte % 16,
            5 => 0,
            6 => u8::MAX,
            _ => byte,
        }
    };
    Just(()).prop_perturb(move |(), mut random| (0..length).map(|_| byte(random.next_u32())).collect())
}

/// Any settings, as read from random bytes of each group.
pub(crate) fn any_settings() -> impl Strategy<Value = MotorSettings> {
    let default = MotorSettings::new(Settings::new(Winding::NEVEREST_60));
    let groups = Group::ALL.map(|group| {
        let values = move |bytes: Vec<u8>| Values::read(group, &mut Fields::new(&bytes)).ok();
        let fits = move |values: &Values| values.apply_to(&default).is_ok();
        let length = group.fields().iter().map(|field| field.size).sum();
        bytes(length).prop_filter_map("values in range", move |bytes| values(bytes).filter(fits)).boxed()
    });
    groups.to_vec().prop_map(move |groups| {
        let apply = |settings, values: Values| values.apply_to(&settings).expect("values that go together");
        groups.into_iter().fold(default, apply)
    })
}
