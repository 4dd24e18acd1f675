//! What a replay comes to, for people, machines and gates.

use super::tally::{Course, Percentiles, Tally, Window, ms};
use crate::cli::output::{self, GateFailed, say};
use clap::Args;
use roomsight_lab::evaluate::Rate;
use roomsight_protocol::stream::DropReason;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io;
use std::time::Duration;

/// What must hold for the replay to succeed.
#[derive(Args)]
pub struct GateArgs {
    /// Fail (exit code 3) where the 99th percentile of the latency is above this
    #[arg(long, value_name = "MS")]
    max_p99: Option<f64>,
    /// Fail where there are more errors than this; a frame without any answer is one
    #[arg(long, value_name = "N")]
    max_errors: Option<u64>,
    /// Fail where more frames than this were dropped
    #[arg(long, value_name = "N")]
    max_drops: Option<u64>,
    /// Fail where a smaller share of the frames that were sent is answered right, by the filter where there is one; a frame
    /// without an answer is not
    #[arg(long, value_name = "RATE", value_parser = share)]
    min_accuracy: Option<f64>,
}

/// The conditions of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct Setting {
    /// The service.
    pub url: String,
    /// What was sent.
    pub data: String,
    /// Whether the frames are simulated.
    pub simulated: bool,
    /// `rest` or `stream`.
    pub transport: &'static str,
    /// `recorded`, `max`, or frames a second.
    pub rate: String,
    /// How many robots sent at once.
    pub robots: usize,
    /// The mode of the streams.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<String>,
    /// The model that answers, with its version, where the service tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Rooms of the data that the model does not know: frames of them count as wrong.
    pub unknown_rooms: Vec<String>,
}

/// What came of a replay.
#[derive(Serialize)]
pub struct Report {
    /// How it was made.
    #[serde(flatten)]
    pub setting: Setting,
    /// From the first frame to the last answer, in seconds.
    pub duration_s: f64,
    /// Frames by what became of them.
    pub frames: FrameCounts,
    /// Frames that got a room, a second.
    pub answers_per_s: f64,
    /// From when a frame was due to its room.
    pub latency_ms: Option<Percentiles>,
    /// From capture to answer, as the service tells it.
    pub age_ms: Option<Percentiles>,
    /// Frames that were not looked at, by reason.
    pub dropped: BTreeMap<DropReason, u64>,
    /// Errors by kind.
    pub errors: BTreeMap<String, u64>,
    /// How many answers to single frames are right.
    pub accuracy_raw: Option<Rate>,
    /// How many of the filter's answers are right.
    pub accuracy_filtered: Option<Rate>,
    /// The latency over time.
    pub course: Vec<Interval>,
    /// The gates that were asked for.
    pub gates: Vec<Gate>,
}

/// The frames that were due in some time and got a room.
#[derive(Serialize)]
pub struct Interval {
    /// From when, in seconds from the start.
    pub from_s: f64,
    /// Until when.
    pub to_s: f64,
    /// How many.
    pub results: u64,
    /// From when a frame was due to its room.
    pub latency_ms: Percentiles,
}

/// Frames by what became of them.
#[derive(Serialize)]
pub struct FrameCounts {
    /// Sent.
    pub sent: u64,
    /// Of these, more than 10 ms after they were due.
    pub late: u64,
    /// How late the latest was.
    pub most_late_ms: f64,
    /// Answered with a room.
    pub results: u64,
    /// Not looked at.
    pub dropped: u64,
    /// Answered with an error.
    pub failed: u64,
    /// Without any answer.
    pub unaccounted: u64,
}

/// Something that must hold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gate {
    /// The option.
    pub gate: &'static str,
    /// What it asks for.
    pub bound: f64,
    /// What was measured; none where nothing was.
    pub measured: Option<f64>,
    /// Whether it holds.
    pub passed: bool,
}

fn course(course: &Course) -> Vec<Interval> {
    let interval = |(idx, window): (usize, &Window)| {
        let from_s = idx as f64 * course.width_s;
        let results = window.latency.as_ref()?.len();
        Some(Interval { from_s, to_s: from_s + course.width_s, results, latency_ms: window.percentiles()? })
    };
    course.windows.iter().enumerate().filter_map(interval).collect()
}

