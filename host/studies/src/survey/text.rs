//! The survey as tables for people.

use super::cells::{self, Cell};
use super::reference::{self, Figure, Row};
use super::{Kind, Knowledge, Response, Survey, Verdict};
use crate::table;
use motor_hub::braking::DutyRule;
use simulated::scheme::describe;

/// The reference's tasks: by the model, and by PID.
pub fn reference(rows: &[Row]) -> String {
    let one = |title: &str, verdicts: fn(&Row) -> &[Verdict]| {
        let periods = reference::PERIODS.map(|ms| format!("{ms} ms"));
        let headings: Vec<&str> =
            ["task", "reference, 50 ms"].into_iter().chain(periods.iter().map(String::as_str)).collect();
        let mut table = table::new(&headings, 1);
        for row in rows {
            let cells = verdicts(row).iter().map(|verdict| figure(row, verdict));
            table.add_row([row.name.clone(), row.reference.to_owned()].into_iter().chain(cells));
        }
        format!("{title}\n{table}\n")
    };
    format!(
        "{}\n{}\nSettling in s / beyond in % of the step, after a torque in % of the speed.\n",
        one("By the model, told exactly", |row| &row.model),
        one("By PID, told nothing", |row| &row.pid)
    )
}

fn figure(row: &Row, verdict: &Verdict) -> String {
    if verdict.fault {
        return "fault".to_owned();
    }
    match row.figure {
        Figure::Settling => {
            let settling = verdict.settling_s.map_or("never".to_owned(), |s| format!("{s:.3}"));
            let beyond = verdict.beyond_percent.map_or("-".to_owned(), |percent| format!("{percent:.1}"));
            format!("{settling}/{beyond}")
        }
        Figure::Offset => format!("{:.1}", verdict.last_error.abs()),
        Figure::Rms => format!("{:.1} %", 100.0 * verdict.last_rms / row.speed),
    }
}

/// Every motor without a load.
pub fn cells(cells: &[Cell]) -> String {
    let mut table = table::new(&["regulator", "motor", "mode", "period", "responses"], 5);
    let mut failed = 0;
    for cell in cells {
        for (regulator, all) in [("model", &cell.model), ("PID", &cell.pid)] {
            for (ms, verdicts) in cells::PERIODS.iter().zip(all) {
                if verdicts.iter().all(|verdict| verdict.settling_s.is_some()) {
                    continue;
                }
                failed += usize::from(regulator == "model");
                table.add_row([
                    regulator.to_owned(),
                    format!("{}{}", cell.motor, if cell.paper_inertia { ", paper's inertia" } else { "" }),
                    cell.mode.to_owned(),
                    format!("{ms} ms"),
                    verdicts.map(|verdict| in_short(&verdict)).join(", "),
                ]);
            }
        }
    }
    let all = cells.len() * cells::PERIODS.len();
    let settle = format!(
        "Bare motors, default settings: {} of {all} settle by the model. What does not, by the model or by PID:",
        all - failed
    );
    format!("{}\n{table}\n", table::paragraph(&settle))
}

fn in_short(verdict: &Verdict) -> String {
    let (low, high) = verdict.last_swing;
    let settling = verdict.settling_s.map_or("never".to_owned(), |s| format!("{s:.2} s"));
    let fault = if verdict.fault { " fault" } else { "" };
    let stalled = if verdict.stalled { " stalled" } else { "" };
    format!("{settling} [{low:+.1} {high:+.1}]{fault}{stalled}")
}

/// The drawn scenarios: figures by what was told, then where failures lie, then the worst.
pub fn survey(survey: &Survey, worst: usize) -> String {
    let Survey { seed, scenarios, asked, responses } = survey;
    let headings = [
        "",
        "never %",
        "cycles %",
        "settling median",
        "p90",
        "beyond median %",
        "p90",
        "load peak p90 %",
        "positions never %",
        "faults",
    ];
    let mut table = table::new(&headings, 1);
    for (index, knowledge) in Knowledge::ALL.into_iter().enumerate() {
        table.add_row(summary(knowledge, &all(responses, index)));
    }
    let mut out = format!(
        "Seed {seed}, {scenarios} scenarios, {asked} responses, of which {} can be settled.\n{table}\n",
        responses.len()
    );
    out.push_str(&breakdown("by kind", responses, |response| format!("{:?}", response.kind).to_lowercase()));
    out.push_str(&breakdown("by dry friction", responses, |response| {
        match response.friction_percent {
            0.0 => "  none",
            percent if percent < 5.0 => " below 5 % of the stall torque",
            _ => "5 to 10 % of the stall torque",
        }
        .to_owned()
    }));
    out.push_str(&breakdown("by period", responses, |response| {
        match response.period_ms {
            0..3 => "  1 to 2 ms",
            3..10 => "  3 to 9 ms",
            10..30 => " 10 to 29 ms",
            30..60 => " 30 to 59 ms",
            _ => " 60 to 100 ms",
        }
        .to_owned()
    }));
    out.push_str(&breakdown("by scheme", responses, |response| describe(response.scheme.0)));
    out.push_str(&breakdown("by duty rule", responses, |response| {
        match response.duty {
            DutyRule::LinearDuty => "linear duty",
            DutyRule::LinearCurrent => "linear current",
        }
        .to_owned()
    }));
    for (index, knowledge) in Knowledge::ALL.into_iter().enumerate() {
        out.push_str(&list(knowledge, index, responses, worst));
    }
    out
}

