//! The survey as text: the result first, then the tables.

use super::bare_motors::{self, BareMotor};
use super::reference::{self, Figure, Row};
use super::{Kind, Knowledge, Response, Results, Survey, Verdict};
use crate::page::Page;
use crate::table::{self, Table};
use motor_hub::braking::DutyRule;
use simulated::scheme::describe;

impl Results {
    /// The result in a sentence, then the tables of every part with this many of the worst responses.
    pub fn page(&self, worst: usize) -> Page {
        let mut page = Page::new(headline(self));
        if let Some(rows) = &self.reference {
            reference(&mut page, rows);
        }
        if let Some(cells) = &self.cells {
            bare_motors(&mut page, cells);
        }
        if let Some(survey) = &self.survey {
            random(&mut page, survey, worst);
        }
        page
    }
}

/// How many responses settle configured exactly, and not configured.
fn headline(results: &Results) -> String {
    let mut settled_of = Vec::new();
    let mut add = |what: &str, verdicts: [Vec<&Verdict>; 2]| {
        let settled = verdicts.each_ref().map(|of| of.iter().filter(|v| v.settling_s.is_some()).count());
        let all = table::grouped(verdicts[0].len());
        let [configured, unknown] = settled.map(table::grouped);
        settled_of.push(format!("{configured} of {all} {what} (not configured: {unknown})"));
    };
    if let Some(rows) = &results.reference {
        let rows = || rows.iter().filter(|row| row.figure == Figure::Settling);
        let of = |verdicts: fn(&Row) -> &[Verdict]| rows().flat_map(verdicts).collect();
        add("reference responses", [of(|row| &row.configured), of(|row| &row.unknown)]);
    }
    if let Some(cells) = &results.cells {
        let of =
            |verdicts: fn(&BareMotor) -> &[[Verdict; 2]]| cells.iter().flat_map(verdicts).flatten().collect();
        add("responses of bare motors", [of(|cell| &cell.configured), of(|cell| &cell.unknown)]);
    }
    if let Some(Survey { responses, .. }) = &results.survey {
        let of = |knowledge| all(responses, knowledge).into_iter().map(|(_, verdict)| verdict).collect();
        add("random responses", [of(Knowledge::EXACT), of(Knowledge::UNKNOWN)]);
    }
    format!("Configured exactly, the hub settles {}.", settled_of.join(", "))
}

/// The tasks of the reference: at 50 ms, then at all periods configured exactly and not configured.
fn reference(page: &mut Page, rows: &[Row]) {
    let compared = reference::PERIODS.iter().position(|ms| *ms == COMPARED_MS);
    let mut table = table::new(&["task", "reference", "configured exactly", "not configured"], 1);
    for row in rows {
        let of = |configured| compared.and_then(|index| cell(row, configured, index)).unwrap_or_default();
        table.add_row([row.name.clone(), row.reference.to_owned(), of(true), of(false)]);
    }
    page.table(&format!("Reference tasks, control period {COMPARED_MS} ms"), table);
    page.text(
        "Settling in s / largest error beyond the set-point in % of the step, or after a torque in % of the speed. \
         Two settling times are of a change at a tick, and of a change 1 ms after a tick, which the hub acts on a period \
         later. A last error is in counts; an rms error is in % of the speed; the heading error of a drive base is in \
         degrees, the largest on the way.",
    );
    let slower: Vec<String> = rows.iter().filter_map(where_configured_is_slower).collect();
    page.text(&if slower.is_empty() {
        "A configured motor settles at least as soon as an unknown one at every task and period.".to_owned()
    } else {
        format!(
            "A configured motor settles later than an unknown one by more than {LATER_S} s at: {}.",
            slower.join("; ")
        )
    });
    page.table("Reference tasks, configured exactly", by_period(rows, true));
    page.table("Reference tasks, not configured", by_period(rows, false));
}

/// The reference's own control period in milliseconds.
const COMPARED_MS: u32 = 50;

/// Largest difference of two settling times, in seconds, that counts as none.
const LATER_S: f64 = 0.01;

/// Names a task, with the periods at which a configured motor settles later than an unknown one, or does not settle
/// although the unknown one does. `None` if there is no such period.
fn where_configured_is_slower(row: &Row) -> Option<String> {
    if row.figure != Figure::Settling {
        return None;
    }
    let slower = |configured: &Verdict, unknown: &Verdict| match (configured.settling_s, unknown.settling_s) {
        (Some(configured), Some(unknown)) => configured > unknown + LATER_S,
        (configured, unknown) => configured.is_none() && unknown.is_some(),
    };
    let periods = reference::PERIODS.iter().zip(row.configured.iter().zip(&row.unknown));
    let periods: Vec<String> = periods
        .filter(|(_, (configured, unknown))| slower(configured, unknown))
        .map(|(ms, _)| format!("{ms} ms"))
        .collect();
    (!periods.is_empty()).then(|| format!("{} ({})", row.name, periods.join(", ")))
}

