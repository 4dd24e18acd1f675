//! A replay as one HTML file: figures, the distribution of the latency, accuracy and rooms over time.

use super::report::{Report, Setting};
use super::tally::{Course, Percentiles, Score, Stay, Stays, Tally, Window, ms};
use hdrhistogram::Histogram;
use roomsight_lab::page::chart::{
    LEFT, N_COLORS, PLOT_HEIGHT, TOP, WIDTH, framed, label, legend, polyline, rate_axis, y_axis, y_of,
};
use roomsight_lab::page::{self, escape};

/// What stands on the x axis of a distribution: how many of all frames are slower, as a power of ten.
const TAILS: [(f64, &str); 6] =
    [(0.0, "0 %"), (1.0, "90 %"), (2.0, "99 %"), (3.0, "99.9 %"), (4.0, "99.99 %"), (5.0, "99.999 %")];
/// The height of a band of rooms.
const BAND: f64 = 24.0;

/// The whole page.
pub fn html(report: &Report, tally: &Tally) -> String {
    let Setting { data, url, transport, rate, robots, mode, model, simulated, unknown_rooms } =
        &report.setting;
    let kind = if *simulated { " (simulated frames)" } else { "" };
    let mode = mode.as_ref().map_or(String::new(), |mode| format!(", {mode}"));
    let model = model.as_ref().map_or(String::new(), |model| format!(", model {model}"));
    let setting =
        format!("{data}{kind} to {url} by {transport}{mode}{model}; robots: {robots}, rate: {rate}");
    let mut body = format!("<h1>Replay</h1>\n<p class=\"source\">{}</p>\n<table>", escape(&setting));
    for (name, figure) in report.figures() {
        let name = escape(name.trim_start());
        body += &format!("<tr><th>{name}</th><td>{}</td></tr>\n", escape(&figure));
    }
    body += "</table>\n";
    for gate in &report.gates {
        let held = if gate.passed { "holds" } else { "FAILED" };
        body += &format!("<p>{held}: {}</p>\n", escape(&gate.to_string()));
    }
    if !unknown_rooms.is_empty() {
        let rooms = escape(&unknown_rooms.join(", "));
        body += &format!("<p>Rooms that the model does not know, whose frames count as wrong: {rooms}</p>\n");
    }
    body += "<section><h2>Latency</h2>\n<p class=\"source\">Milliseconds from when a frame was due to its room, by the \
             share of frames that were at least as fast.</p>\n";
    body += &percentile_table(report);
    body += &distribution(&[("latency", &tally.latency), ("frame age", &tally.age)]);
    body += "</section>\n<section><h2>Latency over time</h2>\n<p class=\"source\">Milliseconds, of frames by when they were due.</p>\n";
    body += &latencies(tally);
    body += "</section>\n<section><h2>Accuracy over time</h2>\n";
    body += &accuracy(tally);
    body += "</section>\n<section><h2>Rooms of the first robot</h2>\n";
    body += &bands(&tally.stays);
    page::page("roomsight: replay", &(body + "</section>\n"))
}

fn percentile_table(report: &Report) -> String {
    let mut html =
        "<table><tr><th>ms</th><th>p50</th><th>p90</th><th>p99</th><th>p99.9</th><th>max</th></tr>\n"
            .to_owned();
    for (name, percentiles) in [("latency", report.latency_ms), ("frame age", report.age_ms)] {
        if let Some(Percentiles { p50, p90, p99, p99_9, max }) = percentiles {
            html += &format!("<tr><th>{name}</th>");
            [p50, p90, p99, p99_9, max].iter().for_each(|value| html += &format!("<td>{value:.1}</td>"));
            html += "</tr>\n";
        }
    }
    html + "</table>\n"
}

/// Distributions in microseconds, their tails stretched so that each power of ten is as wide.
fn distribution(named: &[(&str, &Histogram<u64>)]) -> String {
    let named: Vec<_> = named.iter().filter(|(_, histogram)| !histogram.is_empty()).collect();
    let most_ms = named.iter().map(|(_, histogram)| ms(histogram.max())).fold(0.0, f64::max);
    let n_frames = named.iter().map(|(_, histogram)| histogram.len()).max().unwrap_or(0);
    // Nothing is known of a tail that is rarer than one frame.
    let last_tail = (n_frames.max(10) as f64).log10().min(TAILS[TAILS.len() - 1].0);
    let x_of = |tail: f64| LEFT + (WIDTH - LEFT) * tail / last_tail;
    let top = round_up(most_ms);
    let names: Vec<&str> = named.iter().map(|(name, _)| *name).collect();
    let quarter = |quarter: u8| (f64::from(quarter) / 4.0, format!("{}", top * f64::from(quarter) / 4.0));
    let mut svg = y_axis((0..=4).map(quarter)) + &legend(&names);
    for (color, (_, histogram)) in named.iter().enumerate() {
        let point = |step: u32| {
            let tail = last_tail * f64::from(step) / 200.0;
            let value = histogram.value_at_quantile(1.0 - 10f64.powf(-tail));
            (x_of(tail), y_of(ms(value) / top))
        };
        svg += &polyline(color, (0..=200).map(point));
    }
    for (tail, text) in TAILS.into_iter().filter(|&(tail, _)| tail <= last_tail) {
        svg += &label(x_of(tail), TOP + PLOT_HEIGHT + 16.0, text);
    }
    framed(&svg, TOP + PLOT_HEIGHT + 26.0)
}