impl Report {
    /// Sums up.
    pub fn new(setting: Setting, duration: Duration, tally: &Tally) -> Self {
        Self {
            setting,
            duration_s: duration.as_secs_f64(),
            frames: FrameCounts {
                sent: tally.n_sent,
                late: tally.n_late,
                most_late_ms: ms(tally.most_late.as_micros() as u64),
                results: tally.n_results,
                dropped: tally.n_dropped(),
                failed: tally.n_failed,
                unaccounted: tally.n_unaccounted(),
            },
            answers_per_s: tally.n_results as f64 / duration.as_secs_f64().max(1e-9),
            latency_ms: Percentiles::of(&tally.latency),
            age_ms: Percentiles::of(&tally.age),
            dropped: tally.dropped.clone(),
            errors: tally.errors.clone(),
            accuracy_raw: tally.raw.rate(),
            accuracy_filtered: tally.filtered.rate(),
            course: course(&tally.course),
            gates: Vec::new(),
        }
    }

    /// Holds the figures against the gates. What was not measured holds nothing.
    pub fn judge(&mut self, args: &GateArgs) {
        let n_errors = self.errors.values().sum::<u64>() + self.frames.unaccounted;
        let n_unanswered = self.frames.sent.saturating_sub(self.frames.results);
        let of_sent = |rate: Rate| rate.n_correct as f64 / (rate.n_frames as f64 + n_unanswered as f64);
        let answered = self.accuracy_filtered.or(self.accuracy_raw).filter(|rate| rate.n_frames > 0);
        let accuracy = answered.map(of_sent);
        let at_most = |gate, bound: Option<f64>, measured: Option<f64>| {
            let passed = |bound| measured.is_some_and(|measured| measured <= bound);
            bound.map(|bound| Gate { gate, bound, measured, passed: passed(bound) })
        };
        let accuracy = args.min_accuracy.map(|bound| Gate {
            gate: "--min-accuracy",
            bound,
            measured: accuracy,
            passed: accuracy.is_some_and(|measured| measured >= bound),
        });
        let count = |n: Option<u64>| n.map(|n| n as f64);
        self.gates = [
            at_most("--max-p99", args.max_p99, self.latency_ms.map(|latency| latency.p99)),
            at_most("--max-errors", count(args.max_errors), count(Some(n_errors))),
            at_most("--max-drops", count(args.max_drops), count(Some(self.frames.dropped))),
            accuracy,
        ]
        .into_iter()
        .flatten()
        .collect();
    }

    /// An error that names the gates that do not hold.
    pub fn gates_hold(&self) -> Result<(), GateFailed> {
        let failed: Vec<String> =
            self.gates.iter().filter(|gate| !gate.passed).map(Gate::to_string).collect();
        if failed.is_empty() { Ok(()) } else { Err(GateFailed(failed.join("; "))) }
    }

    /// Prints the tables.
    pub fn print(&self) -> io::Result<()> {
        let Setting { simulated, unknown_rooms, .. } = &self.setting;
        let mut figures = output::table(["", ""]);
        for (name, figure) in self.figures() {
            figures.add_row([name, figure]);
        }
        say!("{figures}")?;
        let mut times = output::table(["ms", "p50", "p90", "p99", "p99.9", "max"]);
        for (name, percentiles) in [("latency", self.latency_ms), ("frame age", self.age_ms)] {
            if let Some(Percentiles { p50, p90, p99, p99_9, max }) = percentiles {
                let digits = [p50, p90, p99, p99_9, max].map(|value| format!("{value:.1}"));
                times.add_row([name.to_owned()].into_iter().chain(digits));
            }
        }
        if !times.is_empty() {
            say!("{times}")?;
        }
        if *simulated {
            say!("Simulated frames.")?;
        }
        if !unknown_rooms.is_empty() {
            say!(
                "Rooms that the model does not know, whose frames count as wrong: {}",
                unknown_rooms.join(", ")
            )?;
        }
        for gate in &self.gates {
            say!("{} {gate}", if gate.passed { "holds: " } else { "FAILED:" })?;
        }
        Ok(())
    }

