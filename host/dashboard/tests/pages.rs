//! Which page is in control, and when a page counts as gone.
#![expect(clippy::unwrap_used, reason = "a failed access is a failed test")]

use dashboard::pages::{Gone, HIDDEN, Pages, SILENCE};
use std::time::{Duration, Instant};

const MS: Duration = Duration::from_millis(1);

/// Pages, with page 1 in control, and the present time.
fn pages() -> (Pages, Instant) {
    let (mut pages, now) = (Pages::new(), Instant::now());
    pages.join(1, now);
    assert_eq!(pages.controller(), Some(1));
    (pages, now)
}

/// Sends frames every 20 ms for a time; page 1 shows each frame after a delay.
fn watch(pages: &mut Pages, from: Instant, length: Duration, late: usize) -> Option<(Gone, Duration)> {
    let frames = length.as_millis() as usize / 20;
    for frame in 0..frames {
        let now = from + 20 * frame as u32 * MS;
        pages.sent(frame as u64, now);
        if let Some(shown) = frame.checked_sub(late) {
            pages.shown(1, shown as u64);
        }
        if let Some(gone) = pages.review(now) {
            return Some((gone, now - from));
        }
    }
    None
}

#[test]
fn a_page_that_shows_frames_as_they_come_stays_in_control() {
    let (mut pages, now) = pages();
    assert_eq!(watch(&mut pages, now, 60 * SILENCE, 0), None);
    assert_eq!(pages.controller(), Some(1));
}

#[test]
fn a_page_that_is_fed_from_a_long_queue_is_gone_though_it_shows_something_all_the_time() {
    let (mut ok, now) = pages();
    assert_eq!(watch(&mut ok, now, 10 * SILENCE, 45), None, "0.9 s late");
    let (mut late, now) = pages();
    assert_eq!(watch(&mut late, now, 10 * SILENCE, 55).unwrap().0, Gone::Silent, "1.1 s late");
    assert_eq!(late.controller(), None);
}

#[test]
fn silence_is_counted_from_the_first_frame_that_was_not_shown_and_reported_once() {
    let (mut pages, now) = pages();
    pages.sent(1, now + MS);
    pages.sent(2, now + 500 * MS);
    pages.shown(1, 2);
    // An older frame shown later has no effect.
    pages.shown(1, 1);
    // A hub that does not answer has no new values to show.
    assert_eq!(pages.review(now + 60 * SILENCE), None);
    let back = now + 60 * SILENCE;
    pages.sent(3, back);
    pages.sent(4, back + 500 * MS);
    assert_eq!(pages.review(back + SILENCE), None);
    assert_eq!(pages.review(back + SILENCE + MS), Some(Gone::Silent));
    assert_eq!(pages.review(back + 2 * SILENCE), None);
}

#[test]
fn frames_that_were_never_sent_or_not_to_this_page_prove_nothing() {
    let (mut pages, now) = pages();
    pages.join(2, now);
    pages.sent(1, now + 900 * MS);
    pages.shown(1, 7);
    pages.shown(2, 1);
    pages.shown(3, 1);
    assert_eq!(pages.review(now + 901 * MS + SILENCE), Some(Gone::Silent));
}

#[test]
fn a_hidden_page_counts_as_gone_after_10_s_unless_it_is_visible_again() {
    let (mut pages, start) = pages();
    let at = |hidden: bool, after: Duration, pages: &mut Pages| {
        let now = start + after;
        pages.sent(after.as_millis() as u64, now);
        pages.shown(1, after.as_millis() as u64);
        pages.hide(1, hidden, now);
        pages.review(now)
    };
    assert_eq!(at(true, MS, &mut pages), None);
    assert_eq!(at(false, HIDDEN, &mut pages), None);
    assert_eq!(at(true, 2 * HIDDEN, &mut pages), None);
    assert_eq!(at(true, 3 * HIDDEN, &mut pages), None);
    assert_eq!(at(true, 3 * HIDDEN + MS, &mut pages), Some(Gone::Hidden));
}

#[test]
fn free_control_is_taken_and_control_of_another_page_is_asked_for() {
    let (mut pages, now) = pages();
    pages.join(2, now);
    pages.join(3, now);
    assert_eq!((pages.controller(), pages.count()), (Some(1), 3), "who comes later looks on");
    assert!(!pages.take(1, now));
    assert_eq!(pages.controller(), Some(1));
    assert!(pages.take(2, now), "another page is in control");
    assert!(pages.take(3, now), "another page is in control");
    assert_eq!((pages.controller(), pages.asks()), (Some(1), Some(3)));
    assert!(!pages.release(2), "it is not in control");
    assert!(pages.release(1));
    assert_eq!((pages.controller(), pages.asks()), (Some(3), None), "who has asked last gets it");
    assert!(pages.take(2, now), "another page is in control");
    assert_eq!(pages.leave(2), None, "it was not in control");
    assert_eq!(pages.asks(), None, "it is gone");
    assert!(pages.release(3));
    assert!(!pages.take(1, now));
    assert_eq!(pages.controller(), Some(1));
    assert!(pages.take(3, now), "another page is in control");
    assert_eq!(pages.leave(1), Some(Gone::Closed));
    assert_eq!((pages.controller(), pages.asks()), (None, None), "a page that is gone gives nothing");
    assert!(!pages.take(9, now), "there is no such page");
    assert_eq!(pages.controller(), None);
}

#[test]
fn a_page_that_gets_control_must_show_frames_like_any_other() {
    let (mut pages, now) = pages();
    pages.join(2, now);
    assert!(pages.take(2, now), "another page is in control");
    assert!(pages.release(1));
    pages.sent(1, now + MS);
    assert_eq!(pages.review(now + SILENCE + 2 * MS), Some(Gone::Silent));
}

#[test]
fn a_page_that_takes_control_counts_as_just_shown() {
    let (mut pages, now) = pages();
    pages.release(1);
    pages.sent(1, now + MS);
    let later = now + 60 * SILENCE;
    assert!(!pages.take(1, later));
    assert_eq!(pages.controller(), Some(1));
    pages.sent(2, later + MS);
    assert_eq!(pages.review(later + SILENCE + MS), None);
    assert_eq!(pages.review(later + SILENCE + 2 * MS), Some(Gone::Silent));
}
