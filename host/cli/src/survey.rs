//! `motor-hub survey`.

use crate::output::{Failure, Folder, drawn, print, print_json, progress};
use crate::parse::whole;
use serde_json::json;
use std::path::PathBuf;
use studies::NamedFigure;
use studies::survey::{Survey, cells, chart, random, reference, text, toml};

/// The long help of the command.
pub(crate) const HELP: &str = "\
How well motors are regulated: reference tasks, bare motors, scenarios by lot

Three parts, each by the model and, beside it, by PID for a motor of which nothing is told: \
the tasks of the reference at six control periods; every motor of the catalogue without a load, told to turn and \
told to go somewhere, at four; and any number of scenarios drawn by lot, with inertia told exactly, 0.7 and 1.4 \
times, and dry friction of up to 10 % of the stall torque in half of the motors. Of the last those responses are \
counted that can be settled: 1.5 times the ideal time of full voltage (95 % of what the battery keeps with all motors \
stalled, within the scheme's range) plus 0.3 s, six control periods and three counts fit into nine tenths of the time, \
and a tenth of the voltage is left at the end.

A scenario is known by seed and number; --dump writes it as a file that `motor-hub run` takes.";

/// A part of the survey.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// The tasks of the reference
    Reference,
    /// Bare motors
    Cells,
    /// Scenarios by lot
    Random,
}

/// Options of `survey`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Only this part
    #[arg(long, value_name = "PART")]
    only: Option<Part>,
    /// What the scenarios follow from
    #[arg(long, default_value_t = 1, value_parser = whole("a seed", 0..=u64::MAX, ""))]
    seed: u64,
    /// How many scenarios
    #[arg(long, default_value_t = 300, value_parser = whole("how many", 0..=1_000_000_u64, "scenarios"))]
    scenarios: u64,
    /// How many of the worst responses to list
    #[arg(long, default_value_t = 10, value_parser = whole("how many to list", 0..=1_000_000_usize, "responses"))]
    worst: usize,
    /// Write the scenario of this number to the folder, and run nothing
    #[arg(long, value_name = "NUMBER", value_parser = whole("a scenario's number", 0..=u64::MAX, ""))]
    dump: Option<u64>,
    /// Folder for charts, or for that scenario
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/survey")]
    out: PathBuf,
    /// One JSON document on standard output instead of tables
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let folder = Folder::new(&self.out)?;
        if let Some(number) = self.dump {
            let name = format!("survey-{}-{number}.toml", self.seed);
            let text = toml(&random::scenario(self.seed, number));
            let files = folder.write_all(vec![(name, text.into_bytes())])?;
            return files.iter().try_for_each(|file| print(&format!("{}\n", file.display())));
        }
        let wanted = |part| self.only.is_none_or(|only| only == part);
        let bar = progress(None, "runs");
        let mut progress = |done: usize, total: usize| {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        };
        let reference = wanted(Part::Reference).then(|| reference::run(&mut progress)).transpose();
        let reference = reference.map_err(Failure::work)?;
        let cells =
            wanted(Part::Cells).then(|| cells::run(&mut progress)).transpose().map_err(Failure::work)?;
        let survey =
            wanted(Part::Random).then(|| Survey::new(self.seed, self.scenarios, &mut progress)).transpose();
        let survey = survey.map_err(Failure::work)?;
        bar.finish_and_clear();
        let figures = [
            reference.as_deref().map(chart::reference),
            cells.as_deref().map(chart::cells),
            survey.as_ref().map(chart::survey),
        ];
        let figures: Vec<NamedFigure> = figures.into_iter().flatten().collect();
        let draw = || folder.write_all(drawn(&figures));
        if self.json {
            let document =
                json!({ "reference": reference, "cells": cells, "survey": survey, "files": draw()? });
            return print_json(&document);
        }
        let parts = [
            reference.map(|rows| text::reference(&rows)),
            cells.map(|cells| text::cells(&cells)),
            survey.map(|survey| text::survey(&survey, self.worst)),
        ];
        parts.into_iter().flatten().try_for_each(|part| print(&part))?;
        draw()?;
        print(&format!("\nCharts (SVG) are in {folder}\n"))
    }
}
