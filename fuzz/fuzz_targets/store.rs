//! Restores random bytes as stored settings. The checked property is that of `any_record_is_survived` in
//! `tests/responder/store.rs`. For any bytes nothing panics and no motor is enabled. The settings that are then in
//! force can be saved and restored again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use motor_hub::braking::Winding;
use motor_hub::extension::{HubFunction, Request};
use motor_hub::hub::{Command, Snapshot};
use motor_hub::motor::Settings;
use motor_hub::protocol::Address;
use motor_hub::responder::Responder;
use motor_hub::store::{Found, VERSION};
use motor_hub::units::Micros;

/// Returns a hub that has just been powered on with these stored settings, and the settings of its motors.
fn powered_on(found: Found) -> (Responder<4>, Vec<Settings>) {
    let mut responder = Responder::new(Address::DEFAULT, [Settings::new(Winding::NEVEREST_60); 4]);
    responder.restore(found);
    let mut settings = Vec::new();
    while let Some(command) = responder.pending() {
        let Command::Configure { settings: of, .. } = command else { panic!("a restore sends {command:?} instead of a configuration") };
        settings.push(of);
        responder.sent(settings.len() as u32);
    }
    assert_eq!((responder.enabled(), settings.len()), ([false; 4], 4));
    (responder, settings)
}

fuzz_target!(|copies: (Vec<u8>, Vec<u8>, bool)| {
    let (mut first, second, known) = copies;
    if let Some(version) = first.first_mut().filter(|_| known) {
        *version = VERSION;
    }
    let mut found = Found::default();
    found.add(Some(&first));
    found.add(Some(&second));
    let (mut responder, settings) = powered_on(found);

    let save = Request::from(HubFunction::Save);
    let packet = save.packet(responder.address().get(), 1, save.id());
    responder.receive(&packet, Micros::new(0), &Snapshot::INITIAL);
    let Some(saved) = responder.store_request(&Snapshot::INITIAL).and_then(|request| request.record) else { return };
    let mut again = Found::default();
    again.add(Some(saved.bytes()));
    again.add(Some(saved.bytes()));
    let (other, found_again) = powered_on(again);
    assert_eq!((other.address(), found_again), (responder.address(), settings));
});
