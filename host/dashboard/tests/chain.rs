//! The hubs of a chain, of which one is lost.
#![expect(clippy::unwrap_used, reason = "a failed access is a failed test")]

mod memory;
mod page;

use dashboard::Place;
use motor_hub::protocol::Address;
use serde_json::json;
use simulated::scenario::Scenario;
use simulated::serve::{self, Hubs, LineFault};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

#[test]
#[ignore = "long: cargo xtask long"]
fn a_child_that_is_lost_while_it_is_shown_gives_way_to_the_parent_whose_motor_goes_on() {
    let line = serve::tcp("127.0.0.1:0").unwrap();
    let place = line.to_string();
    let cut = Arc::new(AtomicBool::new(false));
    let is_cut = Arc::clone(&cut);
    std::thread::spawn(move || {
        let hubs = Hubs::chain([2, 3].into_iter().filter_map(Address::new).collect());
        let chain = hubs.line.clone();
        serve::run(&Scenario::to_serve(), &hubs, line, None, &mut |_| (), &mut |_| {
            chain.set_fault(is_cut.load(Ordering::Relaxed).then_some(LineFault::Cut(1)));
            true
        })
    });
    let open = move |address| dashboard::hub::open(&place, address).map_err(|error| error.to_string());
    let mut page = memory::page(Place::new("a chain", open));

    page.until("a battery", |_, message| message["battery_v"].as_f64() > Some(11.0));
    page.enable(0);
    page.order("hub", json!({ "address": 3 }));
    page.shows(1);
    // The parent is asked often enough that its keep-alive of 2.5 s does not end.
    page.stay(Duration::from_secs(3));
    cut.store(true, Ordering::Relaxed);
    page.notice("hub 3 does not answer");
    let hubs = page.shows(0);
    assert_eq!(hubs["hubs"][1]["lost"], true, "{hubs}");
    page.message("frame");
    assert!(page.enabled(0));
}