fn by_period(rows: &[Row], configured: bool) -> Table {
    let periods = reference::PERIODS.map(|ms| format!("{ms} ms"));
    let mut table = table::new(["task".to_owned()].into_iter().chain(periods), 1);
    for row in rows {
        let figures =
            (0..reference::PERIODS.len()).map(|index| cell(row, configured, index).unwrap_or_default());
        table.add_row([row.name.clone()].into_iter().chain(figures));
    }
    table
}

/// The figure of a task at the period of this index; `None` if there is none.
fn cell(row: &Row, configured: bool, index: usize) -> Option<String> {
    let (verdicts, late, degrees) = if configured {
        (&row.configured, &row.configured_late, &row.configured_degrees)
    } else {
        (&row.unknown, &row.unknown_late, &row.unknown_degrees)
    };
    if row.figure == Figure::Heading {
        return degrees.get(index).map(|degrees| format!("{degrees:.2}"));
    }
    let verdict = verdicts.get(index)?;
    let all = || [Some(verdict), late.get(index)].into_iter().flatten();
    if all().any(|verdict| verdict.fault) {
        return Some("fault".to_owned());
    }
    Some(match row.figure {
        Figure::Settling => {
            let settling =
                |verdict: &Verdict| verdict.settling_s.map_or("never".to_owned(), |s| format!("{s:.3}"));
            let mut times: Vec<String> = all().map(settling).collect();
            times.dedup();
            let beyond = all().filter_map(|verdict| verdict.beyond_percent).reduce(f64::max);
            format!("{}/{}", times.join(" to "), number(beyond, 1))
        }
        Figure::Offset => format!("{:.1}", verdict.last_error.abs()),
        Figure::Rms => format!("{:.1} %", 100.0 * verdict.last_rms / row.speed),
        Figure::Heading => return None,
    })
}

/// The motors without a load that do not settle.
fn bare_motors(page: &mut Page, cells: &[BareMotor]) {
    let mut table = table::new(&["configuration", "motor", "mode", "period", "responses"], 5);
    let mut failed = 0;
    for cell in cells {
        for (knowledge, all) in [(Knowledge::EXACT, &cell.configured), (Knowledge::UNKNOWN, &cell.unknown)] {
            for (ms, verdicts) in bare_motors::PERIODS.iter().zip(all) {
                if verdicts.iter().all(|verdict| verdict.settling_s.is_some()) {
                    continue;
                }
                failed += usize::from(knowledge == Knowledge::EXACT);
                table.add_row([
                    knowledge.name.to_owned(),
                    format!("{}{}", cell.motor, if cell.paper_inertia { ", paper's inertia" } else { "" }),
                    cell.mode.to_owned(),
                    format!("{ms} ms"),
                    verdicts.map(|verdict| in_short(&verdict)).join(", "),
                ]);
            }
        }
    }
    let all = cells.len() * bare_motors::PERIODS.len();
    page.table("Bare motors that do not settle", table);
    page.text(&format!(
        "With default settings {} of {all} settle configured exactly. A response: settling time [lowest and highest error in \
         the last second, counts/s or counts].",
        all - failed
    ));
}

fn in_short(verdict: &Verdict) -> String {
    let (low, high) = verdict.last_swing;
    let settling = table::seconds(verdict.settling_s);
    let fault = if verdict.fault { " fault" } else { "" };
    let stalled = if verdict.stalled { " stalled" } else { "" };
    format!("{settling} [{low:+.1} {high:+.1}]{fault}{stalled}")
}

/// The random scenarios: all responses, then which never settle, then the worst.
fn random(page: &mut Page, survey: &Survey, worst: usize) {
    let Survey { seed, scenarios, total_responses, responses } = survey;
    page.table("Random scenarios", summary(responses));
    page.text(&format!(
        "Seed {seed}, {scenarios} scenarios, {total_responses} responses; the {} that can be settled are counted. Beyond: largest \
         error beyond the set-point, in % of the step. p90: nine of ten responses are below.",
        responses.len()
    ));
    let mut add = |by: &str, of: &dyn Fn(&Response) -> (usize, String)| {
        page.table(
            &format!("Random responses that never settle, in %, by {by}"),
            breakdown(by, responses, of),
        );
    };
    add("kind", &|response| (response.kind as usize, format!("{:?}", response.kind).to_lowercase()));
    add("dry friction", &|response| match response.friction_percent {
        0.0 => (0, "no friction".to_owned()),
        percent if percent < 5.0 => (1, "below 5 % of the stall torque".to_owned()),
        _ => (2, "5 to 10 % of the stall torque".to_owned()),
    });
    add("control period", &|response| {
        let (rank, range) = match response.period_ms {
            0..3 => (0, "1 to 2 ms"),
            3..10 => (1, "3 to 9 ms"),
            10..30 => (2, "10 to 29 ms"),
            30..60 => (3, "30 to 59 ms"),
            _ => (4, "60 to 100 ms"),
        };
        (rank, range.to_owned())
    });
    add("scheme", &|response| (0, describe(response.scheme.0)));
    add("duty rule", &|response| match response.duty {
        DutyRule::LinearDuty => (0, "linear duty".to_owned()),
        DutyRule::LinearCurrent => (1, "linear current".to_owned()),
    });
    for knowledge in Knowledge::OF_MOTION {
        let caption = format!("The worst random responses, {}", knowledge.name);
        page.table(&caption, the_worst(knowledge, responses, worst));
    }
}