/// 1, 2 or 4 times a power of ten that is at least this, so that a quarter of it reads well.
fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.max(0.1).log10().floor());
    [1.0, 2.0, 4.0, 10.0].map(|factor| factor * power).into_iter().find(|&top| top >= value).unwrap_or(value)
}

fn latencies(tally: &Tally) -> String {
    let windows: Vec<Option<Percentiles>> = tally.course.windows.iter().map(Window::percentiles).collect();
    let most_ms = windows.iter().flatten().map(|percentiles| percentiles.p99).fold(0.0, f64::max);
    let top = round_up(most_ms);
    let quarter = |quarter: u8| (f64::from(quarter) / 4.0, format!("{}", top * f64::from(quarter) / 4.0));
    let mut svg = y_axis((0..=4).map(quarter)) + &legend(&["p50", "p99"]);
    for (color, value) in [|p: &Percentiles| p.p50, |p: &Percentiles| p.p99].into_iter().enumerate() {
        let points = windows.iter().enumerate();
        let points = points.filter_map(|(idx, window)| Some((idx, value(window.as_ref()?))));
        svg += &polyline(color, points.map(|(idx, ms)| (window_x(&tally.course, idx), y_of(ms / top))));
    }
    over_time(&tally.course, svg)
}

fn accuracy(tally: &Tally) -> String {
    let course = &tally.course;
    let line = |color, score: fn(&Window) -> Score| {
        let points = course.windows.iter().enumerate().filter_map(|(idx, window)| {
            let rate = score(window).rate()?.rate?;
            Some((window_x(course, idx), y_of(rate)))
        });
        polyline(color, points)
    };
    let has_filter = tally.filtered.rate().is_some();
    let mut svg = rate_axis() + &line(0, |window| window.raw);
    if has_filter {
        svg += &line(1, |window| window.filtered);
    }
    svg += &legend(if has_filter { &["frame by frame", "filtered"] } else { &["frame by frame"] });
    over_time(course, svg)
}

/// Where the middle of a window is.
fn window_x(course: &Course, idx: usize) -> f64 {
    LEFT + (WIDTH - LEFT) * (idx as f64 + 0.5) / course.windows.len().max(1) as f64
}

fn over_time(course: &Course, svg: String) -> String {
    let end_s = course.width_s * course.windows.len() as f64;
    framed(&(svg + &seconds_axis(end_s, TOP + PLOT_HEIGHT + 16.0)), TOP + PLOT_HEIGHT + 26.0)
}

/// Where the robot was, where its frames say it was, where the filter does.
fn bands(stays: &Stays) -> String {
    let all = [("is in", &stays.shown), ("frame says", &stays.raw), ("filter says", &stays.filtered)];
    let named: Vec<_> = all.into_iter().filter(|(_, stays)| !stays.is_empty()).collect();
    let end_s = stays.raw.last().map_or(0.0, |stay| stay.to_s).max(0.001);
    let mut rooms: Vec<&str> = Vec::new();
    for Stay { room, .. } in named.iter().flat_map(|(_, stays)| *stays) {
        if !rooms.contains(&room.as_str()) {
            rooms.push(room);
        }
    }
    let x_of = |seconds: f64| LEFT + (WIDTH - LEFT) * seconds / end_s;
    let mut svg = legend(&rooms);
    let mut y = TOP;
    for (name, stays) in named {
        svg += &label(LEFT, y + 12.0, name);
        for Stay { room, from_s, to_s } in stays {
            let color = rooms.iter().position(|known| known == room).unwrap_or(0) % N_COLORS;
            let (x, width) = (x_of(*from_s), (x_of(*to_s) - x_of(*from_s)).max(0.5));
            svg += &format!(
                "<rect class=\"f{color}\" x=\"{x:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{BAND}\">\
                 <title>{}, {from_s:.1} to {to_s:.1} s</title></rect>\n",
                y + 16.0,
                escape(room)
            );
        }
        y += BAND + 24.0;
    }
    svg += &seconds_axis(end_s, y + 8.0);
    framed(&svg, y + 18.0)
}

fn seconds_axis(end_s: f64, y: f64) -> String {
    let tick = |quarter: u8| {
        let share = f64::from(quarter) / 4.0;
        label(LEFT + (WIDTH - LEFT) * share, y, &format!("{:.1} s", end_s * share))
    };
    (0..=4).map(tick).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_end_at_round_numbers() {
        for (value, top) in
            [(0.0, 0.1), (0.3, 0.4), (7.0, 10.0), (11.0, 20.0), (350.0, 400.0), (400.0, 400.0)]
        {
            assert!((round_up(value) - top).abs() < 1e-9, "{value}: {}", round_up(value));
        }
    }
}