type Answer<'a> = (&'a Response, &'a Verdict);

fn all(responses: &[Response], index: usize) -> Vec<Answer<'_>> {
    responses.iter().filter_map(|response| Some((response, response.verdicts.get(index)?))).collect()
}

fn percent(part: usize, whole: usize) -> String {
    format!("{:.1}", 100.0 * part as f64 / whole.max(1) as f64)
}

fn never(answers: &[Answer<'_>]) -> String {
    let never = answers.iter().filter(|(_, verdict)| verdict.settling_s.is_none()).count();
    percent(never, answers.len())
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let index = (share * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(index).copied().unwrap_or(f64::NAN)
}

fn summary(knowledge: Knowledge, answers: &[Answer<'_>]) -> Vec<String> {
    let count = |test: fn(&Verdict) -> bool| answers.iter().filter(|(_, verdict)| test(verdict)).count();
    let mut settling: Vec<f64> =
        answers.iter().map(|(_, verdict)| verdict.settling_s.unwrap_or(f64::INFINITY)).collect();
    let of = |load: bool| -> Vec<f64> {
        let chosen = answers.iter().filter(|(response, _)| (response.kind == Kind::Load) == load);
        chosen.filter_map(|(_, verdict)| verdict.beyond_percent).collect()
    };
    let (mut beyond, mut peak) = (of(false), of(true));
    let positions: Vec<Answer<'_>> =
        answers.iter().filter(|(response, _)| response.kind == Kind::Position).copied().collect();
    vec![
        knowledge.name().to_owned(),
        never(answers),
        percent(count(|verdict| verdict.cycles), answers.len()),
        format!("{:.2} s", quantile(&mut settling, 0.5)),
        format!("{:.2} s", quantile(&mut settling, 0.9)),
        format!("{:.1}", quantile(&mut beyond, 0.5)),
        format!("{:.1}", quantile(&mut beyond, 0.9)),
        format!("{:.0}", quantile(&mut peak, 0.9)),
        never(&positions),
        count(|verdict| verdict.fault).to_string(),
    ]
}

/// How many never settle, by some property.
fn breakdown(title: &str, responses: &[Response], of: impl Fn(&Response) -> String) -> String {
    let mut values: Vec<String> = responses.iter().map(&of).collect();
    values.sort();
    values.dedup();
    let names = Knowledge::ALL.map(Knowledge::name);
    let headings: Vec<&str> = [title, "responses"].into_iter().chain(names).collect();
    let mut table = table::new(&headings, 1);
    for value in values {
        let mut row = vec![value.trim().to_owned()];
        for index in 0..Knowledge::ALL.len() {
            let answers: Vec<_> =
                all(responses, index).into_iter().filter(|(response, _)| of(response) == value).collect();
            if index == 0 {
                row.push(answers.len().to_string());
            }
            row.push(never(&answers));
        }
        table.add_row(row);
    }
    format!("Never settled, %\n{table}\n")
}

/// What never settled, or swings; then what went furthest beyond.
fn list(knowledge: Knowledge, index: usize, responses: &[Response], worst: usize) -> String {
    let mut answers = all(responses, index);
    // NaN is nowhere, and what is not settled comes first.
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
        ["scenario", "motor", "at", "response", "circumstances", "settling [last swing]", "beyond %"];
    let mut table = table::new(&headings, 5);
    for (response, verdict) in answers.into_iter().take(worst) {
        table.add_row([
            response.scenario.to_string(),
            response.motor.to_string(),
            format!("{:.3} s", response.at_s),
            response.what.clone(),
            response.circumstances.clone(),
            in_short(verdict),
            verdict.beyond_percent.map_or("-".to_owned(), |percent| format!("{percent:.1}")),
        ]);
    }
    format!("The worst, {}\n{table}\n", knowledge.name())
}
