//! Parts of charts as SVG, colored by the style sheet of the page so that they follow light and dark.
//!
//! All are in the same coordinates: a plot [`PLOT_HEIGHT`] high that begins at [`LEFT`] and [`TOP`] in a
//! picture [`WIDTH`] wide.

use super::escape;

/// How wide a picture is.
pub const WIDTH: f64 = 860.0;
/// Where the plot begins, right of the labels of its y axis.
pub const LEFT: f64 = 56.0;
/// Where the plot begins, below the legend.
pub const TOP: f64 = 30.0;
/// How high the plot is.
pub const PLOT_HEIGHT: f64 = 220.0;
/// The style sheet has as many colors, as the classes `f0` and on for areas, `l0` and on for lines.
pub const N_COLORS: usize = 8;

/// Where a share of the plot's height stands, 0 to 1 from its foot.
pub fn y_of(share: f64) -> f64 {
    TOP + PLOT_HEIGHT * (1.0 - share.clamp(0.0, 1.0))
}

/// The y axis of rates, in percent.
pub fn rate_axis() -> String {
    let tick = |percent: u8| (f64::from(percent) / 100.0, percent.to_string());
    y_axis((0..=100).step_by(20).map(tick)) + &y_title(PLOT_HEIGHT, "frames answered right (%)")
}

/// What the y axis of a plot of this height is, with its unit.
pub fn y_title(height: f64, text: &str) -> String {
    let middle = TOP + height / 2.0;
    format!(
        "<text x=\"12\" y=\"{middle:.1}\" text-anchor=\"middle\" transform=\"rotate(-90 12 {middle:.1})\">{}</text>\n",
        escape(text)
    )
}

/// What the x axis is, with its unit; `y` is its baseline.
pub fn x_title(y: f64, text: &str) -> String {
    label((LEFT + WIDTH) / 2.0, y, text)
}

/// Multiples of 1, 2 or 5 times a power of ten that lie in a range, at most `max_ticks` of them.
pub fn round_ticks(range: [f64; 2], max_ticks: usize) -> Vec<f64> {
    let [low, high] = range;
    let least_step = (high - low).max(1e-9) / max_ticks.max(1) as f64;
    let power = 10f64.powf(least_step.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power);
    let step = steps.into_iter().find(|&step| step >= least_step).unwrap_or(10.0 * power);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).map(|idx| idx as f64 * step).collect()
}

/// Names on an x axis at places in growing order; those for which there is no room are left out.
pub fn x_labels(labels: impl Iterator<Item = (f64, String)>, y: f64) -> String {
    let mut free_from = f64::MIN;
    let mut svg = String::new();
    for (x, text) in labels {
        let half = text_width(&text) / 2.0;
        if x - half >= free_from {
            svg += &label(x, y, &text);
            free_from = x + half + 4.0;
        }
    }
    svg
}

/// A y axis with grid lines at shares of the plot's height and their labels.
pub fn y_axis(ticks: impl Iterator<Item = (f64, String)>) -> String {
    let line = |(share, text): (f64, String)| {
        let y = y_of(share);
        format!(
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{WIDTH}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\n",
            LEFT - 6.0,
            y + 4.0,
            escape(&text)
        )
    };
    ticks.map(line).collect()
}

/// A line through points of the picture.
pub fn polyline(color: usize, points: impl Iterator<Item = (f64, f64)>) -> String {
    let points: Vec<String> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    format!("<polyline class=\"l{}\" points=\"{}\"/>\n", color % N_COLORS, points.join(" "))
}

/// Text round a place on the x axis, moved so far that it stays in the picture.
pub fn label(x: f64, y: f64, text: &str) -> String {
    let half = text_width(text) / 2.0;
    let x = x.min(WIDTH - half).max(half);
    format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\">{}</text>\n", escape(text))
}

/// Names beside their colors, the first color first.
pub fn legend(names: &[&str]) -> String {
    let mut x = LEFT;
    let mut svg = String::new();
    for (idx, name) in names.iter().enumerate() {
        svg += &format!(
            "<rect class=\"f{}\" x=\"{x:.1}\" y=\"6\" width=\"10\" height=\"10\"/>\
             <text x=\"{:.1}\" y=\"15\">{}</text>\n",
            idx % N_COLORS,
            x + 14.0,
            escape(name)
        );
        x += 34.0 + text_width(name);
    }
    svg
}

/// A picture of this height around its content. In a narrow window it scrolls, so that its texts can be read.
pub fn framed(content: &str, height: f64) -> String {
    format!(
        "<div class=\"wide\"><svg viewBox=\"0 0 {WIDTH} {height:.0}\" width=\"{WIDTH}\" role=\"img\">\n{content}</svg></div>\n"
    )
}

/// About how wide a text is.
pub fn text_width(text: &str) -> f64 {
    6.5 * text.chars().count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_lie_in_their_range() {
        assert_eq!(round_ticks([-1.3, 14.2], 8), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]);
        assert_eq!(round_ticks([0.0, 1.0], 5), [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
        assert_eq!(round_ticks([-3.0, 22.0], 3), [0.0, 10.0, 20.0]);
        assert_eq!(round_ticks([5.0, 5.0], 3), [5.0]);
    }

    #[test]
    fn labels_that_would_lie_on_each_other_are_left_out() {
        let labels = [(100.0, "350"), (104.0, "400"), (500.0, "60000")];
        let svg = x_labels(labels.into_iter().map(|(x, text)| (x, text.to_owned())), 10.0);
        assert!(svg.contains(">350<") && !svg.contains(">400<") && svg.contains(">60000<"), "{svg}");
    }
}
