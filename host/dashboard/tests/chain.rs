//! The hubs of a chain, of which one is lost.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a failed access is a failed test")]

mod page;

use dashboard::Place;
use motor_hub::protocol::Address;
use page::Page;
use serde_json::json;
use simulated::scenario::Scenario;
use simulated::serve::{self, Hubs, LineFault};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

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
    let mut page = Page::new(Place::real("a chain", open));

    page.until("a battery", |message| message["battery_v"].as_f64() > Some(11.0));
    page.order(&json!({ "drive": { "motor": 0, "mode": "power", "value": 0.2 } }));
    page.order(&json!({ "enable": { "motor": 0, "on": true } }));
    page.order(&json!({ "hub": { "address": 3 } }));
    page.until("the child", |message| message["hubs"][1]["shown"] == true);
    // The parent is asked often enough that its keep-alive of 2.5 s does not end.
    let since = Instant::now();
    page.until("3 s", |_| since.elapsed().as_secs() >= 3);
    cut.store(true, Ordering::Relaxed);
    page.until("a notice", |message| {
        message["text"].as_str().is_some_and(|text| text.starts_with("hub 3 does not answer"))
    });
    let hubs = page.until("the parent", |message| message["hubs"][0]["shown"] == true);
    assert_eq!(hubs["hubs"][1]["lost"], true, "{hubs}");
    let frame = page.frame();
    assert_eq!(frame["motors"][0]["enabled"], true);
}