    /// What is said in words rather than in milliseconds: names and figures.
    pub fn figures(&self) -> Vec<(String, String)> {
        let FrameCounts { sent, late, most_late_ms, results, dropped, failed, unaccounted } = &self.frames;
        let mut figures = vec![("frames sent".to_owned(), format!("{sent} in {:.1} s", self.duration_s))];
        let mut add = |name: &str, figure: String| figures.push((name.to_owned(), figure));
        add("  late", format!("{late}, the latest by {most_late_ms:.1} ms"));
        add("answered", format!("{results}, {:.1} a second", self.answers_per_s));
        add("dropped", dropped.to_string());
        for (reason, n_frames) in &self.dropped {
            add(&format!("  {}", format!("{reason:?}").to_lowercase()), n_frames.to_string());
        }
        add("answered with an error", failed.to_string());
        for (kind, n_errors) in &self.errors {
            add(&format!("  {kind}"), n_errors.to_string());
        }
        add("without any answer", unaccounted.to_string());
        for (name, rate) in
            [("right, frame by frame", self.accuracy_raw), ("right, filtered", self.accuracy_filtered)]
        {
            if let Some(rate) = rate {
                let Rate { n_correct, n_frames, .. } = rate;
                add(name, format!("{} ({n_correct} of {n_frames})", output::rate(&rate)));
            }
        }
        figures
    }
}

impl std::fmt::Display for Gate {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let measured = self.measured.map_or("nothing was measured".to_owned(), |value| format!("{value:.4}"));
        let measured = measured.trim_end_matches('0').trim_end_matches('.');
        write!(f, "{} {}: {measured}", self.gate, self.bound)
    }
}

fn share(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|rate| (0.0..=1.0).contains(rate)).ok_or("give a share from 0 to 1".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(tally: &Tally, args: &GateArgs) -> Vec<(&'static str, bool)> {
        let setting = Setting {
            url: String::new(),
            data: String::new(),
            simulated: false,
            transport: "rest",
            rate: "max".to_owned(),
            robots: 1,
            mode: None,
            model: None,
            unknown_rooms: vec![],
        };
        let mut report = Report::new(setting, Duration::from_secs(1), tally);
        report.judge(args);
        assert_eq!(report.gates_hold().is_ok(), report.gates.iter().all(|gate| gate.passed));
        report.gates.iter().map(|gate| (gate.gate, gate.passed)).collect()
    }

    fn args(max_p99: f64, max_errors: u64, max_drops: u64, min_accuracy: f64) -> GateArgs {
        GateArgs {
            max_p99: Some(max_p99),
            max_errors: Some(max_errors),
            max_drops: Some(max_drops),
            min_accuracy: Some(min_accuracy),
        }
    }

    #[test]
    fn gates_hold_up_to_their_bound_and_only_where_something_was_measured() {
        let mut tally = Tally::new().unwrap();
        let all = ["--max-p99", "--max-errors", "--max-drops", "--min-accuracy"];
        let expected = |passed: [bool; 4]| all.into_iter().zip(passed).collect::<Vec<_>>();
        assert_eq!(judged(&tally, &args(9.0, 0, 0, 0.0)), expected([false, true, true, false]));
        // The fourth frame has no answer.
        (0..4).for_each(|_| tally.sent(Duration::ZERO));
        tally.n_results = 1;
        tally.latency.record(2000).unwrap();
        tally.fail("queue-full".to_owned());
        tally.lose(DropReason::Superseded);
        assert_eq!(judged(&tally, &args(3.0, 2, 1, 0.0)), expected([true, true, true, false]));
        assert_eq!(judged(&tally, &args(1.0, 1, 0, 0.0)), expected([false, false, false, false]));
        // One of four was answered right.
        tally.raw.add(true);
        assert_eq!(judged(&tally, &args(3.0, 2, 1, 0.25)), expected([true; 4]));
        assert_eq!(judged(&tally, &args(3.0, 2, 1, 0.26)), expected([true, true, true, false]));
    }
}