type Answer<'a> = (&'a Response, &'a Verdict);

fn all<'a>(responses: impl IntoIterator<Item = &'a Response>, knowledge: Knowledge) -> Vec<Answer<'a>> {
    responses.into_iter().filter_map(|response| Some((response, response.verdict(knowledge)?))).collect()
}

fn percent(part: usize, whole: usize) -> String {
    format!("{:.1}", 100.0 * part as f64 / whole.max(1) as f64)
}

fn never(answers: &[Answer<'_>]) -> String {
    let never = answers.iter().filter(|(_, verdict)| verdict.settling_s.is_none()).count();
    percent(never, answers.len())
}

/// The value below which this share of the values lies; `None` if there are no values.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let index = (share * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(index).copied()
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

fn summary(responses: &[Response]) -> Table {
    let count = |answers: &[Answer<'_>], test: fn(&Verdict) -> bool| {
        answers.iter().filter(|(_, verdict)| test(verdict)).count()
    };
    let settling = |answers: &[Answer<'_>], share| {
        let times = answers.iter().map(|(_, verdict)| verdict.settling_s.unwrap_or(f64::INFINITY));
        quantile(times.collect(), share)
    };
    let beyond = |answers: &[Answer<'_>], load, share| {
        let chosen = answers.iter().filter(|(response, _)| (response.kind == Kind::Load) == load);
        quantile(chosen.filter_map(|(_, verdict)| verdict.beyond_percent).collect(), share)
    };
    // Without any response there is no time, not even "never".
    let time = |value: Option<f64>| value.map_or("-".to_owned(), |s| table::seconds(Some(s)));
    table::of(
        Knowledge::ALL.map(|knowledge| (knowledge, all(responses, knowledge))),
        1,
        &[
            ("configuration", &|(knowledge, _)| knowledge.name.to_owned()),
            ("never settled, %", &|(_, answers)| never(answers)),
            ("swings, %", &|(_, answers)| percent(count(answers, |verdict| verdict.cycles), answers.len())),
            ("settling, median / p90", &|(_, answers)| {
                [0.5, 0.9].map(|share| time(settling(answers, share))).join(" / ")
            }),
            ("beyond, median / p90, %", &|(_, answers)| {
                [0.5, 0.9].map(|share| number(beyond(answers, false, share), 1)).join(" / ")
            }),
            ("load peak, p90, %", &|(_, answers)| number(beyond(answers, true, 0.9), 0)),
            ("positions never settled, %", &|(_, answers)| {
                let position = |(response, _): &&Answer<'_>| response.kind == Kind::Position;
                never(&answers.iter().filter(position).copied().collect::<Vec<_>>())
            }),
            ("faults", &|(_, answers)| count(answers, |verdict| verdict.fault).to_string()),
        ],
    )
}

/// A table of the percentage of responses that never settle, by a property of the responses. `of` gives the rank of the
/// property in the table, and its text.
fn breakdown(title: &str, responses: &[Response], of: impl Fn(&Response) -> (usize, String)) -> Table {
    let mut values: Vec<(usize, String)> = responses.iter().map(&of).collect();
    values.sort();
    values.dedup();
    let names = Knowledge::OF_MOTION.map(|knowledge| knowledge.name);
    let mut table = table::new([title, "responses"].into_iter().chain(names), 1);
    for value in values {
        let matching: Vec<&Response> = responses.iter().filter(|response| of(response) == value).collect();
        let shares = Knowledge::OF_MOTION.map(|knowledge| never(&all(matching.iter().copied(), knowledge)));
        table.add_row([value.1, matching.len().to_string()].into_iter().chain(shares));
    }
    table
}

/// The responses that never settle or that swing, then the responses with the largest error beyond the set-point.
fn the_worst(knowledge: Knowledge, responses: &[Response], worst: usize) -> Table {
    let mut answers = all(responses, knowledge);
    // Responses that do not settle come first.
    let rank = |verdict: &Verdict| {
        let unsettled = verdict.settling_s.is_none();
        (u8::from(unsettled) + u8::from(verdict.cycles), verdict.beyond_percent.unwrap_or(0.0))
    };
    answers.retain(|(response, verdict)| response.kind != Kind::Load || rank(verdict).0 > 0);
    answers.sort_by(|(_, a), (_, b)| {
        let (a, b) = (rank(a), rank(b));
        b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
    });
    let headings =
        ["scenario", "motor", "at", "response", "circumstances", "settling [last swing]", "beyond, %"];
    let mut table = table::new(&headings, 5);
    for (response, verdict) in answers.into_iter().take(worst) {
        table.add_row([
            response.scenario.to_string(),
            response.motor.to_string(),
            format!("{:.3} s", response.at_s),
            response.what.clone(),
            response.circumstances.clone(),
            in_short(verdict),
            number(verdict.beyond_percent, 1),
        ]);
    }
    table
}
